"""Results on disk: all or none, never over others unasked; and what Linux offers for that."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

from bushfit.errors import OutputError
from bushfit.report.folder import write_files

FILES = {"a.csv": b"1\n", "b.json": b"{}\n"}


def contents(folder: Path, pattern: str = "*") -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.glob(pattern)}


def test_a_new_folder_is_made_with_its_parents(tmp_path: Path) -> None:
    folder = tmp_path / "results" / "deep" / "x"
    write_files(folder, FILES, force=False)
    assert contents(folder) == FILES
    assert [child.name for child in folder.parent.iterdir()] == ["x"]
    umask = os.umask(0)
    os.umask(umask)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o777 & ~umask


def test_standing_results_are_kept_until_force_replaces_them_alone(tmp_path: Path) -> None:
    folder = tmp_path / "x"
    folder.mkdir()
    (folder / "mine.txt").write_bytes(b"kept")
    write_files(folder, FILES, force=False)
    with pytest.raises(OutputError) as caught:
        write_files(folder, {"b.json": b"new", "c.csv": b"new"}, force=False)
    assert "b.json" in str(caught.value)
    assert "--force" in str(caught.value)
    assert contents(folder) == FILES | {"mine.txt": b"kept"}
    write_files(folder, {"b.json": b"new"}, force=True)
    assert contents(folder) == {"a.csv": b"1\n", "b.json": b"new", "mine.txt": b"kept"}
    assert [child.name for child in tmp_path.iterdir()] == ["x"]


def test_a_file_or_a_folder_in_the_way(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("a file")
    (tmp_path / "x" / "a.csv").mkdir(parents=True)
    for folder, says in (
        ("file", "not a folder"),
        ("file/below", "cannot be written"),
        ("x", "a folder stands where a file goes"),
    ):
        for force in (True, False):
            with pytest.raises(OutputError, match=says):
                write_files(tmp_path / folder, FILES, force=force)
    assert (tmp_path / "file").read_text() == "a file"
    assert list((tmp_path / "x").iterdir()) == [tmp_path / "x" / "a.csv"]


def test_force_takes_away_what_the_same_command_wrote_before(tmp_path: Path) -> None:
    """Not what another wrote, what somebody has changed since, or what stands there besides."""
    folder = tmp_path / "x"
    for names, by in (("abc", "one"), ("de", "other"), ("fg", "one")):
        write_files(folder, {f"{name}.csv": b"1" for name in names}, force=False, by=by)
    assert set(contents(folder, "[!.]*")) == {f"{letter}.csv" for letter in "abcdefg"}
    (folder / "b.csv").write_bytes(b"mine")
    (folder / "notes.txt").write_bytes(b"mine")
    write_files(folder, {"c.csv": b"2", "d.csv": b"2"}, force=True, by="one")
    new = {"c.csv": b"2", "d.csv": b"2", "e.csv": b"1"}
    assert contents(folder, "[!.]*") == {"b.csv": b"mine", "notes.txt": b"mine", **new}
    write_files(folder, {"h.csv": b"1"}, force=True, by="one")
    assert set(contents(folder, "[!.]*")) == {"b.csv", "e.csv", "h.csv", "notes.txt"}


@pytest.mark.parametrize(
    "record",
    [b"", b"[]", b"\xff", b'{"written": {"one": {"../mine.txt": 3}}, "removed": ["../mine.txt"]}', b"[" * 100_000],
)
def test_a_record_that_is_spoiled_removes_nothing(record: bytes, tmp_path: Path) -> None:
    folder = tmp_path / "x"
    (tmp_path / "mine.txt").write_bytes(b"mine")
    write_files(folder, {"a.csv": b"1", "b.csv": b"1"}, force=False, by="one")
    (folder / ".bushfit.json").write_bytes(record)
    write_files(folder, {"b.csv": b"2"}, force=True, by="one")
    assert set(contents(folder, "[!.]*")) == {"a.csv", "b.csv"}
    assert (tmp_path / "mine.txt").read_bytes() == b"mine"
