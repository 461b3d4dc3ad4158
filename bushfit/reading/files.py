"""Files given by the user: their bytes, or one clear error."""

import codecs
import hashlib
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from bushfit.errors import BushfitError, did_you_mean

#: Bytes of the largest file that is read: three times a loop of 10 million rows.
_LARGEST_BYTES = 1 << 30
#: Bytes at the start of a file within which its header lies; chosen: far more than preambles have.
HEAD_BYTES = 1 << 18
#: Bytes that are checked at a time; chosen: few enough to be held beside the file, enough to be fast.
CHUNK_BYTES = 1 << 22


def view_bytes(
    file: Path, kind: type[BushfitError], *, largest: int = _LARGEST_BYTES, hint: str = "thin it out"
) -> bytes:
    """The bytes of a file: read and not mapped, because a mapped file that becomes shorter ends the process.

    Raises:
        kind: the file is missing, no regular file, not readable, empty, becomes shorter or longer meanwhile, or has
            more than `largest` bytes (with `hint`).
    """
    try:
        if not file.exists():
            raise _missing(file, kind)
        if not file.is_file():
            found = "a folder" if file.is_dir() else "a device"
            raise kind("this is not a file", file=file, found=found, expected="a file")
        if (size := file.stat().st_size) > largest:
            limit = f"at most {largest} bytes"
            raise kind("the file is too large", file=file, found=f"{size} bytes", expected=limit, hint=hint)
        with file.open("rb") as stream:
            data = stream.read(size + 1)
    except OSError as error:
        raise kind("the file cannot be read", file=file, found=error.strerror or str(error)) from error
    if len(data) != size:
        found = f"{'more than' if len(data) > size else f'{len(data)} of'} {size} bytes"
        hint = "wait until it is written, or copied, to its end"
        raise kind("the file changes while it is read", file=file, found=found, hint=hint)
    if data.isspace() or not data:
        raise kind("the file is empty", file=file, expected="text", hint="export it again")
    return data


def read_utf8(
    file: Path, kind: type[BushfitError], *, largest: int = _LARGEST_BYTES, hint: str = "thin it out"
) -> bytes:
    """The bytes of a text file in UTF-8; a byte order mark stays in place.

    Raises:
        kind: as `view_bytes`, or the file is not UTF-8 text.
    """
    data = view_bytes(file, kind, largest=largest, hint=hint)
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
        expected="an existing file; a relative path counts from here, or from the folder of the file that names it",
        hint=did_you_mean(file.name, siblings) or "check the path for a typing error",
    )


def not_utf8(data: bytes) -> int | None:
    """Index of the first byte that no text in UTF-8 has there; None where there is none."""
    if (zero := data.find(0)) >= 0:
        return zero
    decoder = codecs.getincrementaldecoder("utf-8")()
    for start in range(0, len(data), CHUNK_BYTES):
        try:
            decoder.decode(data[start : start + CHUNK_BYTES], final=start + CHUNK_BYTES >= len(data))
        except UnicodeDecodeError as error:
            return min(start + error.start, len(data) - 1)
    return None


def line_of(data: bytes, index: int) -> str:
    """The line of a byte in words, from 1."""
    number = data.count(b"\n", 0, index) + 1
    return f"line {number}"


def sha256(data: bytes) -> Future[str]:
    """SHA-256 of a file's bytes as hexadecimal digits, of many bytes made meanwhile in a thread."""
    if len(data) <= CHUNK_BYTES:
        made = Future[str]()
        made.set_result(hashlib.sha256(data).hexdigest())
        return made
    thread = ThreadPoolExecutor(1)
    digest = thread.submit(lambda: hashlib.sha256(data).hexdigest())
    thread.shutdown(wait=False)
    return digest
