"""Folders of which no page can be made: one clear error, and nothing is written."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from commandline import call
from reading_html import change

Spoil = Callable[[Path], object]
NO_CONTROL = {"median": 1.0, "sigma": 1.0, "process": {"control": [1.0]}}
BATCH = {"schema": "bushfit/batch/1", "title": "x", "rows": 1, "done": 1, "quantities": {}, "limits": {}}


def written(name: str, text: str) -> Spoil:
    return lambda folder: (folder / name).write_text(text)


def changed(name: str, **keys: object) -> Spoil:
    return lambda folder: change(folder / name, **keys)


def without(pattern: str) -> Spoil:
    return lambda folder: [file.unlink() for file in folder.glob(pattern)]


OF_RESULTS = [
    (shutil.rmtree, ("a folder of results is needed", "nothing")),
    (without("*.json"), ("there is no model in this folder", "axial.csv", "bushfit run CAMPAIGN")),
    (written("model.json", "{"), ("model.json, line 1", "not valid JSON")),
    (written("model.json", "[]"), ("model.json: not a result", "a list")),
    (changed("model.json", schema="bushfit/model/9"), ("model.json, schema",)),
    (changed("model.json", campaign={"name": 3}), ("model.json, campaign.",)),
    (
        changed("diagnosis.json", schema="bushfit/diagnosis/1"),
        ("diagnosis.json, schema", "bushfit/diagnosis/3 or bushfit/diagnosis/2"),
    ),
    (changed("diagnosis.json", gap=7), ("diagnosis.json, gap", "a table")),
    (written("sweeps.csv", "sweep,direction\na,axial\n"), ("a column of a table is missing", "frequency [Hz]")),
    (
        written("axial.csv", "frequency [Hz],amplitude [mm]\nx,1\n"),
        ("axial.csv: this table is not as bushfit writes it", "'x'"),
    ),
    (written("axial.csv", ""), ("axial.csv: the file is empty",)),
    (lambda folder: (folder / "axial.csv").write_bytes(b"\xff\xfe\x00"), ("axial.csv", "not UTF-8")),
    (written("report.html", "mine"), ("results stand there already", "--force")),
]
OF_COMPARISON = [
    (written("compare.json", "{"), ("compare.json, line 1", "not valid JSON")),
    (written("compare.json", "[]"), ("compare.json: not a result", "a list")),
    (changed("compare.json", schema="bushfit/compare/9"), ("compare.json, schema", "bushfit/compare/1")),
    (changed("compare.json", pairs=7), ("compare.json, pairs",)),
    (changed("compare.json", pairs=[]), ("compare.json, pairs",)),
    (written("compare.html", "mine"), ("results stand there already", "--force")),
]
OF_BATCH = [
    (written("batch.json", "{"), ("not valid JSON",)),
    (written("batch.json", '{"schema": "x"}'), ("not a batch this version reads",)),
    (without("batch.json"), ("there is no such file",)),
    (
        written("batch.json", json.dumps(BATCH | {"quantities": {"a [-]": NO_CONTROL}})),
        ("batch.json, quantities.a [-].process.", "a key is missing"),
    ),
    (without("batch.csv"), ("the table of the batch is missing",)),
    (written("batch.csv", "name,status\n"), ("the table of the batch is missing",)),
]


@pytest.mark.parametrize(
    ("kind", "spoil", "says"),
    [
        *(("results", *case) for case in OF_RESULTS),
        *(("comparison", *case) for case in OF_COMPARISON),
        *(("batch", *case) for case in OF_BATCH),
    ],
)
def test_spoiled_folders_are_one_clear_error(
    root: Path, request: pytest.FixtureRequest, tmp_path: Path, kind: str, spoil: Spoil, says: tuple[str, ...]
) -> None:
    folder = tmp_path / "x"
    if kind == "results":
        shutil.copytree(root / "data/reports/mystery_mount", folder)
    elif kind == "comparison":
        folder.mkdir()
        shutil.copy(request.getfixturevalue("compared") / "two/compare.json", folder)
    else:
        folder.mkdir()
        (folder / "batch.json").write_text(json.dumps(BATCH))
        (folder / "batch.csv").write_text("name,status,folder,warnings\na,done,,\n")
        assert call(tmp_path, "report", "x", "-o", "y").returncode == 0
    spoil(folder)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    done = call(tmp_path, "report", "x")
    assert (done.returncode, done.stderr.count("bushfit: error: ")) == (2, 1), done.stderr
    for words in says:
        assert words in done.stderr
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before
