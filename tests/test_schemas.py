"""The JSON Schemas: what the commands write validates by a program that is not ours, and what is spoiled does not."""

import json
import tomllib
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from bushfit.commands.schema import DESCRIBED, schema


def closed(node: Any) -> Any:
    """A schema in which every table has the keys that are described and no others: what is written has no others."""
    if isinstance(node, Mapping):
        ends = {"additionalProperties": False} if "properties" in node and "additionalProperties" not in node else {}
        return {key: closed(value) for key, value in node.items()} | ends
    return [closed(each) for each in node] if isinstance(node, list) else node


@cache
def validator(name: str, *, whole: bool) -> Draft202012Validator:
    """Validator of a schema; with `whole`, of one without further keys."""
    return Draft202012Validator(closed(schema(name)) if whole else schema(name))


def complaints(name: str, document: Any, *, whole: bool = False) -> list[str]:
    """What jsonschema finds wrong with a document; with `whole`, keys that are not described too."""
    return [f"{error.json_path}: {error.message}" for error in validator(name, whole=whole).iter_errors(document)]


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
