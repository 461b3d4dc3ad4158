"""Estimate of the parameters of a rubber that was not tested, from hardness and filler."""

import numpy as np

from bushfit.campaign.quantities import Compound
from bushfit.effects import BASE
from bushfit.geometry import Bushing
from bushfit.model.covariance import Z95
from bushfit.model.model import FIVE, Model
from bushfit.model.result import Result
from bushfit.planning.contract import Knowledge
from bushfit.units import number

#: Density of carbon black [g/cm^3]; handbooks: 1.7 to 1.9.
_BLACK_DENSITY = 1.8
#: Density of polymers [g/cm^3]; handbooks.
_DENSITY = {"natural": 0.92, "SBR": 0.94, "EPDM": 0.86, "NBR": 1.0, "CR": 1.23, "IIR": 0.92}
#: Filler of the paper's compound [phr].
_PAPER_FILLER = 27.0
#: Angular frequency that corresponds to a durometer reading after 3 s [rad/s]: the inverse of the time.
_READING = 1.0 / 3.0
#: Angular frequency at which springpot and spring are compared, 10 Hz [rad/s]: the middle of usual sweeps.
_MIDDLE = 2.0 * np.pi * 10.0
#: Springpot over spring at 10 Hz [1], from Table 1: 0.2/2 62.8^0.24/1.09.
_SPRINGPOT = 0.25
#: Order of the springpot, from Table 1.
_ORDER = 0.24
#: Friction at small strain over spring [1], from Table 1: 14.6/(2 0.013 1090).
_FRICTION = 0.515
#: Strain at half of the friction, from Table 1.
_HALF_STRAIN = 0.013
#: Exponent of the filler's volume fraction in the stiffness of the filler network; Heinrich and Klueppel 2002: 3.5.
_NETWORK = 3.5
#: Smallest volume fraction of filler, for the slight friction of rubber without filler.
_MINIMUM_FRACTION = 0.02
#: Standard deviation of a stated hardness [Shore A]: compounds are sold within 5 degrees, which is taken for 95 %.
_HARDNESS_ERROR = 2.5
#: Standard deviation of ln G at a known hardness; chosen: relations between hardness and modulus differ by some 20 %,
#: and rubber in a mould is not rubber in a sheet.
_MODULUS_ERROR = 0.2
#: Standard deviations of ln q, ln alpha, ln r and ln eps_half in natural rubber: 95 % of rubbers are within factors of
#: 2.4, 1.7, 2.7 and 2.2.
_SHAPE_ERRORS = np.array([0.45, 0.27, 0.5, 0.4])
#: The same in other rubbers, larger because the numbers come from natural rubber; a measured EPDM has alpha below 0.1.
_OTHER_ERRORS = np.array([0.7, 0.5, 0.7, 0.5])
#: Standard deviation of the exponent `_NETWORK`, which differs between carbon blacks.
_NETWORK_ERROR = 1.0


def gent_modulus(shore: float) -> float:
    """Shear modulus [Pa] of a rubber of Shore A hardness `shore`: a third of Young's modulus by Gent (1958)."""
    return 1e6 * 0.0981 * (56.0 + 7.66 * shore) / (0.137505 * (254.0 - 2.54 * shore)) / 3.0


def guess_parameters(bushing: Bushing, compound: Compound) -> Knowledge:
    """Estimate the parameters of a rubber that was not tested, with their uncertainty, from hardness and filler.

    Args:
        bushing: geometry of the bushing.
        compound: hardness [Shore A], carbon black [phr] and polymer.

    Returns:
        Estimates of mu, m, alpha, sigma_fmax and eps_half, with their covariance, from which a plan can start.

    Notes:
        With S in Shore A, n phr of carbon black, and the values of the paper's bushing at index 0:

            E = 0.0981 (56 + 7.66 S)/(0.137505 (254 - 2.54 S)) MPa, G = E/3                   (Gent 1958)
            G = mu + Re m/2 (i omega_S)^alpha, omega_S = 1/(3 s), the reading time of a durometer
            phi = (n/1.8)/(n/1.8 + 100/density), volume fraction of carbon black
            X = 1 + 2.5 phi + 14.1 phi^2, strain of the rubber between particles over the mean (Guth 1945)
            q = m/2 omega_0^alpha/mu = 0.25, alpha = 0.24, omega_0 = 2 pi 10 Hz
            r = sigma_fmax/(2 eps_half mu) = 0.515 (phi/phi_0)^3.5 X_0/X                      (Payne effect)
            eps_half = 0.013 X_0/X

        The numbers are those of the paper's bushing (natural rubber, phi_0 of 27 phr, Table 1). Three laws apply them
        to another compound: a filler network stiffens with phi^3.5, filler amplifies strain by X, and filler amplifies
        spring and springpot equally, so their ratio q is the same.

        Sources: A. N. Gent, Rubber Chemistry and Technology 31 (1958) 896-906, whose relation is quoted with 7.66, as
        here, or with 7.62336, which gives 0.5 % less; E. Guth, J. Applied Physics 16 (1945) 20-25; G. Heinrich, M.
        Klueppel, Advances in Polymer Science 160 (2002) 1-44, for phi^3.5; Garcia Tarrago et al. 2007, Table 1.

        The errors of ln G, ln q, ln alpha, ln r and ln eps_half are independent; their standard deviations are the
        constants of this module. They are chosen: one published and one measured compound lie inside (tests/planning),
        and two compounds prove little. If the stiffness follows a power of frequency over four decades, as for the
        measured compound, a fit gives mu near zero, far from this estimate of mu.
    """
    filler = np.array([compound.filler, _PAPER_FILLER]) / _BLACK_DENSITY  # of the compound and of the paper's
    polymer = 100.0 / np.array([_DENSITY[compound.rubber], _DENSITY["natural"]])
    share, paper_share = phi = np.maximum(filler / (filler + polymer), _MINIMUM_FRACTION)
    amplified, paper_amplified = 1.0 + 2.5 * phi + 14.1 * phi**2
    strained = float(paper_amplified / amplified)
    modulus, more = gent_modulus(compound.hardness), float(np.log(share / paper_share))
    friction, eps_half = _FRICTION * strained * np.exp(_NETWORK * more), _HALF_STRAIN * strained
    at_reading = _SPRINGPOT * (_READING / _MIDDLE) ** _ORDER * np.exp(0.5j * np.pi * _ORDER)
    mu = modulus / (1.0 + at_reading.real)
    values = {
        "mu": mu,
        "m": 2.0 * _SPRINGPOT * mu * _MIDDLE**-_ORDER,
        "alpha": _ORDER,
        "sigma_fmax": 2.0 * eps_half * friction * mu,
        "eps_half": eps_half,
    }
    by_hardness = np.log(gent_modulus(compound.hardness + 0.5) / gent_modulus(compound.hardness - 0.5))
    errors = np.array(_SHAPE_ERRORS if compound.rubber == "natural" else _OTHER_ERRORS)
    errors[2] = np.hypot(errors[2], _NETWORK_ERROR * more)
    errors = np.array([np.hypot(_MODULUS_ERROR, _HARDNESS_ERROR * by_hardness), *errors])
    # rows: ln mu, ln m, ln alpha, ln sigma_fmax, ln eps_half; columns: ln G, ln q, ln alpha, ln r, ln eps_half
    weight = at_reading / (1.0 + at_reading.real)
    of_order = -_ORDER * (weight * (np.log(_READING / _MIDDLE) + 0.5j * np.pi)).real
    spring = np.array([1.0, -weight.real, of_order, 0.0, 0.0])
    slopes = np.outer([1.0, 1.0, 0.0, 1.0, 0.0], spring) + np.diag([0.0, 1.0, 1.0, 1.0, 1.0])
    slopes[1, 2] -= _ORDER * np.log(_MIDDLE)
    slopes[3, 4] += 1.0
    scaled = slopes * errors
    covariance = scaled @ scaled.T
    widths = zip(FIVE, np.exp(Z95 * np.sqrt(np.diag(covariance))).tolist(), strict=True)
    source = (
        f"an estimate from {number(compound.hardness, 3)} Shore A and {number(compound.filler, 3)} phr of carbon black "
        f"in {compound.rubber} rubber: Gent's relation for the modulus, the paper's compound for the rest. 95 % of "
        f"rubbers are assumed within factors of {', '.join(f'{number(factor, 2)} ({name})' for name, factor in widths)}"
    )
    return Knowledge(Result(Model(bushing, BASE, values)), FIVE, covariance, source)
