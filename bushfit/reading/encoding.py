"""Bytes of a test file -> UTF-8, whatever the file is encoded in.

Test files are ASCII but for a few letters of their header, which is too little for detectors that count letters:
tests/benchmarks/test_dialects_elsewhere.py compares charset-normalizer and chardet on such files. So the bytes decide
here: a byte order mark, zeros beside ASCII (UTF-16), what is valid UTF-8, pairs of common Chinese characters (GB18030),
and for the rest Western Latin (cp1252, or Latin-1 where it uses bytes that cp1252 lacks).
"""

from __future__ import annotations

import codecs
import re
from pathlib import Path

import numpy as np

from bushfit.errors import MeasurementError
from bushfit.reading.files import Bytes
from bushfit.reading.parallel import by_chunks

_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_CHUNK = 1 << 22
_SAMPLE = 1 << 16
_HIGH_RUN = re.compile(rb"[\x80-\xff]+")
#: Two bytes of GB2312: its punctuation and its 3755 commonest characters. Western accents make few such pairs.
_COMMON_CHINESE = re.compile(rb"(?:[\xa1-\xa3\xb0-\xd7][\xa1-\xfe])+")


def to_utf8(data: Bytes, file: Path, stated: str | None = None) -> tuple[Bytes, str]:
    """A text as UTF-8 without byte order mark, and the encoding it had.

    Args:
        data: the file's bytes.
        file: for errors.
        stated: the encoding, where the user knows it.

    Raises:
        MeasurementError: no text, or not in the encoding stated.
    """
    if stated is None and _is_ascii(data):
        return data, "utf-8"
    data = data[:]
    encoding = stated or detect(data)
    if encoding in ("utf-8", "utf-8-sig"):
        without_mark = data.removeprefix(codecs.BOM_UTF8)
        if (bad := _not_utf8(without_mark)) is None:
            return without_mark, "utf-8"
        raise _undecodable(data, file, bad, "utf-8")
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError as error:
        raise _undecodable(data, file, error.start, encoding) from None
    except LookupError:
        raise MeasurementError(
            "unknown encoding",
            file=file,
            found=f'"{stated}"',
            expected='a name such as "utf-8", "utf-16", "cp1252", "latin-1" or "gb18030"',
        ) from None
    return text.removeprefix("\ufeff").encode(), encoding


def _is_ascii(data: Bytes) -> bool:
    """Whether all bytes are from 1 to 127."""
    codes = np.frombuffer(data, dtype=np.int8)
    return all(by_chunks(lambda part: bool(codes[part].min() > 0), codes.size, _CHUNK))


def detect(data: bytes) -> str:
    """The encoding of a text, by Python's name; "utf-8" also for what is no text at all."""
    for mark, encoding in _MARKS:
        if data.startswith(mark):
            return encoding
    if 0 in (head := data[:_SAMPLE]):
        even, odd = head[::2].count(0), head[1::2].count(0)
        if max(even, odd) > 0.3 * len(head) / 2 and min(even, odd) == 0:
            return "utf-16-le" if odd else "utf-16-be"
        return "utf-8"
    if _not_utf8(data) is None:
        return "utf-8"
    runs = _HIGH_RUN.findall(data)[:_SAMPLE]
    chinese = sum(_COMMON_CHINESE.fullmatch(run) is not None for run in runs)
    for encoding in ("gb18030", "cp1252") if 2 * chinese > len(runs) else ("cp1252", "gb18030"):
        try:
            data.decode(encoding)
        except UnicodeDecodeError:
            continue
        return encoding
    return "latin-1"


def _not_utf8(data: bytes) -> int | None:
    """Index of the first byte that UTF-8 text cannot have; None where there is none."""
    if (zero := data.find(0)) >= 0:
        return zero
    decoder = codecs.getincrementaldecoder("utf-8")()
    for start in range(0, len(data), _CHUNK):
        try:
            decoder.decode(data[start : start + _CHUNK], final=start + _CHUNK >= len(data))
        except UnicodeDecodeError as error:
            return min(start + error.start, len(data) - 1)
    return None


def _undecodable(data: bytes, file: Path, bad: int, encoding: str) -> MeasurementError:
    line = data.count(b"\n", 0, bad) + 1
    return MeasurementError(
        "this is not text" if data[bad] == 0 else f"this is not {encoding.upper()} text",
        file=file,
        place=f"line {line}",
        found=f"byte 0x{data[bad]:02x}",
        expected="a table as text (UTF-8, UTF-16, Latin-1 or GB18030), or an xlsx workbook",
        hint='export it as "CSV UTF-8", or state encoding = "..." in the campaign',
    )
