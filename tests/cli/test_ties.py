"""Ties and priors as typed: names of bodies, units, bounds, models without a parameter, and the spread of factors."""

import re
from pathlib import Path

import pandas as pd
import pytest
from shell import document

LONG = 'fit."stiffness_factor.front left"'


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
        ("cmp_15961_prior", '[fit.m]\nequal = "mu"', "parameters of different units are not equal"),
        ("cmp_15961_prior", '[fit.alpha]\nexpression = "mu"', "impossible value\n  found: mu = 1."),
        ("cmp_15961_prior", '[fit.m]\nexpression = "log(alpha - 1)"', "this expression has no value"),
        ("three_shapes", f'[{LONG}]\nequal = "stiffness_factor.y z"', "no such direction or specimen"),
        ("three_shapes", f'[{LONG}]\nexpression = "stiffness_factor.y"', "no such direction or specimen"),
    ],
)
def test_an_impossible_tie_is_one_error_with_file_and_parameter(bushfit, root, tmp_path, name, tie, problem):
    campaign = written(root, tmp_path, name, tie)
    done = bushfit("fit", campaign, "-o", tmp_path / "x", status=2)
    assert re.search(rf"^bushfit: error: {re.escape(str(campaign))}, fit\.\w+(\.front left)?: ", done.stderr)
    assert problem in done.stderr
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize(
    "tie", ['equal = "stiffness_factor.x-1"', 'expression = "2 * stiffness_factor.x-1-stiffness_factor.x-1"']
)
def test_bodies_of_any_name_stand_in_a_tie(bushfit, root, tmp_path, tie):
    bushfit("fit", written(root, tmp_path, "three_shapes", f"[{LONG}]\n{tie}"), "-o", tmp_path / "x", "--no-plots")
    parameters = document(tmp_path / "x/model.json")["parameters"]
    assert parameters["stiffness_factor.front left"]["value"] == parameters["stiffness_factor.x-1"]["value"]


@pytest.mark.parametrize(
    ("command", "tie", "lacking"),
    [
        ("fit", '[fit.m]\nexpression = "1e6 * inertia.mass"', "inertia.mass"),
        ("fit", '[fit."inertia.mass"]\nexpression = "1e-8 * mu"', "inertia.mass"),
        ("fit-static", '[fit.m]\nexpression = "0.18 * mu"', "m"),
    ],
)
def test_a_tie_that_is_not_used_is_reported(bushfit, root, tmp_path, command, tie, lacking):
    campaign = written(root, tmp_path, "cmp_15961_prior", tie)
    done = bushfit(command, campaign, "-o", tmp_path / "x", "--no-plots", "-v")
    assert re.search(rf"is not used: the model lacks {lacking}\n", done.stderr)


@pytest.mark.parametrize("prior", [".24 +- .003", "+0.24 ± 3e-3", "24 % +/- 0.3 %"])
def test_numbers_of_a_prior_are_written_in_any_way(bushfit, root, tmp_path, prior):
    campaign = written(root, tmp_path, "cmp_15961_prior", f'[fit.alpha]\nprior = "{prior}"')
    bushfit("fit", campaign, "-o", tmp_path / "x", "--no-plots")
    stated = document(tmp_path / "x/model.json")["parameters"]["alpha"]["prior"]
    assert (stated["source"], stated["mean"]) == (prior, 0.24)
    assert stated["deviation"] == pytest.approx(0.003)


@pytest.mark.parametrize(("keys", "spread"), [('prior = "1 +- 0.08"', 0.08), ("max = 1.2", 0.03)])
def test_the_spread_of_a_new_bushing_is_that_of_the_priors(bushfit, root, tmp_path, keys, spread):
    """A limit alone leaves the prior of a free factor as it is."""
    tables = "\n".join(f'[fit."stiffness_factor.{name}"]\n{keys}' for name in ("x", "front left", "x-1"))
    bushfit("fit", written(root, tmp_path, "three_shapes", tables), "-o", tmp_path / "m", "--no-plots")
    new = ("--bushing", root / "configs/new_bushing.toml", "--direction", "axial")
    done = bushfit("predict", tmp_path / "m", *new, "-o", tmp_path / "x", "--no-plots", "-v")
    assert f"the bands include {100 * spread:g} % of stiffness" in " ".join(done.stderr.split())
    table = pd.read_csv(tmp_path / "x/axial.csv")
    half = table["stiffness [N/mm], high"] / table["stiffness [N/mm]"] - 1.0
    assert half.min() == pytest.approx(1.96 * spread * (1.0 + 1.0 / 3.0) ** 0.5, rel=0.15)


def test_a_tie_and_a_prior_of_a_branch_end_where_a_search_replaces_it(bushfit, root, tmp_path):
    tables = '[fit.sigma_fmax]\nexpression = "0.014 * mu"\n[fit.eps_half]\nprior = "0.013 +- 0.001"'
    campaign = written(root, tmp_path, "cmp_15961_prior", tables)
    bushfit("diagnose", campaign, "-o", tmp_path / "x", "--no-plots")
    assert document(tmp_path / "x/diagnosis.json")["verdict"] == "consistent"


def test_a_profile_contains_errors_that_the_weights_do_not(bushfit, root, tmp_path):
    """A tie determines alpha far better than the gain of the loop, which is assumed, allows."""
    campaign = written(root, tmp_path, "cmp_15961_prior", '[fit.m]\nexpression = "0.18 * mu"')
    bushfit("fit", campaign, "--profile", "-o", tmp_path / "x", "--no-plots")
    alpha = document(tmp_path / "x/model.json")["parameters"]["alpha"]
    assert alpha["profile95"] == pytest.approx(alpha["ci95"], rel=0.01)


@pytest.mark.parametrize(
    ("key", "problem"),
    [
        ('expression = "mu ^ 0.8"', "try: write ** for a power"),
        ('expression = "0.2 MPa"', "try: expressions have values in SI units, without the units"),
        ('prior = "0.2 +- 3 %"', "this is not a prior"),
        ('prior = "none.json"', "none.json: there is no such file"),
    ],
)
def test_what_is_no_tie_or_prior_has_a_next_step(bushfit, root, tmp_path, key, problem):
    campaign = written(root, tmp_path, "cmp_15961_prior", f"[fit.alpha]\n{key}")
    assert problem in bushfit("fit", campaign, "-o", tmp_path / "x", status=2).stderr
