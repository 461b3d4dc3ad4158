"""TOML files of the user's: parsed and checked, or one error with its place."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path

import pytest

from bushfit.campaign.toml import read_toml
from bushfit.errors import CampaignError


@dataclass(frozen=True)
class Schema:
    name: str
    count: int = 1


def read(folder: Path, content: str | bytes) -> Schema:
    file = folder / "x.toml"
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_toml(file, Schema, what="a list", largest=1000)


@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_a_file_becomes_its_dataclass(mark: str, tmp_path: Path) -> None:
    assert read(tmp_path, f'{mark}name = "Büchse"\r\ncount = 2\r\n') == Schema("Büchse", 2)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("name = x\n", ["x.toml, line 1, column 8", "not valid TOML", "put texts and quantities in quotes"]),
        ('name = "a"\nname = "b"\n', ["line 2", "not valid TOML", "Cannot overwrite"]),
        (b'name = "\xfc"\n', ["line 1", "not UTF-8 text", "0xfc"]),
        ("name = 9\n", ["name", "not understood", "a text in quotes"]),
        (f'name = "{"x" * 1000}"', ["too large", "at most 1000 bytes", "give a list, not a measurement"]),
        ("a" + ".a" * 20 + " = 1\n", ["line 1", "nested too deeply"]),
        ('count = "2"\n', ["a key is missing", "name"]),
    ],
)
def test_what_is_no_such_file_has_one_error_with_its_place(
    content: str | bytes, words: list[str], tmp_path: Path
) -> None:
    with pytest.raises(CampaignError) as caught:
        read(tmp_path, content)
    assert [word for word in words if word not in str(caught.value)] == []


def test_keys_of_fifteen_parts_are_still_read(tmp_path: Path) -> None:
    deep = ".".join("abcdefghijklmno") + " = 1"
    assert tomllib.loads(deep)
    with pytest.raises(CampaignError, match="a key is missing"):
        read(tmp_path, deep)
