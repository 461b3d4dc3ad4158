"""How many of the dialects that bushfit reads other libraries read, each left to itself and told what a file is like:

    pytest tests/benchmarks/test_dialects_elsewhere.py -m slow -s

bushfit reads all of them, as tests/reading/test_dialects.py shows.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from dialects import DIALECTS, Kind, expected

from bushfit.reading.encoding import detect
from bushfit.reading.measurement import Floats
from bushfit.reading.numerals import Numerals

pytestmark = pytest.mark.slow

chardet, charset_normalizer, clevercsv, duckdb, polars = (
    pytest.importorskip(name, reason="the group bench is not installed")
    for name in ("chardet", "charset_normalizer", "clevercsv", "duckdb", "polars")
)

#: Typographic separators, as the plain ones that they count as.
SEPARATORS = {"\u00a0": " ", "\u202f": " ", "\u2019": "'"}

Rows = Iterable[Sequence[object]]


def rows_by_sniffing(sniffed: Any, file: Path) -> Rows:
    text = file.read_text("utf-8-sig")
    return sniffed.reader(io.StringIO(text), sniffed.Sniffer().sniff(text))


CANDIDATES: dict[str, Callable[[Path], Rows]] = {
    "csv.Sniffer": partial(rows_by_sniffing, csv),
    "clevercsv": partial(rows_by_sniffing, clevercsv),
    "DuckDB": lambda file: duckdb.sql(f"select * from read_csv('{file}', all_varchar = true)").fetchall(),
    "polars": lambda file: polars.read_csv(file, infer_schema=False).rows(),
    "pandas": lambda file: pd.read_csv(file, sep=None, engine="python", dtype=str).to_numpy().tolist(),
}


def numbers(rows: Rows, numerals: Numerals) -> list[Floats]:
    """The columns of numbers below a header, wherever that is; blank rows are left out."""
    table = [[numerals.value(str(cell).strip()) for cell in row] for row in rows if any(str(c).strip() for c in row)]
    first = next(index for index, row in enumerate(table) if sum(cell is not None for cell in row) > 1)
    columns = zip(*table[first:], strict=True)
    return [np.array(column, dtype=float) for column in columns if None not in column]


def is_right(candidate: Callable[[Path], Rows], file: Path, kind: Kind, numerals: Numerals) -> bool:
    """Whether all columns are found; a refusal counts as other numbers do."""
    try:
        found = numbers(candidate(file), numerals)
    except Exception:
        return False
    return all(any(np.array_equal(column, other) for column in found) for other in expected(kind))


def test_candidates_for_the_detection(tmp_path: Path) -> None:
    """csv.Sniffer and pandas with it, clevercsv, DuckDB and polars on all dialects, which bushfit reads without an
    exception: first each left to itself, then told the encoding and how numbers are written, so that only the
    delimiter and where the table begins are left to find."""
    counts = {(candidate, told): 0 for candidate in CANDIDATES for told in (False, True)}
    print(f"\n{'':30}" + " ".join(name.ljust(12) for name in CANDIDATES))
    for name, dialect in DIALECTS.items():
        alone, told = tmp_path / "alone.csv", tmp_path / "told.csv"
        alone.write_bytes(dialect.bytes())
        told.write_text(dialect.text(), encoding="utf-8", newline="")
        numerals = Numerals(dialect.decimal, SEPARATORS.get(dialect.thousands, dialect.thousands) or None)
        line = f"{name:30}"
        for candidate, rows in CANDIDATES.items():
            by_itself = is_right(rows, alone, dialect.kind, Numerals())
            when_told = is_right(rows, told, dialect.kind, numerals)
            counts[candidate, False] += by_itself
            counts[candidate, True] += when_told
            line += ("right" if by_itself else "if told" if when_told else "-").ljust(13)
        print(line)
    for (candidate, told_it), count in counts.items():
        print(f"{candidate}{' (told)' * told_it}: {count} of {len(DIALECTS)}")
    assert len(DIALECTS) >= 40
    assert max(counts.values()) < len(DIALECTS)


def test_candidates_for_the_encoding() -> None:
    """charset-normalizer and chardet against the ladder of bushfit.encoding, on all dialects with other than ASCII."""
    detectors: dict[str, Callable[[bytes], str | None]] = {
        "charset-normalizer": lambda data: getattr(charset_normalizer.from_bytes(data).best(), "encoding", None),
        "chardet": lambda data: chardet.detect(data)["encoding"],
        "bushfit": detect,
    }
    counts = dict.fromkeys(detectors, 0)
    special = {name: dialect for name, dialect in DIALECTS.items() if not dialect.bytes().isascii()}
    for name, dialect in special.items():
        data, text = dialect.bytes(), dialect.text()
        said = {detector: detect_in(data) for detector, detect_in in detectors.items()}
        for detector, encoding in said.items():
            counts[detector] += decoded(data, encoding) == text
        print(f"{name:32}" + ", ".join(f"{detector} {encoding}" for detector, encoding in said.items()))
    print(f"{len(special)} dialects: " + ", ".join(f"{detector} {count}" for detector, count in counts.items()))
    assert counts.pop("bushfit") == len(special)
    assert max(counts.values()) < len(special)


def decoded(data: bytes, encoding: str | None) -> str | None:
    try:
        return data.decode(encoding or "utf-8").removeprefix("\ufeff")
    except UnicodeDecodeError:
        return None
