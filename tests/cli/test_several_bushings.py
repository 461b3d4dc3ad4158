"""Several bushings of one compound, ties and priors as typed: names of bodies, directions, units and bounds."""

import json
import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commandline import typing
from shell import refused

N = 200
TIME = np.arange(N) / 200.0
MOTION = 0.2 * np.sin(2.0 * np.pi * 5.0 * TIME)
SIZES = 'inner_radius = "10 mm"\nouter_radius = "18 mm"\nlength = "50 mm"\n'
LONG = 'fit."stiffness_factor.front left"'


@pytest.fixture(scope="module")
def shapes(root, work, tmp_path_factory) -> Path:
    """A folder with the fit of three shapes under `model`, of the paper's bushing, and displacement histories."""
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
    shutil.copytree(work / "model", folder / "paper")
    for name, campaign in (("paper", "cmp_15961"), ("longer", "three_shapes")):
        text = (root / f"configs/{campaign}.toml").read_text(encoding="utf-8").replace("../data", f"{root}/data")
        (folder / f"{name}.toml").write_text(text.replace('"50 mm"', '"60 mm"'), encoding="utf-8")
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
    ("command", "problem"),
    [
        ("respond model plain.csv --direction long", "try: state it: --direction 'long axial'"),
        ("respond model plain.csv", "the direction of this displacement is not stated"),
        ("respond model road.csv --direction lon", 'did you mean "long"?'),
        ("compare model paper --direction long", "no such direction"),
        ("compare model paper --direction radial", "radial is not the same in all results"),
        ("predict model --bushing long --direction short", "one of axial, radial, torsion, long axial, long,"),
        ("predict model --bushing long --campaign paper.toml", "paper.toml: the campaign tests another bushing"),
        ("predict model --campaign longer.toml", "longer.toml: the campaign tests another bushing\n  found: long\n"),
        ("diagnose longer.toml --adopt stiffness_factor.lung", "no such direction or specimen"),
        ("diagnose longer.toml --without stiffness_factor.lung", "no such direction or specimen"),
    ],
)
def test_a_bushing_or_direction_that_is_not_there_is_one_error(shapes, tmp_path, command, problem):
    done = typing(shapes)(*shlex.split(command), "-o", tmp_path / "x", status=2)
    refused(done, tmp_path / "x", problem)


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
        assert "expected error" in done.text
    assert ("; no bushing of this shape was tested" in done.text) is (options[1] == "mine.toml")


@pytest.mark.parametrize(
    ("at", "problem"),
    [
        ("axial 25 Hz 0.1 mm", 'several places fit this operating point; found: axial 25 Hz 0.1 mm; expected: "short'),
        ("lung axial 25 Hz 0.1 mm", "no such direction or specimen; found: lung axial"),
    ],
)
def test_an_operating_point_is_of_one_bushing(root, tmp_path, at, problem):
    batch = ("batch", root / "configs/three_shapes.toml", "--at", at, "-o", "out", "--jobs", 1)
    assert problem in " ".join(typing(tmp_path)(*batch, status=1).text.split())


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('bushing = "long"\n', "", "long.csv: the test names no bushing of the campaign"),
        ('bushing = "long"\n', 'bushing = "lang"\n', "found: lang"),
        ('"thick"', '"long axial"', "two bodies have one name"),
    ],
)
def test_a_test_of_another_name_is_refused(root, tmp_path, old, new, problem):
    text = (root / "configs/three_shapes.toml").read_text(encoding="utf-8").replace("../data", f"{root}/data")
    (tmp_path / "c.toml").write_text(text.partition("[simulate]")[0].replace(old, new), encoding="utf-8")
    assert problem in typing(tmp_path)("fit", "c.toml", "-o", "x", status=2).stderr


def test_the_axial_formula_of_an_untested_bushing_is_that_of_a_tested_one(root, tmp_path):
    run = typing(tmp_path)
    run("fit", root / "configs/three_shapes.toml", "--direction", "short", "-o", "m", "--no-plots")
    done = run("predict", "m", "--bushing", "long", "--direction", "axial", "-o", "x", "--no-plots", "-v")
    assert "formula" not in done.stderr


def written(root: Path, folder: Path, name: str, tables: str) -> Path:
    """A campaign of the package without its ties, priors and simulation, with further tables; bodies have odd names."""
    text = (root / f"configs/{name}.toml").read_text(encoding="utf-8").replace("../data", f"{root}/data")
    text = re.split(r"^\[(?:fit|simulate)", text, flags=re.MULTILINE)[0]
    text = text.replace('"long"', '"front left"').replace('"thick"', '"x-1"').replace('"short"', '"x"')
    (folder / "campaign.toml").write_text(f"{text}\n{tables}", encoding="utf-8")
    return folder / "campaign.toml"


@pytest.mark.parametrize(
    ("name", "tie", "problem"),
    [
        ("cmp_15961_prior", '[fit.m]\nequal = "0.18 * mu"', 'try: expression = "..." takes the value of an expression'),
        ("cmp_15961_prior", '[fit.m]\nequal = "mu"', "parameters of different units cannot be equal"),
        ("cmp_15961_prior", '[fit.alpha]\nexpression = "mu"', "impossible value\n  found: mu = 1."),
        ("cmp_15961_prior", '[fit.m]\nexpression = "log(alpha - 1)"', "this expression has no value"),
        ("three_shapes", f'[{LONG}]\nequal = "stiffness_factor.y z"', "no such direction or specimen"),
        ("three_shapes", f'[{LONG}]\nexpression = "stiffness_factor.y"', "no such direction or specimen"),
        ("cmp_15961_prior", '[fit.alpha]\nexpression = "mu ^ 0.8"', "try: write ** for a power"),
        ("cmp_15961_prior", '[fit.alpha]\nexpression = "0.2 MPa"', "expressions have values in SI units, without the"),
        ("cmp_15961_prior", '[fit.alpha]\nprior = "0.2 +- 3 %"', "this is not a prior"),
    ],
)
def test_an_impossible_tie_is_one_error_with_file_and_parameter(bushfit, root, tmp_path, name, tie, problem):
    campaign = written(root, tmp_path, name, tie)
    done = bushfit("fit", campaign, "-o", tmp_path / "x", status=2)
    assert re.search(rf"^bushfit: error: {re.escape(str(campaign))}, fit\.\w+(\.front left)?: ", done.stderr)
    assert problem in done.stderr
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize(
    ("command", "tie", "said"),
    [
        ("fit", '[fit.m]\nexpression = "1e6 * inertia.mass"', "is not used: the model lacks inertia.mass"),
        ("fit", '[fit."inertia.mass"]\nexpression = "1e-8 * mu"', "is not used: the model lacks inertia.mass"),
        ("fit-static", '[fit.m]\nexpression = "0.18 * mu"', "is not used: the model lacks m"),
        ("fit", '[fit.alpha]\nexpression = "0.24"', "alpha (tied) 0.2400 fixed -"),
    ],
)
def test_a_tie_that_is_not_used_or_constant_is_reported(bushfit, root, tmp_path, command, tie, said):
    campaign = written(root, tmp_path, "cmp_15961_prior", tie)
    done = bushfit(command, campaign, "-o", tmp_path / "x", "--no-plots", "-v")
    assert any(" ".join(line.split()).endswith(said) for line in done.text.splitlines())
