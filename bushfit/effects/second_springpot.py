"""Second springpot: a power of frequency beside that of the first, such as the steep rise towards glass."""

from bushfit.effects.contract import Values
from bushfit.effects.springpot import modulus as modulus
from bushfit.effects.springpot import modulus_sensitivities as modulus_sensitivities
from bushfit.effects.springpot import stress as stress
from bushfit.effects.springpot import stress_sensitivities as stress_sensitivities

#: Order from which on a springpot is nearly a dashpot, whose order is 1.
_NEARLY_A_DASHPOT = 0.9


def _dashpot(p: Values) -> dict[str, float] | None:
    """The steeper of the two springpots as a dashpot, m/2 i omega, beside the other: either may be the first."""
    flat, steep = sorted([(p["alpha"], p["m"]), (p["second_springpot.alpha"], p["second_springpot.m"])])
    if steep[0] < _NEARLY_A_DASHPOT:
        return None
    return {"alpha": flat[0], "m": flat[1], "viscous.eta": steep[1] / 2.0}


becomes = ("viscous", _dashpot)
