"""What is kept of a row: trusted only where inputs, settings and files are those of the record."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from bushfit.batch import ledger
from bushfit.batch.manifest import Row, Settings, read_manifest
from bushfit.batch.points import parse_point
from bushfit.errors import OutputError
from bushfit.report.contents import Formats

FILES = {"model.json": b"{}", "loops.csv": b"time [s]\n1\n"}


@pytest.fixture
def row(tmp_path: Path) -> Row:
    (tmp_path / "a.toml").write_text("campaign")
    (tmp_path / "m.toml").write_text('[[bushings]]\ncampaign = "a.toml"\n')
    return read_manifest(str(tmp_path / "m.toml"), Settings()).rows[0]


def kept(output: Path, row: Row, status: str = "done") -> ledger.Record:
    """A row's folder as a worker leaves it."""
    record = {
        "key": ledger.key(row, (), Formats(pictures=False)),
        "status": status,
        "inputs": {"a.toml": ledger.digest(b"campaign")},
        "files": {name: ledger.digest(content) for name, content in FILES.items()},
    }
    with ledger.held(output):
        ledger.keep(output, row, FILES, record)
    return record


def standing(output: Path, row: Row) -> ledger.Record | None:
    return ledger.standing(output, row, ledger.key(row, (), Formats(pictures=False)))


def test_what_was_kept_stands(row: Row, tmp_path: Path) -> None:
    output = tmp_path / "out"
    assert standing(output, row) is None
    record = kept(output, row)
    assert standing(output, row) == record
    folder = ledger.place(output, row)
    assert {file.name: file.read_bytes() for file in folder.iterdir()} == {**FILES, "row.json": ledger.to_line(record)}
    assert [file.name for file in output.iterdir()] == ["bushings"]


def test_what_is_torn_or_changed_does_not_stand(row: Row, tmp_path: Path) -> None:
    output = tmp_path / "out"
    for damage in ("model.json", "row.json"):
        kept(output, row)
        (ledger.place(output, row) / damage).write_bytes(b"{")
        assert standing(output, row) is None
    kept(output, row)
    (ledger.place(output, row) / "loops.csv").unlink()
    assert standing(output, row) is None
    kept(output, row)
    (tmp_path / "a.toml").write_text("another campaign")
    assert standing(output, row) is None


def test_a_failed_row_is_not_taken_for_done(row: Row, tmp_path: Path) -> None:
    kept(tmp_path / "out", row, "failed")
    assert standing(tmp_path / "out", row) is None


def test_the_key_changes_with_all_that_the_answer_depends_on(row: Row) -> None:
    point = parse_point("axial 25 Hz 0.1 mm")
    other = replace(row, settings=replace(row.settings, effects=("inertia",)))
    keys = [
        ledger.key(row, (), Formats(pictures=False)),
        ledger.key(row, (point,), Formats(pictures=False)),
        ledger.key(row, (), Formats()),
        ledger.key(other, (), Formats(pictures=False)),
    ]
    assert len(set(keys)) == 4
    assert ledger.key(row, (point,), Formats(pictures=False)) == keys[1]


def test_later_results_replace_earlier_ones(row: Row, tmp_path: Path) -> None:
    output = tmp_path / "out"
    kept(output, row)
    with ledger.held(output):
        ledger.keep(output, row, {"other.csv": b"x"}, {"status": "failed"})
    assert {file.name for file in ledger.place(output, row).iterdir()} == {"other.csv", "row.json"}


def test_rows_of_an_earlier_batch_are_strays(row: Row, tmp_path: Path) -> None:
    output = tmp_path / "out"
    kept(output, row)
    assert ledger.strays(output, [row]) == []
    assert ledger.strays(output, []) == [ledger.place(output, row)]


def test_one_batch_holds_a_folder_and_clears_what_a_killed_one_left(tmp_path: Path) -> None:
    left = tmp_path / ledger.ASIDE / "half"
    left.mkdir(parents=True)
    with ledger.held(tmp_path):
        assert not left.exists()
        with pytest.raises(OutputError, match="another batch is at work there"), ledger.held(tmp_path):
            pass
    assert not (tmp_path / ledger.ASIDE).exists()
