"""Manifests of every kind, the names they give, and one error for what they may not say."""

from __future__ import annotations

import csv
import io
import tracemalloc
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bushfit.batch.manifest import Manifest, Settings, read_manifest
from bushfit.batch.quantities import parse_point
from bushfit.errors import BushfitError
from bushfit.geometry import Direction


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


def test_a_setting_at_the_top_may_be_for_some_of_the_rows(tmp_path: Path) -> None:
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
BAD = [
    ("m.toml", ROW + 'nme = "x"', ["bushings #1.nme", "unknown key", 'mean "name"']),
    ("m.toml", ROW + 'commands = ["fitt"]', ["bushings #1.commands #1", "'fit'"]),
    ("m.toml", ROW + "commands = []", ["bushings #1.commands", "at least one"]),
    ("m.toml", ROW + 'commands = ["predict"]', ["predict has no model", '"fit", "predict"']),
    ("m.toml", ROW + 'tolerance = "2 %"', ["tolerance", "does nothing here", "commands fit", "goes with diagnose"]),
    ("m.toml", ROW + 'commands = ["diagnose"]\neffects = ["inertia"]', ["effects", "does nothing", "--command fit"]),
    ("m.toml", ROW + 'commands = ["fit", "predict"]\nmodel = "m.json"', ["model", "does nothing", "fit, predict"]),
    ("m.toml", "max_effects = 1\n" + ROW, ["max_effects", "does nothing", "commands fit"]),
    (
        "m.csv",
        "campaign,directions,commands\na.toml,axial,fit\nb.toml,axial,diagnose",
        ["b.toml", "directions", "commands diag"],
    ),
    ("m.toml", ROW + 'commands = ["run", "fit"]', ["commands", "run is the whole chain", "found: run, fit"]),
    (
        "m.toml",
        ROW + 'commands = ["run"]\neffects = ["inertia"]',
        ["effects", "nothing", "try: leave effects out"],
    ),
    ("m.toml", ROW + 'effects = ["inertai"]', ["bushings #1.effects #1", 'did you mean "inertia"?']),
    ("m.toml", 'at = ["axial 25 Hz"]\n' + ROW, ["at", "no operating point", "axial 25 Hz"]),
    ("m.toml", '[[bushings]]\ncampaign = "no/*.toml"', ["the pattern matches no file", "no/*.toml"]),
    ("m.csv", "campaing\na.toml", ["header", "unknown key", 'mean "campaign"']),
    ("m.csv", "campaign,commands\na.toml,fit\nb.toml,fitt", ["line 3", "commands #1"]),
    ("m.csv", "\n\n \ncampaign\na.toml,b.toml", ["line 5", "more cells"]),
    ("m.csv", "name\nx", ["line 2", "a key is missing", "campaign"]),
    ("m.csv", "campaign,name\n", ["no rows"]),
]


@pytest.mark.parametrize(("name", "text", "words"), BAD, ids=lambda value: None if isinstance(value, list) else value)
def test_bad_manifests_have_one_clear_error(tmp_path: Path, name: str, text: str, words: list[str]) -> None:
    with pytest.raises(BushfitError) as caught:
        read(tmp_path, text, name)
    message = str(caught.value)
    assert all(word in message for word in (name, *words)), message


@pytest.mark.slow
def test_a_manifest_of_many_rows_is_read_once_and_small(tmp_path: Path) -> None:
    count = 20_000
    text = "campaign,name\n" + "".join(f"bushings/{n:05}/campaign.toml,bushing {n}\n" for n in range(count))
    source = written(tmp_path, text, "many.csv")
    tracemalloc.start()
    rows = read_manifest(source, Settings()).rows
    held, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    print(f"{held / count:.0f} bytes a row")
    assert len({id(row.settings) for row in rows}) == 1
    assert held / count < 1000
