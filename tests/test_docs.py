"""Stale documentation fails: commands, keys, effects, the map of the code, kept data; and what is built is whole."""

import ast
import json
import os
import re
import shlex
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, get_args, get_type_hints

import click
import pytest
import yaml
from effect_tables import PAGE, renewed
from pydantic import TypeAdapter

from bushfit.batch.limits import Limits
from bushfit.batch.manifest import ManifestFile
from bushfit.campaign.schema import CampaignFile
from bushfit.cli import cli
from bushfit.geometry import Specimen


def blocks(page: Path, language: str) -> list[str]:
    """The fenced blocks of a page that are in that language."""
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def test_effects_and_commands_are_in_the_tables_of_their_pages(root):
    page = PAGE.read_text(encoding="utf-8")
    assert renewed(page) == page, "run: python tests/effect_tables.py"
    commands = (root / "bushfit/manual/commands.md").read_text(encoding="utf-8")
    examples = commands + (root / "README.md").read_text(encoding="utf-8")
    names = cli.list_commands(click.Context(cli))
    assert [name for name in names if f"| `bushfit {name} " not in commands] == []
    assert [name for name in names if not re.search(rf"^\$ bushfit {name} ", examples, re.MULTILINE)] == []


def keys(table: type) -> set[str]:
    """Names of all keys below a table of the campaign file."""
    found = set()
    for name, hint in get_type_hints(table).items():
        if name in {field.name for field in fields(table)}:
            found |= {name}.union(*(keys(part) for part in dataclasses_in(hint)))
    return found


def dataclasses_in(hint: Any) -> list[type]:
    if is_dataclass(hint) and isinstance(hint, type):
        return [] if hint is Specimen else [hint]  # a test names its specimen
    return [part for argument in get_args(hint) for part in dataclasses_in(argument)]


def keys_written(table: Any) -> set[str]:
    if isinstance(table, dict):
        return set(table).union(*(keys_written(value) for value in table.values()))
    return set().union(*(keys_written(entry) for entry in table)) if isinstance(table, list) else set()


def test_the_campaign_reference_is_valid_and_has_every_key(root):
    """The page itself, and its comment with the tables in place of [bushing]."""
    text = (root / "configs/reference.toml").read_text(encoding="utf-8")
    (instead,) = re.findall(r"^# \[\[bushings\]\].*?(?=\n\n)", text, re.MULTILINE | re.DOTALL)
    written = set[str]()
    for page in (text, re.sub("^# ", "", instead, flags=re.MULTILINE)):
        reference = tomllib.loads(page)
        TypeAdapter(CampaignFile).validate_python(reference)
        written |= keys_written(reference)
    # [fit.mu] and the like stand for parameters; a size is a radius or a diameter; an operating point is a text
    assert keys(CampaignFile) - written <= {"parameters", "inner_diameter", "outer_diameter", "place", "unit"}


def test_manifest_and_limits_are_valid_and_have_every_key(root):
    page = root / "bushfit/manual/batch.md"
    manifest, limits = (tomllib.loads(block) for block in blocks(page, "toml"))
    for schema, block in ((ManifestFile, manifest), (Limits, limits)):
        TypeAdapter(schema).validate_python(block)
        text = page.read_text(encoding="utf-8")
        assert [key for key in keys(schema) if not re.search(rf"\b{key}\b", text)] == []


def test_recipes_for_ci_are_valid_and_run_what_there_is(root):
    github, gitlab = (yaml.safe_load(block) for block in blocks(root / "bushfit/manual/batch.md", "yaml"))
    steps = [step["run"] for step in github["jobs"]["fit"]["steps"] if "run" in step]
    above = click.Context(cli, **cli.context_settings)
    batch = cli.get_command(above, "batch")
    for script in (steps, gitlab["bushings"]["script"]):
        (line,) = (line for line in script if line.startswith("bushfit "))
        _, name, *arguments = shlex.split(line)
        assert name == "batch"
        batch.make_context("batch", arguments, parent=above)


def test_the_map_of_the_code_is_the_code(root):
    """Every module and folder of the package, in the order in which they may import."""
    (tree,) = (block for block in blocks(root / "bushfit/README.md", "text") if block.startswith("bushfit/\n"))
    shown = re.findall(r"^  (\w+(?:/|\.py)) +\S", tree, re.MULTILINE)
    settings = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))
    layers = settings["tool"]["importlinter"]["contracts"][0]["layers"]
    assert [entry.rstrip("/").removesuffix(".py") for entry in shown] == re.split(" [|:] ", " | ".join(layers))
    assert [entry for entry in shown if not (root / "bushfit" / entry).exists()] == []


def test_the_page_of_each_folder_has_its_files_in_their_own_words(root):
    """Each file once, with the first sentence of its docstring; the effects are a file each, named after them."""
    folders = [folder for folder in (root / "bushfit").iterdir() if (folder / "__init__.py").exists()]
    assert len(folders) > 10
    for folder in folders:
        text = (folder / "README.md").read_text(encoding="utf-8")
        assert len(text.splitlines()) <= 40, folder
        rows = re.findall(r"^- `(\w+)\.py`: (.+)$", text, re.MULTILINE)
        modules = {file.stem: file for file in folder.glob("*.py") if file.stem != "__init__"}
        if folder.name == "effects":
            modules = {name: file for name, file in modules.items() if name in dict(rows)}
        said = {name: ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) for name, file in modules.items()}
        assert dict(rows) == {name: " ".join((words or "").split("\n\n")[0].split()) for name, words in said.items()}


@pytest.fixture(scope="module")
def wheel(root, tmp_path_factory) -> Path:
    """The wheel, built where the builder is installed."""
    builder = pytest.importorskip("hatchling.builders.wheel").WheelBuilder(str(root))
    return Path(next(builder.build(directory=str(tmp_path_factory.mktemp("wheel")), versions=["standard"])))


def test_measured_rubber_has_a_licence_of_its_own_and_nothing_built_holds_it(root, wheel, tmp_path):
    folders = [folder for folder in (root / "data/measured").iterdir() if folder.is_dir()]
    assert folders
    for folder in folders:
        assert "LICENSE" in {file.name for file in folder.iterdir()}
        assert "https://" in (folder / "README.md").read_text(encoding="utf-8")
    targets = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["hatch"]["build"]["targets"]
    assert targets["wheel"]["packages"] == ["bushfit"]
    assert "/data/measured" in targets["sdist"]["exclude"]
    sdist = pytest.importorskip("hatchling.builders.sdist").SdistBuilder(str(root))
    archive = next(sdist.build(directory=str(tmp_path), versions=["standard"]))
    with tarfile.open(archive) as opened:
        names = opened.getnames()
    names += zipfile.ZipFile(wheel).namelist()
    assert any(name.endswith("data/reference/README.md") for name in names)
    assert [name for name in names if "measured" in Path(name).parts] == []


def test_the_wheel_is_for_every_machine_and_holds_every_file_of_the_package(root, wheel):
    """Words and units, the marker that it carries types, pages, sources in other languages."""
    assert wheel.name.endswith("-py3-none-any.whl")
    package = root / "bushfit"
    files = {file.relative_to(root).as_posix() for file in package.rglob("*") if file.is_file()}
    files = {file for file in files if "__pycache__" not in file}
    assert {"bushfit/py.typed", "bushfit/units.txt", "bushfit/manual/python.md"} <= files
    assert {"bushfit/reading/words.toml", "bushfit/effects/library.toml"} <= files
    held = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert held == files


@pytest.mark.slow
def test_the_wheel_works_elsewhere(wheel, tmp_path):
    """Unpacked into another folder, with nothing of the repository."""
    zipfile.ZipFile(wheel).extractall(tmp_path / "site")
    code = "import bushfit, sys\nfrom bushfit.cli import main\nprint(bushfit.__file__, file=sys.stderr)\nmain()"
    for arguments in (["example"], ["run", "bushfit-example/campaign.toml", "-o", "results", "--json"]):
        done = subprocess.run(
            [sys.executable, "-W", "error", "-c", code, *arguments],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(tmp_path / "site")},
            capture_output=True,
            text=True,
            check=False,
            encoding="utf-8",
        )
        assert done.returncode == 0, done.stderr
        assert done.stderr.startswith(str(tmp_path / "site"))
    assert json.loads(done.stdout)["diagnosis"]["verdict"] == "consistent"
    assert (tmp_path / "results/axial.png").exists()


def test_the_citation_names_the_paper_and_the_version(root):
    citation = yaml.safe_load((root / "CITATION.cff").read_text(encoding="utf-8"))
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert (citation["version"], citation["license"]) == (project["version"], project["license"])
    assert citation["references"][0]["doi"] in (root / "README.md").read_text(encoding="utf-8")
