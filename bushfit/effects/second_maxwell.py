"""Second Maxwell arm: another relaxation beside the first."""

from __future__ import annotations

from dataclasses import replace

from bushfit.effects import maxwell

EFFECT = replace(
    maxwell.EFFECT,
    name="second_maxwell",
    sentence="A second relaxation of the rubber beside the first: two steps of stiffness, at two frequencies.",
    equation="mu1 i omega tau/(1 + i omega tau) with mu1 and tau of its own",
    source="two arms of a generalised Maxwell model; J. D. Ferry, Viscoelastic Properties of Polymers, 3rd ed., 1980, "
    "ch. 3",
    confirmed_by="sweep two decades below and above: between the two relaxations the stiffness must level off",
    after="maxwell",
)
