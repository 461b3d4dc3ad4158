"""Everything that commands print and write agrees with the references in `test_reference_outputs/`."""

import json
import re
import shlex
import tomllib
from collections.abc import Iterator
from pathlib import Path
from string import Template
from unittest import mock

import numpy as np
import pandas as pd
import pytest
from commandline import call, state
from references import check, describe_figure, file_lines, printed_lines, text_lines
from test_schemas import complaints
from tries import some

from bushfit.commands.schema import DESCRIBED

CASES = tomllib.loads((Path(__file__).with_suffix("") / "commands.toml").read_text(encoding="utf-8"))
PARTS, CAMPAIGNS, TEXTS = (CASES.pop(key) for key in ("parts", "campaigns", "texts"))


def change(folder: Path, file: str, column: str, rows: str, expression: str) -> None:
    """Change a column of a CSV in the rows of a pandas query to a NumPy expression of its values x and the table t."""
    t = pd.read_csv(folder / file)
    index = t.query(rows).index
    t.loc[index, column] = eval(expression, {**vars(np), "x": t.loc[index, column], "t": t})
    t.to_csv(folder / file, index=False)


def drop(folder: Path, file: str, rows: str) -> None:
    """Remove the rows of a pandas query from a CSV."""
    table = pd.read_csv(folder / file)
    table.drop(table.query(rows).index).to_csv(folder / file, index=False)


def tabulate(folder: Path, file: str, numbers: str, *columns: str) -> None:
    """Write a CSV of columns `header=expression` of row numbers n, themselves an expression; others are lines above.

    A file of the name +FILE is appended to FILE.
    """
    pairs = [column.rpartition("=") for column in columns]
    n = eval(numbers, vars(np))
    table = pd.DataFrame({header: eval(text, {**vars(np), "n": n}) for header, _, text in pairs if header})
    lines = "".join(f"{text}\n" for header, _, text in pairs if not header)
    with (folder / file.removeprefix("+")).open("a" if file.startswith("+") else "w", encoding="utf-8") as stream:
        stream.write(lines + table.to_csv(index=False, float_format="%.9g"))


EDITS = {"change": change, "drop": drop, "tabulate": tabulate}


def assert_described(text: str, source: str) -> None:
    """A JSON document has the keys of its schema and no others; `source` as in schemas.toml, a regular expression."""
    name = next(name for name, described in DESCRIBED.items() if re.search(source, described.files))
    assert complaints(name, json.loads(text), whole=True) == []


def transcript(folder: Path, commands: str) -> Iterator[str]:
    """Each command with its exit status, what it printed, and the files that it wrote."""
    for command in commands.strip().splitlines():
        yield f"$ bushfit {command}"
        before = state(folder)
        name, *arguments = shlex.split(command)
        if name in EDITS:
            EDITS[name](folder, *arguments)
            continue
        done = call(folder, name, *arguments)
        if "--json" in command and done.stdout:
            assert_described(done.stdout, rf"--json of ([\w ]*{name}\b|the {name[:3]}s)")
        yield from (f"exit status {done.returncode}", *printed_lines(done.stdout), "errors:", *text_lines(done.stderr))
        for path in sorted(file for file, _ in state(folder).items() - before.items() if not file.name.startswith(".")):
            if path.suffix == ".json":
                assert_described(path.read_text(encoding="utf-8"), rf"\b{path.name}")
            yield from (f"-- {path.relative_to(folder).as_posix()}", *file_lines(path))


@pytest.mark.parametrize("name", some(CASES, [name for name, case in CASES.items() if not case.get("slow")]))
def test_commands_print_and_write_what_the_references_hold(name, root, tmp_path, file_regression):
    for folder in ("configs", "data", "tests/files/visit", "tests/files/recordings"):
        (tmp_path / Path(folder).name).symlink_to(root / folder)
    for campaign, text in CAMPAIGNS.items():
        (tmp_path / f"{campaign}.toml").write_text(Template(text).substitute(PARTS), encoding="utf-8")
    for file, text in TEXTS.items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    with mock.patch("bushfit.report.plots.style.to_image", describe_figure):
        text = "\n".join(transcript(tmp_path, CASES[name]["commands"])) + "\n"
    text = text.replace(str(tmp_path), "FOLDER").replace(str(root), "ROOT")
    file_regression.check(text, basename=name, encoding="utf-8", check_fn=check)
