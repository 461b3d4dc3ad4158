"""Springpot and friction in the time domain against closed results and many digits.

The springpot on both roads: from rest, as the rig steps it, and on the steady cycle, as fits follow a loop; friction
against the branches of Eq. 5, Berg's loop area and first harmonic.
"""

from collections.abc import Callable
from functools import cache, partial

import mpmath
import numpy as np
import pytest
from agreement import digits

from bushfit.effects import History, friction
from bushfit.effects.contract import Array
from bushfit.effects.springpot import stress
from bushfit.geometry import Bushing, Direction
from bushfit.model.model import Model
from bushfit.simulation import rig

ALPHAS = (0.1, 0.24, 0.5, 0.9)
STEPS = 2048
MU = 1.0e6
RATIO = 4.0  # m over 2 mu [s^alpha]: a record of 1 s sees a good part of the relaxation

Response = Callable[[float, Array], tuple[Array, Array]]
VALUES = {"sigma_fmax": 1.46e4, "eps_half": 1.3e-2}
SCALED = (1e-3, 0.1, 0.5, 3.8, 50.0, 1000.0)  # e0/eps_half


@cache
def coefficients(alpha: float, beta: float) -> Array:
    """1/Gamma(alpha k + beta) until they vanish."""
    last = int(25.0 / alpha)
    return np.array([float(mpmath.rgamma(mpmath.mpf(alpha) * k + beta)) for k in range(last)])


def mittag_leffler(alpha: float, beta: float, z: Array) -> Array:
    """E_{alpha,beta}(z) = sum z^k/Gamma(alpha k + beta), for |z| <= 1, where no digits cancel."""
    assert np.max(np.abs(z)) <= 1.0
    return np.polynomial.polynomial.polyval(z, coefficients(alpha, beta))


def from_rest(value: Array) -> History:
    return History(value, 1.0 / (value.size - 1), periodic=False, frequency=1.0)


def springpot(alpha: float, time: Array, *, ramp: bool) -> tuple[Array, Array]:
    """Relaxation t^-alpha/Gamma(1 - alpha) after a step; t^(1 - alpha)/Gamma(2 - alpha) under a ramp."""
    found = stress({"m": 1.0, "alpha": alpha}, from_rest(time if ramp else np.ones(time.size)))
    power = float(ramp) - alpha
    return found[1:], time[1:] ** power / float(mpmath.gamma(1.0 + power))


def bushing_model(bushing: Bushing, alpha: float, compliance: float) -> tuple[Model, float, float]:
    """Elasticity and springpot in parallel, a spring in series; with K mu and K m/2 of the axial direction."""
    values = {"mu": MU, "m": 2.0 * MU * RATIO, "alpha": alpha, "rig_compliance.compliance": compliance}
    stiffness = bushing.stiffness_per_modulus(Direction.AXIAL) * MU
    return Model(bushing, ("elastic", "springpot", "rig_compliance"), values), stiffness, stiffness * RATIO


def creep(bushing: Bushing) -> Response:
    """Moved as a constant force moves a fractional Kelvin-Voigt body, F/k (1 - E_alpha(-k/c t^alpha)), the force
    has to be constant."""

    def response(alpha: float, time: Array) -> tuple[Array, Array]:
        model, spring, pot = bushing_model(bushing, alpha, 0.0)
        moved = 100.0 / spring * (1.0 - mittag_leffler(alpha, 1.0, -spring / pot * time**alpha))
        return model.force(Direction.AXIAL, from_rest(moved))[1:], np.full(time.size - 1, 100.0)

    return response


def zener(bushing: Bushing, *, ramp: bool) -> Response:
    """A series spring s makes it a fractional Zener body: x s (1 - s/(s + k) (1 - E_{alpha,1}(-(s + k)/c t^alpha))),
    and under a ramp its integral, with t E_{alpha,2} for E_{alpha,1}."""

    def response(alpha: float, time: Array) -> tuple[Array, Array]:
        _, spring, pot = bushing_model(bushing, alpha, 0.0)
        series = 2.0 * spring
        model, _, _ = bushing_model(bushing, alpha, 1.0 / series)
        moved = 1e-4 * (time if ramp else np.sign(time))
        left = mittag_leffler(alpha, 2.0 if ramp else 1.0, -(series + spring) / pot * time**alpha)
        exact = moved * series * (1.0 - series / (series + spring) * (1.0 - left))
        return model.force(Direction.AXIAL, from_rest(moved))[1:], exact[1:]

    return response


RESPONSES = {
    "springpot, step": lambda _: partial(springpot, ramp=False),
    "springpot, ramp": lambda _: partial(springpot, ramp=True),
    "elastic + springpot, creep": creep,
    "elastic + springpot + series spring, step": lambda bushing: zener(bushing, ramp=False),
    "elastic + springpot + series spring, ramp": lambda bushing: zener(bushing, ramp=True),
}


@pytest.mark.parametrize("name", RESPONSES)
def test_from_rest(name, bushing, agree):
    """The sum of Eq. 3 is first order in the step, so twice as many steps tell its limit."""
    response = RESPONSES[name](bushing)
    plain, limit = [], []
    for alpha in ALPHAS:
        coarse, exact = (part[STEPS // 8 - 1 :] for part in response(alpha, np.linspace(0.0, 1.0, STEPS + 1)))
        fine = response(alpha, np.linspace(0.0, 1.0, 2 * STEPS + 1))[0][1::2][STEPS // 8 - 1 :]
        plain.append(digits(coarse, exact))
        limit.append(digits(2.0 * fine - coarse, exact))
    agree(name, plain)
    agree(f"{name}, extrapolated", limit)


def triangle(alpha: float, phase: float) -> float:
    """D^alpha of a unit triangle of 1 rad/s, 8/pi^2 sum of sin(k t)/k^2 over odd k with alternating sign: a
    polylogarithm of order 2 - alpha."""
    turn = mpmath.expj(phase + mpmath.pi / 2)
    odd = mpmath.polylog(2 - alpha, turn) - mpmath.mpf(2) ** (alpha - 2) * mpmath.polylog(2 - alpha, turn**2)
    return float(8 / mpmath.pi**2 * mpmath.im(odd / 1j * mpmath.expj(alpha * mpmath.pi / 2)))


def test_on_the_steady_cycle(bushing, agree):
    cycles = np.arange(STEPS) / STEPS
    at = [STEPS // 16 * k for k in (1, 2, 3, 5, 6, 7)]
    sine, bent = [], []
    for alpha in ALPHAS:
        model = Model(bushing, ("springpot",), {"m": 1e5, "alpha": alpha})
        per_strain = 1e5 * model.stiffness_per_modulus(Direction.AXIAL) / 2.0
        exact = np.sin(2.0 * np.pi * cycles + alpha * np.pi / 2.0)
        found = model.force(Direction.AXIAL, History.steady(rig.wave("sine", cycles), 0.5 / np.pi)) / per_strain
        sine.append(float(-np.log10(np.max(np.abs(found - exact)))))
        found = model.force(Direction.AXIAL, History.steady(rig.wave("triangle", cycles), 0.5 / np.pi)) / per_strain
        bent.append(digits(found[at], [triangle(alpha, 2.0 * np.pi * cycles[i]) for i in at]))
    agree("springpot, steady sine", sine)
    agree("springpot, steady triangle", bent)


def test_as_the_rig_measures_it(bushing, agree):
    """Ten cycles from rest, then the lock-in over one."""
    found = []
    for alpha in ALPHAS:
        model = Model(bushing, ("springpot",), {"m": 1.0e5, "alpha": alpha})
        exact = 0.5e5 * bushing.stiffness_per_modulus(Direction.AXIAL) * (10.0j * np.pi) ** alpha
        found.append(digits(rig.dynamic_stiffness(model, Direction.AXIAL, np.array([5.0]), np.array([1e-4])), exact))
    agree("springpot, stiffness on the rig", found)


def branches(strain: list[float]) -> list[mpmath.mpf]:
    """Eq. 5 from rest along turning points that alternate."""
    sigma, half = (mpmath.mpf(VALUES[name]) for name in ("sigma_fmax", "eps_half"))
    at, held, out = mpmath.mpf(0), mpmath.mpf(0), []
    for value in map(mpmath.mpf, strain):
        sense, moved = mpmath.sign(value - at), value - at
        held += moved * (sigma - sense * held) / (half * (1 - sense * held / sigma) + sense * moved)
        at = value
        out.append(held)
    return out


def test_branches_from_rest(agree):
    random = np.random.default_rng(1)
    signs = np.where(np.arange(2000) % 2, -1.0, 1.0)
    strain = signs * VALUES["eps_half"] * 10.0 ** random.uniform(-2.0, 1.5, 2000)
    with mpmath.workdps(40):
        exact = np.array([float(value) for value in branches(strain.tolist())])
    found = friction.stress(VALUES, History(strain, 1e-3, periodic=False, frequency=1.0))
    agree("friction, 2000 branches from rest", [float(-np.log10(np.max(np.abs(found / exact - 1.0))))])


def berg_area(x: float) -> mpmath.mpf:
    """Dissipation per cycle and volume [J/m^3] as Berg gives it: 2 F (2 x0 - x2 (1 + u)^2 ln(1 + 2 x0/(x2 (1 + u)))),
    u the share of F that the loop reaches."""
    half, x0 = mpmath.mpf(VALUES["eps_half"]), mpmath.mpf(x) * VALUES["eps_half"]
    u = (mpmath.sqrt(half**2 + x0**2 + 6 * half * x0) - half - x0) / (2 * half)
    return 2 * VALUES["sigma_fmax"] * (2 * x0 - half * (1 + u) ** 2 * mpmath.log1p(2 * x0 / (half * (1 + u))))


def in_phase(x: float) -> mpmath.mpf:
    """A of the first harmonic: the integral of a branch of the loop over its phase."""
    y = (mpmath.sqrt(x**2 + 6 * mpmath.mpf(x) + 1) - x - 1) / 2

    def branch(phase: mpmath.mpf) -> mpmath.mpf:
        moved = x * (1 - mpmath.cos(phase))
        return -(-y + moved * (1 + y) / ((1 + y) + moved)) * mpmath.cos(phase)

    return VALUES["sigma_fmax"] * 2 / mpmath.pi * mpmath.quad(branch, mpmath.linspace(0, mpmath.pi, 9))


def test_area_and_first_harmonic_of_the_steady_loop(agree):
    """Friction knows no time, so that the samples may lie where Gauss integrates each branch exactly."""
    nodes, weights = np.polynomial.legendre.leggauss(400)
    phase, weight = np.pi / 2.0 * (1.0 + nodes), np.pi / 2.0 * weights
    areas, firsts = [], []
    for x in SCALED:
        e0 = x * VALUES["eps_half"]
        up = -e0 * np.cos(phase)
        cycle = np.concatenate([[-e0], up, [e0], -up])
        loading = friction.stress(VALUES, History.steady(cycle, 1.0))[1 : 1 + up.size]
        with mpmath.workdps(30):
            areas.append((2.0 * weight @ (loading * e0 * np.sin(phase)), float(berg_area(x))))
            firsts.append((-2.0 / np.pi * weight @ (loading * np.cos(phase)), float(in_phase(x))))
        print(f"e0/eps_half = {x:g}: area {digits(*areas[-1]):.1f}, in phase {digits(*firsts[-1]):.1f} digits")
    agree("friction, area of the steady loop", [digits(*np.array(areas).T)])
    agree("friction, in-phase first harmonic", [digits(*np.array(firsts).T)])
