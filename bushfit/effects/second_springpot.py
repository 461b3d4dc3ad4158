"""Second springpot: a power of frequency beside that of the first, such as the steep rise towards glass."""

from __future__ import annotations

from dataclasses import replace

from bushfit.effects import springpot
from bushfit.effects.contract import Parameter

EFFECT = replace(
    springpot.EFFECT,
    name="second_springpot",
    sentence="A second, steeper power of frequency: stiffness and loss rise faster at high frequency than below.",
    equation="m/2 (i omega)^alpha with m and alpha of its own",
    parameters=(
        Parameter("m", "Pa*s^alpha", (0.0, 1e8), 0.0, 2e3, meaning="constant of this springpot"),
        Parameter("alpha", "1", (0.02, 1.0), None, 0.6, log=True, meaning="order of this springpot", scale="order"),
    ),
    after="springpot",
    source="two fractional elements: R. L. Bagley, P. J. Torvik, AIAA J. 21 (1983) 741; law as Garcia Tarrago et al. "
    "2007, Eqs. 1-3",
    confirmed_by="sweep to ten times the highest frequency: the rise must go on, where that of a maxwell arm levels "
    "off; a viscous branch is its limit of order 1, without a rise of stiffness",
)
