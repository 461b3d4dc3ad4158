"""Bushing geometry: equivalent strain and stiffness per direction (Eqs. 7, 8, 10, 11, 12).

Source: Garcia Tarrago, Kari, Vinolas, Gil-Negrete, Polymer Testing 26 (2007) 629-638.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import NamedTuple

from scipy.special import ive, kve

from bushfit.errors import ModelError

#: Inner over outer radius, and length over outer radius, for which Eqs. 11 and 12 were checked.
RADIUS_RATIO_RANGE = (0.1, 0.97)
SLENDERNESS_RANGE = (0.05, 100.0)
#: 1.8 mm over 18 mm is not quite 0.1 in binary.
_ROUNDING = 1e-9


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
        words: what moves and what resists, as files and reports call them.
        displacement_unit, force_unit, stiffness_unit: SI units, as `units` writes them.
        display: the units in which engineers read them.
    """

    words: tuple[str, str]
    displacement_unit: str
    force_unit: str
    stiffness_unit: str
    display: Display


TRANSLATION = Motion(
    ("displacement", "force"), "m", "N", "N/m", Display(Unit("mm", 1e3), Unit("N", 1.0), Unit("N/mm", 1e-3))
)
ROTATION = Motion(
    ("rotation", "moment"),
    "rad",
    "N*m",
    "N*m/rad",
    Display(Unit("deg", math.degrees(1.0)), Unit("N m", 1.0), Unit("N m/rad", 1.0)),
)


class Direction(StrEnum):
    """Direction of a test: its name in files, and the kind of motion that it is."""

    AXIAL = "axial"
    RADIAL = "radial"
    TORSION = "torsion"

    @property
    def motion(self) -> Motion:
        """Translation or rotation."""
        return _MOTIONS[self]

    @property
    def is_rotation(self) -> bool:
        """Whether it counts rotation [rad] and moment [N m], and not displacement [m] and force [N]."""
        return self.motion is ROTATION

    @property
    def display(self) -> Display:
        """The units in which engineers read its displacement, force and stiffness."""
        return self.motion.display


_MOTIONS = {Direction.AXIAL: TRANSLATION, Direction.RADIAL: TRANSLATION, Direction.TORSION: ROTATION}


@dataclass(frozen=True)
class Bushing:
    """A rubber tube bonded to two sleeves.

    Args:
        name: label of the bushing.
        inner_radius: a, radius of the inner sleeve [m].
        outer_radius: b, radius of the outer sleeve [m].
        length: L, mean length of the rubber [m].

    Raises:
        ModelError: a radius or length that is not positive and finite, or a >= b.
    """

    name: str
    inner_radius: float
    outer_radius: float
    length: float

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

    @cached_property
    def _log_ratio(self) -> float:
        """ln(b/a), with full precision for thin bushings too."""
        return math.log1p((self.outer_radius - self.inner_radius) / self.inner_radius)

    @property
    def rubber_volume(self) -> float:
        """Volume of rubber [m^3]."""
        return math.pi * (self.outer_radius**2 - self.inner_radius**2) * self.length

    def unit_strain(self, direction: Direction) -> float:
        """Equivalent strain per unit displacement [1/m], or per unit rotation [1/rad] in torsion.

        axial    e/d = 1 / sqrt(2 (b^2 - a^2) ln(b/a))                                   (7)
        radial   e/d = sqrt((a^2 + b^2) / ((b^4 - a^4) ln(b/a) - (a^2 - b^2)^2))         (8)
        torsion  e/theta = a b / (b^2 - a^2), from k theta^2/2 = V mu (2 e)^2/2
        """
        a, b = self.inner_radius, self.outer_radius
        area = (b - a) * (b + a)
        match direction:
            case Direction.AXIAL:
                return 1.0 / math.sqrt(2.0 * area * self._log_ratio)
            case Direction.RADIAL:
                # (b^4 - a^4) ln(b/a) - (b^2 - a^2)^2 = (b^2 - a^2) (b^2 + a^2) (ln(b/a) - q)
                return 1.0 / math.sqrt(area * self._log_ratio_less_q)
            case Direction.TORSION:
                return a * b / area

    def stiffness_per_modulus(self, direction: Direction) -> float:
        """Stiffness per unit equivalent shear modulus: [m], or [m^3/rad] in torsion.

        axial    k/mu = 2 pi L / ln(b/a)                                                 (10)
        radial   k/mu = 10 pi L / (7/2 ln(b/a) - 3/2 q + D), q = (b^2 - a^2)/(b^2 + a^2) (11, 12)
        torsion  k/mu = 4 pi L a^2 b^2 / (b^2 - a^2)
        """
        a, b, length = self.inner_radius, self.outer_radius, self.length
        match direction:
            case Direction.AXIAL:
                return 2.0 * math.pi * length / self._log_ratio
            case Direction.RADIAL:
                return 10.0 * math.pi * length / self._radial_denominator
            case Direction.TORSION:
                return 4.0 * math.pi * length * (a * b) ** 2 / ((b - a) * (b + a))

    @cached_property
    def _log_ratio_less_q(self) -> float:
        """ln(b/a) - q with q = (b^2 - a^2)/(b^2 + a^2); a series where the two cancel.

        ln(b/a) = atanh(q), so the difference is q^3/3 + q^5/5 + ...
        """
        q = self._q
        if q > 0.5:
            return self._log_ratio - q
        return math.fsum(q ** (2 * j + 3) / (2 * j + 3) for j in range(30))

    @property
    def _q(self) -> float:
        a, b = self.inner_radius, self.outer_radius
        return (b - a) * (b + a) / (a * a + b * b)

    @cached_property
    def _radial_denominator(self) -> float:
        """7/2 ln(b/a) - 3/2 q + D of Eq. 11, with D of Eq. 12.

        Every Bessel product is written with the scaled functions, and the common factor
        exp(alpha (b - a)) is divided out of numerator and denominator, so short bushings neither
        over- nor underflow. Agrees with 60-digit arithmetic to 1e-9, and to 1e-7 for tubes that are
        both long and thin, over the checked range.
        """
        a, b = self.inner_radius, self.outer_radius
        if not (_within(a / b, RADIUS_RATIO_RANGE) and _within(self.length / b, SLENDERNESS_RANGE)):
            raise ModelError(
                "the radial formula (Eqs. 11, 12) was not checked for this shape",
                place="inner_radius, outer_radius, length",
                found=f"inner/outer = {a / b:.3g}, length/outer = {self.length / b:.3g}",
                expected="inner/outer 0.1 to 0.97 and length/outer 0.05 to 100",
                hint="check the units of the geometry; the axial direction has no such limit",
            )
        alpha = math.sqrt(60.0) / self.length
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
        return 3.5 * self._log_ratio - 1.5 * self._q + float(numerator / denominator)


def _within(value: float, limits: tuple[float, float]) -> bool:
    return limits[0] * (1.0 - _ROUNDING) <= value <= limits[1] * (1.0 + _ROUNDING)
