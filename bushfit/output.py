"""Results on disk: written aside, then renamed, so that a reader sees whole files or none."""

from __future__ import annotations

import json
import os
import re
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bushfit.errors import OutputError

_UNSAFE_IN_FOLDERS = re.compile(r'[\x00-\x1f\x7f/\\:*?"<>|]+')
_LONGEST_FOLDER = 60


def folder_name(name: str) -> str:
    """A name as that of one folder: it never leads out of the folder it is put in, and is never empty."""
    return _UNSAFE_IN_FOLDERS.sub("_", name)[:_LONGEST_FOLDER].strip(" .") or "campaign"


def to_json(document: Mapping[str, Any]) -> bytes:
    """A document as the bytes of its file."""
    return (json.dumps(document, indent=1, allow_nan=False, ensure_ascii=False) + "\n").encode()


def check_free(folder: Path, names: list[str], *, force: bool) -> None:
    """Refuse to replace results that stand.

    Raises:
        OutputError: the folder is a file, or holds one of the names and `force` is False.
    """
    if folder.exists() and not folder.is_dir():
        raise OutputError("the output is not a folder", file=folder, expected="a folder", hint="another -o/--output")
    standing = [name for name in names if (folder / name).exists()]
    if standing and not force:
        raise OutputError(
            "results stand there already",
            file=folder,
            found=", ".join(standing),
            hint="--force replaces them; -o/--output names another folder",
        )


def write_files(folder: Path, files: Mapping[str, bytes], *, force: bool) -> None:
    """Write a set of files into a folder, all of them or none.

    They are written into a hidden folder beside it first. Where the folder is new, one rename puts it in place;
    else each file is renamed over its predecessor.

    Raises:
        OutputError: the folder cannot be written, or holds results and `force` is False.
    """
    check_free(folder, list(files), force=force)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        aside = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
    except OSError as error:
        raise _unwritable(folder, error) from error
    try:
        for name, content in files.items():
            with (aside / name).open("xb") as stream:
                stream.write(content)
                stream.flush()
                os.fsync(stream.fileno())
        if folder.exists():
            for name in files:
                (aside / name).replace(folder / name)
        else:
            aside.chmod(0o777 & ~_umask())
            aside.rename(folder)
    except OSError as error:
        raise _unwritable(folder, error) from error
    finally:
        shutil.rmtree(aside, ignore_errors=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _unwritable(folder: Path, error: OSError) -> OutputError:
    return OutputError(
        "the results cannot be written",
        file=folder,
        found=error.strerror or str(error),
        hint="free some space or rights there, or name another folder with -o/--output",
    )
