"""Encodings: texts of few letters are read as what they are, and what is no text is named with its line."""

from __future__ import annotations

from pathlib import Path

import pytest

from bushfit.errors import MeasurementError
from bushfit.reading.encoding import detect, to_utf8

FILE = Path("x.csv")


@pytest.mark.parametrize(
    ("data", "encoding"),
    [
        (b"time [s]\n", "utf-8"),
        ("Prüfweg".encode(), "utf-8"),
        ("Prüfweg".encode("cp1252"), "cp1252"),
        ("Prüfweg\x81".encode("latin-1"), "latin-1"),
        ("位移,载荷".encode("gb18030"), "gb18030"),
        ("time".encode("utf-16-le"), "utf-16-le"),
        ("time".encode("utf-16-be"), "utf-16-be"),
        (b"\xff\xfet\0", "utf-16"),
        (b"a\0b\0\0c", "utf-8"),
    ],
)
def test_bytes_tell_their_encoding(data: bytes, encoding: str) -> None:
    assert detect(data) == encoding


def test_a_stated_encoding_goes_before_what_the_bytes_tell() -> None:
    data = "Prüfweg".encode()
    assert to_utf8(data, FILE, "latin-1") == ("PrÃ¼fweg".encode(), "latin-1")
    with pytest.raises(MeasurementError, match=r'unknown encoding[\s\S]*"utf-9"'):
        to_utf8(data, FILE, "utf-9")


@pytest.mark.parametrize(
    ("data", "stated", "words"),
    [
        (b"time\nforce\0c\n", None, r"x.csv, line 2: this is not text[\s\S]*0x00"),
        (b"a\n\nb\xfc\n", "utf-8", r"x.csv, line 3: this is not UTF-8 text[\s\S]*0xfc"),
        ("a\nb".encode("utf-16")[:-1], None, r"this is not UTF-16 text"),
    ],
)
def test_what_is_no_text_is_named_with_its_line(data: bytes, stated: str | None, words: str) -> None:
    with pytest.raises(MeasurementError, match=words):
        to_utf8(data, FILE, stated)
