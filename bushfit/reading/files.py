"""Files given by the user: their bytes, or one clear error."""

from __future__ import annotations

import codecs
import hashlib
import mmap
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from threading import Thread
from typing import TypeVar

from bushfit.errors import BushfitError, did_you_mean

#: Bytes of the largest file that is read: ten times a loop of 10 million rows.
_LARGEST_BYTES = 4 << 30
#: Bytes from which a file is mapped and not copied, and its checksum made in a thread; chosen: a smaller one takes
#: milliseconds.
_MAPPED_BYTES = 1 << 22
#: Bytes at the start of a file in which anything but blanks is looked for first; chosen: nearly every file has some.
_HEAD_BYTES = 1 << 16
#: Bytes that are decoded at a time; chosen: few enough to be held beside the file, enough to be fast.
_CHUNK_BYTES = 1 << 22

#: The bytes of a file: copied, or where the system keeps those of a large one.
Bytes = bytes | mmap.mmap
_AnyBytes = TypeVar("_AnyBytes", bytes, Bytes)


def read_bytes(
    file: Path, kind: type[BushfitError], *, largest: int = _LARGEST_BYTES, hint: str = "thin it out"
) -> bytes:
    """The bytes of a file, read once.

    Raises:
        kind: the file is missing, no regular file, not readable, empty, or has more than `largest` bytes (with `hint`).
    """
    return _checked(file, kind, largest, hint, Path.read_bytes)


def view_bytes(file: Path, kind: type[BushfitError]) -> Bytes:
    """The bytes of a file that may be large, without copying them.

    Raises:
        kind: the same as of `read_bytes`.
    """
    return _checked(file, kind, _LARGEST_BYTES, "thin it out", _view)


def _view(file: Path) -> Bytes:
    """The bytes of a file, mapped where it is large."""
    with file.open("rb") as stream:
        if file.stat().st_size < _MAPPED_BYTES:
            return stream.read()
        return mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)


def _checked(
    file: Path, kind: type[BushfitError], largest: int, hint: str, read: Callable[[Path], _AnyBytes]
) -> _AnyBytes:
    """What `read` gives of a file, which has to be there, regular, not too large and not empty."""
    try:
        if not file.exists():
            raise _missing(file, kind)
        if not file.is_file():
            found = "a folder" if file.is_dir() else "a device"
            raise kind("this is not a file", file=file, found=found, expected="a file")
        if (size := file.stat().st_size) > largest:
            limit = f"at most {largest} bytes"
            raise kind("the file is too large", file=file, found=f"{size} bytes", expected=limit, hint=hint)
        data = read(file)
    except OSError as error:
        raise kind("the file cannot be read", file=file, found=error.strerror or str(error)) from error
    if (data[:_HEAD_BYTES].isspace() and data[:].isspace()) or not data:
        raise kind("the file is empty", file=file, expected="text", hint="export it again")
    return data


def read_utf8(
    file: Path, kind: type[BushfitError], *, largest: int = _LARGEST_BYTES, hint: str = "thin it out"
) -> bytes:
    """The bytes of a text file in UTF-8; a byte order mark stays in place.

    Raises:
        kind: as `read_bytes`, or the file is not UTF-8 text.
    """
    data = read_bytes(file, kind, largest=largest, hint=hint)
    if (bad := not_utf8(data)) is not None:
        raise kind(
            "the file is not UTF-8 text",
            file=file,
            place=line_of(data, bad),
            found=f"byte 0x{data[bad]:02x}",
            expected="text in UTF-8, with or without byte order mark",
            hint="save it as UTF-8, or convert it: iconv -f LATIN1 -t UTF-8 old > new",
        )
    return data


def _missing(file: Path, kind: type[BushfitError]) -> BushfitError:
    """The error for a file that is not there, with the name beside it that is most alike."""
    siblings = [path.name for path in file.parent.iterdir()] if file.parent.is_dir() else []
    return kind(
        "there is no such file",
        file=file,
        expected="an existing file; a relative path counts from the folder of the file that names it",
        hint=did_you_mean(file.name, siblings) or "check the path for a typing error",
    )


def not_utf8(data: bytes) -> int | None:
    """Index of the first byte that no text in UTF-8 has there; None where there is none."""
    if (zero := data.find(0)) >= 0:
        return zero
    decoder = codecs.getincrementaldecoder("utf-8")()
    for start in range(0, len(data), _CHUNK_BYTES):
        try:
            decoder.decode(data[start : start + _CHUNK_BYTES], final=start + _CHUNK_BYTES >= len(data))
        except UnicodeDecodeError as error:
            return min(start + error.start, len(data) - 1)
    return None


def line_of(data: bytes, index: int) -> str:
    """The line of a byte in words, from 1."""
    number = data.count(b"\n", 0, index) + 1
    return f"line {number}"


def sha256(data: Bytes) -> Future[str]:
    """SHA-256 of a file's bytes as hexadecimal digits; that of a large file is made meanwhile, in a thread."""
    future: Future[str] = Future()

    def digest() -> None:
        future.set_result(hashlib.sha256(data).hexdigest())

    if len(data) >= _MAPPED_BYTES:
        Thread(target=digest).start()
    else:
        digest()
    return future
