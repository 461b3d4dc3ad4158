"""Records of all rows, on disk: in memory is where each begins, and of each quantity an array over the rows."""

from __future__ import annotations

import json
from array import array
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from bushfit.batch.ledger import Record
from bushfit.batch.quantities import figures
from bushfit.effects.contract import Array


class Spool:
    """Takes records in any order, gives them back in the order of rows."""

    def __init__(self, path: Path, count: int) -> None:
        self._stream = path.open("w+b")
        self._begins = array("q", [-1]) * count

    def __enter__(self) -> Spool:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()

    def put(self, number: int, line: bytes) -> None:
        self._begins[number] = self._stream.seek(0, 2)
        self._stream.write(line)

    def __iter__(self) -> Iterator[Record]:
        for begin in self._begins:
            self._stream.seek(begin)
            yield json.loads(self._stream.readline())

    def columns(self) -> dict[str, Array]:
        """Values of every quantity over the rows, (n,), NaN where a row has none."""
        columns: dict[str, Array] = {}
        for number, record in enumerate(self):
            for name, (value, *_) in figures(record):
                if name not in columns:
                    columns[name] = np.full(len(self._begins), np.nan)
                columns[name][number] = value
        return columns
