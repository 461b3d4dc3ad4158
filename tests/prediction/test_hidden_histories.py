"""Force over time on motions that no other test has, for each law in time: against the rig at a tenth of the step."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import chirp
from test_response import FINER, LAWS, ROWS, STEP
from tries import some

from bushfit.commands.respond import respond
from bushfit.effects.contract import Array
from bushfit.effects.history import History
from bushfit.geometry import Direction
from bushfit.model import rig
from bushfit.model.result import Result

_RANDOM = np.random.default_rng(9)
_LOW, _HIGH = _RANDOM.uniform(0.5, 3.0, 12), _RANDOM.uniform(15.0, 25.0, 12)
_PHASES = _RANDOM.uniform(0.0, 2.0 * np.pi, 24)


def sweep(time: Array) -> Array:
    return np.asarray(4e-4 * np.minimum(time / 0.1, 1.0) * chirp(time, 0.5, 3.0, 25.0, phi=-90))


def rounded_trapezoid(time: Array) -> Array:
    corners = [0.0, 0.2, 0.7, 1.4, 1.9, 3.0], [0.0, 0.0, 8e-4, 8e-4, -3e-4, -3e-4]
    shifts = np.linspace(-0.05, 0.05, 201)
    return np.asarray(sum(np.interp(time - shift, *corners) for shift in shifts) / shifts.size)


def two_bands(time: Array) -> Array:
    phases = 2.0 * np.pi * np.concatenate((_LOW, _HIGH)) * time[:, None] + _PHASES
    sizes = np.repeat([1.5e-4, 3e-5], 12)
    return np.asarray(np.minimum(time / 0.2, 1.0) * (np.sin(phases) @ sizes))


def decaying_sine(time: Array) -> Array:
    return np.asarray(1e-3 * np.exp(-1.5 * time) * np.sin(2.0 * np.pi * 8.0 * time))


MOTIONS = (sweep, rounded_trapezoid, two_bands, decaying_sine)


@pytest.mark.parametrize("law", some(LAWS, ["paper", "clearance"]))
def test_channels_of_hidden_motions_are_those_of_the_rig(paper_model, law):
    """Two channels at once, axial and torsion."""
    model = paper_model if law == "paper" else paper_model.with_effect(law, LAWS[law])
    time, fine = np.arange(ROWS) * STEP, np.arange((ROWS - 1) * FINER + 1) * STEP / FINER
    turn = model.unit_strain(Direction.AXIAL) / model.unit_strain(Direction.TORSION)
    scales = {Direction.AXIAL: 1.0, Direction.TORSION: turn}
    for number, motion in enumerate(MOTIONS):
        other: Callable[[Array], Array] = MOTIONS[number - 1]
        motions = {Direction.AXIAL: motion, Direction.TORSION: other}
        channels = {str(place): scales[place] * motions[place](time) for place in motions}
        output = respond(Result(model), channels, step=STEP)
        for response in output.responses:
            place = response.direction
            assert isinstance(place, Direction)
            frequency = History.sampled(channels[str(place)], STEP).frequency
            record = rig.imposed(model, place, scales[place] * motions[place](fine), STEP / FINER, frequency)
            expected = record.force[::FINER]
            error = np.sqrt(np.mean((response.force.value - expected) ** 2) / np.mean(expected**2))
            print(f"{law}, {motions[place].__name__}, {place}: {error:.3%} rms")
            assert error < 0.003
