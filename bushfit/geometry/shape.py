"""The paper's radial formulas against finite elements: how far they lie off, as smooth functions of a tube's shape.

The tube is bonded to rigid sleeves, its ends are free. `tests/reference/finite_tube.py` solves it and prints the
coefficients below: of polynomials of Chebyshev's in the two `coordinates` of a shape.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.polynomial.chebyshev import chebval2d

#: Inner over outer radius for which the tube was solved.
RADIUS_RATIO_RANGE = (0.15, 0.92)
#: Length over outer radius for which the tube was solved.
SLENDERNESS_RANGE = (0.1, 60.0)
#: Bulk modulus of a filled rubber [Pa]: that of natural rubber, within a fifth.
BULK_MODULUS = 2e9
#: Shear over bulk modulus of the rubber that was solved; it counts as incompressible, as in the paper.
INCOMPRESSIBLE = 5e-5
#: How far a coordinate may lie beyond 1: 1.5 mm over 10 mm is not quite 0.15 in binary.
_ROUNDING = 1e-8

#: ln(stiffness over that of Eqs. 11 and 12).
_STIFFNESS = np.array(
    [
        [-0.043, -0.0252, 0.0208, 0.0152, 0.0034, -0.0101, -0.0044, 0.0045, 0.003, -0.0017, -0.0017],
        [0.0589, -0.0152, 0.0032, -0.0089, -0.0055, 0.0102, -0.0006, -0.0041, 0.0015, 0.0009, -0.0009],
        [-0.0027, -0.0112, -0.0109, 0.0089, 0.0, -0.0039, 0.0031, -0.0005, -0.0013, 0.0009, 0.0001],
        [0.0004, 0.0079, 0.0038, -0.0048, 0.002, -0.0002, -0.0009, 0.0014, -0.0007, -0.0004, 0.0006],
        [-0.0028, -0.0028, 0.0013, 0.0007, -0.0013, 0.0011, -0.0005, -0.0002, 0.0006, -0.0004, -0.0001],
        [0.0008, 0.0012, -0.0009, 0.0004, -0.0, -0.0003, 0.0005, -0.0003, -0.0, 0.0002, -0.0002],
    ]
)
#: ln(strain over that of Eq. 8).
_STRAIN = np.array(
    [
        [-0.3413, 0.8295, -0.1634, -0.1005, 0.054, 0.0074, -0.0092, 0.001, -0.001, -0.0, 0.0013],
        [0.4993, -0.73, 0.228, 0.0434, -0.0679, 0.021, 0.0063, -0.0104, 0.0039, 0.0022, -0.0019],
        [0.0032, 0.0659, -0.0819, 0.0431, 0.0089, -0.0252, 0.0102, 0.0046, -0.0061, 0.0013, 0.0013],
        [-0.0016, 0.0598, 0.0057, -0.0296, 0.0134, 0.006, -0.0101, 0.0041, 0.0019, -0.0032, 0.001],
        [0.006, -0.0098, 0.0081, 0.0012, -0.0081, 0.0057, 0.0015, -0.0047, 0.0023, 0.001, -0.0017],
        [0.0007, -0.0033, -0.0022, 0.0031, 0.0005, -0.0034, 0.0023, 0.0006, -0.002, 0.0011, 0.0004],
    ]
)
#: ln(softening).
_SOFTENING = np.array(
    [
        [2.4873, 2.3262, -0.5996, -0.2549, 0.1953, 0.0292, -0.0537],
        [-2.2216, -1.112, 0.5028, -0.0557, -0.0868, 0.0629, -0.0159],
        [0.3372, 0.0607, -0.1039, 0.0956, -0.0378, -0.0117, 0.0184],
        [-0.0028, 0.0874, -0.0271, -0.0199, 0.0324, -0.0218, 0.0072],
        [0.0009, -0.0206, 0.0167, -0.009, -0.0016, 0.0091, -0.0076],
    ]
)


class Correction(NamedTuple):
    """What finite elements make of the radial formulas for one shape.

    Args:
        stiffness: radial stiffness over that of Eqs. 11 and 12.
        strain: strain that friction sees over that of Eq. 8: at it, the friction branch gives what its integral over
            the uneven field gives, for strain amplitudes from 0.3 to 3 eps_half.
        softening: relative rise of the compliance per shear modulus over bulk modulus.
    """

    stiffness: float
    strain: float
    softening: float

    def lowering(self, mu: float) -> float:
        """Share by which a bulk modulus of 2 GPa lowers the radial stiffness of rubber with shear modulus `mu` [Pa].

        Notes: rubber that gives way in volume adds its compliance to that of incompressible rubber. That is within
        0.01 of finite elements for mu up to 3.3 MPa, and 0.02 up to 10 MPa.
        """
        return 1.0 - 1.0 / (1.0 + self.softening * (mu / BULK_MODULUS - INCOMPRESSIBLE))


#: No correction: the paper's formulas as they are.
NO_CORRECTION = Correction(1.0, 1.0, 0.0)


def coordinates(radius_ratio: float, slenderness: float) -> tuple[float, float]:
    """A shape's ln((b - a)/a) and ln(L/b), each scaled so that its range becomes -1 to 1.

    Args:
        radius_ratio: a/b, inner over outer radius.
        slenderness: L/b, length over outer radius.
    """
    thin, thick = (math.log(1.0 / ratio - 1.0) for ratio in reversed(RADIUS_RATIO_RANGE))
    flat, long = (math.log(end) for end in SLENDERNESS_RANGE)
    thickness, length = math.log(1.0 / radius_ratio - 1.0), math.log(slenderness)
    return 2.0 * (thickness - thin) / (thick - thin) - 1.0, 2.0 * (length - flat) / (long - flat) - 1.0


def radial_correction(radius_ratio: float, slenderness: float) -> Correction | None:
    """The correction of the radial formulas for a shape; None for one that lies outside the two ranges.

    Args:
        radius_ratio: a/b, inner over outer radius.
        slenderness: L/b, length over outer radius.

    Notes: within 1 % of finite elements in stiffness, and 3 % in strain.
    """
    place = coordinates(radius_ratio, slenderness)
    if max(map(abs, place)) > 1.0 + _ROUNDING:
        return None
    return Correction(*(math.exp(chebval2d(*place, table)) for table in (_STIFFNESS, _STRAIN, _SOFTENING)))
