"""Commands on several bushings of one compound: names of bushings and directions, and other campaigns."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from shell import typing

from bushfit.geometry import Specimen
from bushfit.report.results import place_names

N = 200
TIME = np.arange(N) / 200.0
MOTION = 0.2 * np.sin(2.0 * np.pi * 5.0 * TIME)
SIZES = 'inner_radius = "10 mm"\nouter_radius = "18 mm"\nlength = "50 mm"\n'


@pytest.fixture(scope="module")
def shapes(root, tmp_path_factory) -> Path:
    """A folder with the fit of three shapes under `model`, and displacement histories."""
    folder = tmp_path_factory.mktemp("shapes")
    typing(folder)("fit", root / "configs/three_shapes.toml", "-o", "model", "--no-plots")
    histories = {
        "road": {"axial [mm]": MOTION, "torsion [deg]": MOTION},
        "plain": {"displacement [mm]": MOTION},
        "radial": {"displacement [mm]": MOTION},
        "turn": {"displacement [deg]": MOTION},
    }
    for name, columns in histories.items():
        pd.DataFrame({"time [s]": TIME, **columns}).to_csv(folder / f"{name}.csv", index=False)
    test = f'[[sweeps]]\nfile = "{root}/data/three_shapes/long.csv"\ndirection = "axial"\n'
    (folder / "mine.toml").write_text(f'[bushing]\nname = "mine"\n{SIZES}{test}', encoding="utf-8")
    text = (root / "configs/three_shapes.toml").read_text(encoding="utf-8").replace("../data", f"{root}/data")
    (folder / "longer.toml").write_text(text.replace('"50 mm"', '"60 mm"'), encoding="utf-8")
    return folder


@pytest.mark.parametrize(
    ("history", "direction", "places"),
    [
        ("road", None, "short axial, long axial, thick axial, short torsion, long torsion, thick torsion"),
        ("road", "long", "long axial, long torsion"),
        ("road", "torsion", "short torsion, long torsion, thick torsion"),
        ("plain", "long radial", "long radial"),
        ("radial", "long", "long radial"),
        ("turn", "thick", "thick torsion"),
    ],
)
def test_a_history_moves_the_bushings_asked_for(shapes, tmp_path, history, direction, places):
    options = ("--direction", direction) if direction else ()
    done = typing(shapes)("respond", "model", f"{history}.csv", *options, "-o", tmp_path / "x", "--no-plots", "--json")
    assert list(json.loads(done.stdout)["directions"]) == places.split(", ")


@pytest.mark.parametrize(
    ("history", "options", "problem"),
    [
        ("plain", ("--direction", "long"), "try: state it: --direction 'long axial'"),
        ("plain", (), "the direction of this displacement is not stated"),
        ("road", ("--direction", "lon"), 'did you mean "long"?'),
    ],
)
def test_a_history_of_no_known_bushing_or_direction_is_refused(shapes, tmp_path, history, options, problem):
    done = typing(shapes)("respond", "model", f"{history}.csv", *options, "-o", tmp_path / "x", status=2)
    assert problem in done.stderr


@pytest.mark.parametrize(
    ("options", "places"),
    [
        (("--direction", "long"), {"long axial", "long radial", "long torsion"}),
        (("--direction", "radial"), {"short radial", "long radial", "thick radial"}),
    ],
)
def test_results_are_compared_for_the_bushings_asked_for(bushfit, shapes, tmp_path, options, places):
    bushfit("compare", shapes / "model", shapes / "model", *options, "-o", tmp_path / "x", "--no-plots")
    assert set(pd.read_csv(tmp_path / "x/differences.csv")["place"]) == places
    done = bushfit("compare", shapes / "model", "model", *options, "-o", tmp_path / "y", status=2)
    problem = "no such direction" if "long" in options else "radial is not the same in all results"
    assert problem in done.stderr


@pytest.mark.parametrize(
    ("options", "files"),
    [
        (("--bushing", "long", "--direction", "long"), {"long axial", "long radial", "long torsion"}),
        (("--bushing", "long", "--direction", "long radial"), {"long radial"}),
        (("--bushing", "long", "--campaign", "mine.toml"), {"long axial", "long radial", "measured"}),
        (("--bushing", "mine.toml", "--campaign", "mine.toml"), {"axial", "radial", "measured"}),
    ],
)
def test_predictions_are_of_the_bushing_asked_for(shapes, tmp_path, options, files):
    """A campaign with a [bushing] is of the fitted bushing with its geometry."""
    done = typing(shapes)("predict", "model", *options, "-o", tmp_path / "x", "--no-plots")
    assert {file.stem for file in (tmp_path / "x").glob("*.csv")} == files
    if "measured" in files:
        assert "expected error" in done.stderr


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        (("--bushing", "long", "--direction", "short"), "expected: one of axial, radial, torsion, long axial, long,"),
        (("--bushing", "long", "--campaign", "CMP"), "cmp_15961.toml: the campaign tests another bushing"),
        (("--campaign", "longer.toml"), "longer.toml: the campaign tests another bushing\n  found: long\n"),
    ],
)
def test_bushings_that_do_not_fit_the_model_are_refused(shapes, root, tmp_path, options, problem):
    stated = [root / "configs/cmp_15961.toml" if option == "CMP" else option for option in options]
    done = typing(shapes)("predict", "model", *stated, "-o", tmp_path / "x", status=2)
    assert problem in done.stderr
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize(
    ("commands", "tables"),
    [("'run'", set()), ("'fit', 'diagnose', 'predict', 'respond'", {"response.csv", "measured.csv"})],
)
def test_a_batch_of_several_bushings_has_their_columns_files_and_limits(shapes, root, tmp_path, commands, tables):
    campaign, history = root / "configs/three_shapes.toml", shapes / "road.csv" if tables else None
    settings = f"commands = [{commands}]\nat = ['long axial 25 Hz 0.1 mm', 'thick torsion 5 Hz 1 deg']\n"
    settings += f"history = '{history}'\n" if history else ""
    (tmp_path / "batch.toml").write_text(f"{settings}[[bushings]]\ncampaign = '{campaign}'\n", encoding="utf-8")
    factor, stiffness = (
        '[parameters."stiffness_factor.long"]\nmax = 1.1',
        'at = "long axial 25 Hz 0.1 mm"\nmax = "1 N/mm"',
    )
    (tmp_path / "limits.toml").write_text(f"{factor}\n[[stiffness]]\n{stiffness}\n", encoding="utf-8")
    batch = ("batch", "batch.toml", "--limits", "limits.toml", "-o", "out", "--jobs", 1)
    done = typing(tmp_path)(*batch, status=1)
    assert "three_shapes fails: stiffness long axial 25 Hz 0.1 mm 1095 N/mm" in " ".join(done.stderr.split())
    (row,) = pd.read_csv(tmp_path / "out/batch.csv").to_dict("records")
    assert row["verdict"] == "consistent"
    assert row["stiffness_factor.long [-]"] == pytest.approx(1.033, abs=0.002)
    predicted = pd.read_csv(tmp_path / "out/bushings/three_shapes/long axial.csv")
    largest = predicted["stiffness [N/mm]"].max()
    assert 0.5 * largest < row["stiffness long axial 25 Hz 0.1 mm [N/mm]"] < largest
    assert row["stiffness thick torsion 5 Hz 1 deg [N m/rad]"] > 10.0
    written = {file.name for file in (tmp_path / "out/bushings/three_shapes").iterdir()}
    axes = {f"{name} {axis}.csv" for name in ("short", "long", "thick") for axis in ("axial", "radial")}
    assert {"model.json", "diagnosis.json", *axes, *tables} <= written


@pytest.mark.parametrize(
    ("at", "problem"),
    [
        (
            "axial 25 Hz 0.1 mm",
            'this operating point is of several places; found: axial 25 Hz 0.1 mm; expected: "short',
        ),
        ("lung axial 25 Hz 0.1 mm", "no such direction or specimen; found: lung axial"),
    ],
)
def test_an_operating_point_is_of_one_bushing(root, tmp_path, at, problem):
    batch = ("batch", root / "configs/three_shapes.toml", "--at", at, "-o", "out", "--jobs", 1)
    done = typing(tmp_path)(*batch, status=1)
    assert problem in " ".join(done.stderr.split())


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('bushing = "long"\n', "", "long.csv: a test of no bushing of the campaign"),
        ('bushing = "long"\n', 'bushing = "lang"\n', "found: lang"),
        ('"thick"', '"long axial"', "two bodies have one name"),
    ],
)
def test_a_test_of_another_name_is_refused(root, tmp_path, old, new, problem):
    text = (root / "configs/three_shapes.toml").read_text(encoding="utf-8").replace("../data", f"{root}/data")
    (tmp_path / "c.toml").write_text(text.partition("[simulate]")[0].replace(old, new), encoding="utf-8")
    assert problem in typing(tmp_path)("fit", "c.toml", "-o", "x", status=2).stderr


def test_the_axial_formula_of_an_untested_bushing_is_that_of_a_tested_one(shapes, root, tmp_path):
    run = typing(tmp_path)
    run("fit", root / "configs/three_shapes.toml", "--direction", "short", "-o", "m", "--no-plots")
    done = run("predict", "m", "--bushing", "long", "--direction", "axial", "-o", "x", "--no-plots", "-v")
    assert "formula" not in done.stderr


def test_files_of_bushings_differ_where_a_system_ignores_case():
    names = place_names([Specimen("Long", "modulus"), Specimen("long", "modulus")])
    assert names[0].casefold() != names[1].casefold()


@pytest.mark.parametrize("option", ["--adopt", "--without"])
def test_a_diagnosis_knows_the_places_of_its_effects(root, tmp_path, option):
    campaign = root / "configs/three_shapes.toml"
    done = typing(tmp_path)("diagnose", campaign, option, "stiffness_factor.lung", "-o", "x", status=2)
    assert "no such direction or specimen" in done.stderr
