"""Sixteen campaigns from another rig's code: what is missing is named, and its size found."""

import json
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from rigged import said

from bushfit.campaign.campaign import load_campaign
from bushfit.commands.diagnose import diagnose as diagnose_campaign
from bushfit.diagnosis.record import Diagnosis, DiagnosisSettings
from bushfit.diagnosis.workflow import diagnose
from bushfit.effects import twins_of
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.report.page.record import read_results
from bushfit.report.results import Formats, write_results

Truths = dict[str, dict[str, Any]]

#: The other code's names for what bushfit calls otherwise: ours, theirs, and theirs in our unit.
SIZES = {
    "inertia.mass": ("inertia", "mass"),
    "delay.tau": ("delay", "tau"),
    "sleeve_compliance.compliance": ("rig", "k"),
    "viscous.eta": ("viscous", "eta"),
    "strain_stiffening.c3": ("cubic", "c3"),
    "interface_slip.force": ("coulomb", "Fc"),
    "rate_dependent_friction.n": ("rate_friction", "n"),
    "self_heating.beta": ("thermal", "beta"),
    "clearance.delta": ("clearance", "delta"),
    "asymmetry.c2": ("quadratic", "c2"),
    "coupled_breakdown.q": ("coupled", "q"),
}


@pytest.fixture(scope="module")
def truths(root) -> Truths:
    """The answers; of twins the name of the bushing's, as these tests cannot tell more."""
    answers = json.loads((root / "data/practice/answers.json").read_text())
    return {case: {**truth, "truth": [twins_of(name)[0] for name in truth["truth"]]} for case, truth in answers.items()}


class Found(dict[str, Diagnosis]):
    """Cases, each diagnosed from its files alone when it is first asked for."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def __missing__(self, case: str) -> Diagnosis:
        found = diagnose_campaign(load_campaign(self._folder / case / "bushing.toml"))
        self[case] = found.diagnosis
        with TemporaryDirectory() as folder:  # what is written is read back
            write_results(Path(folder) / "x", found.files, Formats(pictures=False))
            assert read_results(Path(folder) / "x")
        return self[case]


@pytest.fixture(scope="module")
def found(root) -> Found:
    return Found(root / "data/practice")


def right(truth: dict[str, Any], diagnosis: Diagnosis) -> bool:
    """By the rules: named alone or in a set of at most three; nothing invented; the unknown called unknown."""
    if truth["out_of_library"]:
        return diagnosis.verdict in ("unexplained", "described", "partly")
    if not truth["truth"]:
        return diagnosis.verdict == "consistent"
    sets = [{effect.name, *(other.label for other in effect.alternatives)} for effect in diagnosis.effects]
    everything = all(any(name in members and len(members) <= 3 for members in sets) for name in truth["truth"])
    return everything and len(sets) == len(truth["truth"]) and diagnosis.verdict in ("named", "ambiguous")


def test_nothing_is_nothing_and_the_unknown_is_unknown(truths, found):
    for unknown in (False, True):
        case = next(
            case for case, each in truths.items() if not each["truth"] and bool(each["out_of_library"]) == unknown
        )
        assert right(truths[case], found[case]), said(found[case])


@pytest.mark.slow
def test_at_most_one_of_sixteen_is_wrong_and_plain_effects_are_named_alone(truths, found):
    """From a gain of 200 in chi-square on a set would be too little; a name closes the gap where nothing was fitted."""
    wrong, plain = [], []
    for case, truth in truths.items():
        diagnosis = found[case]
        names = {effect.name for effect in diagnosis.effects}
        wrong += [case] * (not right(truth, diagnosis))
        if diagnosis.verdict == "named":
            assert names <= set(truth["truth"]), case
            assert (diagnosis.holdout.after or 9.9) <= 1.1, case
        is_ambiguous = diagnosis.verdict == "ambiguous"  # then a correction lowers chi-square, too
        if truth["truth"] and not is_ambiguous and diagnosis.before.chi_square - diagnosis.after.chi_square >= 200.0:
            plain.append(diagnosis.verdict == "named" and names == set(truth["truth"]))
    assert len(truths) == 16
    assert len(wrong) <= 1, wrong
    assert len(plain) >= 10
    assert sum(plain) >= 0.9 * len(plain)


@pytest.mark.slow
@pytest.mark.parametrize("name", SIZES)
def test_sizes(root, truths, found, name):
    effect, (theirs, key) = name.partition(".")[0], SIZES[name]
    cases = [case for case, truth in truths.items() if truth["truth"] and theirs in truth["effects"]]
    assert cases
    for case in cases:
        result = found[case].result
        if found[case].verdict == "ambiguous":  # it has its size once the reader says which it is
            campaign = load_campaign(root / "data/practice" / case / "bushing.toml")
            result = diagnose(
                PreparedCampaign.from_campaign(campaign), settings=DiagnosisSettings(adopt=(effect,))
            ).result
        assert effect in result.model.effects
        truth = truths[case]["effects"][theirs][key]
        truth = 1.0 / truth if theirs == "rig" else truth
        value, stderr, ends = result.model.values[name], result.covariance.stderr(name), result.interval(name)
        assert stderr is not None
        assert ends[0] <= truth <= ends[1] or abs(value - truth) <= 3.0 * stderr, (case, value, stderr, truth)
