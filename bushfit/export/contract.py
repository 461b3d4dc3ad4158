"""What every export format is given, and what it gives back."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

from bushfit.export.systems import UnitSystem
from bushfit.geometry import Place
from bushfit.model.arms import Arms
from bushfit.model.result import Result
from bushfit.prediction.caveats import warnings_of
from bushfit.prediction.stiffness import Prediction
from bushfit.reading.measurement import Source

#: Whose bulk data the format `nastran` writes: MSC and NX Nastran's, or Altair OptiStruct's.
Dialect = Literal["nastran", "optistruct"]


@dataclass(frozen=True, eq=False)
class Order:
    """A model to be written for another program.

    Args:
        result: the fitted model.
        source: the file it came from, with its SHA-256.
        predictions: its dynamic stiffness over the whole grid of frequencies and amplitudes, one a place.
        accuracy: largest relative error of the modulus that arms in place of a springpot may have.
        units: of the files; None leaves them to the format: mm, t, s and N in decks, those of people in tables.
        dialect: of the format `nastran`.
        decimal_comma: whether the format `csv` has semicolons and decimal commas.
    """

    result: Result
    source: Source
    predictions: tuple[Prediction, ...]
    accuracy: float
    units: UnitSystem | None = None
    dialect: Dialect = "nastran"
    decimal_comma: bool = False

    def remarks(self, losses: Iterable[str]) -> list[tuple[str, str]]:
        """What every format says beside its numbers: what it leaves out, and all warnings."""
        found = warnings_of(self.result, [prediction.warnings for prediction in self.predictions])
        return [*(("left out", loss) for loss in losses), *(("warning", line) for line in found)]

    @property
    def places(self) -> tuple[Place, ...]:
        """Directions and specimens that are exported."""
        return tuple(prediction.direction for prediction in self.predictions)


@dataclass(frozen=True, eq=False)
class Exported:
    """The files of an export by name, what it could not carry, and the error that this costs; and its Maxwell arms."""

    files: Mapping[str, bytes]
    losses: tuple[str, ...] = ()
    arms: tuple[Arms, ...] = ()
