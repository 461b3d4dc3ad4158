"""Tables [bushing], [[bushings]] and [[specimens]] of a campaign file: the bodies that were tested."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from bushfit.errors import CampaignError, ModelError
from bushfit.geometry import Bushing, CouponKind, Direction, Shape, Specimen, StatedStrain
from bushfit.validation import Count, Length, Name, si


def _check_name(name: str) -> str:
    """Check the name of a bushing or specimen, and return it.

    Raises:
        ValueError: a direction, or another table in the results folder, has this name.
    """
    if name in (*Direction, "loops", "sweeps", "gap", "candidates", "measured", "shear"):
        expected = "a unique name, because the tables are named after it"
        raise ValueError(CampaignError("another table has this name", found=name, expected=expected))
    return name


#: Name of a body whose result tables are named after it.
BodyName = Annotated[Name, AfterValidator(_check_name)]


@dataclass(frozen=True)
class BushingSettings:
    """[bushing]: a tube of rubber between two sleeves, by its radii or its diameters.

    Args:
        name: name of the bushing, used as title of tables and plots.
        inner_radius, outer_radius: radius of the rubber [m].
        inner_diameter, outer_diameter: diameter of the rubber in place of the radius [m].
        length: mean length of the rubber [m].
        shape: formulas for radial stiffness: those of the paper, or corrected by finite elements.
    """

    name: Name
    length: Length
    inner_radius: Length | None = None
    outer_radius: Length | None = None
    inner_diameter: Length | None = None
    outer_diameter: Length | None = None
    shape: Shape = "paper"

    def __post_init__(self) -> None:
        for side in ("inner", "outer"):
            radius, diameter = getattr(self, f"{side}_radius"), getattr(self, f"{side}_diameter")
            if (radius is None) == (diameter is None):
                problem = f"the {side} size of the rubber is {'missing' if radius is None else 'stated twice'}"
                expected = f"{side}_radius or {side}_diameter"
                raise ValueError(CampaignError(problem, place=f"{side}_radius", expected=expected))

    def to_bushing(self) -> Bushing:
        """Make the bushing that the table [bushing] describes.

        Returns:
            The bushing; diameters are converted to radii.

        Raises:
            ModelError: impossible sizes; the error states radii or diameters, as the table does.
        """
        radii = {
            f"{side}_radius": getattr(self, f"{side}_radius") or getattr(self, f"{side}_diameter") / 2.0
            for side in ("inner", "outer")
        }
        try:
            return Bushing(self.name, length=self.length, shape=self.shape, **radii)
        except ModelError as error:
            keys = (error.place or "").split(", ")
            table_keys = [key if getattr(self, key) else key.replace("radius", "diameter") for key in keys]
            if table_keys != keys:
                error.place, error.hint = ", ".join(table_keys), "check that inner and outer are not swapped"
                error.found = " and ".join(f"{1e3 * getattr(self, key):g} mm" for key in table_keys)
            raise


@dataclass(frozen=True)
class SeveralBushings(BushingSettings):
    """[[bushings]]: one of several bushings of one compound, in place of [bushing].

    Args:
        factor: "free" to fit the ratio of measured to computed stiffness of this bushing; "one" to fix the ratio at 1.
    """

    name: BodyName
    factor: Literal["one", "free"] = "one"


@dataclass(frozen=True)
class SpecimenSettings:
    """[[specimens]]: another body of the same compound, and the kind of its tests. See geometry.Specimen.

    Args:
        name: name of the specimen in tests and tables.
        kind: "modulus" if tests give strain and modulus, "shear" if tests give displacement and force of blocks.
        strain: strain in files of a modulus test: engineering shear, tensor (half of it), or that of a bar in tension.
        area: area of one block in shear [m^2].
        thickness: thickness of one block in shear [m].
        elements: number of blocks in parallel.
    """

    name: BodyName
    kind: CouponKind
    strain: StatedStrain = "engineering"
    area: Annotated[float, si("m^2"), Field(gt=0)] | None = None
    thickness: Length | None = None
    elements: Count = 1


def specimens_of(bushings: Iterable[SeveralBushings], coupons: Iterable[SpecimenSettings]) -> list[Specimen]:
    """Make the specimens of a campaign: the directions of each of several bushings, then the [[specimens]]."""
    directions = [place for table in bushings for place in Specimen.of_bushing(table.to_bushing())]
    return [*directions, *(Specimen(**vars(table)) for table in coupons)]
