"""CSV files as bushfit writes them, those of tests among them, which the reader takes back.

Every one has seven digits, UTF-8, and no text that a spreadsheet would run as a formula. It has commas and decimal
points; or semicolons and decimal commas, as Excel expects where numbers are written so, after the byte order mark by
which Excel knows UTF-8.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable
from functools import lru_cache
from typing import TYPE_CHECKING, TextIO

import numpy as np

from bushfit.errors import printable
from bushfit.geometry import STRAINING, Display, Place, Unit, stated_strain
from bushfit.reading.measurement import loss_factor

if TYPE_CHECKING:
    import pandas as pd

    from bushfit.reading.measurement import Loop, Sweep
    from bushfit.reading.resonance import ResonanceTest

#: The start of a text that a spreadsheet takes for a formula, in ASCII or full width, even after blanks.
_FORMULA = re.compile("[\\s\"']*[=+\\-@\uff1d\uff0b\uff0d\uff20|%]|\\t")
#: What parts the lines of a text.
_LINE_ENDS = re.compile("[\\r\\n]+")


class Rows:
    """Writes rows of texts and numbers to a stream as they come."""

    def __init__(self, stream: TextIO, headers: Iterable[str], *, decimal_comma: bool = False) -> None:
        self._point = "," if decimal_comma else "."
        self._writer = csv.writer(stream, delimiter=";" if decimal_comma else ",", lineterminator="\n")
        self._writer.writerow([defused(header) for header in headers])

    def add(self, cells: Iterable[str | float | None]) -> None:
        """Write one row; None and nan become empty cells."""
        self._writer.writerow([_cell(value, self._point) for value in cells])


def encoding(decimal_comma: bool) -> str:
    """The encoding of a file: UTF-8, before decimal commas with a byte order mark."""
    return "utf-8-sig" if decimal_comma else "utf-8"


def to_csv(table: pd.DataFrame, *, decimal_comma: bool = False) -> bytes:
    """The bytes of a table's file."""
    text = io.StringIO()
    rows = Rows(text, map(str, table.columns), decimal_comma=decimal_comma)
    for cells in zip(*(column.tolist() for _, column in table.items()), strict=True):
        rows.add(cells)
    return text.getvalue().encode(encoding(decimal_comma), "replace")


def _cell(value: object, point: str) -> str:
    if isinstance(value, float):
        return "" if value != value else f"{value:.7g}".replace(".", point)
    if isinstance(value, str):
        return defused(value)
    return "" if value is None else str(value)


@lru_cache(maxsize=4096)
def defused(text: str) -> str:
    """A text in one line, after an apostrophe where a spreadsheet would run it as a formula."""
    line = in_a_line(text)
    return f"'{line}" if _FORMULA.match(line) else line


def in_a_line(text: str) -> str:
    """A text as a cell has it: in one line, control characters as escapes."""
    return "\t".join(map(printable, " ".join(_LINE_ENDS.split(text)).split("\t")))


def undefused(text: str) -> str:
    """The text that was written so, but for the ends of its lines."""
    return text[1:] if text.startswith("'") and _FORMULA.match(text[1:]) else text


def raw_loop_table(loop: Loop) -> pd.DataFrame:
    """A loop as a rig writes it: time, displacement and force in the units of engineers, or strain and stress."""
    import pandas as pd

    moves, resists, _ = loop.direction.motion.words
    (length, length_factor), (force, force_factor), _ = _as_stated(loop.direction)
    return pd.DataFrame(
        {
            "time [s]": loop.time,
            f"{moves} [{length}]": loop.displacement * length_factor,
            f"{resists} [{force}]": loop.force * force_factor,
        }
    )


def raw_sweep_table(sweep: Sweep) -> pd.DataFrame:
    """A sweep as a rig writes it: frequency, amplitude, repeat, stiffness and loss factor in the units of engineers.

    Where the amplitude is stepped, it is written as reached, without its level.
    """
    import pandas as pd

    motion = sweep.direction.motion
    amplitude, relates = "strain amplitude" if motion is STRAINING else "amplitude", motion.words[2]
    (length, length_factor), _, (stiffness, factor) = _as_stated(sweep.direction)
    level, reached = sweep.amplitude, sweep.reached
    if sweep.stepped == "amplitude" and reached is not None:
        level, reached = reached, None
    return pd.DataFrame(
        {
            "frequency [Hz]": sweep.frequency,
            f"{amplitude} [{length}]": level * length_factor,
            **({} if reached is None else {f"amplitude reached [{length}]": reached * length_factor}),
            "repeat": sweep.repeat,
            f"{relates} [{stiffness}]": np.abs(sweep.stiffness) * factor,
            "loss factor [-]": loss_factor(sweep.stiffness),
        }
    )


def raw_resonance_table(test: ResonanceTest) -> pd.DataFrame:
    """A resonance test as a shaker's controller writes it: accelerations of base and mass, and their phase."""
    import pandas as pd

    return pd.DataFrame(
        {
            "frequency [Hz]": test.frequency,
            "base acceleration [m/s^2]": test.base_acceleration,
            "mass acceleration [m/s^2]": test.base_acceleration * np.abs(test.transmissibility),
            "phase [deg]": np.degrees(np.angle(test.transmissibility)),
        }
    )


def _as_stated(place: Place) -> Display:
    """The units in which files of a place have displacement, force and stiffness; tensor strain is half of gamma."""
    (unit, factor), force, stiffness = place.display
    stated = stated_strain(place)
    return Display(Unit(unit, factor / stated), force, stiffness)
