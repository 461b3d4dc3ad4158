"""Points left out that meet at one frequency tell of a disturbance there; points that go wrong singly do not."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from asking import asked, names
from rigged import LEVELS, SHARED, Measured, both, changed, off

from bushfit.campaign.campaign import Campaign
from bushfit.diagnosis.explanations import meetings
from bushfit.fitting.data import Data
from bushfit.model.model import Model
from bushfit.model.result import Outlier


def wild(campaign: Campaign, frequencies: tuple[float, ...]) -> Campaign:
    """The smallest levels of both directions off by a sixth at these frequencies, in turn up and down."""
    for number, sweep in enumerate(campaign.sweeps):
        rows = np.flatnonzero((sweep.amplitude == sweep.amplitude.min()) & np.isin(sweep.frequency, frequencies))
        factor = np.ones(sweep.frequency.size)
        factor[rows] = 1.0 + np.where(np.arange(rows.size) % 2, -1 / 6, 1 / 6)
        campaign = changed(campaign, number, factor)
    return campaign


def test_hum_is_told_though_its_rows_are_left_out(measured: Measured) -> None:
    """At 65 Hz; whatever its phase in a run, so that no share of the stiffness is common to them."""
    diagnosis = asked(wild(measured({}, SHARED), (65.0,)))
    assert diagnosis.verdict == "unexplained"
    assert names(diagnosis) == set()
    assert "65 Hz in several directions" in diagnosis.summary
    assert diagnosis.where[0].frequency == (65.0, 65.0)
    assert diagnosis.where[0].excess > 3.0
    assert diagnosis.odds.nothing < 0.03


@pytest.fixture
def left(measured: Measured, paper_model: Model) -> tuple[Data, Model]:
    return Data.of(measured({}, SHARED)), paper_model


def at(data: Data, *points: tuple[int, float, int]) -> list[Outlier]:
    """Outliers of sweeps, by number, at a frequency: and its place among the rows there."""
    found = []
    for number, frequency, which in points:
        sweep = data.sweeps[number]
        point = np.flatnonzero(sweep.frequency == frequency)[which]
        found.append(Outlier(sweep.name, None, int(sweep.order[point]) + 1, "stiffness", 8.0))
    return found


def test_odds_by_hand(left: tuple[Data, Model]) -> None:
    data, model = left
    count = np.unique(np.concatenate([sweep.frequency for sweep in data.sweeps])).size
    (three,) = meetings(at(data, (0, 65.0, 0), (0, 65.0, 1), (1, 65.0, 0)), data.sweeps, model)
    assert three.log_odds == pytest.approx(2.0 * np.log(count))
    assert three.apart == pytest.approx(8.0)
    pairs = meetings(at(data, (0, 65.0, 0), (0, 65.0, 1), (1, 45.0, 0)), data.sweeps, model)
    assert [pair.frequency[0] for pair in pairs] == [65.0]
    assert pairs[0].log_odds == pytest.approx(-np.log(1.0 - (1.0 - 1.0 / count) ** 2))
    assert meetings(at(data, (0, 65.0, 0), (1, 45.0, 0)), data.sweeps, model) == []
    assert meetings([], (), model) == []


def test_odds_that_no_float_holds_are_large_ones(left: tuple[Data, Model]) -> None:
    """Of 400 rows at one of 16 frequencies: 16 to the power of -399."""
    _, model = left
    count = 16 * 400
    swept = SimpleNamespace(
        name="swept",
        direction="axial",
        frequency=np.repeat(np.arange(1.0, 17.0), 400),
        amplitude=np.ones(count),
        order=np.arange(count),
        off=lambda _: np.zeros((2, count)),
    )
    every = [Outlier("swept", None, row + 1, "stiffness", 8.0) for row in range(400)]
    (found,) = meetings(every, [swept], model)  # type: ignore[list-item]
    assert 700.0 < found.log_odds < 800.0


def test_two_rows_that_went_wrong_apart_are_no_gap(measured: Measured) -> None:
    rows = [off(number, 1.15, frequency=f, amplitude=LEVELS[0], repeat=1) for number, f in enumerate((35.0, 85.0))]
    assert asked(both(*rows)(measured({}, SHARED))).verdict == "consistent"
