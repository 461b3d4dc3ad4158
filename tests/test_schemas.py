"""The JSON Schemas: what the commands write validates by a program that is not ours, and what is spoiled does not."""

import json
import shutil
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from commandline import typing
from jsonschema import Draft202012Validator

from bushfit.commands.schema import DESCRIBED, schema

Documents = dict[str, list[Any]]
INPUTS = ("campaign", "manifest", "limits")
OUTPUTS = tuple(name for name in DESCRIBED if name not in INPUTS)


def closed(node: Any) -> Any:
    """A schema in which every table has the keys that are described and no others: what is written has no others."""
    if isinstance(node, Mapping):
        ends = {"additionalProperties": False} if "properties" in node and "additionalProperties" not in node else {}
        return {key: closed(value) for key, value in node.items()} | ends
    return [closed(each) for each in node] if isinstance(node, list) else node


def complaints(name: str, document: Any, *, whole: bool = False) -> list[str]:
    """What jsonschema finds wrong with a document; with `whole`, keys that are not described too."""
    described = closed(schema(name)) if whole else schema(name)
    return [f"{error.json_path}: {error.message}" for error in Draft202012Validator(described).iter_errors(document)]


def written(root: Path, folder: Path) -> Documents:
    """Documents that commands wrote or printed in a folder, by the schema that describes them."""
    for name in ("configs", "data"):
        shutil.copytree(root / name, folder / name)
    found: Documents = {name: [] for name in DESCRIBED}

    def run(printed: str, *arguments: str, status: int = 0) -> None:
        done = typing(folder)(*arguments, "--json", "-q", "--no-plots", status=status)
        found[printed].append(json.loads(done.stdout))

    def read(name: str, pattern: str) -> None:
        files = sorted(folder.glob(pattern))
        assert files, pattern
        found[name] += [json.loads(file.read_text(encoding="utf-8")) for file in files]

    run("run", "run", "data/practice/case_001/bushing.toml", "-o", "run")
    run("model", "fit", "configs/cmp_15961.toml", "--profile", "--loss", "soft_l1", "-o", "profile")
    run("model", "fit", "configs/epdm_70.toml", "--direction", "DMA", "-o", "specimens")
    own = ("--campaign", "data/practice/case_001/bushing.toml")
    run("prediction", "predict", "run/model.json", *own, "-o", "predicted")
    shaken = ("--mass", "1 kg", "--base-acceleration", "0.1 g", "--direction", "mount")
    run("prediction", "predict", "specimens/model.json", *shaken, "-o", "shaken")
    run("plan", "plan", own[1], "--rivals", "inertia,delay", "--hours", "1", "-o", "plan")
    run("comparison", "compare", "run", "configs/arm_bushing.toml", "-o", "compared")
    run("comparison", "compare", "configs/cmp_15961.toml", "-o", "families", "--families", "sliders")
    (folder / "broken.toml").write_text("[bushing]\n")
    batch = ("batch", "configs/cmp_15961.toml", "data/practice/case_001/bushing.toml", "broken.toml")
    asked = ("--command", "fit", "--command", "diagnose", "--at", "axial 25 Hz 0.1 mm", "--jobs", "1")
    run("batch", *batch, *asked, "--limits", "configs/limits.toml", "-o", "batch", status=1)
    run("simulation", "simulate", "run/model.json", "-o", "simulated")
    run("export", "export", "run/model.json", "--format", "nastran", "--format", "xlsx", "-o", "exported")
    run("response", "respond", "data/arm_bushing/truth.json", "data/road/axial_radial.csv", "-o", "response")
    loop, sweep = ("data/cmp_15961/loop_axial_1.csv", "data/cmp_15961/sweep_axial.csv")
    run("inspection", "inspect", loop, sweep)
    run("reduction", "reduce", "data/cmp_15961_raw/stepped_sine_axial.csv", "-o", "reduced")
    mass = ("--mass", "1.196 kg", "--specimen", "mount")
    run("reduction", "reduce", "data/measured/epdm_70/shaker_1g_1196g.csv", *mass, "-o", "shaken_mass")
    sizes = ("--inner-radius", "10 mm", "--outer-radius", "18 mm", "--length", "34 mm")
    run("inspection", "init", loop, sweep, *sizes, "-o", "begun")
    for names in ("model", "static", "dynamic", "joint", "truth"):
        read("model", f"*/{names}.json")
    read("diagnosis", "**/diagnosis.json")
    read("batch", "batch/batch.json")
    read("row", "batch/bushings/*/row.json")
    known = {"compare", "plan", *(name for name in DESCRIBED), "static", "dynamic", "joint", "truth"}
    strange = [file for file in folder.glob("*/**/[!.]*.json") if file.stem not in known]
    assert [file for file in strange if "data" not in file.parts] == [], "a file that no schema describes"
    return found


def keys_without_a_word(node: Any, place: str) -> Iterator[str]:
    """Places of keys that a schema lists and says nothing of."""
    if isinstance(node, Mapping):
        for key, value in node.get("properties", {}).items():
            if "description" not in value and "description" not in str(value.get("anyOf")) and "$ref" not in value:
                yield f"{place}.{key}"
        for key, value in node.items():
            yield from keys_without_a_word(value, f"{place}.{key}")


@pytest.mark.parametrize("name", DESCRIBED)
def test_a_schema_is_valid_and_says_what_every_key_holds(name):
    made = schema(name)
    Draft202012Validator.check_schema(made)
    assert made["$id"] == f"urn:bushfit:schema:{name}"
    assert made["title"].startswith(f"bushfit {name}: ")
    assert [*keys_without_a_word(made, name)] == []


@pytest.mark.slow
def test_what_is_written_has_the_keys_that_are_described_and_no_others(root, tmp_path):
    """Of every kind, so that keys which are there now and then have been seen."""
    found = written(root, tmp_path)
    wrong = [(name, said) for name in OUTPUTS for each in found[name] for said in complaints(name, each, whole=True)]
    assert wrong == []
    assert [name for name in OUTPUTS if not found[name]] == []
    assert {document["schema"] for document in found["model"]} == {"bushfit/model/1"}
    assert {document["status"] for document in found["row"]} == {"done", "failed"}
    assert {"consistent", "named"} <= {document["verdict"] for document in found["diagnosis"]}
    assert any("profile95" in entry for document in found["model"] for entry in document["parameters"].values())
    assert any(document["failed"] for document in found["batch"])
    assert any("joint" in document for document in found["run"])


def described_by(file: Path) -> str:
    """The schema of a TOML file of the repository."""
    return file.stem if file.stem == "limits" else "manifest" if file.stem == "batch" else "campaign"


def test_every_model_and_campaign_of_the_repository_validates(root):
    truths = sorted((root / "data").glob("**/truth.json"))
    tables = [file for top in ("configs", "data") for file in sorted((root / top).glob("**/*.toml"))]
    tables.remove(root / "data/example_effect/pyproject.toml")
    assert len(truths) > 1
    assert len(tables) > 20
    for file in truths:
        assert complaints("model", json.loads(file.read_text(encoding="utf-8"))) == [], file
    for file in tables:
        assert complaints(described_by(file), tomllib.loads(file.read_text(encoding="utf-8"))) == [], file


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ('inner_radius = "10 mm"', "inner_radius = 10"), ('inner_radius = "10 mm"', 'inner_radios = "10 mm"'),
        ('columns = { force = "Kraft" }', 'columns = { forces = "Kraft" }'), ("vary = true", 'vary = "yes"'),
        ('delimiter = "semicolon"', 'delimiter = ";"'), ('step = "10 Hz" }', 'steps = "10 Hz" }'),
        ("seed = 1 ", "seed = 1.5 "), ('specimen = "DMA"', "specimen = 1"),
    ],
)  # fmt: skip
def test_what_is_mistyped_in_a_campaign_is_refused(root, right, wrong):
    text = (root / "configs/reference.toml").read_text(encoding="utf-8")
    assert right in text
    assert complaints("campaign", tomllib.loads(text.replace(right, wrong, 1)))


def test_printed_and_written_are_the_same(typed, tmp_path):
    printed = typed("schema", "diagnosis", "-q")
    assert printed.stderr == ""
    assert json.loads(printed.stdout) == schema("diagnosis")
    typed("schema", "-o", "all")
    files = {file.name.removesuffix(".schema.json"): file for file in (tmp_path / "all").glob("[!.]*")}
    assert set(files) == set(DESCRIBED)
    assert files["diagnosis"].read_text(encoding="utf-8") == printed.stdout
    listed = typed("schema", "--json", "-q")
    assert json.loads(listed.stdout) == {name: described.files for name, described in DESCRIBED.items()}
    wrong = typed("schema", "diagnoses", status=2)
    assert wrong.stdout == ""
    assert 'did you mean "diagnosis"' in wrong.stderr
