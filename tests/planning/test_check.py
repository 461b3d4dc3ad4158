"""A plan as a campaign for simulate, as a sheet and as a picture, and what many simulations of it show."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from bushfit.campaign.campaign import load_campaign, model_of
from bushfit.campaign.quantities import Compound
from bushfit.campaign.schema import RigSettings, SimulatedLoop, SimulatedSweep, SimulateSettings
from bushfit.geometry import Bushing, Direction, Specimen
from bushfit.planning.campaign import Check, campaign_toml, check, settings_of
from bushfit.planning.contract import Noise, Plan, Points, Test, Wanted
from bushfit.planning.knowledge import guess
from bushfit.planning.plan import plan
from bushfit.report.artifacts import plan_sheet

AXIAL, RADIAL = Direction.AXIAL, Direction.RADIAL
RIG = RigSettings(gain_error=0.005, phase_error=0.0044, max_force=5e3, max_frequency=200.0)
WANTED = Points(AXIAL, np.array([10.0, 50.0, 150.0]), np.array([2e-4, 2e-4, 5e-4]))


@pytest.fixture(scope="module")
def small() -> Plan:
    known = guess(Bushing("planned", 0.010, 0.018, 0.034), Compound(61.0, 27.0))
    return plan(known, Wanted("predictions", 0.7, RIG, (AXIAL,), (WANTED,), known.names))


def test_simulated_campaigns_show_the_errors_promised(small: Plan) -> None:
    """Twenty campaigns tell a standard error within a third; the page quotes 300."""
    found = check(small, 20, 7, lambda seeds, work: enumerate(work(seeds)))
    low, high = found.interval
    print("found over predicted", (found.found / found.predicted).round(2))
    assert found.failed == 0
    assert found.off.shape == (20, len(found.names))
    assert np.all(low < 1.2 * found.predicted)
    assert np.all(high > found.predicted / 1.2)


def test_the_interval_of_a_standard_error_holds_it() -> None:
    """Numbers of known scatter: their root mean square lies in its interval in 95 % of cases."""
    random, held = np.random.default_rng(5), []
    for _ in range(400):
        off = 0.01 * random.standard_normal((30, 1))
        low, high = Check(("mu",), np.array([0.01]), off, 0, 1).interval
        held.append(bool(low[0] <= 0.01 <= high[0]))
    print("held", np.mean(held))
    assert 0.91 < np.mean(held) < 0.985


def test_the_campaign_of_a_plan_is_what_simulate_reads(small: Plan, tmp_path: Path) -> None:
    """All that the file states comes back as it was planned: tests, repeats, errors of the rig, and the model."""
    coupon = Specimen("coupon", "shear", area=4e-4, thickness=6e-3)
    tests: tuple[Test, ...] = (
        SimulatedLoop(AXIAL, 1e-3, 0.1, cycles=5),
        SimulatedSweep(RADIAL, (1e-4,), (5.0, 40.0, 155.0)),
        SimulatedSweep(Direction.TORSION, (0.01, 0.02), (10.0,), "amplitude"),
        SimulatedSweep(coupon, (3e-4,), (1.0, 10.0)),
        SimulatedSweep(RADIAL, (1e-4,), (5.0, 40.0, 155.0)),
    )
    model = small.knowledge.model.with_effect("inertia", {"inertia.mass": 0.07}).with_effect("second_springpot")
    known = replace(small.knowledge, model=model, noise=Noise(rows_as_one=9.0, level=(0.003, 0.002)))
    file = tmp_path / "planned.toml"
    file.write_text(
        campaign_toml(replace(small, knowledge=known, planned=replace(small.planned, tests=tests)), 3), encoding="utf-8"
    )
    campaign = load_campaign(file)
    asked, read = settings_of(tests, known.noise, 3), campaign.simulate
    assert read is not None
    assert [test.repeats for test in read.sweeps] == [2, 1, 1]
    for each in fields(SimulateSettings):
        if each.name not in ("parameters", "effects", "loops", "sweeps"):
            assert getattr(read, each.name) == pytest.approx(getattr(asked, each.name)), each.name
    for one, other in zip((*asked.loops, *asked.sweeps), (*read.loops, *read.sweeps), strict=True):
        for each in fields(one):
            expected = getattr(one, each.name)
            numbers = isinstance(expected, tuple | float)
            assert getattr(other, each.name) == (pytest.approx(expected) if numbers else expected), each.name
    assert dict(model_of(campaign).values) == pytest.approx(dict(model.values), rel=1e-10)


def test_the_sheet_counts_repeats_and_says_what_each_run_is_for(small: Plan) -> None:
    sheet = plan_sheet(small)
    assert sheet["what for"].str.len().min() > 0
    for test, repeats in sheet.groupby("amplitude")["repeat"]:
        assert {text.split(" of ")[0] for text in repeats} >= {"1"}, test
