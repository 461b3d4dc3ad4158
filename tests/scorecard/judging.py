"""Whether what diagnose says of a campaign is acceptable, by the keys of its diagnosis.json alone; and what a perfect
observer could know: how much likelier the tests are by the truth than by the model that was told."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
from lab_campaign import Answer

from bushfit.campaign.campaign import load_campaign
from bushfit.fitting.coordinates import residual
from bushfit.fitting.preparation import MeasuredLoop, MeasuredSweep, MeasuredTest, with_gain_weighting
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.problem import FitProblem
from bushfit.fitting.solve import solve
from bushfit.model.file import load_result

#: Verdicts under which names stay in the model.
_KEEPING = ("named", "partly")
#: What a correction without a name is called in the list of effects.
UNNAMED = "unnamed"
#: Names in a set at most, its leader among them, for the truth in it to count.
_LARGEST_SET = 4
#: Without noise repeats agree in all digits, but here they are no copies: no row is left out.
_EVERY_ROW: dict[str, Any] = {"without_copied_tests": list, "without_copied_repeats": lambda sweep: sweep}


class Judged(NamedTuple):
    """What an answer is worth.

    Args:
        acceptable: nothing wrong is said, and what is visible is told in some form.
        passed_over: what is visible is called consistent; of a clean campaign never.
        wrong_name: a name is kept that is not true, nor said to be a limit of a true one or equal to it.
        seen: the verdict is not "consistent"; of a clean campaign a false alarm.
        wrong_set: look-alikes are told, and the truth is not among them.
    """

    acceptable: bool
    passed_over: bool
    wrong_name: bool
    seen: bool
    wrong_set: bool


def acceptable(answer: Answer, diagnosis: Mapping[str, Any]) -> Judged:
    """Judge a diagnosis beside the truth.

    A name must be one of those that describe the kind truly. Where there is none, or beside it, a gap described or told
    unexplained is acceptable; so is a place at fault where the kind is off at such a place alone. What cannot be seen
    may be called consistent.
    """
    verdict = str(diagnosis["verdict"])
    told = [effect for effect in diagnosis["effects"] if effect["name"] != UNNAMED]
    names = [(effect["name"], *effect.get("twins", ())) for effect in told]
    others = [tuple(effect.get("alternatives", ())) for effect in told]
    claims = list(zip(names, others, strict=True))
    open_ = verdict == "ambiguous"
    wrong_name = any(not _true(answer, own) for own, rest in claims if verdict in _KEEPING or (open_ and not rest))
    wrong_set = open_ and any(
        not _true(answer, (*own, *rest)) or len(rest) >= _LARGEST_SET for own, rest in claims if rest
    )
    seen = verdict != "consistent"
    passed_over = answer.visible and not seen
    false_alarm = seen and not answer.kind
    return Judged(not (wrong_name or wrong_set or passed_over or false_alarm), passed_over, wrong_name, seen, wrong_set)


#: Words by which a place at fault is told, after "fault: ".
_WORDS = {"frequency": " Hz", "level": "level", "repeat": "repeat", "loop": "loop", "direction": ""}


def _true(answer: Answer, names: Sequence[str]) -> bool:
    """Whether one of the names, or of a pair of names, tells the kind truly, or a place of its sort is among them."""
    parts = [part for name in names for part in name.split(" + ")]
    families = {part.partition(".")[0] for part in parts}
    places = [part for part in parts if part.startswith("fault")]
    return bool(families.union(parts) & {*answer.right}) or any(
        _WORDS[place] in part for part in places for place in answer.place
    )


def against_truth(folder: Path, silent: Path, model: Path) -> float:
    """Logarithm of the likelihood of a campaign's tests by the truth over that by a model that was fitted to them.

    Args:
        folder, silent: of the campaign with the rig's errors, and of the same without any.
        model: the file of the model.

    Notes:
        Both by the noise that bushfit estimates, with the errors of its class. A model that
        is as good as the truth comes out at minus half the number of its parameters.
    """
    told = load_result(model).model
    with patch.multiple("bushfit.campaign.campaign", **_EVERY_ROW):
        tests, true = (
            PreparedCampaign.from_campaign(load_campaign(each / "bushing.toml")) for each in (folder, silent)
        )
    data_sets = with_gain_weighting((*tests.loops, *tests.sweeps), weigh=True)
    told = solve(FitProblem(told, data_sets, tuple(told.values))).model
    off = residual(told, data_sets)
    as_true = [_with(one, other) for one, other in zip(data_sets, (*true.loops, *true.sweeps), strict=True)]
    noise = off - residual(told, as_true)  # residuals are linear in what was measured: here the model falls out
    return float(off @ off - noise @ noise) / 2.0


def _with(test: MeasuredTest, true: MeasuredTest) -> MeasuredTest:
    """A test, its weights and its noise as they are, with what another one measured."""
    if isinstance(test, MeasuredLoop) and isinstance(true, MeasuredLoop):
        force = np.interp(test.drive.phase, true.drive.phase, true.drive.force)
        return replace(test, drive=replace(test.drive, force=force))
    assert isinstance(test, MeasuredSweep)
    assert isinstance(true, MeasuredSweep)
    return replace(test, sweep=replace(test.sweep, stiffness=true.sweep.stiffness))
