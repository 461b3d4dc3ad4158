"""Manifests of every kind and the names they give, operating points in words, limits and the four verdicts."""

from __future__ import annotations

import csv
import io
import math
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bushfit.batch.limits import Judge, Limits, Verdict, judge, read_limits
from bushfit.batch.manifest import Manifest, Settings, read_manifest
from bushfit.batch.quantities import at_point, parameter_quantities, parse_point
from bushfit.batch.work import numbers_of
from bushfit.errors import BatchError, CampaignError, ModelError, UnitError
from bushfit.geometry import STRAINING, TRANSLATION, Direction, Specimen
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.reduction.arrays import scatter


def written(folder: Path, text: str, name: str = "m.toml") -> str:
    (folder / name).write_text(text, encoding="utf-8")
    return str(folder / name)


def read(folder: Path, text: str, name: str = "m.toml", given_: Settings | None = None) -> Manifest:
    return read_manifest(written(folder, text, name), given_ or Settings())


def test_toml_rows_take_what_they_do_not_say_from_the_top(tmp_path: Path) -> None:
    manifest = read(
        tmp_path,
        'commands = ["fit", "predict"]\neffects = ["inertia"]\nat = ["axial 25 Hz 0.1 mm"]\n'
        '[[bushings]]\ncampaign = "a.toml"\n'
        '[[bushings]]\ncampaign = "sub/b.toml"\nname = "B"\ncommands = ["diagnose"]\ntolerance = "2 %"\n',
    )
    one, other = manifest.rows
    assert (one.name, one.settings.commands, one.settings.effects) == ("a", ("fit", "predict"), ("inertia",))
    assert (other.name, other.settings.commands, other.settings.tolerance) == ("B", ("diagnose",), 0.02)
    assert one.campaign == str(tmp_path / "a.toml")
    assert manifest.points == (parse_point("axial 25 Hz 0.1 mm"),)
    assert manifest.stem == "m"
    rows = '[[bushings]]\ncampaign = "b.toml"\ncommands = ["predict"]\n' + ROW + 'commands = ["diagnose"]\n'
    manifest = read(tmp_path, 'model = "m.json"\ntolerance = "2 %"\neffects = ["inertia"]\n' + rows + ROW)
    assert [row.settings.commands for row in manifest.rows] == [("predict",), ("diagnose",), ("fit",)]
    assert {row.settings.model for row in manifest.rows} == {str(tmp_path / "m.json")}


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_csv_of_any_delimiter_with_a_byte_order_mark(tmp_path: Path, delimiter: str) -> None:
    lines = [["campaign", "name", "commands"], ["a.toml", "A", "fit predict"], [], ["b.toml", "", ""]]
    text = "\ufeff" + "\r\n".join(delimiter.join(line) for line in lines)
    manifest = read(tmp_path, text, "m.csv", Settings(directions=(Direction.RADIAL,)))
    assert [(row.name, row.settings.commands) for row in manifest.rows] == [("A", ("fit", "predict")), ("b", ("fit",))]
    assert {row.settings.directions for row in manifest.rows} == {("radial",)}


def test_a_pattern_takes_every_match_and_names_by_folder_where_files_share_a_name(shop: Path) -> None:
    manifest = read_manifest(str(shop / "bushings/*/bushing.toml"), Settings())
    assert [row.name for row in manifest.rows] == ["b0", "b1", "b2", "b3", "b4"]
    inside = read(shop, '[[bushings]]\ncampaign = "bushings/b[0-2]/*.toml"\n[[bushings]]\ncampaign = "x.toml"\n')
    assert [row.name for row in inside.rows] == ["b0", "b1", "b2", "x"]
    assert inside.stem == "m"


@pytest.mark.parametrize(
    ("lines", "problem", "place"),
    [
        (('"a.toml,A', "b.toml,B", "c.toml,C"), "a quote is not closed", "line 2"),
        (("a.toml,A", '"b.toml,B', 'c.toml",C'), "a quote is not closed", "line 3"),
        (("a.toml,A", 'b.toml,"B" two'), "a quote is not closed", "line 3"),
    ],
)
def test_a_quote_that_swallows_rows_is_an_error(
    tmp_path: Path, lines: tuple[str, ...], problem: str, place: str
) -> None:
    with pytest.raises(CampaignError, match=problem) as error:
        read(tmp_path, "\n".join(["campaign,name", *lines]), "m.csv")
    assert error.value.place == place


def test_two_columns_of_one_name_are_an_error(tmp_path: Path) -> None:
    with pytest.raises(CampaignError, match='two columns are called "campaign"'):
        read(tmp_path, "campaign,name,campaign\na.toml,A,b.toml\n", "m.csv")


@given(st.lists(st.text(min_size=1), min_size=1, max_size=8))
def test_folders_are_of_their_own_and_lead_nowhere_else(
    tmp_path_factory: pytest.TempPathFactory, names: list[str]
) -> None:
    names = [name for name in names if name.strip() and "\0" not in name and name.isprintable()]
    if not names:
        return
    text = io.StringIO()
    csv.writer(text).writerows([["campaign", "name"], *(["x.toml", name] for name in names)])
    rows = read(tmp_path_factory.getbasetemp(), text.getvalue(), "names.csv").rows
    folders = [row.folder for row in rows]
    assert len({folder.casefold() for folder in folders}) == len(names)
    assert all(Path(folder).name == folder and folder not in (".", "..") for folder in folders)


ROW = '[[bushings]]\ncampaign = "a.toml"\n'


def test_a_manifest_of_many_rows_is_read_once_and_small(tmp_path: Path) -> None:
    count = 1000
    text = "campaign,name\n" + "".join(f"bushings/{n:05}/campaign.toml,bushing {n}\n" for n in range(count))
    source = written(tmp_path, text, "many.csv")
    tracemalloc.start()
    rows = read_manifest(source, Settings()).rows
    held, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    print(f"{held / count:.0f} bytes a row")
    assert len({id(row.settings) for row in rows}) == 1
    assert held / count < 1000


NAN = math.nan
finite = st.floats(-1e3, 1e3)


@pytest.mark.parametrize(
    ("value", "half", "verdict"),
    [(1.0, 0.5, "pass"), (1.8, 0.5, "conditional pass"), (2.2, 0.5, "conditional fail"), (-0.6, 0.5, "fail")],
)
def test_four_verdicts(value: float, half: float, verdict: str) -> None:
    assert str(judge((value, value - half, value + half), 0.0, 2.0)) == verdict


@given(finite, st.floats(0, 1e3), finite, st.floats(0, 1e3))
def test_verdicts_follow_value_and_interval(value: float, half: float, low: float, width: float) -> None:
    high = low + width
    verdict = judge((value, value - half, value + half), low, high)
    assert (verdict <= Verdict.CONDITIONAL_PASS) == (low <= value <= high)
    assert judge((-value, -value - half, -value + half), -high, -low) is verdict
    assert judge((value, NAN, NAN), low, high) in (Verdict.PASS, Verdict.FAIL)
    wider = judge((value, value - 2 * half, value + 2 * half), low, high)
    assert (wider in (Verdict.PASS, Verdict.FAIL)) <= (verdict is wider)


def limits(folder: Path, text: str) -> Limits:
    (folder / "limits.toml").write_text(text, encoding="utf-8")
    return read_limits(folder / "limits.toml")


ALL = """
nrmse = "2 %"
reduced_chi_square = 1.5
verdicts = ["consistent", "named"]
loss_factor = [{ at = "axial 25 Hz 0.1 mm", max = 0.12 }]
stiffness = [
  { at = "axial 25 Hz 0.1 mm", min = "550 N/mm", max = "0.65 kN/mm" },
  { at = "torsion 10 Hz 1 deg", max = "100 N m/rad" },
]
[parameters]
mu = { min = "1 MPa", max = "1.2 MPa" }
alpha = { nominal = 0.24, tolerance = "5 %" }
sigma_fmax = { sigma = 3, at_least = 5 }
"""


def test_limits_of_every_kind_and_of_the_batch_s_own_scatter(tmp_path: Path) -> None:
    read = limits(tmp_path, ALL)
    values = np.array([1.0, 1.01, 0.99, 1.02, 0.98, 7.0]) * 1e4
    columns = {"sigma_fmax": values}
    quantities = {q.name: q for q in parameter_quantities(["mu", "alpha", "sigma_fmax"])}
    judged = Judge(read, columns, quantities | {q.name: q for q in (at_point(p, "stiffness") for p in read.points)})
    assert judged.allowed["mu"] == (1e6, 1.2e6)
    assert judged.allowed["alpha"] == pytest.approx((0.228, 0.252))
    assert judged.allowed["stiffness axial 25 Hz 0.1 mm"] == (550e3, 650e3)
    assert judged.allowed["stiffness torsion 10 Hz 1 deg"] == (-math.inf, 100.0)
    assert judged.allowed["loss factor axial 25 Hz 0.1 mm"] == (-math.inf, 0.12)
    assert judged.allowed["NRMSE"] == (-math.inf, 0.02)
    middle, spread = scatter(values)
    assert judged.allowed["sigma_fmax"] == pytest.approx((middle - 3 * spread, middle + 3 * spread))
    assert judged.allowed["sigma_fmax"][1] < 1.2e4, "one far out must not widen the limits"
    assert judged.notes == []
    read = limits(tmp_path, "[parameters.mu]\nsigma = 3\n")
    few = Judge(read, {"mu": np.array([1.0, 2.0, np.nan])}, {})
    assert "2 bushings, and at_least = 10" in few.notes[0]
    same = Judge(read, {"mu": np.ones(12)}, {})
    assert "agree to the digit" in same.notes[0]
    assert few.allowed == same.allowed == {"mu": (-math.inf, math.inf)}


FEW = """
verdicts = ["consistent", "named"]
parameters = { mu = { min = "1 MPa", max = "1.2 MPa" }, alpha = { nominal = 0.24, tolerance = "5 %" } }
"""
QUANTITIES = {q.name: q for q in parameter_quantities(["mu", "alpha", "eps_half"])}


def test_a_bushing_is_as_good_as_its_worst_and_the_words_say_why(tmp_path: Path) -> None:
    known = {"mu": [1.19e6, 1.17e6, 1.21e6], "alpha": [0.26, 0.25, 0.27]}
    judged = Judge(limits(tmp_path, FEW), {}, QUANTITIES)
    found = judged(known, {"verdict": "named"})
    assert found.verdict is Verdict.CONDITIONAL_FAIL
    assert dict(found.missed) == {"alpha": "alpha = 0.26 (0.25 to 0.27), min 0.228 max 0.252: conditional fail"}
    assert dict(found.edge) == {"mu": "mu = 1.19 (1.17 to 1.21) MPa, min 1 max 1.2: conditional pass"}
    partly = judged(known, {"verdict": "partly"})
    assert partly.verdict is Verdict.FAIL
    assert partly.missed["verdict"] == "verdict partly, allowed consistent, named"
    guarded = Judge(limits(tmp_path, "guard = true\n" + FEW), {}, QUANTITIES)
    assert set(guarded(known, {"verdict": "named"}).missed) == {"mu", "alpha"}
    unknown = judged({"mu": [1.1e6, NAN, NAN]}, {})
    assert unknown.verdict is Verdict.FAIL
    assert dict(unknown.missed) == {
        "alpha": "alpha is not known: fail",
        "verdict": "verdict is not known, allowed consistent, named",
    }


@pytest.mark.parametrize(
    ("text", "place", "amplitude", "shown"),
    [
        ("axial 25 Hz 0.1 mm", "axial", 1e-4, "axial 25 Hz 0.1 mm"),
        ("DMA, 10 Hz, 1 %", "DMA", 0.01, "DMA 10 Hz 1 %"),
        ("mount: 1/2 0.025 kHz 100 um", "mount: 1/2", 1e-4, "mount: 1/2 25 Hz 0.1 mm"),
    ],
)
def test_points_in_words(text: str, place: str, amplitude: float, shown: str) -> None:
    point = parse_point(text)
    assert (point.place, str(point)) == (place, shown)
    assert point.amplitude == pytest.approx(amplitude)
    assert point.motion is (STRAINING if "%" in text else TRANSLATION)
    assert parse_point(shown) == point


@pytest.mark.parametrize(
    "text", ["axail 25 Hz 0.1 mm", "Axial 25 Hz 0.1 mm", "DMA 25 Hz", "DMA 25 Hz 1 kg", "axial 25 Hz 1 %"]
)
def test_what_is_no_point(text: str) -> None:
    with pytest.raises(UnitError):
        parse_point(text)


def test_a_point_at_a_specimen_is_that_of_the_model(paper_model: Model) -> None:
    result = Result(paper_model, specimens=(coupon := Specimen("DMA", "modulus"),))
    record = numbers_of(result, [parse_point("DMA 10 Hz 1 %")], ())
    modulus = abs(paper_model.stiffness(coupon, 10.0, 0.01))
    assert record["points"]["DMA 10 Hz 1 %"]["stiffness"][0] == pytest.approx(modulus)
    with pytest.raises(BatchError, match=r"this amplitude is none of the place[\s\S]*an amplitude in %"):
        numbers_of(result, [parse_point("DMA 10 Hz 1 mm")], ())
    with pytest.raises(ModelError, match="no such direction or specimen"):
        numbers_of(result, [parse_point("coupon 10 Hz 1 %")], ())
