"""Calls of the operating system that a set of files needs to change at once: exchange, lock and flush a folder."""

from __future__ import annotations

import ctypes
import errno
import os
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

#: Linux' word for the working folder, in calls that take a folder and a path (fcntl.h).
_AT_FDCWD = -100
#: Linux' flag of renameat2 that swaps two paths (linux/fs.h).
_RENAME_EXCHANGE = 2


def exchange(one: Path, other: Path) -> None:
    """Swap two folders of one file system in a single step: whoever looks sees the one or the other, whole.

    Raises:
        OSError: this system, or this file system, cannot do it; both are as they were.
    """
    rename = getattr(_libc(), "renameat2", None)
    if rename is None:
        raise OSError(errno.ENOSYS, "folders cannot be exchanged here")
    if rename(_AT_FDCWD, os.fsencode(one), _AT_FDCWD, os.fsencode(other), _RENAME_EXCHANGE) != 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number), str(other))


def flush(files: list[int]) -> None:
    """Make sure that open files are on the disk and not only in memory.

    In one go where the system can: one by one costs several times as much.

    Raises:
        OSError: the disk is full or fails.
    """
    sync = getattr(_libc(), "syncfs", None)
    if files and sync is not None and sync(ctypes.c_int(files[0])) == 0:
        return
    for descriptor in files:
        os.fsync(descriptor)


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Let no other run of bushfit work on a folder while the body runs; wait until none does.

    The lock is no file, and ends with the process. Where the system or the file system has no such locks, the body runs
    without.
    """
    with closing(claim(folder)):
        yield


def claim(folder: Path, *, wait: bool = True) -> Claim:
    """Mark a folder as in use, for other runs to see, until the claim is closed or this process ends.

    Raises:
        BlockingIOError: another holds it, and `wait` is False.
    """
    if sys.platform == "win32":
        return Claim(None)
    import fcntl

    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except OSError:
        return Claim(None)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except OSError as error:
        os.close(descriptor)
        if isinstance(error, BlockingIOError):
            raise
        return Claim(None)
    return Claim(descriptor)


def is_abandoned(folder: Path) -> bool:
    """Whether no run claims a folder any more; False where that cannot be told."""
    try:
        left = claim(folder, wait=False)
    except BlockingIOError:
        return False
    left.close()
    return left.descriptor is not None


@dataclass(frozen=True)
class Claim:
    """A folder marked as in use: the open folder that holds the lock, None where there are no locks."""

    descriptor: int | None

    def close(self) -> None:
        """End the claim."""
        if self.descriptor is not None:
            os.close(self.descriptor)


@cache
def _libc() -> Any:
    """Linux' C library; None on other systems."""
    return ctypes.CDLL(None, use_errno=True) if sys.platform.startswith("linux") else None
