"""What is tested, and how: a bushing in a direction, or a specimen of its compound; equivalent strain and stiffness.

Eqs. 7, 8, 10, 11, 12. Source: Garcia Tarrago, Kari, Vinolas, Gil-Negrete, Polymer Testing 26 (2007) 629-638.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property, lru_cache
from typing import Literal, NamedTuple

from scipy.special import ive, kve

from bushfit.errors import ModelError
from bushfit.shape import NO_CORRECTION, Correction, radial_correction

#: Which radial formulas a bushing goes by: the paper's as they are, or corrected by finite elements.
Shape = Literal["paper", "calibrated"]
#: Inner over outer radius for which the radial formula was checked against 60-digit arithmetic.
RADIUS_RATIO_RANGE = (0.1, 0.97)
#: Length over outer radius for which the radial formula was checked against 60-digit arithmetic.
SLENDERNESS_RANGE = (0.05, 100.0)
#: Relative width by which the two ranges are widened: 1.8 mm over 18 mm is not quite 0.1 in binary.
_ROUNDING = 1e-9
#: q = (b^2 - a^2)/(b^2 + a^2) up to which ln(b/a) - q is summed as a series; above it, the two no longer cancel.
_LARGEST_Q_OF_SERIES = 0.5
#: Terms of that series; at the largest q, the first one left out is 1e-17 of the sum.
_SERIES_TERMS = 30
#: Bushings whose radial factors are kept: a fit asks for those of one bushing thousands of times.
_CACHED_BUSHINGS = 256


class Unit(NamedTuple):
    """A unit in which people read a quantity, and the factor from SI to it."""

    name: str
    factor: float


class Display(NamedTuple):
    """The units in which engineers read displacement, force and stiffness."""

    displacement: Unit
    force: Unit
    stiffness: Unit


@dataclass(frozen=True)
class Motion:
    """A kind of motion: what moves, what resists it, and the units of both.

    Args:
        words: what moves, what resists it, and what relates the two, as files and reports call them.
        displacement_unit, force_unit, stiffness_unit: SI units, as `units` writes them.
        display: the units in which engineers read them.
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


class Direction(StrEnum):
    """Direction in which a bushing is tested: its name in files, and its kind of motion."""

    AXIAL = "axial"
    RADIAL = "radial"
    TORSION = "torsion"

    @property
    def motion(self) -> Motion:
        """Translation or rotation."""
        return _DEFINITIONS[self].motion

    @property
    def is_rotation(self) -> bool:
        """Whether it counts rotation [rad] and moment [N m], and not displacement [m] and force [N]."""
        return self.motion is ROTATION

    @property
    def display(self) -> Display:
        """The units in which engineers read its displacement, force and stiffness."""
        return self.motion.display


@dataclass(frozen=True)
class Bushing:
    """A rubber tube bonded to two sleeves.

    Args:
        name: label of the bushing.
        inner_radius: a, radius of the inner sleeve [m].
        outer_radius: b, radius of the outer sleeve [m].
        length: L, mean length of the rubber [m].
        shape: whether the radial formulas are the paper's, or corrected by finite elements.

    Raises:
        ModelError: a radius or length that is not positive and finite, or a >= b; a calibrated shape that no finite
            elements were computed for.
    """

    name: str
    inner_radius: float
    outer_radius: float
    length: float
    shape: Shape = "paper"

    def __post_init__(self) -> None:
        for key in ("inner_radius", "outer_radius", "length"):
            value = getattr(self, key)
            if not (math.isfinite(value) and value > 0):
                raise ModelError("impossible bushing", place=key, found=f"{value:g} m", expected="a positive length")
        if self.inner_radius >= self.outer_radius:
            raise ModelError(
                "impossible bushing",
                place="inner_radius, outer_radius",
                found=f"{self.inner_radius:g} m and {self.outer_radius:g} m",
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

    @cached_property
    def log_ratio(self) -> float:
        """ln(b/a), with full precision for thin bushings too."""
        return math.log1p((self.outer_radius - self.inner_radius) / self.inner_radius)

    @property
    def proportions(self) -> tuple[float, float]:
        """Inner over outer radius, and length over outer radius."""
        return self.inner_radius / self.outer_radius, self.length / self.outer_radius

    @cached_property
    def correction(self) -> Correction | None:
        """What finite elements make of the radial formulas, applied or not; None where none were computed."""
        return radial_correction(*self.proportions)

    @property
    def applied(self) -> Correction:
        """The correction of the radial formulas that this bushing goes by."""
        return self.correction if self.shape == "calibrated" and self.correction else NO_CORRECTION

    def unit_strain(self, direction: Direction) -> float:
        """Equivalent strain per unit displacement [1/m], or per unit rotation [1/rad]."""
        return _DEFINITIONS[direction].unit_strain(self)

    def stiffness_per_modulus(self, direction: Direction) -> float:
        """Stiffness per unit equivalent shear modulus: [m], or [m^3/rad] of a rotation."""
        return _DEFINITIONS[direction].stiffness_per_modulus(self)


@dataclass(frozen=True)
class Specimen:
    """A body of the compound that is tested in one way only: a coupon, or a mount in plain shear.

    Args:
        name: of the specimen; its tests and tables go by it.
        kind: "modulus" where tests give strain and modulus, "shear" where they give displacement and force of rubber
            blocks in shear.
        strain: of a modulus test, what its files state: engineering shear strain gamma = 2 e, the tensor's shear e (it
            is read as gamma), or the strain of a bar in tension, with Young's modulus.
        area: of one block in shear [m^2].
        thickness: of one block [m].
        elements: blocks in parallel.

    Raises:
        ModelError: a shear specimen without a positive area and thickness.

    Notes:
        The model's equivalent strain e is the tensor's shear, with stress 2 mu e. A block in shear has e/d = 1/(2
        thickness) and K/G = elements area/thickness. A bar of an incompressible rubber in tension has E = 3 G and, by
        equal energy, e = sqrt(3)/2 of its strain.
    """

    name: str
    kind: Literal["modulus", "shear"]
    strain: Literal["engineering", "tensor", "tension"] = "engineering"
    area: float | None = None
    thickness: float | None = None
    elements: int = 1

    def __post_init__(self) -> None:
        for key in ("area", "thickness"):
            size = getattr(self, key)
            if (self.kind == "shear") != (size is not None) or not (size is None or (math.isfinite(size) and size > 0)):
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

    @property
    def is_rotation(self) -> bool:
        """Whether it counts rotation; no specimen does."""
        return False

    @property
    def display(self) -> Display:
        """The units in which engineers read its displacement, force and stiffness, or strain, stress and modulus."""
        return self.motion.display

    @property
    def unit_strain(self) -> float:
        """Equivalent strain per unit displacement [1/m], or per unit of its strain [1]."""
        if self.thickness is not None:
            return 0.5 / self.thickness
        return math.sqrt(3.0) / 2.0 if self.strain == "tension" else 0.5

    @property
    def stiffness_per_modulus(self) -> float:
        """Stiffness per unit equivalent shear modulus [m], or modulus that a test gives over it [1]."""
        if self.area is not None and self.thickness is not None:
            return self.elements * self.area / self.thickness
        return 3.0 if self.strain == "tension" else 1.0

    @property
    def stated_strain(self) -> float:
        """What one unit of strain as its files state it is as it is counted: 2 of the tensor's shear, else 1."""
        return 2.0 if self.strain == "tensor" else 1.0


#: Where a response is measured or predicted: a direction of the bushing, or a specimen of its compound.
Place = Direction | Specimen


def place_named(name: str, specimens: Iterable[Specimen]) -> Place:
    """The specimen of this name, or else the direction.

    Raises:
        ModelError: it is neither.
    """
    known: dict[str, Place] = {str(place): place for place in (*Direction, *specimens)}
    if name not in known:
        raise ModelError("no such direction or specimen", found=name, expected="one of " + ", ".join(known))
    return known[name]


def unit_strain(bushing: Bushing | None, place: Place) -> float:
    """Equivalent strain per unit displacement [1/m], rotation [1/rad] or strain [1] at a place.

    Raises:
        ModelError: a direction where there is no bushing.
    """
    return place.unit_strain if isinstance(place, Specimen) else _present(bushing, place).unit_strain(place)


def stiffness_per_modulus(bushing: Bushing | None, place: Place) -> float:
    """Stiffness per unit equivalent shear modulus at a place: [m], [m^3/rad] of a rotation, [1] of a modulus.

    Raises:
        ModelError: a direction where there is no bushing.
    """
    if isinstance(place, Specimen):
        return place.stiffness_per_modulus
    return _present(bushing, place).stiffness_per_modulus(place)


def stated_strain(place: Place) -> float:
    """What one unit of displacement or strain in a test's file is as it is counted: 2 of the tensor's shear, else 1."""
    return place.stated_strain if isinstance(place, Specimen) else 1.0


def _present(bushing: Bushing | None, place: Direction) -> Bushing:
    if bushing is None:
        raise ModelError(
            "there is no bushing",
            place=str(place),
            expected="a [bushing] with its radii and length, which a direction belongs to",
            hint="bushfit predict MODEL.json --bushing other.toml carries the compound of a model to a bushing",
        )
    return bushing


def _axial_strain(tube: Bushing) -> float:
    """e/d = 1 / sqrt(2 (b^2 - a^2) ln(b/a)) (Eq. 7)."""
    return 1.0 / math.sqrt(2.0 * _area(tube) * tube.log_ratio)


def _axial_stiffness(tube: Bushing) -> float:
    """k/mu = 2 pi L / ln(b/a) (Eq. 10)."""
    return 2.0 * math.pi * tube.length / tube.log_ratio


@lru_cache(maxsize=_CACHED_BUSHINGS)
def _radial_strain(tube: Bushing) -> float:
    """e/d = sqrt((a^2 + b^2) / ((b^4 - a^4) ln(b/a) - (a^2 - b^2)^2)) (Eq. 8), corrected where the shape is calibrated.

    Notes: with q = (b^2 - a^2)/(b^2 + a^2) this is 1 / sqrt((b^2 - a^2) (ln(b/a) - q)). Where ln(b/a) and q cancel, the
    difference is summed as q^3/3 + q^5/5 + ..., because ln(b/a) = atanh(q).
    """
    q = _q(tube)
    series = (q ** (2 * j + 3) / (2 * j + 3) for j in range(_SERIES_TERMS))
    difference = tube.log_ratio - q if q > _LARGEST_Q_OF_SERIES else math.fsum(series)
    return tube.applied.strain / math.sqrt(_area(tube) * difference)


@lru_cache(maxsize=_CACHED_BUSHINGS)
def _radial_stiffness(tube: Bushing) -> float:
    """k/mu = 10 pi L / (7/2 ln(b/a) - 3/2 q + D), with q = (b^2 - a^2)/(b^2 + a^2) and D of Eq. 12 (Eq. 11).

    Raises:
        ModelError: a shape for which the formula was not checked.

    Notes: every Bessel product of D is written with the scaled functions, and the common factor exp(alpha (b - a)) is
    divided out of numerator and denominator, so short bushings neither over- nor underflow. Agrees with 60-digit
    arithmetic to 1e-9, and to 1e-7 for tubes that are both long and thin, over the checked range.
    """
    a, b, length = tube.inner_radius, tube.outer_radius, tube.length
    if not (_within(a / b, RADIUS_RATIO_RANGE) and _within(length / b, SLENDERNESS_RANGE)):
        raise ModelError(
            "the radial formula (Eqs. 11, 12) was not checked for this shape",
            place="inner_radius, outer_radius, length",
            found=f"inner/outer = {a / b:.3g}, length/outer = {length / b:.3g}",
            expected="inner/outer 0.1 to 0.97 and length/outer 0.05 to 100",
            hint="check the units of the geometry; the axial direction has no such limit",
        )
    alpha = math.sqrt(60.0) / length
    inner, outer = alpha * a, alpha * b
    once, twice = math.exp(inner - outer), math.exp(2.0 * (inner - outer))
    (i0a, i0b), (i1a, i1b) = ive(0, [inner, outer]), ive(1, [inner, outer])
    (k0a, k0b), (k1a, k1b) = kve(0, [inner, outer]), kve(1, [inner, outer])
    numerator = (
        4.0 * (b**2 + a**2) * once
        - outer * (b**2 + 3.0 * a**2) * (i1b * k0a + i0a * k1b * twice)
        - inner * (3.0 * b**2 + a**2) * (i1a * k0b * twice + i0b * k1a)
    )
    denominator = inner * outer * (b**2 + a**2) * (i1b * k1a - i1a * k1b * twice)
    paper = 10.0 * math.pi * length / (3.5 * tube.log_ratio - 1.5 * _q(tube) + float(numerator / denominator))
    return tube.applied.stiffness * paper


def _torsion_strain(tube: Bushing) -> float:
    """e/theta = a b / (b^2 - a^2), from the energy: k theta^2/2 = V mu (2 e)^2/2."""
    return tube.inner_radius * tube.outer_radius / _area(tube)


def _torsion_stiffness(tube: Bushing) -> float:
    """k/mu = 4 pi L a^2 b^2 / (b^2 - a^2)."""
    return 4.0 * math.pi * tube.length * (tube.inner_radius * tube.outer_radius) ** 2 / _area(tube)


def _area(tube: Bushing) -> float:
    """b^2 - a^2 [m^2], with full precision for thin bushings too."""
    return (tube.outer_radius - tube.inner_radius) * (tube.outer_radius + tube.inner_radius)


def _q(tube: Bushing) -> float:
    """(b^2 - a^2)/(b^2 + a^2)."""
    return _area(tube) / (tube.inner_radius * tube.inner_radius + tube.outer_radius * tube.outer_radius)


def _within(value: float, limits: tuple[float, float]) -> bool:
    return limits[0] * (1.0 - _ROUNDING) <= value <= limits[1] * (1.0 + _ROUNDING)


class _Definition(NamedTuple):
    """What a direction is: its kind of motion, and a bushing's two formulas for it.

    Args:
        motion: translation or rotation.
        unit_strain: equivalent strain per unit displacement [1/m], or per unit rotation [1/rad].
        stiffness_per_modulus: stiffness per unit equivalent shear modulus: [m], or [m^3/rad] of a rotation.
    """

    motion: Motion
    unit_strain: Callable[[Bushing], float]
    stiffness_per_modulus: Callable[[Bushing], float]


#: A new direction is a name in `Direction` and an entry here.
_DEFINITIONS = {
    Direction.AXIAL: _Definition(TRANSLATION, _axial_strain, _axial_stiffness),
    Direction.RADIAL: _Definition(TRANSLATION, _radial_strain, _radial_stiffness),
    Direction.TORSION: _Definition(ROTATION, _torsion_strain, _torsion_stiffness),
}
