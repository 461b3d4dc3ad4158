"""Bodies under test: a bushing in a direction, or a specimen of its compound; equivalent strain and stiffness."""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Literal, NamedTuple

from bushfit.errors import ModelError, did_you_mean
from bushfit.geometry import tube
from bushfit.geometry.motion import ROTATION as ROTATION
from bushfit.geometry.motion import STRAINING as STRAINING
from bushfit.geometry.motion import TRANSLATION as TRANSLATION
from bushfit.geometry.motion import Display as Display
from bushfit.geometry.motion import Motion as Motion
from bushfit.geometry.motion import Unit as Unit
from bushfit.geometry.shape import NO_CORRECTION, Correction, radial_correction

#: Radial formulas of a bushing: those of the paper, or corrected by finite elements.
Shape = Literal["paper", "calibrated"]
#: Kind of test of a coupon: strain and modulus, or displacement and force of blocks in shear.
CouponKind = Literal["modulus", "shear"]
#: Kind of specimen: a coupon, or one direction of one of several bushings.
SpecimenKind = CouponKind | Literal["bushing"]
#: Kind of strain in the files of a modulus test.
StatedStrain = Literal["engineering", "tensor", "tension"]


#: Shortest and longest plausible side of a body of rubber [m].
_SHORTEST = 1e-6
_LONGEST = 100.0


class _TestObject:
    """Base class of the two kinds of test objects: a direction of the bushing, or a specimen of its compound."""

    @property
    def motion(self) -> Motion:
        """Kind of motion in a test of this direction or specimen."""
        raise NotImplementedError

    @property
    def labels(self) -> tuple[str, ...]:
        """Names to which an effect that acts here may be restricted: "long radial", "long" (body) and "radial"."""
        return (str(self),)

    @property
    def is_rotation(self) -> bool:
        """True if tests have rotation [rad] and moment [N m] instead of displacement [m] and force [N]."""
        return self.motion is ROTATION

    @property
    def display(self) -> Display:
        """Display units of displacement, force and stiffness, or of strain, stress and modulus."""
        return self.motion.display


class Direction(_TestObject, StrEnum):
    """Direction in which a bushing is tested: axial or radial displacement, or torsion (rotation about the axis)."""

    AXIAL = "axial"
    RADIAL = "radial"
    TORSION = "torsion"

    @property
    def motion(self) -> Motion:
        """Kind of motion of this direction: translation or rotation."""
        return _DEFINITIONS[self].motion

    @property
    def axis(self) -> "Direction":
        """Direction of the motion: this direction."""
        return self

    @property
    def body(self) -> str:
        """Name of the body under test; empty for the one bushing of a campaign."""
        return ""


@dataclass(frozen=True)
class Bushing:
    """Geometry of a bushing: a rubber tube bonded to two rigid sleeves.

    Args:
        name: label of the bushing.
        inner_radius, outer_radius: radii a and b of the rubber tube [m].
        length: mean length L of the rubber [m].
        shape: "paper" for the radial formulas of Garcia Tarrago et al. 2007, "calibrated" to correct them by finite
            elements.

    Raises:
        ModelError: a radius or length is not positive and finite, a >= b, or the shape is "calibrated" outside the
            range of the finite elements.

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
                expected="an inner size below the outer size",
                hint="check that the values are radii, not diameters, and that inner and outer are not swapped",
            )
        if self.shape == "calibrated" and self.correction is None:
            raise ModelError(
                "the calibrated formulas do not cover this shape",
                place="shape",
                found='"calibrated" for inner/outer = {:.3g}, length/outer = {:.3g}'.format(*self.proportions),
                expected="inner/outer 0.15 to 0.92 and length/outer 0.1 to 60",
                hint='check the units of the geometry, or state shape = "paper"',
            )

    @property
    def proportions(self) -> tuple[float, float]:
        """Ratios of inner to outer radius and of length to outer radius."""
        return self.inner_radius / self.outer_radius, self.length / self.outer_radius

    @cached_property
    def correction(self) -> Correction | None:
        """Correction of the radial formulas by finite elements; None outside the computed shapes."""
        return radial_correction(*self.proportions)

    def unit_strain(self, direction: Direction) -> float:
        """Equivalent strain of the rubber per displacement [1/m], or per rotation [1/rad] in torsion."""
        strain = _DEFINITIONS[direction].unit_strain(self.inner_radius, self.outer_radius)
        return strain * self._correction_factors(direction).strain

    def stiffness_per_modulus(self, direction: Direction) -> float:
        """Stiffness of the bushing per equivalent shear modulus of the rubber: [m], or [m^3/rad] in torsion."""
        sizes = self.inner_radius, self.outer_radius, self.length
        return _DEFINITIONS[direction].stiffness_per_modulus(*sizes) * self._correction_factors(direction).stiffness

    def _correction_factors(self, direction: Direction) -> Correction:
        """Correction factors of the formulas of a direction; 1 unless the direction is radial and calibrated."""
        calibrated = direction is Direction.RADIAL and self.shape == "calibrated"
        return self.correction if calibrated and self.correction else NO_CORRECTION


@dataclass(frozen=True)
class Specimen(_TestObject):
    """Specimen of the compound: a coupon, a mount in simple shear, or a direction of one of several bushings.

    Args:
        name: name of the specimen.
        kind: "modulus" if tests measure strain and modulus; "shear" if they measure displacement and force of rubber
            blocks in shear; "bushing" for one direction of one of several bushings.
        strain: strain in the files of a modulus test: "engineering" for the shear strain gamma = 2 e, "tensor" for the
            tensor's shear component e (the files' strains are doubled), or "tension" for the strain of a bar in
            tension, with Young's modulus.
        area, thickness: area [m^2] and thickness [m] of one block in shear; None for a modulus test.
        elements: number of blocks in parallel.
        bushing, axis: bushing and direction of its tests; None for a coupon.

    Raises:
        ModelError: a shear specimen lacks a positive area or thickness, or a modulus test has one.

    Notes:
        The model's equivalent strain e is the shear component of the strain tensor, with stress 2 mu e. A block in
        shear has e/d = 1/(2 thickness) and K/G = elements area/thickness. A bar of an incompressible rubber in tension
        has E = 3 G and, by equal energy, e = sqrt(3)/2 times its strain.
    """

    name: str
    kind: SpecimenKind
    strain: StatedStrain = "engineering"
    area: float | None = None
    thickness: float | None = None
    elements: int = 1
    bushing: Bushing | None = None
    axis: Direction | None = None

    @classmethod
    def of_bushing(cls, bushing: Bushing) -> "list[Specimen]":
        """List the three directions of one of several bushings as specimens.

        >>> [str(place) for place in Specimen.of_bushing(Bushing("long", 0.01, 0.018, 0.034))]
        ['long axial', 'long radial', 'long torsion']
        """
        return [cls(f"{bushing.name} {axis}", "bushing", bushing=bushing, axis=axis) for axis in Direction]

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
        """Kind of motion: translation or rotation (bushing), translation (block in shear), or strain (coupon)."""
        if self.axis:
            return self.axis.motion
        return TRANSLATION if self.kind == "shear" else STRAINING

    @property
    def body(self) -> str:
        """Name of the body under test: the bushing or the coupon."""
        return self.bushing.name if self.bushing else self.name

    @property
    def labels(self) -> tuple[str, ...]:
        """Names to which an effect that acts here may be restricted: "long radial", "long" (body) and "radial"."""
        return (self.name, self.body, str(self.axis)) if self.axis else (self.name,)


#: A direction of the bushing, or a specimen of its compound.
Place = Direction | Specimen


def get_place(name: str, specimens: Iterable[Specimen]) -> Place:
    """Return the direction or specimen with the given name.

    Raises:
        ModelError: no direction or specimen has this name.

    >>> get_place("mount", [Specimen("mount", "shear", area=1e-3, thickness=0.01)]).motion.words
    ('displacement', 'force', 'stiffness')
    """
    places: dict[str, Place] = {str(place): place for place in (*Direction, *specimens)}
    if name not in places:
        names = dict.fromkeys([*Direction, *(label for place in places.values() for label in place.labels)])
        near = did_you_mean(name, names)
        raise ModelError("no such direction or specimen", found=name, expected="one of " + ", ".join(names), hint=near)
    return places[name]


def get_places(name: str, specimens: Sequence[Specimen]) -> list[Place]:
    """Directions and specimens with a name: one, or all of a bushing or a direction if there are several bushings.

    Raises:
        ModelError: no direction, specimen or bushing has this name.

    >>> sides = Specimen.of_bushing(Bushing("long", 0.01, 0.018, 0.034))
    >>> [str(place) for place in get_places("radial", sides)], len(get_places("long", sides))
    (['long radial'], 3)
    """
    return [place for place in specimens if name in place.labels] or [get_place(name, specimens)]


def default_places(bushing: Bushing | None, specimens: Sequence[Specimen]) -> list[Place]:
    """List the directions and specimens that are predicted by default: axial, radial, and all coupons."""
    directions = [Direction.AXIAL, Direction.RADIAL] if bushing or not specimens else []
    return [*directions, *(place for place in specimens if place.axis is not Direction.TORSION)]


def shared_labels(places: Iterable[Place]) -> list[str]:
    """List the names of directions, specimens and bodies to which a missing effect may be restricted.

    A name is left out if the tests cannot distinguish it from others: a bushing that was tested in one direction only,
    and the first of two bodies, because stiffening of the first looks like softening of the second.

    Args:
        places: tested directions and specimens.

    Returns:
        Names of directions and specimens; then, of several bushings, of the bodies and of the common directions.
    """
    tested = [*dict.fromkeys(places)]
    mounted = [place for place in tested if isinstance(place, Specimen) and place.bushing]
    bodies = Counter(place.body for place in mounted)
    names = [str(place) for place in tested if bodies[place.body] != 1]
    names += list(bodies)[len(bodies) == 2 :]
    axes = [*dict.fromkeys(str(place.axis) for place in mounted)]
    return [*names, *(axes if len(bodies) > 1 and len(axes) > 1 else [])]


def unit_strain(bushing: Bushing | None, place: Place) -> float:
    """Equivalent strain of the rubber per displacement [1/m], rotation [1/rad] or strain [1] that a test prescribes.

    Args:
        bushing: the one bushing of the campaign; None without a bushing, or with several.
        place: direction of this bushing, or specimen.

    Raises:
        ModelError: `place` is a direction, but there is no bushing.

    >>> unit_strain(None, Specimen("coupon", "modulus"))
    0.5
    """
    if place.axis:
        return _require_bushing(bushing, place).unit_strain(place.axis)
    assert isinstance(place, Specimen)
    if place.thickness is not None:
        return 0.5 / place.thickness
    return math.sqrt(3.0) / 2.0 if place.strain == "tension" else 0.5


def stiffness_per_modulus(bushing: Bushing | None, place: Place) -> float:
    """Measured stiffness per equivalent shear modulus: [m], [m^3/rad] in torsion, [1] for a modulus test.

    Args:
        bushing: the one bushing of the campaign; None without a bushing, or with several.
        place: direction of this bushing, or specimen.

    Raises:
        ModelError: `place` is a direction, but there is no bushing.

    >>> stiffness_per_modulus(None, Specimen("mount", "shear", area=1e-3, thickness=0.01, elements=2))
    0.2
    """
    if place.axis:
        return _require_bushing(bushing, place).stiffness_per_modulus(place.axis)
    assert isinstance(place, Specimen)
    if place.area is not None and place.thickness is not None:
        return place.elements * place.area / place.thickness
    return 3.0 if place.strain == "tension" else 1.0


def strain_factor_of_files(place: Place) -> float:
    """Factor that converts the strain or displacement of a test file: 2 for a tensor's shear strain, 1 otherwise.

    >>> strain_factor_of_files(Specimen("coupon", "modulus", "tensor")), strain_factor_of_files(Direction.AXIAL)
    (2.0, 1.0)
    """
    return 2.0 if isinstance(place, Specimen) and place.strain == "tensor" else 1.0


def bushing_at(bushing: Bushing | None, place: Place) -> Bushing | None:
    """Bushing to which a direction or specimen belongs: `bushing` for a direction of one bushing; None for a coupon."""
    return place.bushing if isinstance(place, Specimen) else bushing


def _require_bushing(bushing: Bushing | None, place: Place) -> Bushing:
    """Return the bushing to which a direction or specimen belongs; raise a ModelError if there is none."""
    if (bushing := bushing_at(bushing, place)) is None:
        raise ModelError(
            "there is no bushing",
            place=str(place),
            expected="a [bushing] table with radii and length: each direction belongs to a bushing",
            hint="to predict a bushing of the same compound: bushfit predict MODEL.json --bushing other.toml",
        )
    return bushing


class _Definition(NamedTuple):
    """Kind of motion of a direction, and formulas for its strain and stiffness as functions of radii and length [m]."""

    motion: Motion
    unit_strain: Callable[[float, float], float]
    stiffness_per_modulus: Callable[[float, float, float], float]


#: A new direction is a name in `Direction` and an entry here.
_DEFINITIONS = {
    Direction.AXIAL: _Definition(TRANSLATION, tube.axial_strain, tube.axial_stiffness),
    Direction.RADIAL: _Definition(TRANSLATION, tube.radial_strain, tube.radial_stiffness),
    Direction.TORSION: _Definition(ROTATION, tube.torsion_strain, tube.torsion_stiffness),
}
