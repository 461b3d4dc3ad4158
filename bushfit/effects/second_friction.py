"""Second friction branch: what develops at smaller strains than the first."""

from __future__ import annotations

from dataclasses import replace

from bushfit.effects import friction
from bushfit.effects.contract import Parameter

EFFECT = replace(
    friction.EFFECT,
    name="second_friction",
    sentence="A second filler friction at a smaller strain scale: extra stiffness at the smallest amplitudes.",
    equation="(A + iB)/(2 e0) with sigma_fmax and eps_half of its own",
    parameters=(
        Parameter("sigma_fmax", "Pa", (0.0, 1e8), 0.0, 2e3, meaning="largest stress of this friction"),
        Parameter(
            "eps_half",
            "1",
            (1e-6, 1.0),
            None,
            1e-3,
            log=True,
            meaning="strain that develops half of that stress",
            scale="strain",
        ),
    ),
    source="Garcia Tarrago et al. 2007, Eq. 5, once more; friction elements in parallel as in Iwan 1966",
    confirmed_by="sweep at a fifth and a tenth of the smallest amplitude: stiffness must level off",
)
