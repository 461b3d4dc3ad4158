"""What a test of a campaign file is made on: a direction of the bushing, or a specimen."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from bushfit.errors import CampaignError, naming
from bushfit.geometry import Bushing, Direction, Place, Specimen, unit_strain
from bushfit.reading.measurement import Loop, Sweep
from bushfit.units import number, told

#: Keys of a table that tell it.
PLACE_KEYS = ("direction", "specimen")
#: Lists of tests in [simulate].
_LISTS = ("loops", "sweeps", "resonances")
#: Strain amplitude that no filled rubber bears over the cycles of a test; chosen: a bushing sees less than a third of
#: it, and a wrong prefix of a unit is a factor of 1000.
_MOST_STRAIN = 3.0


def place_tested(specimen: object, direction: object, specimens: Sequence[Specimen]) -> Place:
    """The direction or the specimen that the two keys of a test mean.

    Raises:
        CampaignError: an unknown specimen, a bushing without a direction, or a specimen with one of the bushing's.
    """
    known = {specimen.name: specimen for specimen in specimens}
    if specimen is None:
        if isinstance(direction, str) and direction in [*Direction]:
            return Direction(direction)
        expected = "direction = " + " or ".join(f'"{choice}"' for choice in Direction)
        hint = f'or specimen = "{next(iter(known))}"' if known else None
        found = "none" if direction is None else str(direction)
        raise CampaignError("a test without a direction", found=found, expected=expected, hint=hint)
    if not isinstance(specimen, str) or specimen not in known:
        raise CampaignError(
            "this specimen is not in the campaign",
            found=str(specimen),
            expected="one of " + ", ".join(known) if known else "a [[specimens]] table with this name",
        )
    if direction not in (None, "shear"):
        expected = 'direction = "shear", or none: a specimen is tested in one way only'
        raise CampaignError("a specimen has no such direction", found=str(direction), expected=expected)
    return known[specimen]


def refuse_strain(bushing: Bushing | None, place: Place, test: Loop | Sweep) -> None:
    """Raise a CampaignError where a test strains its rubber by more than any bears: a unit, or a size, is wrong."""
    moved = test.amplitude if isinstance(test, Sweep) else 0.5 * np.ptp(test.displacement, keepdims=True)
    largest = float(np.max(moved))
    if (strain := largest * unit_strain(bushing, place)) > _MOST_STRAIN:
        raise CampaignError(
            "no rubber bears the amplitude of this test",
            found=f"{told(place.motion.displacement_unit, largest)}, {place}: a strain of {number(100 * strain, 2)} %",
            expected=f"a strain below {100 * _MOST_STRAIN:g} %",
            hint="check the unit of the amplitude or displacement, and the sizes of what was tested",
        )


def with_places(tables: Any, specimens: Sequence[Specimen]) -> Any:
    """A parsed [simulate] with the place itself for the keys that tell it; what is no table is left alone.

    Raises:
        CampaignError: as of `place_tested`.
    """

    def placed(test: Any, place: str) -> Any:
        if not isinstance(test, dict):
            return test
        with naming(place=place):
            direction = place_tested(test.get("specimen"), test.get("direction"), specimens)
        return {**{key: value for key, value in test.items() if key not in PLACE_KEYS}, "direction": direction}

    if not isinstance(tables, dict):
        return tables
    return {
        key: [placed(test, f"{key} #{number}") for number, test in enumerate(table, 1)]
        if key in _LISTS and isinstance(table, list)
        else table
        for key, table in tables.items()
    }
