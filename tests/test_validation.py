"""Checked tables: every complaint of pydantic's in the project's words, at the place where the file has it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import pytest
from pydantic import ConfigDict, Field, ValidationInfo

from bushfit.errors import CampaignError, ModelError, UnitError
from bushfit.validation import Name, Text, check_tables, converted, known_keys, standing_in_table, unknown_key


def metres(raw: object, _: ValidationInfo) -> float:
    if not isinstance(raw, str) or not raw.endswith(" m"):
        raise UnitError("a quantity without its unit", found=str(raw), expected="a length")
    return float(raw.removesuffix(" m"))


@dataclass(frozen=True)
class Part:
    length: Annotated[float, converted(metres), Field(gt=0)]
    label: Text = "x"


@dataclass(frozen=True)
class Fit:
    rounds: Annotated[int, Field(strict=True)] = 1
    parameters: Mapping[str, Part] = field(default_factory=dict, metadata=standing_in_table(lambda: ("mu", "m")))


@dataclass(frozen=True)
class File:
    __pydantic_config__ = ConfigDict(extra="forbid")

    name: Name
    parts: tuple[Part, ...] = ()
    fit: Fit = field(default_factory=Fit)


FILE = Path("x.toml")


def test_a_table_becomes_its_dataclass_with_values_converted() -> None:
    found = check_tables({"name": "n", "parts": [{"length": "2 m"}], "fit": {"rounds": 3}}, FILE, File)
    assert found == File("n", (Part(2.0),), Fit(3))


@pytest.mark.parametrize(
    ("table", "place", "words"),
    [
        ({}, "name", ["a key is missing", "name = ..."]),
        ({"name": 3}, "name", ["not understood", "found: 3", "a text in quotes"]),
        ({"name": ""}, "name", ["a text that is not empty"]),
        ({"nmae": "n"}, "nmae", ["unknown key", "one of name, parts, fit", 'did you mean "name"?']),
        ({"name": "n", "parts": 1}, "parts", ["a list"]),
        ({"name": "n", "fit": [1]}, "fit", ["a table"]),
        ({"name": "n", "fit": {"rounds": True}}, "fit.rounds", ["found: true", "a whole number"]),
        ({"name": "n", "parts": [{"length": "1 m"}, {"lenght": "1 m"}]}, "parts #2.lenght", ["unknown key", "length"]),
        ({"name": "n", "parts": [{"length": "-1 m"}]}, "parts #1.length", ["greater than 0"]),
        ({"name": "n", "fit": {"parameters": {"mu": {"length": "0 m"}}}}, "fit.mu.length", ["greater than 0"]),
    ],
)
def test_each_complaint_has_its_place_and_words(table: dict[str, Any], place: str, words: list[str]) -> None:
    with pytest.raises(CampaignError) as caught:
        check_tables(table, FILE, File)
    assert (caught.value.file, caught.value.place) == (FILE, place)
    assert [word for word in words if word not in str(caught.value)] == []


def test_an_error_of_a_conversion_comes_through_with_its_place() -> None:
    with pytest.raises(UnitError, match=r"x.toml, parts #1.length: a quantity without its unit[\s\S]*found: 2"):
        check_tables({"name": "n", "parts": [{"length": 2}]}, FILE, File)


def test_a_table_inside_a_file_says_so_and_the_kind_of_error_can_be_chosen() -> None:
    with pytest.raises(ModelError, match=r"x.toml, row 3, name: a key is missing"):
        check_tables({}, FILE, File, "row 3", kind=ModelError)


def test_known_keys_are_those_that_stand_in_the_file() -> None:
    assert known_keys(File) == ["name", "parts", "fit"]
    assert known_keys(Fit) == ["rounds", "mu", "m"]


def test_an_unknown_key_lists_some_that_are_known_and_the_nearest() -> None:
    assert unknown_key("alfa", ["mu", "alpha"]).hint == 'did you mean "alpha"?'
    many = unknown_key("zzz", [f"key_{number}" for number in range(20)])
    assert many.hint is None
    assert str(many.expected).endswith("key_11, ...")
