"""Long sweeps count in narrow bands: as sharp as their points, and as honest."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from paper import CMP_15961, TABLE_1
from rigged import LEVELS

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import RigSettings
from bushfit.diagnosis.condense import shorten_tests
from bushfit.diagnosis.explanation_text import format_amount
from bushfit.diagnosis.fits import within_reach
from bushfit.diagnosis.workflow import diagnose
from bushfit.effects import BASE
from bushfit.effects.contract import Array
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.geometry import Direction
from bushfit.model.model import Model
from bushfit.reading.measurement import Sweep

PAPER = Model(CMP_15961, BASE, TABLE_1)
POINTS = 900
SCATTER = 0.01
UP = np.geomspace(5.0, 60.0, 450)
BENT = [1.0 + 9.0 / (1.0 + (f - middle) ** 2) for f, middle in ((UP, 25.0), (UP[::-1], 18.0))]


def swept(model: Model, points: int = POINTS, repeats: int = 2, seed: int = 3) -> Sweep:
    """A swept sine of `points` at each level and repeat: the closed form and white noise, not the rig, which would
    take hours for so many points."""
    rng = np.random.default_rng(seed)
    frequency = np.tile(np.geomspace(5.0, 150.0, points), len(LEVELS) * repeats)
    amplitude = np.repeat(LEVELS, points * repeats)
    noise = SCATTER * (rng.standard_normal(frequency.size) + 1j * rng.standard_normal(frequency.size))
    stiffness = (model.stiffness(Direction.AXIAL, frequency, amplitude) * (1.0 + noise)).astype(complex)
    repeat = np.tile(np.repeat(np.arange(1, repeats + 1), points), len(LEVELS))
    return Sweep("swept", Direction.AXIAL, frequency, amplitude, stiffness, repeat)


def data_of(*sweeps: Sweep) -> PreparedCampaign:
    return PreparedCampaign.from_campaign(Campaign("long", Path("long.toml"), PAPER.bushing, sweeps=sweeps))


def silent(frequency: Array, amplitude: Array, stepped: Any = "frequency") -> Sweep:
    """A sweep without noise."""
    stiffness = PAPER.stiffness(Direction.AXIAL, frequency, amplitude)
    return Sweep("silent", Direction.AXIAL, frequency, amplitude, stiffness, stepped=stepped)


def off(sweep: Sweep) -> Array:
    return np.asarray(np.log(sweep.stiffness / PAPER.stiffness(Direction.AXIAL, sweep.frequency, sweep.amplitude)))


def test_means_are_as_sharp_as_their_points():
    """Scatter of 900 points in 100 bands falls with the root of 9, and so does the noise that is estimated."""
    (sweep,), said = shorten_tests(data_of(swept(PAPER)))[0].sweeps, shorten_tests(data_of(swept(PAPER)))[1]
    assert tuple(map(str, said)) == ("swept: 5400 points are averaged to 600 narrow bands for the diagnosis",)
    expected = SCATTER / np.sqrt(POINTS / 100)
    assert np.std(off(sweep.test).real) == pytest.approx(expected, rel=0.1)
    assert sweep.relative_noise == pytest.approx(expected, rel=0.1)
    assert abs(np.mean(off(sweep.test))) < 4.0 * expected / np.sqrt(600)
    assert set(sweep.test.amplitude) == set(LEVELS)


@pytest.mark.parametrize(
    ("sweep", "largest"),
    [
        (silent(np.linspace(0.5, 200.0, 6000), np.full(6000, 2e-4)), 2e-3),
        (silent(np.linspace(5.0, 200.0, 6000), np.full(6000, 2e-4)), 2e-3),
        (silent(np.concatenate((UP, UP[::-1])), 1e-4 * np.concatenate(BENT), stepped=None), 2e-3),
        (silent(np.repeat([10.0, 100.0], 600), np.tile(np.geomspace(1e-5, 1e-3, 600), 2), stepped="amplitude"), 1e-3),
    ],
    ids=["from 0.5 Hz", "from 5 Hz", "up and down through a resonance", "amplitudes"],
)
def test_means_lie_on_the_curve(sweep, largest):
    """Evenly in frequency the first bands are wide in its logarithm; where neither is held, points at one frequency may
    have amplitudes far apart, and are taken in turn."""
    made = shorten_tests(data_of(sweep))[0].sweeps[0].test
    assert made.frequency.size < sweep.frequency.size
    assert np.abs(off(made)).max() < largest
    if sweep.stepped == "frequency":
        assert np.abs(np.mean(off(made))) < 2e-5
    if sweep.stepped == "amplitude":
        assert made.frequency.tolist() == [10.0] * 100 + [100.0] * 100


def test_a_hidden_lag_is_named_in_a_long_sweep_and_the_means_are_told():
    lagging = PAPER.with_effect("delay", {"delay.tau": 2e-4})
    found = diagnose(data_of(swept(lagging)))
    assert [effect.name for effect in found.effects] == ["delay"]
    assert any("narrow bands" in note for note in map(str, found.notes))
    low, high = found.result.interval("delay.tau") or (0.0, 0.0)
    assert low < 2e-4 < high
    words = format_amount("delay", found.result)
    opposite = {"delay.tau": -found.result.model.values["delay.tau"]}
    late = replace(found.result, model=found.result.model.with_values(opposite))
    assert words.startswith("delay of the force: ")
    assert format_amount("delay", late) == words.replace("force", "displacement")


def test_a_shape_whose_start_values_differ_by_rounding_alone_has_no_reach(bare):
    model = bare.model.with_values({"eps_half": 1e-6}).with_effect("second_friction")
    reach = within_reach(model, bare.data_sets)
    assert "second_friction.eps_half" not in reach
    assert "second_friction.eps_half" in within_reach(bare.model.with_effect("second_friction"), bare.data_sets)
    assert all(low < high for low, high in reach.values())


@pytest.mark.parametrize(("most", "kept"), [(6.0, "012345"), (5.0, "01235"), (4.1, "0125"), (3.2, "015"), (0.1, "05")])
def test_of_very_many_rows_of_loops_each_loop_once_is_diagnosed_before_any_is_repeated(
    campaign, monkeypatch, most, kept
):
    """Three that differ, one of them radial and of a third as many rows, and three repeats of one."""
    (loop,) = campaign.loops
    once = loop.select(slice(0, loop.time.size // 3 + 1))  # of three cycles
    made = [(loop, 1.0, 0), (loop, 0.5, 0), (loop, 1.0, 0), (loop, 1.0, 0), (loop, 1.0, 0), (once, 1.0, 1)]
    directions = Direction.AXIAL, Direction.RADIAL
    loops = tuple(
        replace(
            of, name=f"{n}", displacement=size * of.displacement, force=size * of.force, direction=directions[place]
        )
        for n, (of, size, place) in enumerate(made)
    )
    data = PreparedCampaign.from_campaign(replace(campaign, loops=loops, rig=RigSettings(gain_error=0.01)))
    assert shorten_tests(data)[1] == ()
    monkeypatch.setattr("bushfit.diagnosis.condense._MOST_ROWS", most * data.loops[0].size)
    fewer, said = shorten_tests(data)
    assert "".join(each.name for each in fewer.loops) == kept
    assert len(said) == (len(kept) < 6)
    assert all(f"the diagnosis uses {len(kept)} of the 6 loops" in words.text for words in said)
    assert fewer.sweeps == data.sweeps
    whole = sum(made[int(name)][1] == 1.0 and made[int(name)][2] == 0 for name in kept)
    assert fewer.loops[0].gain_error == pytest.approx(0.01 * np.sqrt(whole))
