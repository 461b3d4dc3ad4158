"""Records of all rows, on disk: in memory is where each begins, and of each quantity an array over the rows."""

import json
from array import array
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from bushfit.batch.document import Record
from bushfit.batch.quantities import figures
from bushfit.effects.contract import Array


class Spool:
    """Takes records in any order, gives them back in the order of rows."""

    def __init__(self, path: Path, count: int) -> None:
        self._stream = path.open("w+b")
        self._begins = array("q", [-1]) * count

    def close(self) -> None:
        self._stream.close()

    def put(self, number: int, line: bytes) -> None:
        self._begins[number] = self._stream.seek(0, 2)
        self._stream.write(line)

    def __iter__(self) -> Iterator[Record]:
        for begin in self._begins:
            self._stream.seek(begin)
            yield json.loads(self._stream.readline())

    def columns(self) -> tuple[dict[str, Array], dict[str, Array]]:
        """Of every quantity over the rows, NaN where a row has none: values (n,), and ends of 95 % intervals (2, n)."""
        count = len(self._begins)
        columns: dict[str, Array] = defaultdict(lambda: np.full(count, np.nan))
        intervals: dict[str, Array] = defaultdict(lambda: np.full((2, count), np.nan))
        for number, record in enumerate(self):
            for name, (value, low, high, _) in figures(record):
                columns[name][number] = value
                if low is not None and high is not None:
                    intervals[name][:, number] = low, high
        return columns, intervals
