"""Agreement with numbers of others, in digits."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

#: (what, digits of each case) -> None: prints them and judges them by the README's table.
Agree = Callable[[str, Sequence[float]], None]


def digits(found: ArrayLike, exact: ArrayLike) -> float:
    """Digits in which the worst of some numbers agree: -log10 of the relative error, 15 at most."""
    error = np.max(np.abs(np.asarray(found) - np.asarray(exact)) / np.abs(exact))
    return float(-np.log10(max(error, 1e-15)))
