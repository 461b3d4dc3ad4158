"""Campaigns cut down and diagnosed, and what was said of them: shared by the tests of the workflow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from rigged import LEVELS, cut

from bushfit.campaign.campaign import Campaign
from bushfit.diagnosis.record import Diagnosis, Settings
from bushfit.diagnosis.workflow import diagnose
from bushfit.fitting.data import Data
from bushfit.model.model import Model

INERTIA = {"inertia": {"mass": 0.06}}
SLIP = {"interface_slip": {"force": 6.0}}
TWO = {"delay": {"tau": 1e-4}, "strain_stiffening": {"c3": 20.0}}


def asked(campaign: Campaign, model: Model | None = None, **settings: object) -> Diagnosis:
    diagnosis = diagnose(Data.of(campaign), model, Settings(**settings))  # type: ignore[arg-type]
    odds = [
        f"{label} {share:.3f}" for label, (_, share) in zip(diagnosis.odds.labels, diagnosis.odds.told, strict=True)
    ]
    print(
        said(diagnosis), diagnosis.summary, f"nothing {diagnosis.odds.nothing:.3g}", *odds, *diagnosis.notes, sep=" | "
    )
    return diagnosis


def said(diagnosis: Diagnosis) -> str:
    return f"{diagnosis.verdict} " + " + ".join("|".join((e.name, *e.alternatives)) for e in diagnosis.effects)


def names(diagnosis: Diagnosis) -> set[str]:
    return {effect.name for effect in diagnosis.effects}


def no_loops(c: Campaign) -> Campaign:
    return replace(c, loops=())


def no_sweeps(c: Campaign) -> Campaign:
    return replace(c, sweeps=())


def one_direction(c: Campaign) -> Campaign:
    return replace(c, sweeps=c.sweeps[:1])


def one_loop(c: Campaign) -> Campaign:
    return replace(c, sweeps=(), loops=c.loops[:1])


def no_repeats(c: Campaign) -> Campaign:
    return replace(c, sweeps=tuple(cut(sweep, sweep.repeat == 1) for sweep in c.sweeps))


def missing_points(c: Campaign) -> Campaign:
    random = np.random.default_rng(3)
    return replace(c, sweeps=tuple(cut(sweep, random.random(sweep.frequency.size) < 0.7) for sweep in c.sweeps))


def one_level(c: Campaign) -> Campaign:
    return replace(c, sweeps=tuple(cut(sweep, sweep.amplitude == LEVELS[0]) for sweep in c.sweeps))


def one_frequency(c: Campaign) -> Campaign:
    return replace(c, sweeps=tuple(cut(sweep, sweep.frequency == 25.0) for sweep in c.sweeps))
