"""Tables as their files give them back: for the page of a batch."""

from __future__ import annotations

import numpy as np
import pandas as pd

from bushfit.effects.contract import Array
from bushfit.reading.tablefile import for_each_distinct, in_a_line
from bushfit.report.page.record import read_table as read_table
from bushfit.report.tables import TEXTS

#: Powers of ten that are exact.
_TENS = np.array([float(f"1e{power}") for power in range(23)])


def canonical(table: pd.DataFrame) -> pd.DataFrame:
    """A table as its file would give it back: texts, and numbers of seven digits; nan where a cell is empty."""

    def column(name: str) -> object:
        values = table[name]
        if name in TEXTS:
            return for_each_distinct(values.astype(str), lambda value: in_a_line(str(value)))
        return _of_seven_digits(values.to_numpy(dtype=float, na_value=np.nan))

    return pd.DataFrame({str(name): column(name) for name in table.columns})


def _of_seven_digits(values: Array) -> Array:
    """What seven digits give back of numbers, (n,): by arithmetic, which is exact up to the 22nd power of ten, but for
    the few that are larger, or nearly half way between two."""
    with np.errstate(divide="ignore", invalid="ignore"):
        places = 6.0 - np.floor(np.log10(np.abs(values)))
        usual = np.abs(places) < _TENS.size
        tens = _TENS[np.where(usual, np.abs(places), 0.0).astype(int)]
        scaled = np.where(places < 0.0, values / tens, values * tens)
        whole = np.rint(scaled)
        sure = usual & (np.abs(np.abs(scaled - whole) - 0.5) > 1e-6) & (np.abs(whole) >= 1e6) & (np.abs(whole) <= 1e7)
    found = np.where(places < 0.0, whole * tens, whole / tens)
    found[~sure] = [float(f"{value:.7g}") for value in values[~sure].tolist()]
    return found
