"""What Linux offers for a set of files: folders exchanged, locked and flushed."""

from __future__ import annotations

import os
import sys
import threading
from pathlib import Path

import pytest

from bushfit.report import disk

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="folders are neither locked nor exchanged there")


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="renameat2")
def test_two_folders_are_exchanged_or_left_as_they_were(tmp_path: Path) -> None:
    one, other = tmp_path / "one", tmp_path / "other"
    for folder in (one, other):
        folder.mkdir()
        (folder / folder.name).touch()
    try:
        disk.exchange(one, other)
    except OSError:  # a file system that cannot
        assert (one / "one").exists()
        assert (other / "other").exists()
    else:
        assert (one / "other").exists()
        assert (other / "one").exists()
    with pytest.raises(OSError, match="such file"):
        disk.exchange(one, tmp_path / "none")
    assert one.is_dir()


def test_a_claim_holds_until_it_is_closed(tmp_path: Path) -> None:
    assert disk.is_abandoned(tmp_path)
    claim = disk.claim(tmp_path)
    assert not disk.is_abandoned(tmp_path)
    with pytest.raises(BlockingIOError):
        disk.claim(tmp_path, wait=False)
    claim.close()
    assert disk.is_abandoned(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_what_is_not_there_cannot_be_said_to_be_abandoned(tmp_path: Path) -> None:
    assert not disk.is_abandoned(tmp_path / "none")


def test_a_locked_folder_lets_one_in_after_the_other(tmp_path: Path) -> None:
    inside: list[str] = []
    waiting = threading.Thread(target=lambda: enter(tmp_path, inside, "second"))
    with disk.locked(tmp_path):
        waiting.start()
        waiting.join(0.2)
        assert waiting.is_alive()
        inside.append("first")
    waiting.join(10.0)
    assert inside == ["first", "second"]


def enter(folder: Path, inside: list[str], name: str) -> None:
    with disk.locked(folder):
        inside.append(name)


def test_open_files_are_flushed_and_closed_ones_are_an_error(tmp_path: Path) -> None:
    descriptor = os.open(tmp_path / "a", os.O_CREAT | os.O_WRONLY)
    disk.flush([descriptor])
    os.close(descriptor)
    disk.flush([])
    with pytest.raises(OSError, match=r"[Bb]ad file descriptor"):
        disk.flush([descriptor])
