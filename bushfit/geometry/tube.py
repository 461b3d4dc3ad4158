"""Eqs. 7, 8, 10, 11, 12 for a rubber tube between two sleeves, of radii a < b and length L.

Source: Garcia Tarrago, Kari, Vinolas, Gil-Negrete, Polymer Testing 26 (2007) 629-638.
Strains are per unit displacement [1/m] or rotation [1/rad], stiffnesses per unit shear modulus [m] or [m^3/rad].
"""

import math
from functools import lru_cache

from scipy.special import ive, kve

from bushfit.errors import ModelError

#: Range of inner over outer radius in which the radial formula was checked against 60-digit arithmetic.
RADIUS_RATIO_RANGE = (0.1, 0.97)
#: Range of length over outer radius in which the radial formula was checked against 60-digit arithmetic.
SLENDERNESS_RANGE = (0.05, 100.0)
#: Relative tolerance of the two ranges, for rounding: 1.8 mm / 18 mm is not exactly 0.1.
_ROUNDING = 1e-9
#: q = (b^2 - a^2)/(b^2 + a^2) up to which ln(b/a) - q is summed as a series; above it, the two no longer cancel.
_LARGEST_Q_OF_SERIES = 0.5


def axial_strain(a: float, b: float) -> float:
    """Equivalent axial strain per displacement [1/m] for radii a < b [m] (Garcia Tarrago et al. 2007, Eq. 7).

    Notes: e/d = 1 / sqrt(2 (b^2 - a^2) ln(b/a)).

    >>> round(axial_strain(0.010, 0.018), 2)
    61.62
    """
    return 1.0 / math.sqrt(2.0 * _area(a, b) * _log_ratio(a, b))


def axial_stiffness(a: float, b: float, length: float) -> float:
    """Compute the axial stiffness per shear modulus, k/mu = 2 pi L / ln(b/a) (Garcia Tarrago et al. 2007, Eq. 10).

    Args:
        a, b: inner and outer radius [m].
        length: length of the rubber [m].

    Returns:
        Stiffness per unit shear modulus [m].

    >>> round(axial_stiffness(0.010, 0.018, 0.034), 4)
    0.3634
    """
    return 2.0 * math.pi * length / _log_ratio(a, b)


@lru_cache(maxsize=256)  # a fit asks for those of one bushing thousands of times
def radial_strain(a: float, b: float) -> float:
    """Equivalent radial strain per displacement [1/m] for radii a < b [m] (Garcia Tarrago et al. 2007, Eq. 8).

    Notes: e/d = sqrt((a^2 + b^2) / ((b^4 - a^4) ln(b/a) - (a^2 - b^2)^2)). With q = (b^2 - a^2)/(b^2 + a^2), this
    equals 1 / sqrt((b^2 - a^2) (ln(b/a) - q)). If ln(b/a) and q cancel, the difference is summed as
    q^3/3 + q^5/5 + ..., because ln(b/a) = atanh(q).

    >>> round(radial_strain(0.010, 0.018), 1)
    274.0
    """
    q = _area(a, b) / (a * a + b * b)
    series = (q ** (2 * j + 3) / (2 * j + 3) for j in range(30))  # the next one is 1e-17 of the sum at the largest q
    difference = _log_ratio(a, b) - q if q > _LARGEST_Q_OF_SERIES else math.fsum(series)
    return 1.0 / math.sqrt(_area(a, b) * difference)


@lru_cache(maxsize=256)
def radial_stiffness(a: float, b: float, length: float) -> float:
    """Compute the radial stiffness per shear modulus (Garcia Tarrago et al. 2007, Eqs. 11 and 12).

    Args:
        a, b: inner and outer radius [m].
        length: length of the rubber [m].

    Returns:
        Stiffness per unit shear modulus [m].

    Raises:
        ModelError: the formula was not checked for this shape.

    Notes: k/mu = 10 pi L / (7/2 ln(b/a) - 3/2 q + D), with q = (b^2 - a^2)/(b^2 + a^2) and D of Eq. 12. Every Bessel
    product of D is written with the scaled functions, and the common factor exp(alpha (b - a)) is divided out of
    numerator and denominator, so short bushings neither over- nor underflow. Agrees with 60-digit arithmetic to 1e-9,
    and to 1e-7 for tubes that are both long and thin, over the checked range.

    >>> round(radial_stiffness(0.010, 0.018, 0.034), 4)
    2.8431
    """
    ranges = ((a / b, RADIUS_RATIO_RANGE), (length / b, SLENDERNESS_RANGE))
    if not all(low * (1.0 - _ROUNDING) <= value <= high * (1.0 + _ROUNDING) for value, (low, high) in ranges):
        raise ModelError(
            "the radial formula (Eqs. 11, 12) was not checked for this shape",
            place="inner_radius, outer_radius, length",
            found=f"inner/outer = {a / b:.3g}, length/outer = {length / b:.3g}",
            expected="inner radius 0.1 to 0.97 times and length 0.05 to 100 times the outer radius",
            hint="check the units of the geometry; the axial direction has no such limit",
        )
    q = _area(a, b) / (a * a + b * b)
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
    return float(10.0 * math.pi * length / (3.5 * _log_ratio(a, b) - 1.5 * q + numerator / denominator))


def torsion_strain(a: float, b: float) -> float:
    """Equivalent torsional strain per rotation [1/rad], e/theta = a b / (b^2 - a^2), for radii a < b [m].

    Notes: follows from the energy, k theta^2/2 = V mu (2 e)^2/2.

    >>> round(torsion_strain(0.010, 0.018), 4)
    0.8036
    """
    return a * b / _area(a, b)


def torsion_stiffness(a: float, b: float, length: float) -> float:
    """Compute the torsional stiffness per shear modulus, k/mu = 4 pi L a^2 b^2 / (b^2 - a^2).

    Args:
        a, b: inner and outer radius [m].
        length: length of the rubber [m].

    Returns:
        Stiffness per unit shear modulus [m^3/rad].

    >>> round(torsion_stiffness(0.010, 0.018, 0.034) * 1e6, 1)  # [mm^2 m]
    61.8
    """
    return 4.0 * math.pi * length * (a * b) ** 2 / _area(a, b)


def _log_ratio(a: float, b: float) -> float:
    """Compute ln(b/a) with full precision for thin bushings, too."""
    return math.log1p((b - a) / a)


def _area(a: float, b: float) -> float:
    """Compute b^2 - a^2 [m^2] with full precision for thin bushings, too."""
    return (b - a) * (b + a)
