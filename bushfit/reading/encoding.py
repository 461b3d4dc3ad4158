"""The encoding of a test file, and its text as UTF-8.

Notes:
    Test files are ASCII but for a few letters of their header, too few for detectors that count letters, such as
    charset-normalizer and chardet. Here the bytes decide, in this order: a byte order mark; zeros beside ASCII
    (UTF-16); valid UTF-8; pairs of common Chinese characters (GB18030); and Western Latin for the rest (cp1252, or
    Latin-1 where it has bytes that cp1252 lacks).
"""

import codecs
import io
import re
from contextlib import suppress
from pathlib import Path

from bushfit.errors import MeasurementError
from bushfit.reading.files import CHUNK_BYTES, HEAD_BYTES, line_of, not_utf8

#: Byte order marks, and Python's name of the encoding that each tells. UTF-32's begins with UTF-16's.
_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
#: Share of zeros among every other byte from which a text is taken for UTF-16; ASCII has nearly all of them zero.
_LEAST_ZERO_SHARE = 0.3
#: Runs of bytes beyond ASCII that are compared; chosen: many times those of a header.
_MOST_RUNS = 1 << 16
#: A run of bytes beyond ASCII.
_HIGH_RUN = re.compile(rb"[\x80-\xff]+")
#: Two bytes of GB2312: its punctuation and its 3755 commonest characters. Western accents make few such pairs.
_COMMON_CHINESE = re.compile(rb"(?:[\xa1-\xa3\xb0-\xd7][\xa1-\xfe])+")


def to_utf8(data: bytes, file: Path, stated: str | None = None) -> tuple[bytes, str]:
    """A text as UTF-8 without byte order mark, and the encoding it had; errors name `file`.

    Raises:
        MeasurementError: no text, or not in the encoding stated.
    """
    if stated is None and data.isascii() and 0 not in data:
        return data, "utf-8"
    encoding = stated or detect(data)
    if encoding in ("utf-8", "utf-8-sig"):
        without_mark = data.removeprefix(codecs.BOM_UTF8)
        if (bad := not_utf8(without_mark)) is None:
            return without_mark, "utf-8"
        raise _undecodable(data, file, bad, "utf-8")
    raw = io.BytesIO(data)
    try:
        text = io.TextIOWrapper(raw, encoding, newline="")  # decoded in one piece, it would take four times its bytes
        parts = [part.encode("utf-8", "replace") for part in iter(lambda: text.read(CHUNK_BYTES), "")]
    except UnicodeDecodeError as error:
        raise _undecodable(data, file, raw.tell() - len(error.object) + error.start, encoding) from None
    except LookupError:
        raise MeasurementError(
            "unknown encoding",
            file=file,
            found=f'"{stated}"',
            expected='a name such as "utf-8", "utf-16", "cp1252", "latin-1" or "gb18030"',
        ) from None
    return b"".join(parts).removeprefix(codecs.BOM_UTF8), encoding


def detect(data: bytes) -> str:
    """Python's name of the encoding of a text; "utf-8" also where it is no text."""
    for mark, encoding in _MARKS:
        if data.startswith(mark):
            return encoding
    if 0 in data:
        head = data[:HEAD_BYTES]
        even, odd = head[::2].count(0), head[1::2].count(0)
        if max(even, odd) > _LEAST_ZERO_SHARE * len(head) / 2 and min(even, odd) == 0:
            return "utf-16-le" if odd else "utf-16-be"
        return "utf-8"
    if not_utf8(data) is None:
        return "utf-8"
    runs = _HIGH_RUN.findall(data)[:_MOST_RUNS]
    chinese = sum(_COMMON_CHINESE.fullmatch(run) is not None for run in runs)
    for encoding in ("gb18030", "cp1252") if 2 * chinese > len(runs) else ("cp1252", "gb18030"):
        with suppress(UnicodeDecodeError):
            data.decode(encoding)
            return encoding
    return "latin-1"


def _undecodable(data: bytes, file: Path, bad: int, encoding: str) -> MeasurementError:
    """The error for a byte, by its index, that a text in this encoding does not have."""
    return MeasurementError(
        "this is not text" if data[bad] == 0 else f"this is not {encoding.upper()} text",
        file=file,
        place=line_of(data, bad),
        found=f"byte 0x{data[bad]:02x}",
        expected="a table as text (UTF-8, UTF-16, Latin-1 or GB18030), a workbook, or a recording such as .tdms",
        hint='export it as "CSV UTF-8", or state encoding = "..." in the campaign',
    )
