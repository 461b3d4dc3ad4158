"""The five parameters of one campaign as one would find them without bushfit, and by it, in one run:

    pytest tests/benchmarks/test_beside_others.py --benchmark-enable --dist no -m slow -s

Two scripts such as an engineer writes: lmfit on the closed form, test by test and point by point in Python, and SciPy's
least_squares on a model that is stepped through time, all points at once. Both take the campaign of the paper's bushing
in configs/, its axial loop and sweep, read already; neither knows of noise, repeats or intervals. Times are processor
times; nothing but the answer is asserted. RheoJAX fits springpots to moduli, but has no friction that depends on
amplitude: it cannot fit this model, and is left out.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator

import lmfit
import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from scipy.optimize import least_squares

from bushfit.campaign.campaign import Campaign
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.procedures import fit_joint
from bushfit.geometry import Direction
from bushfit.model.model import FIVE

pytestmark = pytest.mark.slow

#: Where both scripts start: a soft rubber as a handbook has it.
START = {"mu": 0.8e6, "m": 0.2e6, "alpha": 0.3, "sigma_fmax": 3e4, "eps_half": 1e-2}
#: Cycles of run-in and steps of one cycle in the stepped model; with half of them it is off by a per cent.
RUN_IN, STEPS = 5, 256

Values = dict[str, float]


def strain_and_factor(campaign: Campaign) -> tuple[float, float]:
    """Strain per displacement (Eq. 7) and stiffness per modulus (Eq. 10), axial."""
    tube = campaign.bushing
    a, b, length = tube.inner_radius, tube.outer_radius, tube.length
    return 1.0 / math.sqrt(2.0 * (b * b - a * a) * math.log(b / a)), 2.0 * math.pi * length / math.log(b / a)


def walked(strain: list[float], p: Values) -> Iterator[float]:
    """The friction stress of Eq. 5, sample by sample from rest."""
    last = turned_at = before = stress_there = 0.0
    way = 1.0
    for e in strain:
        if (e - last) * way < 0.0:
            way, turned_at, stress_there = -way, last, before
        run = e - turned_at
        limit, half = p["sigma_fmax"], p["eps_half"]
        before = stress_there + run * (limit - way * stress_there) / (
            half * (1.0 - way * stress_there / limit) + way * run
        )
        last = e
        yield before


def springpot_weights(alpha: float, count: int) -> np.ndarray:
    """Weights of Gruenwald and Letnikov (Eq. 3), (count,)."""
    j = np.arange(1, count)
    return np.cumprod(np.append(1.0, (j - 1.0 - alpha) / j))


def looped(p: Values, strain: np.ndarray, step: float) -> np.ndarray:
    """Stress of a loop (Eqs. 1, 3, 5 and 6) that is walked three times, of the last one, (n,)."""
    whole = np.tile(strain, 3)
    weights = springpot_weights(p["alpha"], whole.size)
    springpot = p["m"] * step ** -p["alpha"] * np.convolve(whole, weights)[: whole.size]
    friction = np.fromiter(walked(whole.tolist(), p), float, whole.size)
    return (2.0 * p["mu"] * whole + springpot + friction)[-strain.size :]


def closed(p: Values, frequency: float, e0: float) -> complex:
    """The equivalent modulus of one point in closed form."""
    x = e0 / p["eps_half"]
    y = (math.sqrt(x * x + 6.0 * x + 1.0) - x - 1.0) / 2.0
    scale, c = p["sigma_fmax"] * (1.0 + y), p["eps_half"] * (1.0 + y)
    big = 1.0 + c / e0
    in_phase = 2.0 * scale * (c / e0) * (big / math.sqrt(big * big - 1.0) - 1.0)
    quadrature = 2.0 / math.pi * (2.0 * p["sigma_fmax"] - scale * (c / e0) * math.log((big + 1.0) / (big - 1.0)))
    omega = 2.0 * math.pi * frequency
    return p["mu"] + 0.5 * p["m"] * (1j * omega) ** p["alpha"] + (in_phase + 1j * quadrature) / (2.0 * e0)


def stepped(p: Values, frequency: np.ndarray, e0: np.ndarray) -> np.ndarray:
    """The equivalent modulus of all points, (n,), each stepped through run-in and a cycle."""
    wave = np.sin(2.0 * np.pi * np.arange((RUN_IN + 1) * STEPS) / STEPS)
    weights = np.convolve(wave, springpot_weights(p["alpha"], wave.size))[: wave.size]
    springpot = p["m"] * (1.0 / (frequency * STEPS))[:, None] ** -p["alpha"] * e0[:, None] * weights
    friction = np.array([list(walked((e * wave).tolist(), p)) for e in e0.tolist()])
    stress = 2.0 * p["mu"] * e0[:, None] * wave + springpot + friction
    turn = np.exp(-2j * np.pi * np.arange(STEPS) / STEPS)
    return (stress[:, -STEPS:] @ turn) / (2.0 * e0 * (wave[-STEPS:] @ turn))


def residual_of(
    campaign: Campaign, modulus: Callable[[Values, np.ndarray, np.ndarray], np.ndarray]
) -> Callable[[Values], np.ndarray]:
    """Residuals of the loop, relative to its largest force, and of the sweep, relative to |K|, over values."""
    per, factor = strain_and_factor(campaign)
    loop = next(loop for loop in campaign.loops if loop.direction is Direction.AXIAL)
    sweep = next(sweep for sweep in campaign.sweeps if sweep.direction is Direction.AXIAL)
    thin = slice(None, None, max(1, loop.time.size // 500))  # as one thins a record that a script walks
    motion, force, step = loop.displacement[thin], loop.force[thin], float(np.diff(loop.time[thin]).mean())
    points, place = np.unique(np.stack((sweep.frequency, sweep.amplitude)), axis=1, return_inverse=True)

    def residual(p: Values) -> np.ndarray:
        # a stress acts as twice its modulus: F = K x, K = factor modulus, stress = 2 modulus strain
        off = factor / (2.0 * per) * looped(p, per * (motion - motion.mean()), step) - (force - force.mean())
        ratio = factor * modulus(p, points[0], per * points[1])[place.ravel()] / sweep.stiffness - 1.0
        return np.concatenate((off / np.abs(force).max(), ratio.real, ratio.imag))

    return residual


def with_lmfit(campaign: Campaign) -> Values:
    """lmfit as its manual begins: parameters with bounds, a function, derivatives by differences."""
    residual = residual_of(campaign, lambda p, f, e: np.array([closed(p, *each) for each in zip(f, e, strict=True)]))
    parameters = lmfit.Parameters()
    for name, value in START.items():
        parameters.add(
            name, value, min=0.02 if name == "alpha" else value / 100.0, max=1.0 if name == "alpha" else 100.0 * value
        )
    return lmfit.minimize(lambda tried: residual(tried.valuesdict()), parameters).params.valuesdict()


def with_time_steps(campaign: Campaign) -> Values:
    """SciPy on the stepped model, in logarithms."""
    residual = residual_of(campaign, stepped)
    begin = np.log(list(START.values()))
    found = least_squares(lambda u: residual(dict(zip(FIVE, np.exp(u).tolist(), strict=True))), begin, diff_step=1e-5)
    return dict(zip(FIVE, np.exp(found.x).tolist(), strict=True))


def test_one_campaign_beside_two_scripts(benchmark: BenchmarkFixture, campaign: Campaign) -> None:
    """Processor time of each script and of the joint fit, noise, outliers, covariance and warnings included."""
    assert list(START) == list(FIVE)
    benchmark.pedantic(lambda: fit_joint(PreparedCampaign.from_campaign(campaign)), rounds=1)
    works: dict[str, Callable[[], Values]] = {
        "bushfit": lambda: dict(fit_joint(PreparedCampaign.from_campaign(campaign)).model.values),
        "lmfit, closed form point by point": lambda: with_lmfit(campaign),
        "least_squares, time steps": lambda: with_time_steps(campaign),
    }
    found, taken = {}, {}
    for name, work in works.items() if benchmark.enabled else [*works.items()][:2]:
        begin = time.process_time()
        found[name] = work()
        taken[name] = time.process_time() - begin
    print()
    for name, values in found.items():
        apart = max(abs(values[each] / found["bushfit"][each] - 1.0) for each in FIVE)
        times = f"{1e3 * taken[name]:.0f} ms, {taken[name] / taken['bushfit']:.1f} times"
        print(f"{name}: {times}; apart {100.0 * apart:.1f} %")
        assert apart < 0.25  # a script weighs every row alike, and its loop begins at rest
