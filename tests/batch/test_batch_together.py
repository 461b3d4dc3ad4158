"""A batch as a whole: who differs and by what, drift, control limits, capability; and how often by chance."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from production import COUNT, DRIFT, LOSSY, SOFT, fitted
from scipy import stats

from bushfit.effects.contract import Array
from bushfit.prediction.comparison import holm
from bushfit.report.process import LEVEL, Process, process, robust_z


@pytest.fixture(scope="module")
def table(made: Path) -> pd.DataFrame:
    return pd.read_csv(made / "out/batch.csv", keep_default_na=False, na_values={"mu [MPa], std error": ""})


@pytest.fixture(scope="module")
def document(made: Path) -> Any:
    return json.loads((made / "out/batch.json").read_text(encoding="utf-8"))


def test_who_differs_is_told_by_the_parameter_that_was_changed(made: Path, table: pd.DataFrame, document: Any) -> None:
    differ = {each["name"]: each for each in document["differ"]}
    assert set(differ) == {f"part_0{LOSSY}", f"part_{SOFT}"}
    lossy, soft = differ[f"part_0{LOSSY}"], differ[f"part_{SOFT}"]
    assert (next(iter(lossy["by"])), next(iter(soft["by"]))) == ("alpha", "mu")
    assert lossy["by"]["alpha"] > document["least_told"]
    assert soft["by"]["measured stiffness"] < 0
    assert lossy["row"] == LOSSY + 1
    assert list(np.flatnonzero(table["differs in"] != "")) == [LOSSY, SOFT]
    assert table["robust z of mu [-]"][SOFT] == pytest.approx(soft["by"]["mu"], abs=0.01)
    assert f"differs: part_0{LOSSY}: alpha +" in (made / "said").read_text(encoding="utf-8")


def test_new_columns_end_the_table_and_the_curve_is_what_was_measured(made: Path, table: pd.DataFrame) -> None:
    columns = list(table)
    last = columns.index("warnings")
    assert columns[last + 1 :][:3] == ["campaign name", "subgroup", "differs in"]
    assert columns.index("mu [MPa]") < last
    assert list(table["campaign name"]) == [f"SN {900 + number}" for number in range(COUNT)]
    curve = [name for name in columns[last:] if name.startswith("measured stiffness axial ")]
    assert len(curve) == 6
    sweep = pd.read_csv(made / "part_03/sweep.csv")
    there = sweep[(sweep["frequency [Hz]"] == 25) & (sweep["amplitude [mm]"] == 0.2)]
    measured = table["measured stiffness axial 25 Hz 0.2 mm [N/mm]"]
    assert measured[3] == pytest.approx(there["stiffness [N/mm]"].mean(), rel=1e-6)
    off = np.exp(np.log(table[curve] / table[curve].median()).mean(axis=1)) - 1.0
    assert np.allclose(table["measured stiffness off the median [%]"], 100.0 * off, atol=1e-3)


def test_drift_and_control_limits_follow_the_dates(made: Path, table: pd.DataFrame, document: Any) -> None:
    assert document["order"] == "by the dates of the tests"
    assert list(table["order of test [-]"]) == list(range(COUNT, 0, -1))
    mu = document["quantities"]["mu [MPa]"]["process"]
    change, low, _, p = mu["drift"]
    assert (p < 1e-6, low > 0.5 * DRIFT) == (True, True)
    assert change == pytest.approx(1.09 * DRIFT, rel=0.25), "the first of the list was tested last"
    drifts = "mu drifts from the first bushing to the last, by the dates of the tests: +"
    assert any(line.startswith(drifts) for line in document["warnings"])
    assert f"warning: {drifts}" in (made / "said").read_text(encoding="utf-8")
    values = table["mu [MPa]"].drop(index=SOFT)[::-1].to_numpy()
    ranges = np.abs(np.diff(values))
    assert (mu["points"], mu["size"]) == (COUNT - 1, 1)
    half = 2.66 * ranges.mean()
    assert mu["control"] == pytest.approx([values.mean(), values.mean() - half, values.mean() + half], rel=1e-3)
    assert mu["ranges"] == pytest.approx([ranges.mean(), 3.267 * ranges.mean()], rel=1e-3)
    assert mu["beyond"] >= 1


def test_capability_is_that_of_fixed_limits_and_of_a_process_that_is_not_steady(
    made: Path, table: pd.DataFrame, document: Any
) -> None:
    found, mu = document["quantities"]["mu [MPa]"]["process"], table["mu [MPa]"]
    assert found["index"] == "Ppk"
    sigma = mu.std()
    assert found["spread"][0] == pytest.approx(0.35 / (6 * sigma), rel=1e-5)
    ends = [0.35 / (6 * sigma) * math.sqrt(stats.chi2.ppf(p, COUNT - 1) / (COUNT - 1)) for p in (0.025, 0.975)]
    assert found["spread"][1:] == pytest.approx(ends, rel=1e-5)
    assert found["nearest"][0] == pytest.approx(min(1.25 - mu.mean(), mu.mean() - 0.9) / (3 * sigma), rel=1e-5)
    assert document["quantities"]["alpha [-]"]["process"]["index"] is None, "limits by sigma are the batch's own"
    one_sided = document["quantities"]["stiffness axial 25 Hz 0.2 mm [N/mm]"]["process"]
    assert (one_sided["spread"], one_sided["nearest"] is None) == (None, False)
    assert "capability: mu: Pp = " in (made / "said").read_text(encoding="utf-8")


def test_few_bushings_tell_little_and_subgroups_make_charts(made: Path) -> None:
    done = fitted(made, "part_0[0-4]/bushing.toml", "-o", "few")
    assert "5 bushings cannot tell whether it is above 1.33; about" in done.stderr
    found = json.loads((made / "few/batch.json").read_text(encoding="utf-8"))
    assert found["differ"] == []
    assert found["least_told"] > 20
    page = (made / "few/index.html").read_text(encoding="utf-8")
    assert "limits of 5 bushings are provisional" in page
    rows = [f"part_{number:02}/bushing.toml,shift {number // 3}\n" for number in range(COUNT)]
    (made / "shifts.csv").write_text("campaign,subgroup\n" + "".join(rows))
    fitted(made, "shifts.csv", "-o", "shifts")
    table = pd.read_csv(made / "shifts/batch.csv")
    chart = json.loads((made / "shifts/batch.json").read_text())["quantities"]["alpha [-]"]["process"]
    assert (chart["size"], chart["points"]) == (3, COUNT // 3 - 1)
    alpha = table["alpha [-]"].to_numpy().reshape(-1, 3)
    others = np.arange(COUNT // 3) != LOSSY // 3
    middle = np.ptp(alpha, axis=1)[others].mean()
    assert chart["control"][2] - chart["control"][1] == pytest.approx(2 * 1.023 * middle, rel=2e-3), "A2 of ISO 7870-2"
    assert chart["ranges"][1] == pytest.approx(2.575 * middle, rel=2e-3), "D4 of ISO 7870-2"
    assert chart["beyond"] >= 1
    (made / "shifts.csv").write_text("campaign,subgroup\n" + "".join(rows[:-1]) + "part_29/bushing.toml,\n")
    done = fitted(made, "shifts.csv", "-o", "shifts")
    assert "subgroup is stated of 29 of 30 bushings: individuals are charted" in done.stderr


def process_of(values: Array, *stated: float) -> Process:
    low, high = stated or (-math.inf, math.inf)
    return process(values, values * math.nan, np.zeros(values.size, dtype=bool), (low, high), [], 1)


def test_drift_and_the_interval_of_cpk_are_those_of_the_textbooks() -> None:
    values = np.random.default_rng(0).normal(size=40) + np.linspace(0.0, 1.0, 40)
    found, slope = process_of(values)["drift"], stats.theilslopes(values, np.arange(40.0))
    assert found
    assert found[0] == pytest.approx(39 * slope.slope)
    assert list(found[1:3]) == pytest.approx([39 * slope.low_slope, 39 * slope.high_slope], rel=0.05)
    assert found[3] == pytest.approx(stats.kendalltau(np.arange(40), values).pvalue, rel=0.1)
    random, held = np.random.default_rng(2), 0
    for values in random.normal(size=(500, 20)):
        nearest = process_of(values, -4.0, 5.0)["nearest"]
        assert nearest
        held += nearest[1] <= 4.0 / 3.0 <= nearest[2]
    assert 0.92 <= held / 500 <= 0.985


@pytest.mark.parametrize("count", [5, 10, 30])
@pytest.mark.parametrize("error", [0.0, 1.0, 3.0])
def test_a_bushing_that_differs_by_chance_is_told_in_one_batch_of_twenty_at_most(count: int, error: float) -> None:
    random, told, batches = np.random.default_rng(count), 0, 200
    for _ in range(batches):
        own = error * np.exp(0.3 * random.normal(size=(6, count)))
        values = random.normal(size=(6, count)) + own * random.normal(size=(6, count))
        chance = np.array([robust_z(each, errors)[1] for each, errors in zip(values, own, strict=True)])
        told += min(holm(chance.ravel().tolist())) < LEVEL
    assert told <= stats.binom.ppf(0.999, batches, LEVEL)
