"""A batch as a whole: who differs and by what, the measured curves, capability; how often a part is named by chance."""

import html
import json
import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from production import COUNT, LOSSY, SOFT
from scipy import stats

from bushfit.batch.comparison import capability, find_outliers, smallest_deviation
from bushfit.batch.document import Estimate, RowFile
from bushfit.batch.quantities import measured_curve
from bushfit.batch.summary import BatchResult
from bushfit.geometry import Direction
from bushfit.reading.measurement import Sweep


@pytest.fixture(scope="module")
def table(made) -> pd.DataFrame:
    return pd.read_csv(made / "out/batch.csv", keep_default_na=False, na_values={"mu [MPa], std error": ""})


@pytest.fixture(scope="module")
def document(made) -> Any:
    return json.loads((made / "out/batch.json").read_text(encoding="utf-8"))


def test_a_part_that_differs_is_named_with_the_parameter_that_was_changed(made, table, document):
    lossy, soft = (document["parts"][number] for number in (LOSSY, SOFT))
    assert document["differ"] == [f"part_0{LOSSY}", f"part_{SOFT}"]
    assert (next(iter(lossy["deviations"])), next(iter(soft["deviations"]))) == ("alpha", "mu")
    assert lossy["deviations"]["alpha"] > document["detectable"]
    assert document["detectable"] == smallest_deviation(COUNT, 8), "of 8 quantities"
    assert soft["deviations"]["measured stiffness"] < -document["detectable"]
    assert list(np.flatnonzero(table["differs in"] != "")) == [LOSSY, SOFT]
    assert table["robust z of mu [-]"][SOFT] == pytest.approx(soft["deviations"]["mu"], abs=0.01)
    alpha = table["alpha [-]"]
    percent = 100.0 * (alpha[LOSSY] / alpha.median() - 1.0)
    assert lossy["differs"].startswith(f"alpha {percent:+.3g} %")
    said = (made / "said").read_text(encoding="utf-8")
    assert f"part_0{LOSSY} differs from the others: alpha +" in said
    assert said.startswith(f"batch: {document['headline']}\n")


def test_the_page_lists_a_warning_once_with_the_number_of_its_parts(made, document):
    page = html.unescape((made / "out/index.html").read_text(encoding="utf-8"))
    listed = page.partition('<ol class="warnings">')[2].partition("</ol>")[0].split("</li>")[:-1]
    kinds: dict[str, set[str]] = {}
    for part in document["parts"]:
        for kind in part["warning_kinds"]:
            kinds.setdefault(kind, set()).add(part["name"])
    heads = [line.removeprefix("<li>").partition(": ")[0].partition(",")[0] for line in listed]
    wanted = [f"{len(names)} parts" if len(names) > 1 else min(names) for names in kinds.values()]
    assert sorted(heads) == sorted(wanted)


def test_capability_is_that_of_fixed_limits(table, document):
    quantities, mu = document["quantities"], table["mu [MPa]"]
    sigma, found = mu.std(), quantities["mu [MPa]"]
    assert found["cp"][0] == pytest.approx(0.35 / (6 * sigma), rel=1e-5)
    ends = [0.35 / (6 * sigma) * math.sqrt(stats.chi2.ppf(p, COUNT - 1) / (COUNT - 1)) for p in (0.025, 0.975)]
    assert found["cp"][1:] == pytest.approx(ends, rel=1e-5)
    assert found["cpk"][0] == pytest.approx(min(1.25 - mu.mean(), mu.mean() - 0.9) / (3 * sigma), rel=1e-5)
    assert (found["min"], found["max"], found["median"]) == pytest.approx((0.9, 1.25, mu.median()), rel=1e-6)
    assert quantities["alpha [-]"]["cpk"] is None, "limits by sigma are the batch's own"
    assert quantities["alpha [-]"]["max"] > quantities["alpha [-]"]["median"]
    one_sided = quantities["stiffness axial 25 Hz 0.2 mm [N/mm]"]
    assert (one_sided["cp"], one_sided["cpk"] is None) == (None, False)


def test_a_soft_part_of_ten_is_named():
    """Of ten parts that scatter by 2 %, one that is 15.7 % soft."""
    random = np.random.default_rng(0)
    values = 100.0 * (1.0 + 0.02 * random.normal(size=(8, 10)))
    values[0, 6] = 84.3
    unknown = np.full(10, np.nan)
    deviations, outliers = find_outliers({str(number): (row, unknown) for number, row in enumerate(values)})
    assert np.flatnonzero(outliers["0"]).tolist() == [6]
    assert not any(outliers[str(number)].any() for number in range(1, 8))
    others = np.delete(values[0], 6)
    z = (values[0, 6] - others.mean()) / (others.std(ddof=1) * math.sqrt(1.0 + 1.0 / 9.0))
    assert deviations["0"][6] == pytest.approx(z)
    limit = smallest_deviation(10, 8)
    assert limit
    assert stats.t.sf(limit, 8) == pytest.approx(0.05 / 2 / 80)
    assert not find_outliers({"0": (values[0], np.where(np.arange(10) == 6, 9.0, 0.1))})[1]["0"].any(), "a large error"


def test_parts_with_the_same_data_or_without_the_sweep_of_the_others_are_named():
    curve = {f"axial {frequency} Hz 0.1 mm": 5e5 for frequency in (5, 25, 100)}
    whole = RowFile(status="done", quantities={"mu": Estimate(1e6)}, curve=curve)
    records = [*[whole] * 6, replace(whole, curve={})]
    plan: Any = SimpleNamespace(limits=None, task=SimpleNamespace(points=()))
    result = BatchResult(plan, records, 0, 0.0, ())
    assert np.isnan(result.compared_values["mu"][0]).tolist() == [False] * 6 + [True]
    parts: Any = [SimpleNamespace(name=f"P{n}", poor_fit=0, warning_kinds=(), folder=1, curve=n < 6) for n in range(7)]
    named = [(warning.kind, warning.text[-2:]) for warning in result.warnings(parts)]
    assert named == [("same_parts", "es"), ("part_without_sweep", "P6")]


@pytest.mark.parametrize(("count", "level"), [(1, 0.1), (2, 0.1), (3, 0.2), (4, 0.2)])
def test_the_curve_of_a_part_is_the_mean_of_the_repeats_at_its_middle_level(count, level):
    amplitude = np.repeat([1e-4, 2e-4, 4e-4, 8e-4][:count], 6)
    frequency = np.tile([5.0, 25.0, 100.0], 2 * count)
    stiffness = 1e9 * amplitude + 10.0 * frequency + np.tile(np.repeat([1.0, 3.0], 3), count) + 0j
    found = measured_curve([Sweep("s", Direction.AXIAL, frequency, amplitude, stiffness)])
    expected = {f"axial {f} Hz {level} mm": 1e6 * level + 10.0 * f + 2.0 for f in (5, 25, 100)}
    assert found == pytest.approx(expected)


@pytest.mark.parametrize("count", [5, 8, 30])
@pytest.mark.parametrize("error", [0.0, 3.0])
def test_a_part_is_named_by_chance_in_one_batch_of_twenty_at_most(count, error):
    random, named, batches = np.random.default_rng(count), 0, 200
    for _ in range(batches):
        own = error * np.exp(0.3 * random.normal(size=(6, count)))
        values = random.normal(size=(6, count)) + own * random.normal(size=(6, count))
        pairs = {str(row): (values[row], own[row] if error else np.full(count, np.nan)) for row in range(6)}
        named += any(outliers.any() for outliers in find_outliers(pairs)[1].values())
    assert named <= stats.binom.ppf(0.999, batches, 0.05)


def test_the_interval_of_cpk_is_that_of_bissell():
    """Of five parts: Cpk = 1.5, and 1.96 sqrt(1/45 + 1.5^2/8) = 1.0797 on either side."""
    values = np.array([-2.0, -1.0, 0.0, 1.0, 2.0]) / math.sqrt(2.5)
    _, cpk = capability(values, -math.inf, 4.5)
    assert cpk == pytest.approx((1.5, 0.4203, 2.5797), abs=1e-4)
