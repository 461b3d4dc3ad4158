"""Results on disk: a set of files comes whole or not at all, and never over others unasked."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

from bushfit.errors import OutputError
from bushfit.report import disk

#: Where a set of files is made ready, and where one waits that is decided but not yet in place.
_STAGE, _DECIDED = ".bushfit-", ".bushfit-decided"
#: A folder that holds more than this is no folder of results: its files are replaced one by one.
_MOST_LINKED = 2000


def to_json(document: Mapping[str, Any]) -> bytes:
    """A document as the bytes of its file."""
    return (json.dumps(document, indent=1, allow_nan=False, ensure_ascii=False) + "\n").encode()


def check_free(folder: Path, names: list[str], *, force: bool) -> None:
    """Refuse what could not be written, before the work.

    Raises:
        OutputError: the folder is a file or allows no writing, holds a folder of one of the names, or holds one of
            the names and `force` is False.
    """
    try:
        if folder.exists() and not folder.is_dir():
            hint = "another -o/--output"
            raise OutputError("the output is not a folder", file=folder, expected="a folder", hint=hint)
        _check_writable(folder)
        standing = [name for name in names if os.path.lexists(folder / name)]
        folders = [name for name in standing if (folder / name).is_dir()]
    except OSError as error:
        raise _unwritable(folder, error) from error
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


def _check_writable(folder: Path) -> None:
    """The folder, or the nearest one above it that exists, must take new files."""
    place = folder.absolute()
    nearest = next(path for path in (place, *place.parents) if os.path.lexists(path))
    if nearest.exists() and not nearest.is_dir():
        raise NotADirectoryError(20, "Not a directory", str(nearest))
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise PermissionError(13, "no right to write there", str(nearest))


def write_files(folder: Path, files: Mapping[str, bytes], *, force: bool) -> None:
    """Write a set of files into a folder, all of them or none, whatever else happens to run or fail meanwhile.

    They are made ready in a hidden folder. A new folder is then put in place by one renaming. One that stands is
    exchanged in one step for a folder with the new files and links to all other files of the old. Where that cannot
    be (`-o .`, a network drive), the set is first marked as decided and then moved file by file; if the run is killed
    in between, the next one that writes there ends the work. Runs into one folder take turns: whole sets, the last
    one stands. What a killed run left is removed by the next.

    Raises:
        OutputError: the folder cannot be written, or holds results and `force` is False.
    """
    check_free(folder, list(files), force=force)
    try:
        place = folder.resolve()
        with _parents(place.parent):
            inside = place.is_dir() and (len(files) == 1 or not _exchangeable(place))
            with _staged(place if inside else place.parent, files) as ready, disk.locked(place.parent):
                _end_decided(place)
                check_free(folder, list(files), force=force)
                if not place.exists():
                    ready.rename(place)
                elif inside or not _exchanged(ready, place):
                    ready.rename(place / _DECIDED)
                    _end_decided(place)
    except OSError as error:
        raise _unwritable(folder, error) from error


@contextmanager
def _parents(folder: Path) -> Iterator[None]:
    """Make a folder and what is missing above it; remove that again if the body fails."""
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
    """The files in a folder of their own, on the disk; what is left of it is removed afterwards."""
    with disk.locked(home):
        _clear_abandoned(home)
        stage = Path(tempfile.mkdtemp(prefix=_STAGE, dir=home))
        claim = disk.claim(stage)
    try:
        ready = stage / "new"
        ready.mkdir()
        _write(ready, files)
        yield ready
    finally:
        shutil.rmtree(stage, ignore_errors=True)
        claim.close()


def _write(folder: Path, files: Mapping[str, bytes]) -> None:
    streams = []
    try:
        for name, content in files.items():
            streams.append((folder / name).open("xb", buffering=0))
            left = memoryview(content)
            while left:
                left = left[streams[-1].write(left) :]
        disk.flush([stream.fileno() for stream in streams])
    finally:
        for stream in streams:
            stream.close()


@cache  # once a run is enough: a batch writes into one folder a thousand times
def _clear_abandoned(home: Path) -> None:
    """Remove what killed runs left: stages that nobody claims any more."""
    for stage in home.glob(_STAGE + "????????"):
        if disk.is_abandoned(stage):
            shutil.rmtree(stage, ignore_errors=True)


def _exchangeable(place: Path) -> bool:
    """Whether a folder may be exchanged for another: not where this process, and its user, stand in it."""
    here = Path.cwd()
    return place not in (here, *here.parents) and not place.is_mount() and os.access(place.parent, os.W_OK)


def _exchanged(ready: Path, place: Path) -> bool:
    """Exchange the folder for one with the new files and the others that stand there; False where that cannot be."""
    whole = ready.with_name("whole")
    try:
        shutil.copytree(ready, whole, copy_function=os.link)
        _link_others(place, whole, _MOST_LINKED)
        _keep_rights(place, whole)
        disk.exchange(whole, place)
    except OSError:  # no links, no exchange, rights that a copy would lose: the other way asks for none of these
        return False
    return True


def _link_others(source: Path, target: Path, left: int) -> int:
    """Link every file below a folder to its place below another, except where one stands; how many more may come."""
    for entry in os.scandir(source):
        left -= 1
        if left < 0:
            raise OSError(f"more than {_MOST_LINKED} files")
        place = target / entry.name
        if entry.is_dir(follow_symlinks=False):
            if not entry.name.startswith(_STAGE):
                place.mkdir()
                left = _link_others(Path(entry.path), place, left)
                _keep_rights(Path(entry.path), place)
        elif not os.path.lexists(place):
            os.link(entry.path, place, follow_symlinks=False)
    return left


def _keep_rights(source: Path, target: Path) -> None:
    old, new = source.stat(), target.stat()
    if (old.st_uid, old.st_gid) != (new.st_uid, new.st_gid):
        os.chown(target, old.st_uid, old.st_gid)
    shutil.copystat(source, target)


def _end_decided(place: Path) -> None:
    """Move files that are decided into their place: those of this run, or of one that was killed meanwhile."""
    decided = place / _DECIDED
    if decided.is_dir():
        for file in decided.iterdir():
            file.replace(place / file.name)
        decided.rmdir()


def _unwritable(folder: Path, error: OSError) -> OutputError:
    return OutputError(
        "the results cannot be written",
        file=folder,
        found=error.strerror or str(error),
        hint="free some space or rights there, or name another folder with -o/--output",
    )
