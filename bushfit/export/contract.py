"""What every export format is given, and what it gives back."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

from bushfit.effects.contract import Circumstances
from bushfit.effects.temperature import REFERENCE
from bushfit.export.systems import UnitSystem
from bushfit.geometry import Place
from bushfit.model.arms import Arms
from bushfit.model.result import Result
from bushfit.prediction.caveats import warnings_of
from bushfit.prediction.stiffness import Prediction
from bushfit.reading.measurement import Source
from bushfit.units import CELSIUS, number, told

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
        temperature: of the rubber [K], of a model that knows it; None for its reference.
        day: of writing, as decks state it; None leaves it out.
    """

    result: Result
    source: Source
    predictions: tuple[Prediction, ...]
    accuracy: float
    units: UnitSystem | None = None
    dialect: Dialect = "nastran"
    decimal_comma: bool = False
    temperature: float | None = None
    day: str | None = None

    def remarks(self, losses: Iterable[str]) -> list[tuple[str, str]]:
        """What every format says beside its numbers: the campaign, where it holds, what it leaves out, all warnings."""
        found = warnings_of(self.result, [prediction.warnings for prediction in self.predictions])
        return [*self._about(), *(("left out", loss) for loss in losses), *(("warning", line) for line in found)]

    @property
    def under(self) -> Circumstances:
        """What the rubber is under."""
        return Circumstances(self.temperature)

    def _about(self) -> Iterator[tuple[str, str]]:
        """The campaign, its days, the temperature, and of each place within what the tests were fitted."""
        campaign, measured, model = self.result.campaign, self.result.measured, self.result.model
        if campaign:
            days = sorted({str(test.conditions["date"]) for test in campaign.tests if "date" in test.conditions})
            yield "campaign", f"{campaign.name}, {campaign.file}, sha256 {campaign.sha256}"
            yield "tests", f"{len(campaign.tests)}, {'made ' + ', '.join(days) if days else 'no date stated'}"
        if model.knows_temperature:
            warmth = number((self.temperature or REFERENCE) - CELSIUS, 3)
            yield "temperature", f"{warmth} degC, as if it were the same at all times and throughout"
        if measured is None:
            return
        warm = [kelvin - CELSIUS for kelvin in measured.temperature or ()]
        for place in self.places:
            unit, factor = place.display.displacement
            reached = [factor * strain / model.unit_strain(place) for strain in measured.strain]
            parts = [str(place), told("Hz", *measured.frequency), told(unit, *reached)]
            parts.append(told("degC", *warm) if warm else "temperature not stated")
            parts.append("fitted there" if str(place) in measured.directions else "not fitted there")
            yield "valid", ", ".join(parts)

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
