"""Results whole or absent, never mixed, whatever interrupts a run, and never over others unasked."""

from __future__ import annotations

import json
import os
import stat
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from bushfit.errors import OutputError
from bushfit.report import folder as results
from bushfit.report.folder import write_files

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="processes are forked and killed")

HERE = Path(__file__).parent
OLD = {"a.csv": b"old a", "b.json": b"old b"}
NEW = {"a.csv": b"new a", "b.json": b"new b"}


def script(name: str, *arguments: str) -> dict[str, int]:
    done = subprocess.run(
        [sys.executable, str(HERE / name), *arguments], capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stderr
    print(done.stdout.strip())
    return json.loads(done.stdout)


def exchange_works(folder: Path) -> bool:
    one, other = folder / "one", folder / "other"
    one.mkdir()
    other.mkdir()
    try:
        results.exchange(one, other)
    except OSError:
        return False
    return True


@pytest.mark.parametrize("how", ["killed", "full"])
@pytest.mark.parametrize("where", ["new", "exchanged", "inside"])
def test_stopped_at_every_system_call(where: str, how: str, tmp_path: Path) -> None:
    """Every state is whole. Inside the folder where the user stands nothing can be exchanged, and what was decided is
    ended by the next run."""
    seen = script("interrupt.py", str(tmp_path / "results" / "x"), where, how)["seen"]
    states = {state.split(",")[0] for state in seen}
    allowed = {"new": {"absent", "new"}, "exchanged": {"old", "new"}, "inside": {"old", "new", "decided"}}[where]
    if where == "exchanged" and not exchange_works(tmp_path):
        allowed.add("decided")
    assert states <= allowed
    assert len(states) >= 2


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 64 KiB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mounting = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(folder)]
    try:
        done = subprocess.run(mounting, capture_output=True, text=True, check=False)
    except FileNotFoundError as error:
        pytest.skip(f"no disk can be mounted here: {error}")
    if done.returncode:
        pytest.skip(f"no disk may be mounted here: {done.stderr.strip()}")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


@pytest.mark.parametrize(
    ("mounted", "size", "says"),
    [("", 90_000, "No space left"), ("remount,ro", 10, "no right to write there")],
    ids=["full", "read only"],
)
def test_a_disk_that_is_full_or_may_only_be_read(small_disk: Path, mounted: str, size: int, says: str) -> None:
    write_files(small_disk / "x", OLD, force=False)
    if mounted:
        subprocess.run(["mount", "-o", mounted, str(small_disk)], check=True)
    for place in (small_disk / "y", small_disk / "x"):
        with pytest.raises(OutputError, match=says):
            write_files(place, {"a.csv": bytes(size // 3), "b.json": bytes(2 * size // 3)}, force=True)
    assert [path.name for path in small_disk.iterdir()] == ["x"]
    assert contents(small_disk / "x") == OLD


def test_a_folder_that_allows_no_writing() -> None:
    """Rights do not bind root, so that a child gives its own up first."""
    with tempfile.TemporaryDirectory() as home:
        folder = Path(home) / "x"
        folder.mkdir()
        folder.chmod(0o555)
        Path(home).chmod(0o755)
        child = os.fork()
        if not child:
            status = 1
            if os.getuid() == 0:
                os.setuid(65534)
            try:
                write_files(folder, NEW, force=True)
            except OutputError as error:
                status = 0 if "no right to write there" in str(error) else 2
            os._exit(status)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
        assert contents(folder) == {}


def test_files_are_flushed_one_by_one_where_the_system_knows_no_other_way(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flushed: list[int] = []
    monkeypatch.setattr(results, "_libc", lambda: None)
    monkeypatch.setattr(os, "fsync", flushed.append)
    write_files(tmp_path / "x", OLD, force=False)
    write_files(tmp_path / "x", NEW, force=True)  # nor can folders be exchanged there
    assert len(flushed) == 4
    assert contents(tmp_path / "x") == NEW
    assert [path.name for path in tmp_path.iterdir()] == ["x"]


@pytest.mark.parametrize("force", [True, False])
def test_runs_into_one_folder_at_a_time(tmp_path: Path, force: bool) -> None:
    """Whole sets: with --force the last one stands, without it the first, and each other one is told."""
    sets = [dict.fromkeys("abcdefgh", b"%d" % number * 2000) for number in range(8)]
    refused: list[OutputError] = []

    def write(files: dict[str, bytes]) -> None:
        try:
            write_files(tmp_path / "x", files, force=force)
        except OutputError as error:
            refused.append(error)

    threads = [threading.Thread(target=write, args=(files,)) for files in sets]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert contents(tmp_path / "x") in sets
    assert len(refused) == (0 if force else 7)
    assert all("results stand there already" in str(error) for error in refused)
    assert [path.name for path in tmp_path.iterdir()] == ["x"]


def test_what_a_killed_run_left_is_removed_but_not_what_another_run_is_at(tmp_path: Path) -> None:
    left, at_work, of_the_user = (tmp_path / name for name in (".bushfit-abcdefgh", ".bushfit-ijklmnop", ".bushfit-x"))
    for folder in (left, at_work, of_the_user):
        (folder / "new").mkdir(parents=True)
    claim = results.claim(at_work)
    write_files(tmp_path / "x", NEW, force=False)
    claim.close()
    assert {path.name for path in tmp_path.iterdir()} == {"x", at_work.name, of_the_user.name}


FILES = {"a.csv": b"1\n", "b.json": b"{}\n"}


def contents(folder: Path, pattern: str = "*") -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.glob(pattern)}


def test_a_new_folder_is_made_and_one_that_stands_keeps_rights_subfolders_and_links(tmp_path: Path) -> None:
    folder = tmp_path / "results" / "deep" / "x"
    write_files(folder, FILES, force=False)
    assert contents(folder) == FILES
    assert [child.name for child in folder.parent.iterdir()] == ["x"]
    umask = os.umask(0)
    os.umask(umask)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o777 & ~umask
    folder = tmp_path / "x"
    (folder / "sub" / "deep").mkdir(parents=True)
    (folder / "sub" / "deep" / "mine.txt").write_text("mine")
    (folder / "link").symlink_to("nowhere")
    folder.chmod(0o750)
    (tmp_path / "way").symlink_to(folder, target_is_directory=True)
    write_files(folder, OLD, force=False)
    write_files(tmp_path / "way", NEW, force=True)
    assert (tmp_path / "way").is_symlink()
    assert (folder / "a.csv").read_bytes() == b"new a"
    assert (folder / "sub" / "deep" / "mine.txt").read_text() == "mine"
    assert (folder / "link").readlink() == Path("nowhere")
    assert folder.stat().st_mode & 0o777 == 0o750


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
