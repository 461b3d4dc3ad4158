"""Results on disk: all or none, and never over others unasked."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

from bushfit.errors import OutputError
from bushfit.report.folder import check_free, write_files

FILES = {"a.csv": b"1\n", "b.json": b"{}\n"}


def contents(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.iterdir()}


def test_a_new_folder_is_made_with_its_parents(tmp_path: Path) -> None:
    folder = tmp_path / "results" / "deep" / "x"
    write_files(folder, FILES, force=False)
    assert contents(folder) == FILES
    assert [child.name for child in folder.parent.iterdir()] == ["x"]
    umask = os.umask(0)
    os.umask(umask)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o777 & ~umask


def test_standing_results_are_kept_and_the_remedy_is_named(tmp_path: Path) -> None:
    write_files(tmp_path / "x", FILES, force=False)
    with pytest.raises(OutputError) as caught:
        write_files(tmp_path / "x", {"b.json": b"new", "c.csv": b"new"}, force=False)
    assert "b.json" in str(caught.value)
    assert "--force" in str(caught.value)
    assert contents(tmp_path / "x") == FILES


def test_force_replaces_its_own_files_only(tmp_path: Path) -> None:
    write_files(tmp_path / "x", FILES, force=False)
    (tmp_path / "x" / "mine.txt").write_text("kept")
    write_files(tmp_path / "x", {"b.json": b"new"}, force=True)
    assert contents(tmp_path / "x") == {"a.csv": b"1\n", "b.json": b"new", "mine.txt": b"kept"}
    assert [child.name for child in tmp_path.iterdir()] == ["x"]


def test_other_files_in_the_folder_do_not_hinder(tmp_path: Path) -> None:
    (tmp_path / "x").mkdir()
    (tmp_path / "x" / "mine.txt").write_text("kept")
    write_files(tmp_path / "x", FILES, force=False)
    assert set(contents(tmp_path / "x")) == {*FILES, "mine.txt"}


def test_a_file_in_the_way(tmp_path: Path) -> None:
    (tmp_path / "x").write_text("a file")
    with pytest.raises(OutputError, match="not a folder"):
        write_files(tmp_path / "x", FILES, force=True)
    with pytest.raises(OutputError, match="cannot be written"):
        write_files(tmp_path / "x" / "below", FILES, force=True)
    assert (tmp_path / "x").read_text() == "a file"


def test_a_folder_in_the_way(tmp_path: Path) -> None:
    (tmp_path / "x" / "a.csv").mkdir(parents=True)
    for force in (True, False):
        with pytest.raises(OutputError, match="a folder stands where a file goes"):
            write_files(tmp_path / "x", FILES, force=force)
    assert list((tmp_path / "x").iterdir()) == [tmp_path / "x" / "a.csv"]


def test_check_free_says_nothing_where_nothing_stands(tmp_path: Path) -> None:
    check_free(tmp_path / "absent", ["a.csv"], force=False)
    check_free(tmp_path, ["a.csv"], force=False)


def test_force_takes_away_what_the_same_command_wrote_before(tmp_path: Path) -> None:
    """Not what another wrote, what somebody has changed since, or what stands there besides."""
    folder = tmp_path / "x"
    write_files(folder, {"a.csv": b"1", "b.csv": b"1", "c.csv": b"1"}, force=False, by="one")
    write_files(folder, {"d.csv": b"1", "e.csv": b"1"}, force=False, by="other")
    write_files(folder, {"f.csv": b"1", "g.csv": b"1"}, force=False, by="one")
    assert {file.name for file in folder.glob("[!.]*")} == {f"{letter}.csv" for letter in "abcdefg"}
    (folder / "b.csv").write_bytes(b"mine")
    (folder / "notes.txt").write_bytes(b"mine")
    write_files(folder, {"c.csv": b"2", "d.csv": b"2"}, force=True, by="one")
    assert {file.name: file.read_bytes() for file in folder.glob("[!.]*")} == {
        "b.csv": b"mine",
        "c.csv": b"2",
        "d.csv": b"2",
        "e.csv": b"1",
        "notes.txt": b"mine",
    }
    write_files(folder, {"h.csv": b"1"}, force=True, by="one")
    assert {file.name for file in folder.glob("[!.]*")} == {"b.csv", "e.csv", "h.csv", "notes.txt"}


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
    assert {file.name for file in folder.glob("[!.]*")} == {"a.csv", "b.csv"}
    assert (tmp_path / "mine.txt").read_bytes() == b"mine"


def test_nothing_stands_where_the_last_word_fails(tmp_path: Path) -> None:
    def closed() -> None:
        raise OutputError("standard output cannot be written")

    with pytest.raises(OutputError, match="standard output"):
        write_files(tmp_path / "x", {"a.csv": b"1"}, force=False, before=closed)
    assert list(tmp_path.iterdir()) == []
