"""Files of the user's: their bytes, or one clear error."""

from __future__ import annotations

import os
from pathlib import Path
from typing import BinaryIO

import pytest

from bushfit.errors import CampaignError, MeasurementError
from bushfit.geometry import Direction
from bushfit.reading.files import detect, read_utf8, to_utf8, view_bytes
from bushfit.reading.loops import read_loop
from bushfit.reading.stated import LoopFile


def test_bytes_come_as_they_are_up_to_a_number_and_the_error_is_of_the_kind_asked_for(tmp_path: Path) -> None:
    file = tmp_path / "x.toml"
    file.write_bytes(b"\xef\xbb\xbf1\r\n")
    assert view_bytes(file, CampaignError, largest=6) == read_utf8(file, CampaignError) == b"\xef\xbb\xbf1\r\n"
    with pytest.raises(CampaignError, match=r"too large[\s\S]*6 bytes[\s\S]*at most 5 bytes[\s\S]*give another"):
        view_bytes(file, CampaignError, largest=5, hint="give another")


@pytest.mark.parametrize(
    ("then", "found"), [(8_000_000, "8000000 of 9600000"), (0, "0 of 9600000"), (10_000_000, "more than 9600000")]
)
def test_a_file_that_changes_while_it_is_read(then: int, found: str, tmp_path: Path) -> None:
    """As a test machine, or a copy over the network, may do: in a moment between its opening and its first byte."""

    class Changing(type(tmp_path)):  # type: ignore[misc]
        def open(self, mode: str) -> BinaryIO:
            stream: BinaryIO = super().open(mode)
            os.truncate(self, then)
            return stream

    (tmp_path / "loop.csv").write_text("time_s,displacement_mm,force_N\n" + "\n" * 9_599_969)
    with pytest.raises(MeasurementError, match=f"file changes while it is read\n  found: {found} bytes\n  try: wait"):
        read_loop(Changing(tmp_path / "loop.csv"), Direction.AXIAL, LoopFile(file="loop.csv"))


def test_bytes_tell_their_encoding_unless_it_is_stated() -> None:
    """What the dialects do not show."""
    assert detect("Prüfweg\x81".encode("latin-1")) == "latin-1"
    assert detect("time".encode("utf-16-be")) == "utf-16-be"
    data = "Prüfweg".encode()
    assert to_utf8(data, Path("x.csv"), "latin-1") == ("PrÃ¼fweg".encode(), "latin-1")
    with pytest.raises(MeasurementError, match=r'unknown encoding[\s\S]*"utf-9"'):
        to_utf8(data, Path("x.csv"), "utf-9")


@pytest.mark.parametrize(
    ("data", "stated", "words"),
    [
        (b"time\nforce\0c\n", None, r"x.csv, line 2: this is not text[\s\S]*0x00"),
        (b"a\0b\0\0c", None, "this is not text"),
        (b"a\n\nb\xfc\n", "utf-8", r"x.csv, line 3: this is not UTF-8 text[\s\S]*0xfc"),
        ("a\nb".encode("utf-16")[:-1], None, r"this is not UTF-16 text"),
    ],
)
def test_what_is_no_text_is_named_with_its_line(data: bytes, stated: str | None, words: str) -> None:
    with pytest.raises(MeasurementError, match=words):
        to_utf8(data, Path("x.csv"), stated)
