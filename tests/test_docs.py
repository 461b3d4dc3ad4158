"""Stale documentation fails: the README's effects, commands and campaign keys, and data it says can be made again."""

from __future__ import annotations

import io
import json
import re
import shlex
import tomllib
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, get_args, get_type_hints

import click
import numpy as np
import pandas as pd
import pytest
import yaml
from pydantic import TypeAdapter

from bushfit.batch.limits import Limits
from bushfit.batch.manifest import ManifestFile
from bushfit.campaign.campaign import load_campaign
from bushfit.campaign.schema import CampaignFile
from bushfit.cli import cli
from bushfit.effects import LIBRARY, Effect, qualified
from bushfit.simulation import model_of, simulate, to_files


@pytest.fixture(scope="module")
def readme(root: Path) -> str:
    return (root / "README.md").read_text(encoding="utf-8")


def row(effect: Effect) -> str:
    """The row of an effect in the README's table."""
    parameters = "; ".join(
        f"`{qualified(effect, p)}` " + ("" if p.unit == "1" else f"[{p.unit}] ") + p.meaning for p in effect.parameters
    )
    return f"| `{effect.name}` | {effect.level} | {effect.sentence} | `{effect.equation}` | {parameters} |"


def test_the_table_of_effects_is_the_library(readme: str) -> None:
    shown = [line for line in readme.splitlines() if re.match(r"\| `\w+` \| (material|component|instrument) \|", line)]
    assert shown == [row(effect) for effect in LIBRARY.values()]


def test_every_command_is_shown(readme: str) -> None:
    names = cli.list_commands(click.Context(cli))
    assert [name for name in names if f"| `bushfit {name} " not in readme] == []
    assert [name for name in names if not re.search(rf"^(\$ )?bushfit {name} ", readme, re.MULTILINE)] == []


def keys(table: type) -> set[str]:
    """Names of all keys below a table of the campaign file."""
    found = set()
    for name, hint in get_type_hints(table).items():
        if name in {field.name for field in fields(table)}:
            found |= {name}.union(*(keys(part) for part in dataclasses_in(hint)))
    return found


def dataclasses_in(hint: Any) -> list[type]:
    if is_dataclass(hint) and isinstance(hint, type):
        return [hint]
    return [part for argument in get_args(hint) for part in dataclasses_in(argument)]


def keys_written(table: Any) -> set[str]:
    if isinstance(table, dict):
        return set(table).union(*(keys_written(value) for value in table.values()))
    return set().union(*(keys_written(entry) for entry in table)) if isinstance(table, list) else set()


def test_the_campaign_reference_is_valid_and_has_every_key(readme: str) -> None:
    blocks = re.findall(r"^```toml\n(.*?)^```", readme, re.MULTILINE | re.DOTALL)
    reference = tomllib.loads(max(blocks, key=len))
    TypeAdapter(CampaignFile).validate_python(reference)
    assert keys(CampaignFile) - keys_written(reference) <= {"parameters"}


def test_manifest_and_limits_are_valid_and_have_every_key(readme: str) -> None:
    blocks = [tomllib.loads(block) for block in re.findall(r"^```toml\n(.*?)^```", readme, re.MULTILINE | re.DOTALL)]
    for schema, mark in ((ManifestFile, "bushings"), (Limits, "parameters")):
        (block,) = (block for block in blocks if mark in block and "bushing" not in block)
        TypeAdapter(schema).validate_python(block)
        assert [key for key in keys(schema) if not re.search(rf"\b{key}\b", readme)] == []


def test_recipes_for_ci_are_valid_and_run_what_there_is(readme: str) -> None:
    recipes = [yaml.safe_load(block) for block in re.findall(r"^```yaml\n(.*?)^```", readme, re.MULTILINE | re.DOTALL)]
    github, gitlab = recipes
    steps = [step["run"] for step in github["jobs"]["fit"]["steps"] if "run" in step]
    batch = cli.get_command(click.Context(cli), "batch")
    assert batch is not None
    for script in (steps, gitlab["bushings"]["script"]):
        (line,) = (line for line in script if line.startswith("bushfit "))
        _, name, *arguments = shlex.split(line)
        assert name == "batch"
        batch.make_context("batch", arguments)


def test_json_keys_of_a_model_are_listed(readme: str, root: Path) -> None:
    document = json.loads((root / "data/arm_bushing/truth.json").read_text(encoding="utf-8"))
    assert [key for key in document if key != "schema" and f"`{key}`" not in readme] == []


def test_the_second_bushing_can_be_made_again(root: Path) -> None:
    campaign = load_campaign(root / "configs/simulate_arm_bushing.toml")
    assert campaign.simulate is not None
    files = to_files(simulate(model_of(campaign), campaign.simulate))
    tables = {name: content for name, content in files.items() if name.endswith(".csv")}
    assert len(tables) == 4
    for name, content in tables.items():
        made, kept = pd.read_csv(io.BytesIO(content)), pd.read_csv(root / "data/arm_bushing" / name)
        assert list(made) == list(kept)
        for column in made:
            np.testing.assert_allclose(made[column], kept[column], rtol=1e-5, atol=1e-6 * kept[column].abs().max())
