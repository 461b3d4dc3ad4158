"""What a test of a campaign file is made on: a direction of the bushing, or a specimen."""

from collections.abc import Sequence
from typing import Any

from bushfit.errors import CampaignError, naming
from bushfit.geometry import Direction, Place, Specimen

#: Keys of a table that tell it.
PLACE_KEYS = ("direction", "specimen")
#: Lists of tests in [simulate].
_LISTS = ("loops", "sweeps", "resonances")


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
