"""Read files given by the user, as bytes or as UTF-8 text, with one clear error."""

import codecs
import gzip
import hashlib
import html
import io
import re
import unicodedata
import zlib
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

from bushfit.errors import BushfitError, MeasurementError, did_you_mean
from bushfit.reading.headers import ERRORS, WORDS

#: Size of the largest file that is read [bytes]: three times that of a loop of 10 million rows.
_LARGEST_BYTES = 1 << 30
#: Bytes at the start of a file within which its header lies; chosen: far more than preambles have.
HEAD_BYTES = 1 << 18
#: Bytes that are checked at a time; chosen: few enough to fit in memory next to the file, enough to be fast.
CHUNK_BYTES = 1 << 22
#: Byte order marks with Python's name of the encoding. The mark of UTF-32 begins with that of UTF-16.
_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
#: Quoted cell of a header with a line end, such as "Force(line end)[N]".
_QUOTED_LINE_END = re.compile(rb'(?:^|(?<=[,;\t\r\n]))"[^"\r\n,;\t]+(?:\r?\n[^"\r\n,;\t]+){1,2}"(?=[,;\t\r\n])')
#: Smallest share of zeros among the even or odd bytes of UTF-16; for ASCII characters nearly all of them are zero.
_LEAST_ZERO_SHARE = 0.3
#: Largest number of runs of non-ASCII bytes that are compared; chosen: many times those of a header.
_MOST_RUNS = 1 << 16
#: Encodings that are detected only by known column names: Japanese, Korean, Central European, Cyrillic, Turkish.
_RARE = ("cp932", "cp949", "cp1250", "cp1251", "cp1254")
#: Known column names with non-ASCII letters; chosen: two characters or more, which do not occur by chance.
_KNOWN_WORDS = frozenset(
    word.lower()
    for table in WORDS.values()
    for words in table.values()
    for word in words
    if len(word) > 1 and not word.isascii()
)
#: Cell that is written as the formula of its text, as in ="0.1"; line that is quoted as a whole.
_QUOTED_CELL = re.compile(r'"?="+([^"\n]*)"+')
_QUOTED_LINE = re.compile(r'^"([^"\n]*[;,\t][^"\n]*)"(?=[;,]*\r?$)', re.MULTILINE)
#: Time at which a serial monitor received a line: "12:01:02.123 -> 1.2,3.4".
_RECEIVED = re.compile(r"^(\d\d:\d\d:\d\d(?:[.,]\d+)?) -> ", re.MULTILINE)
#: HTML entity such as &micro; and characters of UTF-8 that were decoded as cp1252.
_ENTITY = re.compile(r"&(?:#\d{1,5}|[A-Za-z]{2,8}\d?);")
_READ_AS_CP1252 = re.compile(r"[Â-ß][^\x00-\x7f]|[à-ï][^\x00-\x7f]{2}")
#: Characters without a width; characters of full or half width, and units of one character, such as mm and Hz.
_INVISIBLE = re.compile("[\u200b-\u200f\u2060\ufeff]")
_OTHER_WIDTH = re.compile("[\uff0c-\uff1a\uff21-\uff3a\uff41-\uff5a\uff66-\uff9f\u3300-\u33ff]+")
#: Run of non-ASCII bytes.
_HIGH_RUN = re.compile(rb"[\x80-\xff]+")
#: Two bytes of GB2312: its punctuation and its 3755 commonest characters. Western accents make few such pairs.
_COMMON_CHINESE = re.compile(rb"(?:[\xa1-\xa3\xb0-\xd7][\xa1-\xfe])+")


def view_bytes(
    file: Path, kind: type[BushfitError], *, largest: int = _LARGEST_BYTES, hint: str = "thin it out"
) -> bytes:
    """Read the whole content of a file, with a clear error if that is not possible.

    Args:
        file: path of the file.
        kind: class of the exception to raise.
        largest: largest allowed size of the file [bytes].
        hint: next step to suggest if the file is larger.

    Returns:
        Content in memory; not memory-mapped, because a mapped file that becomes shorter ends the process.

    Raises:
        kind: the file is missing, not a regular file, unreadable, empty, too large, or changes in size during reading.
    """
    try:
        if not file.exists():
            if file.is_symlink():
                raise kind("this link leads to no file", file=file, found=f"a link to {file.readlink()}")
            siblings = [path.name for path in file.parent.iterdir()] if file.parent.is_dir() else []
            # a name with another number is another part or test
            similar = [name for name in siblings if re.findall(r"\d+", name) == re.findall(r"\d+", file.name)]
            hint = did_you_mean(file.name, similar, similarity=0.85) or "check the path for a typing error"
            raise kind("there is no such file", file=file, expected="an existing file", hint=hint)
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
        raise kind(**ERRORS["changing_file"], file=file, found=found)
    if data.isspace() or not data:
        raise kind("the file is empty", file=file, expected="text", hint="export it again")
    return data


def unpack_gzip(data: bytes, file: Path) -> bytes:
    """Return the content of a file packed by gzip; the bytes of any other file are unchanged.

    Raises:
        MeasurementError: the packed file is damaged, or its content is too large.
    """
    if not data.startswith(b"\x1f\x8b"):
        return data
    try:
        with gzip.open(io.BytesIO(data)) as packed:
            packed.seek(_LARGEST_BYTES)  # keeps nothing in memory
            if packed.read(1):
                found = f"more than {_LARGEST_BYTES} bytes when unpacked"
                raise MeasurementError("the file is too large", file=file, found=found, hint="thin it out")
            packed.seek(0)
            return packed.read()
    except (OSError, EOFError, zlib.error) as error:
        raise MeasurementError("the file is damaged", file=file, found=str(error), hint="pack it again") from error


def read_utf8(
    file: Path, kind: type[BushfitError], *, largest: int = _LARGEST_BYTES, hint: str = "thin it out"
) -> bytes:
    """Return the bytes of a text file after checking that they are valid UTF-8; a byte order mark is kept.

    Args:
        file: path of the file.
        kind: class of the exception to raise.
        largest: largest allowed size of the file [bytes].
        hint: next step to suggest if the file is larger.

    Raises:
        kind: the file cannot be read (see `view_bytes`), or is not UTF-8 text.
    """
    data = view_bytes(file, kind, largest=largest, hint=hint)
    if (bad := not_utf8(data)) is not None:
        raise kind(**ERRORS["not_utf8"], file=file, place=line_of(data, bad), found=f"byte 0x{data[bad]:02x}")
    return data


def not_utf8(data: bytes) -> int | None:
    """Return the index of the first byte that is zero or not valid UTF-8; None if all bytes are valid text."""
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
    """Return the line that contains the byte at an index of a text, such as "line 3"; lines count from 1."""
    number = data.count(b"\n", 0, index) + 1
    return f"line {number}"


def sha256(data: bytes) -> Future[str]:
    """Return a future with the SHA-256 of bytes in hexadecimal digits, computed in a thread if there are many bytes."""
    if len(data) <= CHUNK_BYTES:
        digest = Future[str]()
        digest.set_result(hashlib.sha256(data).hexdigest())
        return digest
    thread = ThreadPoolExecutor(1)
    digest = thread.submit(lambda: hashlib.sha256(data).hexdigest())
    thread.shutdown(wait=False)
    return digest


def join_quoted(data: bytes) -> bytes:
    """Replace line ends inside quoted header cells of a UTF-8 text by blanks, so that the header is one line."""
    head = data[:HEAD_BYTES]
    if b'"' not in head:
        return data
    joined = _QUOTED_LINE_END.sub(lambda match: b" ".join(match[0].split()), head)
    return data if joined == head else joined + data[HEAD_BYTES:]


def to_utf8(data: bytes, file: Path, stated_encoding: str | None = None) -> tuple[bytes, str]:
    """Convert the text of a file to UTF-8.

    Args:
        data: bytes of the file.
        file: path, for errors.
        stated_encoding: encoding given by the user; None to detect it.

    Returns:
        Text in UTF-8 without byte order mark, and Python's name of the original encoding.

    Raises:
        MeasurementError: the file is not text, or not in the given encoding.
    """
    if stated_encoding is None and data.isascii() and 0 not in data:
        return _plain_bytes(data), "utf-8"
    encoding = stated_encoding or detect_encoding(data)
    if encoding in ("utf-8", "utf-8-sig"):
        without_mark = data.removeprefix(codecs.BOM_UTF8)
        if (bad := not_utf8(without_mark)) is None:
            return _plain_bytes(without_mark), "utf-8"
        raise _decoding_error(data, file, bad, "utf-8")
    raw = io.BytesIO(data)
    try:
        text = io.TextIOWrapper(raw, encoding, newline="")  # decoded in one piece, it would take four times its bytes
        parts = [part.encode("utf-8", "replace") for part in iter(lambda: text.read(CHUNK_BYTES), "")]
    except UnicodeDecodeError as error:
        raise _decoding_error(data, file, raw.tell() - len(error.object) + error.start, encoding) from None
    except UnicodeError:  # UTF-16 or UTF-32 without a byte order mark
        raise _decoding_error(data, file, 0, encoding) from None
    except LookupError:
        raise MeasurementError(**ERRORS["unknown_encoding"], file=file, found=f'"{stated_encoding}"') from None
    return _plain_bytes(b"".join(parts).removeprefix(codecs.BOM_UTF8)), encoding


def _plain_bytes(data: bytes) -> bytes:
    """Apply `plain_text` to the lines of a text in UTF-8; to its first lines alone if the text is large."""
    end = data.rfind(b"\n", 0, CHUNK_BYTES) + 1 if len(data) > CHUNK_BYTES else len(data)
    return plain_text(data[:end].decode("utf-8")).encode("utf-8") + data[end:]


def plain_text(text: str) -> str:
    """Replace other spellings of the characters in a text or cell by the usual ones.

    Letters and digits of full or half width become plain ones, and HTML entities the characters they stand for; UTF-8
    that was read as cp1252 ("Âµ") is repaired, and quotation marks that keep a program from reading a cell or a whole
    line, as in ="0.1", are dropped. The time before an arrow in the log of a serial monitor becomes a cell.

    Returns:
        The text, with as many lines.
    """
    if '"' in text:
        text = _QUOTED_CELL.sub(r'"\1"', text)
        lines = _QUOTED_LINE.findall(text)
        text = _QUOTED_LINE.sub(r"\1", text) if 2 * len(lines) > text.count("\n") else text
    if " -> " in text:
        text = _RECEIVED.sub("\\1" + next((mark for mark in ";\t," if mark in text), " "), text)
    if "&" in text:
        text = _ENTITY.sub(lambda match: html.unescape(match[0]), text)
    if text.isascii():
        return text
    text = _READ_AS_CP1252.sub(_as_utf8, _INVISIBLE.sub("", text))
    return _OTHER_WIDTH.sub(lambda match: unicodedata.normalize("NFKC", match[0]), text)


def _as_utf8(match: re.Match[str]) -> str:
    """Decode characters as UTF-8 that were decoded as cp1252; unchanged if they are not valid UTF-8."""
    try:
        return match[0].encode("cp1252").decode("utf-8")
    except UnicodeError:
        return match[0]


def detect_encoding(data: bytes) -> str:
    """Detect the encoding of a text.

    Args:
        data: bytes of the file.

    Returns:
        Python's name of the encoding; "utf-8" if the bytes are not text.

    Notes:
        Test files are ASCII except for a few letters in their header, too few for detectors that count letters, such as
        charset-normalizer and chardet. Here the bytes decide, in this order: a byte order mark; zeros beside ASCII
        (UTF-16); valid UTF-8; the encoding in which most names of columns are found; pairs of common Chinese characters
        (GB18030); and Western Latin for the rest (cp1252, or Latin-1 if cp1252 lacks a byte).
    """
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
    is_chinese = 2 * sum(_COMMON_CHINESE.fullmatch(run) is not None for run in runs) > len(runs)
    usual = ["gb18030", "cp1252"] if is_chinese else ["cp1252", "gb18030"]
    heads = {encoding: data[:HEAD_BYTES].decode(encoding, "ignore").lower() for encoding in (*usual, *_RARE)}
    counts = {encoding: sum(word in head for word in _KNOWN_WORDS) for encoding, head in heads.items()}
    for encoding in sorted(counts, key=lambda encoding: -counts[encoding]):
        if encoding in usual or counts[encoding]:
            with suppress(UnicodeDecodeError):
                data.decode(encoding)
                return encoding
    return "latin-1"


def _decoding_error(data: bytes, file: Path, bad: int, encoding: str) -> MeasurementError:
    """Error for the byte at index `bad`, which is not valid in the encoding."""
    return MeasurementError(
        "this is not text" if data[bad] == 0 else f"this is not {encoding.upper()} text",
        file=file,
        place=line_of(data, bad),
        found=f"byte 0x{data[bad]:02x}",
        **ERRORS["not_text"],
    )
