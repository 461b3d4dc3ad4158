"""What every export format is given, and what it gives back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from bushfit.geometry import Place
from bushfit.model.result import Result
from bushfit.prediction import Prediction
from bushfit.reading.measurement import Source


@dataclass(frozen=True, eq=False)
class Order:
    """A model to be written for another program.

    Args:
        result: the fitted model.
        source: the file it came from, with its SHA-256.
        predictions: its dynamic stiffness over the whole grid of frequencies and amplitudes, one a place.
        accuracy: largest relative error of the modulus that arms in place of a springpot may have.
    """

    result: Result
    source: Source
    predictions: tuple[Prediction, ...]
    accuracy: float

    @property
    def places(self) -> tuple[Place, ...]:
        """Directions and specimens that are exported."""
        return tuple(prediction.direction for prediction in self.predictions)


@dataclass(frozen=True, eq=False)
class Exported:
    """The files of an export by name, what it could not carry, and the error that this costs."""

    files: Mapping[str, bytes]
    losses: tuple[str, ...] = ()
