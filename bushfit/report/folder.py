"""Writes the files of a result into a folder: all of them or none, and over existing ones only where that is asked.

How `write_files` does it:

1. The files are written into a hidden folder beside the target (the stage) and flushed to the disk.
2. If the target does not exist, the stage is renamed to it: one step of the file system.
3. If it exists, links to its other files are added to the stage, and the two folders are exchanged in one step.
4. If they cannot be exchanged (the working folder, a network drive), the stage is renamed to a fixed name inside the
   target, which means "decided", and its files are then moved into place one by one. A run that is killed in between
   leaves the decided folder, and the next run that writes there finishes the moves first.
"""

from __future__ import annotations

import ctypes
import errno
import hashlib
import json
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from bushfit.errors import CONTROL, OutputError

#: Linux' word for the working folder, in calls that take a folder and a path (fcntl.h).
_AT_FDCWD = -100
#: Linux' flag of renameat2 that swaps two paths (linux/fs.h).
_RENAME_EXCHANGE = 2
#: Start of the name of a stage, the hidden folder in which a set of files is written.
_STAGE = ".bushfit-"
#: Name of a set of files that is complete and waits to be moved into the folder around it.
_DECIDED = ".bushfit-decided"
#: Name of the record, in a folder of results, of the files that each command wrote there: as JSON their SHA-256 by
#: command and name, and the names that the last one took away.
_RECORD = ".bushfit.json"
#: Characters of a document that steer a terminal; the ends of its lines do not.
_STEERING = re.compile(rf"(?!\n){CONTROL.pattern}")
#: Most files of a folder that is exchanged [files]; one that holds more is no folder of results, and linking its files
#: would take longer than moving the new ones in.
_MOST_LINKED = 2000


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


@dataclass(frozen=True)
class _Record:
    """SHA-256 of the files in a folder by command and name, and the names of those that the last one took away."""

    written: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    removed: tuple[str, ...] = ()


def to_json(document: Mapping[str, Any]) -> bytes:
    """A document as the bytes of its file, in which no character steers a terminal."""
    text = json.dumps(document, indent=1, allow_nan=False, ensure_ascii=False)
    return (_STEERING.sub(lambda sign: f"\\u{ord(sign[0]):04x}", text) + "\n").encode()


def check_free(folder: Path, names: list[str], *, force: bool) -> None:
    """Refuse a folder that the results could not be written to; called before the work begins, too.

    Raises:
        OutputError: the folder is a file or allows no writing, holds a folder of one of the names, or holds one of
            the names and `force` is False.
    """
    try:
        if folder.exists() and not folder.is_dir():
            raise OutputError(
                "the output is not a folder", file=folder, expected="a folder", hint="another -o/--output"
            )
        # the folder, or the nearest one above it that exists, has to take new files
        place = folder.absolute()
        nearest = next(path for path in (place, *place.parents) if os.path.lexists(path))
        if nearest.exists() and not nearest.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, "Not a directory", str(nearest))
        if not os.access(nearest, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, "no right to write there", str(nearest))
        standing = [name for name in names if os.path.lexists(folder / name)]
        folders = [name for name in standing if (folder / name).is_dir()]
    except OSError as error:
        raise unwritable(folder, error) from error
    if folders:
        raise OutputError(
            "a folder stands where a file goes",
            file=folder / folders[0],
            hint="move it away, or name another folder with -o/--output",
        )
    if standing and not force:
        raise OutputError(
            "results stand there already",
            file=folder,
            found=", ".join(standing),
            hint="--force replaces them; -o/--output names another folder",
        )


def write_files(
    folder: Path,
    files: Mapping[str, bytes],
    *,
    force: bool,
    by: str | None = None,
    before: Callable[[], None] = lambda: None,
) -> None:
    """Write a set of files into a folder: all of them or none, even if this run is killed or another writes there.

    The steps stand at the top of this module. Runs that write into one folder take turns, and the last one's files
    stay. What a killed run left behind is removed by the next. With `force` files of these names are replaced, and
    those that the same command, `by`, wrote there before and does not write now are removed, unless somebody has
    changed them since. `before` is called when all is on the disk and only stands elsewhere; if it raises, nothing is
    written.

    Raises:
        OutputError: the folder cannot be written, or holds results and `force` is False.
    """
    check_free(folder, list(files), force=force)
    try:
        place = folder.resolve()
        with _parents(place.parent):
            inside = place.is_dir() and (len(files) == 1 or not _exchangeable(place))
            with _staged(place if inside else place.parent, files) as ready, locked(place.parent):
                _end_decided(place)
                check_free(folder, list(files), force=force)
                _record(place, ready, files, by, force=force)
                before()
                if not place.exists():
                    ready.rename(place)
                elif inside or not _exchanged(ready, place):
                    ready.rename(place / _DECIDED)
                    _end_decided(place)
    except OSError as error:
        raise unwritable(folder, error) from error


def _record(place: Path, ready: Path, files: Mapping[str, bytes], by: str | None, *, force: bool) -> None:
    """Put the record of a folder's files beside new ones, where a command writes several there or has done so.

    It names what is to be removed, too: files as the command wrote them before, and does not write now.
    """
    known = _recorded(place)
    if by is None or not (known.written or len(files) > 1):
        return
    before = known.written.get(by, {})
    there = [name for name in before if name not in files and (place / name).is_file()]
    left = [name for name in there if hashlib.sha256((place / name).read_bytes()).hexdigest() == before[name]]
    written = {
        command: {name: digest for name, digest in names.items() if name not in files and not (force and name in left)}
        for command, names in known.written.items()
    }
    written[by] = written.get(by, {}) | {name: hashlib.sha256(content).hexdigest() for name, content in files.items()}
    record = _Record(written, tuple(left) if force else ())
    (ready / _RECORD).write_bytes(to_json(asdict(record)))


def _recorded(folder: Path) -> _Record:
    """The record in a folder; an empty one, by which nothing is removed, where there is none that can be read."""
    from pydantic import TypeAdapter

    try:
        data = (folder / _RECORD).read_bytes()
        record = TypeAdapter(_Record).validate_json(data)
    except (OSError, ValueError):
        return _Record()
    names = {*record.removed, *(name for names in record.written.values() for name in names)}
    return record if all(Path(name).name == name for name in names) else _Record()


@contextmanager
def _parents(folder: Path) -> Iterator[None]:
    """Make a folder and the missing ones above it; remove them again if the body fails."""
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    try:
        yield
    except BaseException:
        for path in missing:
            with suppress(OSError):  # another run may have put something there
                path.rmdir()
        raise


@contextmanager
def _staged(home: Path, files: Mapping[str, bytes]) -> Iterator[Path]:
    """Write the files to a stage in `home` and give the folder they are in; the stage is removed in the end."""
    with locked(home):
        _clear_abandoned(home)
        stage = Path(tempfile.mkdtemp(prefix=_STAGE, dir=home))
        held = claim(stage)
    try:
        ready = stage / "new"
        ready.mkdir()
        with ExitStack() as opened:
            streams = [opened.enter_context((ready / name).open("xb")) for name in files]
            for stream, content in zip(streams, files.values(), strict=True):
                stream.write(content)
                stream.flush()
            flush([stream.fileno() for stream in streams])
        yield ready
    finally:
        shutil.rmtree(stage, ignore_errors=True)
        held.close()


@cache  # once a run is enough: a batch writes into one folder a thousand times
def _clear_abandoned(home: Path) -> None:
    """Remove the stages of runs that were killed, which nobody claims any more."""
    for stage in home.glob(_STAGE + "????????"):
        if is_abandoned(stage):
            shutil.rmtree(stage, ignore_errors=True)


def _exchangeable(place: Path) -> bool:
    """Whether a folder may be exchanged for another: not the working folder or one above it, nor a mounted drive."""
    here = Path.cwd()
    return place not in (here, *here.parents) and not place.is_mount() and os.access(place.parent, os.W_OK)


def _exchanged(ready: Path, place: Path) -> bool:
    """Exchange a folder for one that holds the new files and its own other ones; False where that cannot be done."""
    whole, home, count, removed = ready.with_name("whole"), ready.stat(), 0, _recorded(ready).removed

    def passed_over(folder: str, names: list[str]) -> list[str]:
        """What of a folder is not linked: stages, and files that are written anew."""
        nonlocal count
        count, owned = count + len(names), Path(folder).stat()
        if count > _MOST_LINKED or (owned.st_uid, owned.st_gid) != (home.st_uid, home.st_gid):
            raise OSError("too many files, or folders that a copy would give another owner")
        anew = [name for name in names if (ready / name).exists() or name in removed] if Path(folder) == place else []
        return [*anew, *(name for name in names if name.startswith(_STAGE))]

    try:
        shutil.copytree(ready, whole, copy_function=os.link)
        shutil.copytree(place, whole, symlinks=True, ignore=passed_over, copy_function=os.link, dirs_exist_ok=True)
        exchange(whole, place)
    except OSError:  # no links, no exchange, or an owner that a copy would lose: moving the files needs none of these
        return False
    return True


def _end_decided(place: Path) -> None:
    """Move the files of a decided set into the folder: those of this run, or of one that was killed before it could."""
    decided = place / _DECIDED
    if decided.is_dir():
        for name in _recorded(decided).removed:
            (place / name).unlink(missing_ok=True)
        for file in sorted(decided.iterdir(), key=lambda file: file.name == _RECORD):
            file.replace(place / file.name)
        decided.rmdir()


def unwritable(folder: Path, error: OSError) -> OutputError:
    """What is told of a failure of the disk."""
    return OutputError(
        "the results cannot be written",
        file=folder,
        found=error.strerror or str(error),
        hint="free some space or rights there, or name another folder with -o/--output",
    )
