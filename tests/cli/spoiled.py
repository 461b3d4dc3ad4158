"""Spoiled inputs, one a row: the command line, what was done to its files, and what the one error has to say."""

import json
import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

TABLES = Path(__file__).parents[1] / "files" / "spoiled"
#: A small campaign, the same with keys that it does not use (more.toml), a model, and tests.
FILES = {file.name: file.read_text(encoding="utf-8") for file in sorted((TABLES / "inputs").iterdir())}
FILES["book.XLSX"] = "PK\x03\x04"
MODEL: dict[str, Any] = json.loads(FILES["model.json"])
#: The formats that are written without a compiler.
EXPORT = ("export", "model.json", *(f"--format={name}" for name in ("nastran", "abaqus", "adams", "csv", "xlsx")))


@dataclass(frozen=True)
class Spoiled:
    """One spoiled input: a command line, the files that differ from FILES (None: not there), and what to say."""

    table: str
    name: str
    command: tuple[str, ...]
    says: tuple[str, ...]
    files: dict[str, str | bytes | None] = field(default_factory=dict)

    @property
    def arguments(self) -> tuple[str, ...]:
        return (self.command[0], *(() if self.command[0] == "schema" else ("-o", "x")), *self.command[1:])


#: Inputs that are no text, or too long for a table of them: name, command, file, content, and what the error says.
UNWRITTEN: list[tuple[str, str, str, str | bytes, list[str]]] = [
    ("binary campaign", "run", "campaign.toml", b"\x89PNG\r\n\x1a\n\0\0", ["campaign.toml, line 3: the file is not UTF-8 text"]),
    ("campaign in latin-1", "fit", "campaign.toml", 'name = "Gummi für Tür"'.encode("latin-1"), [
        "campaign.toml, line 1: the file is not UTF-8 text", "iconv -f LATIN1 -t UTF-8 old > new",
    ]),
    ("campaign of 1 MB", "plan", "campaign.toml", FILES["campaign.toml"] + "#" * 1_000_001, ["campaign.toml: the file is too large"]),
    ("a key of many parts", "fit", "campaign.toml", ".".join("a" * 5000) + " = 1\n", ["campaign.toml, line 1: the tables are nested too deeply"]),
    ("deep lists", "fit", "campaign.toml", "a = " + "[" * 5000, ["campaign.toml: the tables are nested too deeply"]),
    ("name without end", "predict", "model.json", json.dumps(MODEL).replace("Test", "x" * 5000), ["bushing.name: this value is not understood", "at most 200"]),
    ("100 000 warnings", "predict", "model.json", json.dumps(MODEL | {"warnings": ["w"] * 100_000}), ["model.json, warnings: ", "at most 10000 items"]),
    ("a warning of 5 MB", "predict", "model.json", json.dumps(MODEL | {"warnings": ["w" * 5_000_000]}), ["warnings #1: ", "at most 10000 characters"]),
    ("an integer of many digits", "predict", "model.json", '{"schema": ' + "9" * 5000 + "}", ["model.json: this is not valid JSON"]),
    ("a model of 10 MB", "predict", "model.json", " " * 10_000_001 + "{}", ["model.json: the file is too large"]),
    ("binary loop", "fit", "loop.csv", b"\x00\x01\x02" * 100, ["loop.csv, line 1: this is not text", 'export it as "CSV UTF-8", or state encoding = "..."']),
    ("a workbook cut short", "fit", "loop.csv", b"PK\x03\x04" + b"x" * 100, ["#1 of campaign.toml: the workbook cannot be read", "save it again as xlsx"]),
    ("zeros far behind the head", "fit", "loop.csv", FILES["loop.csv"].encode() * 40 + bytes(5), ["loop.csv, line ", "this is not text", "byte 0x00"]),
    ("zeros in a file of Latin letters", "fit", "loop.csv", (FILES["loop.csv"] + "\xe4\n").encode("latin-1") * 40 + b"1,2\x00,3\n", ["this is not text", "byte 0x00"]),
]  # fmt: skip


def listed() -> Iterator[Spoiled]:
    """The rows of the tables in tests/files/spoiled; what is wrong with a model is told by `export`, too."""
    for table in sorted(TABLES.glob("*.toml")):
        for row in tomllib.loads(table.read_text(encoding="utf-8"))["rows"]:
            name, files = row.get("name", f"{row['command']} {row.get('new', '')}"), dict[str, str | bytes | None]()
            if "missing" in row:
                files[row["missing"]] = None
            elif "text" in row:
                files[row["file"]] = row["text"]
            elif "pattern" in row:
                files[row["file"]] = re.sub(row["pattern"], row["new"], FILES[row["file"]])
            elif "file" in row:
                assert row["old"] in FILES[row["file"]], row
                files[row["file"]] = FILES[row["file"]].replace(row["old"], row["new"], 1)
            yield Spoiled(table.stem, name, tuple(row["command"].split("|")), tuple(row["says"]), files)
            if table.stem == "models":
                yield Spoiled("models_to_export", f"export: {name}", EXPORT, tuple(row["says"]), files)


ROWS = [
    *listed(),
    *(Spoiled("unwritten", name, (command, file if file != "loop.csv" else "campaign.toml"), tuple(says), {file: content})
      for name, command, file, content, says in UNWRITTEN),
]  # fmt: skip
