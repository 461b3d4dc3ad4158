"""`init` of parts in files of their own, of folders in folders, and of names that no campaign can hold."""

import os
import tomllib
from pathlib import Path

import pytest
from shell import CAMPAIGN, GEOMETRY

from bushfit.campaign.campaign import load_campaign


def sweep(root: Path, file: Path, above: str = "") -> None:
    text = (root / "data/cmp_15961/sweep_axial.csv").read_text(encoding="utf-8")
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(above + text, encoding="utf-8")


@pytest.mark.parametrize("name", ["axial_{number}", "{part}_axial", "part {part} axial", "{part}/axial"])
def test_files_of_several_parts_are_campaigns_and_a_manifest(name, typed, root, tmp_path):
    """The number is above the table, in the name of the file, or in that of a folder."""
    parts = [f"P{number:02}" for number in range(1, 11)]
    for number, part in enumerate(parts):
        above = "" if "part" in name else f"Specimen: {part}\n"
        sweep(root, tmp_path / "lab" / f"{name.format(number=number, part=part)}.csv", above)
    done = typed("init", "lab", *GEOMETRY, "-o", "x")
    assert "next: bushfit batch x/batch.toml" in done.stderr
    rows = tomllib.loads((tmp_path / "x/batch.toml").read_text(encoding="utf-8"))["bushings"]
    assert [row["campaign"] for row in rows] == [f"{part}.toml" for part in parts]
    for number, part in enumerate(parts):
        (test,) = load_campaign(tmp_path / f"x/{part}.toml").sweeps
        assert test.source.file.as_posix() == f"../lab/{name.format(number=number, part=part)}.csv"
    typed("init", "lab", *GEOMETRY, "-o", "y", "--specimen-number", "P00")
    assert (tmp_path / "y/campaign.toml").read_text(encoding="utf-8").count("[[sweeps]]") == 10


def test_folders_in_folders_are_searched_and_bad_names_are_left_out(typed, root, tmp_path):
    sweep(root, tmp_path / "lab/monday/sweep_axial.csv")
    sweep(root, tmp_path / "lab/tuesday/deep/sweep_radial.csv")
    (tmp_path / "lab/dangling.csv").symlink_to("nowhere.csv")
    (tmp_path / "lab/axial_\u202e.csv").write_text("x", encoding="utf-8")
    Path(os.fsdecode(os.fsencode(tmp_path / "lab") + b"/axial_\xff.csv")).write_text("x", encoding="utf-8")
    done = typed("init", "lab", *GEOMETRY, "-o", "x.toml")
    campaign = load_campaign(tmp_path / "x.toml")
    assert [str(test.direction) for test in campaign.sweeps] == ["axial", "radial"]
    for words in (r"axial_\u202e.csv: its name", r"axial_\udcff.csv: its name", "dangling.csv: a broken link"):
        assert words in done.stderr


def test_control_characters_of_a_name_are_escaped(typed, root, tmp_path):
    sweep(root, tmp_path / "axial_\u202e\u0085.csv")
    done = typed("inspect", "axial_\u202e\u0085.csv", "--no-plots")
    assert not {"\u202e", "\u0085"} & {*done.stdout, *done.stderr}
    assert tomllib.loads(done.stdout)["sweeps"][0]["file"].endswith("axial_\u202e\u0085.csv")


def test_the_campaign_corrects_the_radial_formula_and_mentions_the_report(typed, root, tmp_path):
    sweep(root, tmp_path / "axial.csv")
    typed("init", "axial.csv", *GEOMETRY, "-o", "x.toml")
    text = (tmp_path / "x.toml").read_text(encoding="utf-8")
    assert load_campaign(tmp_path / "x.toml").bushing.shape == "calibrated"
    assert "# [report]" in text


@pytest.mark.parametrize(
    ("keys", "problem"),
    [
        ('inner_diameter = "20 mm"\nouter_diameter = "36 mm"', None),
        ('inner_diameter = "20 mm"\nouter_radius = "18 mm"', None),
        ('inner_diameter = "20 mm"\ninner_radius = "10 mm"\nouter_radius = "18 mm"', "the inner size"),
        ('inner_diameter = "20 mm"', "the outer size of the rubber is missing"),
    ],
)
def test_a_campaign_has_radii_or_diameters(bushfit, own, keys, problem):
    campaign = own / CAMPAIGN
    text = campaign.read_text(encoding="utf-8")
    campaign.write_text(text.replace('inner_radius = "10 mm"\nouter_radius = "18 mm"', keys), encoding="utf-8")
    if problem:
        done = bushfit("fit", campaign, "-o", own / "x", status=2)
        assert problem in done.stderr
        assert "_diameter" in done.stderr
    else:
        bushing = load_campaign(campaign).bushing
        assert (bushing.inner_radius, bushing.outer_radius) == pytest.approx((0.01, 0.018))


@pytest.mark.parametrize(("key", "words"), [("specimen_number", "of specimens"), ("preload", "under preloads of")])
def test_tests_of_two_specimens_or_preloads_are_not_fitted_in_silence(bushfit, own, key, words):
    campaign = own / CAMPAIGN
    head, loop, *sweeps = campaign.read_text(encoding="utf-8").split("[[")
    stated = [f'{test.rstrip()}\n{key} = "{value}"\n' for test, value in zip(sweeps, ("0 mm", "5 mm"), strict=True)]
    campaign.write_text("[[".join([head, loop, *stated]), encoding="utf-8")
    done = bushfit("fit", campaign, "-o", own / "x", "--no-plots")
    assert f"the tests were made {words} 0 mm (sweep_axial), 5 mm (sweep_radial)" in done.stderr
