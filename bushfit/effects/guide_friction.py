"""Guide friction: dry friction in the rig's guides, in parallel with the bushing, as of slip at its sleeve."""

from __future__ import annotations

from dataclasses import replace

from bushfit.effects import interface_slip
from bushfit.effects.contract import Level, Parameter

EFFECT = replace(
    interface_slip.EFFECT,
    name="guide_friction",
    sentence="Dry friction in the rig's guides: extra loss that fades with amplitude, the same at every frequency.",
    level=Level.INSTRUMENT,
    parameters=(Parameter("force", "N", (0.0, 1e5), 0.0, 5.0, meaning="Coulomb force of the guides"),),
    confirmed_by="run the empty fixture slowly: what force remains is friction of the guides",
    twins=(),
)
