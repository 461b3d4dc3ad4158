"""Measured data: Loop and Sweep, frozen, SI, checked."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bushfit.geometry import Direction

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Source:
    """The file a measurement came from, for provenance."""

    file: Path
    sha256: str


@dataclass(frozen=True, eq=False)
class Loop:
    """A quasi-static hysteresis loop: time [s], displacement [m or rad], force [N or N m], each (n,).

    noise is the standard deviation of the force relative to its half range, where the campaign states it.
    """

    name: str
    direction: Direction
    time: Floats
    displacement: Floats
    force: Floats
    noise: float | None = None
    source: Source | None = None


@dataclass(frozen=True, eq=False)
class Sweep:
    """Stepped sine: frequency [Hz], zero-to-peak amplitude [m or rad], complex dynamic stiffness
    [N/m or N m/rad] and repeat number, each (n,).

    noise is the standard deviation of the real and of the imaginary part, each relative to |K|, where
    the campaign states it.
    """

    name: str
    direction: Direction
    frequency: Floats
    amplitude: Floats
    stiffness: NDArray[np.complex128]
    repeat: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    noise: float | None = None
    source: Source | None = None
