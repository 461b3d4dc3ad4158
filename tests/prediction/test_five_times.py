"""Force at five times the tested amplitude, of rubber whose law the fit does not know: in the band, or with a warning.

The truths are laws of the library with random parameters, and a rubber of the scorecard that shares no code with it.
"""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from fits import joint_fit
from other_rubbers import log_normal_sliders
from rubber_in_time import StrainHistory
from time_rig import first_harmonic
from tries import SEEDS

from bushfit.campaign.campaign import Campaign
from bushfit.effects.contract import Array
from bushfit.effects.history import History
from bushfit.geometry import Bushing, Direction, stiffness_per_modulus, unit_strain
from bushfit.model.model import FIVE, Model
from bushfit.prediction.response import TimeResponse, time_response
from bushfit.reading.measurement import Loop, Sweep

BUSHING = Bushing("arm", 10e-3, 18e-3, 34e-3)
STRAIN, SIZE = unit_strain(BUSHING, Direction.AXIAL), stiffness_per_modulus(BUSHING, Direction.AXIAL)
FREQUENCIES = np.array([5.0, 10.0, 20.0, 40.0, 80.0, 150.0])
STEP, ROWS, NOISE = 1e-3, 2000, 5e-3
TIME = np.arange(ROWS) * STEP
BEYOND = "extrapolated outside this range"


class Truth(NamedTuple):
    """Complex stiffness [N/m] at frequencies [Hz] and an amplitude [m], and force [N] over a history."""

    stiffness: Callable[[Array, float], Array]
    force: Callable[[History], Array]


def of_library(random: np.random.Generator, effect: str | None, values: dict[str, float]) -> Truth:
    paper = dict(zip(FIVE, (1.09e6, 1.99e5, 0.24, 1.44e4, 0.0071), strict=True))
    drawn = {name: value * float(random.uniform(0.6, 1.6)) for name, value in (paper | values).items()}
    model = Model.with_defaults(BUSHING, ("elastic", "springpot", "friction"), drawn)
    if effect == "linear":
        model = model.without("friction")
    elif effect:
        model = model.with_effect(effect, {name: drawn[name] for name in values})
    return Truth(
        lambda frequency, amplitude: model.stiffness(Direction.AXIAL, frequency, amplitude),
        lambda history: model.force(Direction.AXIAL, history),
    )


def other_rubber(random: np.random.Generator) -> Truth:
    law = log_normal_sliders(random)

    def stiffness(frequency: Array, amplitude: float) -> Array:
        wave = np.tile(amplitude * STRAIN * np.sin(2.0 * np.pi * np.arange(512) / 512), (frequency.size, 1))
        stress = law(StrainHistory(wave, 1.0 / (512 * frequency[:, None]), periodic=True))
        return np.asarray(SIZE * first_harmonic(stress) / (2.0 * first_harmonic(wave)))

    def force(history: History) -> Array:
        strain = StrainHistory(STRAIN * history.value[None], np.array([[history.step]]), periodic=False)
        return np.asarray(SIZE * law(strain)[0] / (2.0 * STRAIN))

    return Truth(stiffness, force)


TRUTHS: dict[str, Callable[[np.random.Generator], Truth]] = {
    "linear": lambda random: of_library(random, "linear", {}),
    "friction": lambda random: of_library(random, None, {}),
    "cubic": lambda random: of_library(random, "strain_stiffening", {"strain_stiffening.c3": 40.0}),
    "sliders": lambda random: of_library(
        random, "sliders", {"sliders.sigma": 1.4e4, "sliders.e_s": 0.014, "sliders.spread": 1.5}
    ),
    "two frictions": lambda random: of_library(
        random, "second_friction", {"second_friction.sigma_fmax": 1e4, "second_friction.eps_half": 0.05}
    ),
    "other rubber": other_rubber,
}


def respond(truth: Truth, amplitude: float, random: np.random.Generator, times: float) -> tuple[TimeResponse, Array]:
    """Fit a loop and a sweep at one amplitude [m]; predicted and true force of random motion at so many times it."""
    phase = 2.0 * np.pi * np.arange(3000) / 1000.0
    motion = amplitude * np.sin(phase)
    force = truth.force(History(motion, 2e-3, periodic=False, frequency=0.5))
    force += NOISE * np.ptp(force) / 2.0 * random.standard_normal(force.size)
    loop = Loop("loop", Direction.AXIAL, 2e-3 * np.arange(1000), motion[-1000:], force[-1000:])
    frequency, repeat = np.tile(FREQUENCIES, 3), np.repeat([1, 2, 3], FREQUENCIES.size)
    noise = 1.0 + NOISE * (random.standard_normal((2, frequency.size)).T @ [1.0, 1j])
    stiffness = truth.stiffness(frequency, amplitude) * noise
    sweep = Sweep("sweep", Direction.AXIAL, frequency, np.full(frequency.size, amplitude), stiffness, repeat)
    campaign = Campaign("arm", Path("arm"), BUSHING, (loop,), (sweep,))
    result = joint_fit(campaign)
    sines = random.uniform(0.5, 20.0, 12), random.uniform(0.0, 2.0 * np.pi, 12)
    road = np.sin(2.0 * np.pi * sines[0] * TIME[:, None] + sines[1]).sum(axis=1) * np.minimum(TIME / 0.2, 1.0)
    history = History.sampled(times * amplitude / np.abs(road).max() * road, STEP)
    return time_response(result, Direction.AXIAL, history), truth.force(history)


@pytest.mark.parametrize("seeds", [1, pytest.param(SEEDS, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", TRUTHS)
def test_five_times_the_tested_amplitude_is_in_the_band_or_has_a_warning(name, seeds):
    inside, warned, errors = [], [], []
    for seed in range(seeds):
        random = np.random.default_rng([54, seed])
        truth, amplitude = TRUTHS[name](random), float(np.exp(random.uniform(np.log(5e-5), np.log(5e-4))))
        response, force = respond(truth, amplitude, random, 5.0)
        band = response.force
        inside.append(float(np.mean((band.low <= force) & (force <= band.high))))
        warned.append(any(line.endswith(BEYOND) and "strains" in line for line in map(str, response.warnings)))
        errors.append(float(np.std(band.value - force) / np.std(force)))
    fine = np.array(warned) | (np.array(inside) > 0.93)
    print(
        f"{name}: {fine.sum()} of {seeds} in the band or with a warning; points in the band: median "
        f"{100 * np.median(inside):.0f} %; rms error: median {100 * np.median(errors):.1f} %, "
        f"largest {100 * max(errors):.0f} %"
    )
    assert fine.all()
