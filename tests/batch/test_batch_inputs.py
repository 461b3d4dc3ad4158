"""Manifests of every kind and the names they give, operating points in words, limits and the four verdicts."""

import math
from pathlib import Path

import numpy as np
import pytest

from bushfit.batch.document import Estimate, RowFile
from bushfit.batch.limits import RESULTS, Limits, judge_part, read_limits, resolve_limits
from bushfit.batch.manifest import Manifest, RowSettings, read_manifest
from bushfit.batch.quantities import list_quantities
from bushfit.geometry.point import parse_point
from bushfit.reduction.arrays import median_and_scatter

ROW = '[[bushings]]\ncampaign = "a.toml"\n'


def written(folder: Path, text: str, name: str = "m.toml") -> str:
    (folder / name).write_text(text, encoding="utf-8")
    return str(folder / name)


def read(folder: Path, text: str, name: str = "m.toml", given_: RowSettings | None = None) -> Manifest:
    return read_manifest(written(folder, text, name), given_ or RowSettings())


def test_toml_rows_take_what_they_do_not_say_from_the_top(tmp_path):
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
    assert manifest.title == "m"
    rows = '[[bushings]]\ncampaign = "b.toml"\ncommands = ["predict"]\n' + ROW + 'commands = ["diagnose"]\n'
    manifest = read(tmp_path, 'model = "m.json"\ntolerance = "2 %"\neffects = ["inertia"]\n' + rows + ROW)
    assert [row.settings.commands for row in manifest.rows] == [("predict",), ("diagnose",), ("fit",)]
    assert {row.settings.model for row in manifest.rows} == {str(tmp_path / "m.json")}


def test_a_pattern_takes_every_match_and_names_by_folder_where_files_share_a_name(shop):
    manifest = read_manifest(str(shop / "bushings/*/bushing.toml"), RowSettings())
    assert [row.name for row in manifest.rows] == ["b0", "b1", "b2", "b3", "b4"]
    inside = read(shop, '[[bushings]]\ncampaign = "bushings/b[01]/*.toml"\n[[bushings]]\ncampaign = "x.toml"\n')
    assert [row.name for row in inside.rows] == ["b0", "b1", "x"]
    assert inside.title == "m"


def limits(folder: Path, text: str) -> Limits:
    return read_limits(Path(written(folder, text, "limits.toml")), ())


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


def test_limits_of_every_kind_and_of_the_scatter_of_the_batch(tmp_path):
    values = np.array([1.0, 1.01, 0.99, 1.02, 0.98, 7.0]) * 1e4
    allowed, notes = resolve_limits(limits(tmp_path, ALL), {"sigma_fmax": values})
    assert allowed["mu"] == (1e6, 1.2e6)
    assert allowed["alpha"] == pytest.approx((0.228, 0.252))
    assert allowed["stiffness axial 25 Hz 0.1 mm"] == (550e3, 650e3)
    assert allowed["stiffness torsion 10 Hz 1 deg"] == (-math.inf, 100.0)
    assert allowed["loss factor axial 25 Hz 0.1 mm"] == (-math.inf, 0.12)
    assert allowed["NRMSE"] == (-math.inf, 0.02)
    middle, spread = median_and_scatter(values)
    assert allowed["sigma_fmax"] == pytest.approx((middle - 3 * spread, middle + 3 * spread))
    assert allowed["sigma_fmax"][1] < 1.2e4, "one far out must not widen the limits"
    assert notes == []
    by_sigma = limits(tmp_path, "[parameters.mu]\nsigma = 3\n")
    few = resolve_limits(by_sigma, {"mu": np.array([1.0, 2.0, np.nan])})
    assert "2 parts, fewer than at_least = 10" in few[1][0].text
    same = resolve_limits(by_sigma, {"mu": np.ones(12)})
    assert "have exactly the same value" in same[1][0].text
    assert few[0] == same[0] == {"mu": (-math.inf, math.inf)}


FEW = """
verdicts = ["consistent", "named"]
parameters = { mu = { min = "1 MPa", max = "1.2 MPa" }, alpha = { nominal = 0.24, tolerance = "5 %" } }
"""


def judged(read: Limits, **record: object) -> tuple[str, dict[str, str], dict[str, str]]:
    """Result, misses and doubtful limits of a part."""
    allowed, _ = resolve_limits(read, {})
    quantities = list_quantities(["mu", "alpha"], [bounds.at for bounds in (*read.stiffness, *read.loss_factor)])
    return judge_part(RowFile(status="done", **record), read, allowed, quantities)  # type: ignore[arg-type]


def test_a_part_is_as_good_as_its_worst_and_the_words_say_why(tmp_path):
    known = {"mu": Estimate(1.19e6, 1.17e6, 1.21e6), "alpha": Estimate(0.26, 0.25, 0.27)}
    read = limits(tmp_path, FEW)
    assert judged(read, quantities=known, verdict="named") == (
        "conditional fail",
        {"alpha": "alpha 0.26 (0.25 to 0.27), limit 0.252: conditional fail"},
        {"mu": "mu 1.19 MPa (1.17 to 1.21), limit 1.2 MPa: conditional pass"},
    )
    assert judged(read, quantities=known, verdict="partly")[:2] == (
        "fail",
        {
            "alpha": "alpha 0.26 (0.25 to 0.27), limit 0.252: conditional fail",
            "verdict": "verdict partly, allowed consistent, named",
        },
    )
    guarded = limits(tmp_path, "guard = true\n" + FEW)
    assert set(judged(guarded, quantities=known, verdict="named")[1]) == {"mu", "alpha"}
    assert judged(read, quantities={"mu": Estimate(1.1e6)})[:2] == (
        "fail",
        {"alpha": "alpha is not known", "verdict": "verdict not known, allowed consistent, named"},
    )
    assert judged(limits(tmp_path, 'verdicts = ["named"]'), verdict="named") == ("pass", {}, {})
    assert RESULTS.index("not judged") > RESULTS.index("conditional pass"), "what is not judged is no pass"


def test_a_part_whose_fit_misses_the_tests_is_judged_on_measured_points(tmp_path):
    stiffness = "stiffness axial 25 Hz 0.1 mm"
    poor = {"NRMSE": Estimate(0.12), "reduced chi-square": Estimate(90.0)}
    poor |= {stiffness: Estimate(5e5), "mu": Estimate(9e6)}
    read = limits(
        tmp_path, '[parameters.mu]\nmax = "1 MPa"\n[[stiffness]]\nat = "axial 25 Hz 0.1 mm"\nmin = "440 N/mm"\n'
    )
    not_judged = {"mu": "mu not judged: poor fit"}
    assert judged(read, quantities=poor) == (
        "not judged", {}, not_judged | {stiffness: f"{stiffness} not judged: poor fit"}
    )  # fmt: skip
    measured = {stiffness: Estimate(3.99e5, 3.95e5, 4.03e5)}
    assert judged(read, quantities=poor, measured=measured) == (
        "fail", {stiffness: f"measured {stiffness} 399 N/mm (395 to 403), limit 440 N/mm"}, not_judged
    )  # fmt: skip
    noisy = poor | {"reduced chi-square": Estimate(1.1)}
    assert judged(read, quantities=noisy, measured=measured)[1].keys() == {"mu"}, "noise is in the interval"
    assert "mu" in judged(limits(tmp_path, 'nrmse = "15 %"\n[parameters.mu]\nmax = "1 MPa"\n'), quantities=poor)[1]
