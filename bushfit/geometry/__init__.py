"""Bodies under test: a bushing in a direction, or a specimen of its compound; equivalent strain and stiffness."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Literal, NamedTuple

from bushfit.errors import ModelError, did_you_mean
from bushfit.geometry import tube
from bushfit.geometry.shape import NO_CORRECTION, Correction, radial_correction

#: Radial formulas of a bushing: those of the paper, or corrected by finite elements.
Shape = Literal["paper", "calibrated"]
#: Tests of a specimen: strain and modulus, or displacement and force of blocks in shear.
SpecimenKind = Literal["modulus", "shear"]
#: Kind of strain in the files of a modulus test.
StatedStrain = Literal["engineering", "tensor", "tension"]


#: Shortest and longest plausible side of a body of rubber [m].
_SHORTEST = 1e-6
_LONGEST = 100.0


class Unit(NamedTuple):
    """A display unit with its factor from SI."""

    name: str
    factor: float


class Display(NamedTuple):
    """Display units of displacement, force and stiffness."""

    displacement: Unit
    force: Unit
    stiffness: Unit


@dataclass(frozen=True)
class Motion:
    """A kind of motion.

    Args:
        words: names of displacement, force and stiffness.
        displacement_unit, force_unit, stiffness_unit: SI units.
        display: display units.
    """

    words: tuple[str, str, str]
    displacement_unit: str
    force_unit: str
    stiffness_unit: str
    display: Display


TRANSLATION = Motion(
    words=("displacement", "force", "stiffness"),
    displacement_unit="m",
    force_unit="N",
    stiffness_unit="N/m",
    display=Display(Unit("mm", 1e3), Unit("N", 1.0), Unit("N/mm", 1e-3)),
)
ROTATION = Motion(
    words=("rotation", "moment", "stiffness"),
    displacement_unit="rad",
    force_unit="N*m",
    stiffness_unit="N*m/rad",
    display=Display(Unit("deg", math.degrees(1.0)), Unit("N m", 1.0), Unit("N m/rad", 1.0)),
)
#: Of a test of the material alone, whatever the shape of the specimen.
STRAINING = Motion(
    words=("strain", "stress", "modulus"),
    displacement_unit="1",
    force_unit="Pa",
    stiffness_unit="Pa",
    display=Display(Unit("%", 100.0), Unit("kPa", 1e-3), Unit("MPa", 1e-6)),
)


class _Tested:
    """Common properties of directions and specimens."""

    @property
    def motion(self) -> Motion:
        """Kind of motion of its tests."""
        raise NotImplementedError

    @property
    def is_rotation(self) -> bool:
        """True for rotation [rad] and moment [N m] instead of displacement [m] and force [N]."""
        return self.motion is ROTATION

    @property
    def display(self) -> Display:
        """Display units of displacement, force and stiffness, or of strain, stress and modulus."""
        return self.motion.display


class Direction(_Tested, StrEnum):
    """Direction in which a bushing is tested."""

    AXIAL = "axial"
    RADIAL = "radial"
    TORSION = "torsion"

    @property
    def motion(self) -> Motion:
        """Translation or rotation."""
        return _DEFINITIONS[self].motion


@dataclass(frozen=True)
class Bushing:
    """A rubber tube bonded to two sleeves.

    Args:
        name: label of the bushing.
        inner_radius, outer_radius: a and b, of the sleeves [m].
        length: L, mean length of the rubber [m].
        shape: whether the radial formulas are the paper's, or corrected by finite elements.

    Raises:
        ModelError: a radius or length that is not positive and finite, or a >= b; a calibrated shape that no finite
            elements were computed for.

    >>> tube = Bushing("CMP 15 961", 0.010, 0.018, 0.034)
    >>> round(tube.unit_strain(Direction.RADIAL) / tube.unit_strain(Direction.AXIAL), 2)
    4.45
    """

    name: str
    inner_radius: float
    outer_radius: float
    length: float
    shape: Shape = "paper"

    def __post_init__(self) -> None:
        for key in ("inner_radius", "outer_radius", "length"):
            value = getattr(self, key)
            if not _SHORTEST <= value <= _LONGEST:
                raise ModelError(
                    "impossible bushing",
                    place=key,
                    found=f"{1e3 * value:g} mm",
                    expected=f"a positive length, {_SHORTEST:g} to {_LONGEST:g} m",
                )
        if self.inner_radius >= self.outer_radius:
            raise ModelError(
                "impossible bushing",
                place="inner_radius, outer_radius",
                found=f"{1e3 * self.inner_radius:g} mm and {1e3 * self.outer_radius:g} mm",
                expected="inner_radius below outer_radius",
                hint="check that radii were given, not diameters, and that they are not swapped",
            )
        if self.shape == "calibrated" and self.correction is None:
            raise ModelError(
                "no finite elements were computed for this shape",
                place="shape",
                found='"calibrated" for inner/outer = {:.3g}, length/outer = {:.3g}'.format(*self.proportions),
                expected="inner/outer 0.15 to 0.92 and length/outer 0.1 to 60",
                hint='check the units of the geometry, or take shape = "paper"',
            )

    @property
    def proportions(self) -> tuple[float, float]:
        """Inner over outer radius, and length over outer radius."""
        return self.inner_radius / self.outer_radius, self.length / self.outer_radius

    @cached_property
    def correction(self) -> Correction | None:
        """Correction of the radial formulas by finite elements; None outside the computed shapes."""
        return radial_correction(*self.proportions)

    def unit_strain(self, direction: Direction) -> float:
        """Equivalent strain per unit displacement [1/m], or per unit rotation [1/rad]."""
        strain = _DEFINITIONS[direction].unit_strain(self.inner_radius, self.outer_radius)
        return strain * self._corrected(direction).strain

    def stiffness_per_modulus(self, direction: Direction) -> float:
        """Stiffness per unit equivalent shear modulus: [m], or [m^3/rad] of a rotation."""
        sizes = self.inner_radius, self.outer_radius, self.length
        return _DEFINITIONS[direction].stiffness_per_modulus(*sizes) * self._corrected(direction).stiffness

    def _corrected(self, direction: Direction) -> Correction:
        """Correction that is applied to the formulas of a direction."""
        calibrated = direction is Direction.RADIAL and self.shape == "calibrated"
        return self.correction if calibrated and self.correction else NO_CORRECTION


@dataclass(frozen=True)
class Specimen(_Tested):
    """A body of the compound that is tested in one way only: a coupon, or a mount in plain shear.

    Args:
        kind: "modulus" where tests give strain and modulus, "shear" where they give displacement and force of rubber
            blocks in shear.
        strain: of a modulus test, what its files state: engineering shear strain gamma = 2 e, the tensor's shear e (it
            is read as gamma), or the strain of a bar in tension, with Young's modulus.
        area, thickness: of one block in shear [m^2, m].
        elements: blocks in parallel.

    Raises:
        ModelError: a shear specimen without a positive area and thickness.

    Notes:
        The model's equivalent strain e is the tensor's shear, with stress 2 mu e. A block in shear has e/d = 1/(2
        thickness) and K/G = elements area/thickness. A bar of an incompressible rubber in tension has E = 3 G and, by
        equal energy, e = sqrt(3)/2 of its strain.
    """

    name: str
    kind: SpecimenKind
    strain: StatedStrain = "engineering"
    area: float | None = None
    thickness: float | None = None
    elements: int = 1

    def __post_init__(self) -> None:
        for key in ("area", "thickness"):
            size = getattr(self, key)
            if (self.kind == "shear") != (size is not None) or not (size is None or _SHORTEST**2 <= size <= _LONGEST):
                raise ModelError(
                    "impossible specimen",
                    place=f"{self.name}, {key}",
                    found="none" if size is None else f"{size:g}",
                    expected="a positive size" if self.kind == "shear" else f'none, because kind = "{self.kind}"',
                )

    def __str__(self) -> str:
        return self.name

    @property
    def motion(self) -> Motion:
        """Displacement and force of a block, or strain and stress of the material."""
        return TRANSLATION if self.kind == "shear" else STRAINING


#: A direction of the bushing, or a specimen of its compound.
Place = Direction | Specimen


def get_place(name: str, specimens: Iterable[Specimen]) -> Place:
    """Specimen or direction of a name.

    Raises:
        ModelError: an unknown name.

    >>> get_place("mount", [Specimen("mount", "shear", area=1e-3, thickness=0.01)]).motion.words
    ('displacement', 'force', 'stiffness')
    """
    places: dict[str, Place] = {str(place): place for place in (*Direction, *specimens)}
    if name not in places:
        near = did_you_mean(name, places)
        raise ModelError("no such direction or specimen", found=name, expected="one of " + ", ".join(places), hint=near)
    return places[name]


def unit_strain(bushing: Bushing | None, place: Place) -> float:
    """Equivalent strain per unit displacement [1/m], rotation [1/rad] or strain [1] of a direction or specimen.

    Raises:
        ModelError: a direction without a bushing.

    >>> unit_strain(None, Specimen("coupon", "modulus"))
    0.5
    """
    if not isinstance(place, Specimen):
        return _present(bushing, place).unit_strain(place)
    if place.thickness is not None:
        return 0.5 / place.thickness
    return math.sqrt(3.0) / 2.0 if place.strain == "tension" else 0.5


def stiffness_per_modulus(bushing: Bushing | None, place: Place) -> float:
    """Stiffness per unit equivalent shear modulus: [m], [m^3/rad] of a rotation, [1] of a modulus.

    Raises:
        ModelError: a direction without a bushing.

    >>> stiffness_per_modulus(None, Specimen("mount", "shear", area=1e-3, thickness=0.01, elements=2))
    0.2
    """
    if not isinstance(place, Specimen):
        return _present(bushing, place).stiffness_per_modulus(place)
    if place.area is not None and place.thickness is not None:
        return place.elements * place.area / place.thickness
    return 3.0 if place.strain == "tension" else 1.0


def strain_factor_of_files(place: Place) -> float:
    """Displacement or strain per unit in a test file: 2 for shear strain of the tensor, 1 otherwise.

    >>> strain_factor_of_files(Specimen("coupon", "modulus", "tensor")), strain_factor_of_files(Direction.AXIAL)
    (2.0, 1.0)
    """
    return 2.0 if isinstance(place, Specimen) and place.strain == "tensor" else 1.0


def _present(bushing: Bushing | None, place: Direction) -> Bushing:
    if bushing is None:
        raise ModelError(
            "there is no bushing",
            place=str(place),
            expected="a [bushing] with its radii and length, which a direction belongs to",
            hint="bushfit predict MODEL.json --bushing other.toml carries the compound of a model to a bushing",
        )
    return bushing


class _Definition(NamedTuple):
    """Kind of motion and formulas of a tube for a direction, as functions of its radii and length."""

    motion: Motion
    unit_strain: Callable[[float, float], float]
    stiffness_per_modulus: Callable[[float, float, float], float]


#: A new direction is a name in `Direction` and an entry here.
_DEFINITIONS = {
    Direction.AXIAL: _Definition(TRANSLATION, tube.axial_strain, tube.axial_stiffness),
    Direction.RADIAL: _Definition(TRANSLATION, tube.radial_strain, tube.radial_stiffness),
    Direction.TORSION: _Definition(ROTATION, tube.torsion_strain, tube.torsion_stiffness),
}
