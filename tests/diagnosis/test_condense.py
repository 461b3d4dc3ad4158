"""Long sweeps count in narrow bands: as sharp as their points, and as honest."""

from dataclasses import astuple, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rigged import LEVELS, cut

from bushfit.campaign.campaign import Campaign, load_campaign
from bushfit.campaign.schema import RigSettings
from bushfit.diagnosis.condense import condensed
from bushfit.diagnosis.workflow import diagnose
from bushfit.effects.contract import Array
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.geometry import Bushing, Direction
from bushfit.model.model import FIVE, Model
from bushfit.reading.measurement import Sweep

PAPER = Model.with_defaults(
    Bushing("paper's", 0.010, 0.018, 0.034),
    ("elastic", "springpot", "friction"),
    dict(zip(FIVE, (1.09e6, 0.2e6, 0.24, 14.6e3, 0.013), strict=True)),
)
POINTS = 900
SCATTER = 0.01


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


def grid(levels: Array) -> Sweep:
    """Four frequencies at each of many levels, without noise."""
    return silent(np.tile([5.0, 20.0, 60.0, 150.0], levels.size), np.repeat(levels, 4))


def joined(*sweeps: Sweep) -> Sweep:
    columns = ("frequency", "amplitude", "stiffness", "repeat")
    return replace(sweeps[0], **{name: np.concatenate([getattr(each, name) for each in sweeps]) for name in columns})


def off(sweep: Sweep) -> Array:
    return np.asarray(np.log(sweep.stiffness / PAPER.stiffness(Direction.AXIAL, sweep.frequency, sweep.amplitude)))


def test_a_campaign_without_long_runs_is_as_it_was() -> None:
    data = data_of(swept(PAPER, points=100))
    assert condensed(data) == (data, ())


def test_means_are_as_sharp_as_their_points() -> None:
    """Scatter of 900 points in 100 bands falls with the root of 9, and so does the noise that is estimated."""
    (sweep,), said = condensed(data_of(swept(PAPER)))[0].sweeps, condensed(data_of(swept(PAPER)))[1]
    assert said == ("swept: 5400 points are averaged to 600 narrow bands for the diagnosis",)
    expected = SCATTER / np.sqrt(POINTS / 100)
    assert np.std(off(sweep.sweep).real) == pytest.approx(expected, rel=0.1)
    assert sweep.relative_noise == pytest.approx(expected, rel=0.1)
    assert abs(np.mean(off(sweep.sweep))) < 4.0 * expected / np.sqrt(600)
    assert set(sweep.sweep.amplitude) == set(LEVELS)


def test_short_runs_beside_long_ones_stay_points_and_rows_without_weight_count_nowhere() -> None:
    data = data_of(swept(PAPER), replace(swept(PAPER, points=30), name="short"), replace(swept(PAPER), name="off"))
    long, short, off = data.sweeps
    wild = long.without(np.arange(7)), short.without(np.array([3])), off.without(np.arange(5400))
    banded, said = condensed(replace(data, sweeps=wild))
    assert len(said) == 1
    lowest = banded.sweeps[0].sweep.frequency[0]
    assert lowest > condensed(data)[0].sweeps[0].sweep.frequency[0]  # the mean of what is left of the band
    assert banded.sweeps[1].sweep is short.sweep
    assert np.flatnonzero(banded.sweeps[1].weights == 0.0).tolist() == [3]
    assert not banded.sweeps[2].weights.any()


def test_of_very_many_levels_some_are_diagnosed_and_none_forgotten() -> None:
    """Rows of levels that are not looked at were measured all the same, and the rubber remembers them."""
    levels = np.random.default_rng(1).permutation(np.geomspace(1e-5, 1e-3, 300))
    data = data_of(grid(levels))
    banded, said = condensed(data)
    sweep = banded.sweeps[0].sweep
    assert said == ("silent: 40 of its 300 runs at one level, or frequency, are used in the diagnosis, evenly spread",)
    assert sweep.frequency.size == 160
    assert {sweep.amplitude.min(), sweep.amplitude.max()} == {levels.min(), levels.max()}
    assert np.abs(off(sweep)).max() < 1e-12
    before, after = data.sweeps[0], banded.sweeps[0]
    for point in range(0, 160, 7):
        same = (before.sweep.amplitude == sweep.amplitude[point]) & (before.sweep.frequency == sweep.frequency[point])
        assert astuple(after.test_conditions.select(point)) == astuple(
            before.test_conditions.select(int(np.flatnonzero(same)[0]))
        )


UP = np.geomspace(5.0, 60.0, 450)
BENT = [1.0 + 9.0 / (1.0 + (f - middle) ** 2) for f, middle in ((UP, 25.0), (UP[::-1], 18.0))]


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
def test_means_lie_on_the_curve(sweep: Sweep, largest: float) -> None:
    """Evenly in frequency the first bands are wide in its logarithm; where neither is held, points at one frequency may
    have amplitudes far apart, and are taken in turn."""
    made = condensed(data_of(sweep))[0].sweeps[0].sweep
    assert made.frequency.size < sweep.frequency.size
    assert np.abs(off(made)).max() < largest
    if sweep.stepped == "frequency":
        assert np.abs(np.mean(off(made))) < 2e-5
    if sweep.stepped == "amplitude":
        assert made.frequency.tolist() == [10.0] * 100 + [100.0] * 100


def test_lines_keep_their_own_noise_beside_means() -> None:
    """A short level in a long sweep, and a short sweep beside one: 1 % stays 1 %, stated or found."""
    few = swept(PAPER, points=30, repeats=1, seed=5)
    whole = swept(PAPER)
    mixed = joined(cut(whole, whole.amplitude < LEVELS[2]), cut(few, few.amplitude == LEVELS[2]))
    in_means = SCATTER / np.sqrt(POINTS / 100)
    for stated in (None, SCATTER):
        data = data_of(replace(mixed, noise=stated), replace(few, name="short", noise=stated))
        long, short = condensed(data)[0].sweeps
        found = {key: gain for key, (gain, _) in long.noise.random.items()}
        assert long.noise is short.noise
        assert found["swept", LEVELS[0]] == pytest.approx(in_means, rel=0.15)
        assert found["swept", LEVELS[2]] == pytest.approx(SCATTER, rel=0.25)
        assert found["short", LEVELS[0]] == pytest.approx(SCATTER, rel=0.25)


def test_a_hidden_lag_is_named_in_a_long_sweep_and_the_means_are_told() -> None:
    lagging = PAPER.with_effect("delay", {"delay.tau": 2e-4})
    found = diagnose(data_of(swept(lagging)))
    assert [effect.name for effect in found.effects] == ["delay"]
    assert any("narrow bands" in note for note in found.notes)
    low, high = found.result.interval("delay.tau") or (0.0, 0.0)
    assert low < 2e-4 < high


@pytest.mark.parametrize("beside", [False, True], ids=["alone", "beside a short one"])
def test_a_clean_long_sweep_is_consistent(beside: bool) -> None:
    """The noise is white and of the fit's own kind, which proves half."""
    short = [replace(swept(PAPER, 30, 1, 100), name="short")] * beside
    assert diagnose(data_of(swept(PAPER), *short)).verdict == "consistent"


def test_means_that_a_robust_fit_leaves_out_are_told() -> None:
    """Rows of two bands 2.5 standard deviations off are no outliers; the mean of one is."""
    sweep = swept(PAPER)
    band = (sweep.frequency > 40.0) & (sweep.frequency < 43.0) & (sweep.amplitude == LEVELS[1]) & (sweep.repeat == 1)
    assert np.count_nonzero(band) == 19
    off_there = replace(sweep, stiffness=np.where(band, 1.0 + 2.5 * SCATTER, 1.0) * sweep.stiffness)
    data = data_of(off_there)
    robust = PreparedCampaign.from_campaign(replace(data.campaign, fit=replace(data.campaign.fit, loss="soft_l1")))
    (told,) = [note for note in diagnose(robust).notes if "left out" in note]
    assert told == "swept: 1 of these points are left out, because they deviate by more than noise"
    as_it_was = replace(robust.campaign, sweeps=(sweep,))
    assert not any("left out" in note for note in diagnose(PreparedCampaign.from_campaign(as_it_was)).notes)


@pytest.mark.parametrize(("most", "kept"), [(6.0, "012345"), (5.0, "01235"), (4.1, "0125"), (3.2, "015"), (0.1, "15")])
def test_of_very_many_rows_of_loops_each_loop_once_is_diagnosed_before_any_is_repeated(
    root: Path, monkeypatch: pytest.MonkeyPatch, most: float, kept: str
) -> None:
    """Three that differ, one of them radial and of a third as many rows, and three repeats of one."""
    campaign = load_campaign(root / "configs/cmp_15961.toml")
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
    assert condensed(data)[1] == ()
    monkeypatch.setattr("bushfit.diagnosis.condense._MOST_ROWS", most * data.loops[0].size)
    fewer, said = condensed(data)
    assert "".join(each.name for each in fewer.loops) == kept
    assert len(said) == (len(kept) < 6)
    assert all(f"{len(kept)} of the 6 loops are used in the diagnosis" in words for words in said)
    assert fewer.sweeps == data.sweeps
    whole = sum(made[int(name)][1] == 1.0 and made[int(name)][2] == 0 for name in kept)
    assert fewer.loops[0].gain_error == pytest.approx(0.01 * np.sqrt(whole if kept[0] != "1" else 1))


def test_points_left_out_meet_at_their_own_frequency_in_runs_that_are_diagnosed_in_means() -> None:
    """Rows count in the sweep as it was read: in its means the points that were left out are no more."""
    sweep = swept(PAPER, points=450)
    rows = np.flatnonzero(sweep.frequency == sweep.frequency[200])
    factor = np.ones(sweep.frequency.size)
    factor[rows] += np.where(np.arange(rows.size) % 2, 0.2, -0.2)
    diagnosis = diagnose(data_of(replace(sweep, stiffness=sweep.stiffness * factor)))
    assert rows.size > 3
    assert diagnosis.verdict == "unexplained"
    assert f"{sweep.frequency[200]:.4g} Hz in axial ({rows.size} points left out)" in diagnosis.summary
