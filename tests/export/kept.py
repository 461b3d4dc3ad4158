"""The kept computation of the paper's bushing, level by level, as decks hold it."""

from __future__ import annotations

import numpy as np
import pandas as pd

from bushfit.geometry import Direction

#: Of an order that no file stands behind.
HASH = "0123456789abcdef" * 4


def rows_of(known: pd.DataFrame, direction: Direction, level: int) -> tuple[np.ndarray, np.ndarray]:
    """Frequency and complex stiffness of the kept computation at a level of amplitude from 1, or else the last."""
    rows = known[known["direction"] == direction]
    amplitudes = np.sort(rows["amplitude"].unique())
    rows = rows[rows["amplitude"] == amplitudes[min(level, amplitudes.size) - 1]].sort_values("frequency")
    storage = rows["stiffness"] / np.hypot(1.0, rows["loss"])
    return rows["frequency"].to_numpy(), (storage * (1.0 + 1j * rows["loss"])).to_numpy()
