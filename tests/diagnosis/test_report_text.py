"""The verdict: look-alikes are a set, twins leave the level open, what cannot be shown is said; and the next test.

That is an entry of the menu that parts the models in question, and none where there is nothing to part.
"""

from dataclasses import replace
from math import log
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rigged import SHARED, asked, said

from bushfit.diagnosis.explanations import Explanation
from bushfit.diagnosis.hypotheses import Hypothesis
from bushfit.diagnosis.next_test import BUSHING_TESTS, FIXTURE_TESTS, deciding_test, remaining_entropy
from bushfit.diagnosis.record import Odds
from bushfit.diagnosis.verdict import Finding, decide_verdict
from bushfit.effects import BASE
from bushfit.effects.mistakes import MISTAKES
from bushfit.fitting.preparation import MeasuredTest, planned_sweep
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.geometry import Direction, Specimen
from bushfit.model.covariance import Covariance
from bushfit.model.model import Model
from bushfit.model.result import Result

#: 3 % of give in the axial direction, 17 % in the radial, measured at a few frequencies.
SOFT_RIG = {"rig_compliance": {"compliance": 4e-8}}
FEW = tuple(replace(sweep, frequencies=(5.0, 25.0, 55.0, 85.0, 115.0, 155.0)) for sweep in SHARED.sweeps)
#: With torsion, in which nothing gives way along a line: it tells the rubber by itself.
TURNED = replace(SHARED, sweeps=(*FEW, replace(FEW[0], direction=Direction.TORSION, amplitudes=(0.01, 0.03))))
EVEN = (0.5, 0.5)
SLIP = {"interface_slip.force": 2.0}
SECOND = {"second_friction.sigma_fmax": 2e3, "second_friction.eps_half": 5e-4}
STOP = {"bump_stop.gap": 4e-4, "bump_stop.stiffness": 1e5}
TOLERANCE = 0.01


@pytest.mark.slow
def test_compliance_in_one_direction_alone_is_never_a_bold_name(measured):
    """A softer rig and a softer rubber look alike in one direction; two leave open which gives way, torsion tells."""
    campaign = measured(SOFT_RIG, TURNED)
    whole = asked(campaign)
    assert said(whole) == "named sleeve_compliance"
    assert said(asked(replace(campaign, sweeps=campaign.sweeps[:2]))) == (
        "ambiguous sleeve_compliance|sleeve_compliance.radial"
    )
    assert whole.result.unresolved == ("sleeve_compliance",)
    (entry,) = whole.to_document()["effects"]
    assert (entry["level"], entry["twins"]) == ("unresolved", ["rig_compliance"])
    low, high = whole.result.interval("sleeve_compliance.compliance") or (0.0, 0.0)
    assert low <= 4e-8 <= high
    for sweeps, loops in ((campaign.sweeps[:1], campaign.loops), (campaign.sweeps[1:2], ())):
        alone = asked(replace(campaign, sweeps=sweeps, loops=loops))
        assert alone.verdict in ("consistent", "ambiguous")
        assert "one_direction" in [note.kind for note in alone.notes]
    assert "one_direction" not in [note.kind for note in whole.notes]
    again = asked(campaign, whole.result.model, unresolved=whole.result.unresolved)
    assert (again.verdict, again.result.unresolved) == ("consistent", ("sleeve_compliance",))
    settled = asked(campaign, whole.result.model, unresolved=whole.result.unresolved, adopt=("rig_compliance",))
    assert (settled.verdict, settled.result.unresolved) == ("consistent", ())
    assert settled.result.model.effects == (*BASE, "rig_compliance")
    assert settled.result.model.values["rig_compliance.compliance"] == pytest.approx(
        whole.result.model.values["sleeve_compliance.compliance"], rel=1e-3
    )
    proposed = {decide_verdict.name for decide_verdict in settled.candidates}
    assert not proposed & {"sleeve_compliance", "rig_compliance"}


SENTENCES = [test.sentence for test in BUSHING_TESTS]
SENTENCES += [test.sentence.format(place=place) for test in FIXTURE_TESTS for place in ("axial", "radial")]


@pytest.fixture
def data_sets(measured) -> list[MeasuredTest]:
    data = PreparedCampaign.from_campaign(measured())
    return [*data.loops, *data.sweeps]


def with_each(model: Model, *effects: dict[str, float]) -> list[Model]:
    """The model with one effect more, each in turn, by the values of its parameters."""
    return [model.with_effect(next(iter(values)).partition(".")[0], values) for values in effects]


@pytest.mark.parametrize(
    ("one", "other", "words"),
    [
        ({"rig_compliance.compliance": 1e-7}, STOP, ("fixture", "dummy")),
        ({"inertia.mass": 0.03}, {"viscous.eta": 60.0}, ("fixture", "highest frequency")),
        ({"viscous.eta": 60.0}, {"maxwell.mu1": 1e5, "maxwell.tau": 6e-4}, ("highest frequency",)),
        ({"strain_stiffening.c3": 0.5}, {"bump_stop.gap": 4.5e-4, "bump_stop.stiffness": 2e3}, ("largest amplitude",)),
        (SLIP, SECOND, ("smallest",)),
        ({"interface_slip.force": 0.4}, {"viscous.eta": 8.0}, ("smallest",)),  # where slip by far outweighs the rest
    ],
    ids=lambda value: next(iter(value)).partition(".")[0] if isinstance(value, dict) else "",
)
def test_pairs(paper_model, data_sets, one, other, words):
    models = with_each(paper_model, one, other)
    found = deciding_test(models, EVEN, data_sets)
    assert found in SENTENCES
    assert any(word in found for word in words)
    assert deciding_test(models[::-1], EVEN, data_sets) == found


@pytest.mark.parametrize("odds", [(1.0, 1.0), (0.8, 0.2), (1.0, 1e-5)])
def test_what_stays_open_is_bounded_from_above(odds):
    """Against the entropy that is left of two normal distributions a distance apart, by integration."""
    p, x = np.array(odds) / sum(odds), np.linspace(-12.0, 20.0, 20_001)
    for distance in (0.0, 0.5, 3.0, 8.0):
        weighed = p[:, None] * np.exp(-0.5 * np.square(x - np.array([[0.0], [distance]]))) / np.sqrt(2.0 * np.pi)
        share = weighed / weighed.sum(axis=0)
        left = -float(np.trapezoid((weighed * np.log(np.maximum(share, 1e-300))).sum(axis=0), x))
        bound = float(remaining_entropy(odds, distance**2 * (1.0 - np.eye(2))))
        assert left - 1e-6 <= bound <= left + 0.2
    assert remaining_entropy(odds, np.zeros((2, 2))) == pytest.approx(-float(p @ np.log(p)))
    far = [float(remaining_entropy((*odds, 0.0), d * (1.0 - np.eye(3)))) for d in (300.0, 1000.0, 3000.0)]
    assert far[0] > far[1] > far[2] > 0.0, "no rounding stands in for what is left"


@pytest.mark.parametrize("bushing", [True, False])
def test_coupons_with_a_bushing_are_followed_by_a_sweep_of_it(bushing, paper_model):
    """A bushing that was not tested is proposed, and no test of a bushing if the campaign has none."""
    model = paper_model if bushing else replace(paper_model, bushing=None)
    coupon = Specimen("DMA", "modulus")
    sweep = planned_sweep(model, coupon, np.array([5.0, 25.0, 105.0]), np.full(3, 0.01), (2e-3, 2e-3), (2e-3, 2e-3))
    rivals = [model, model.with_effect("stiffness_factor.radial", {"stiffness_factor.radial": 1.2})]
    assert ("radial direction" in deciding_test(rivals, EVEN, [sweep])) == bushing


def one(parts: str, odds: float, *, size: float = 0.05, last: float = 0.0, p_value: float = 0.5) -> Hypothesis:
    """Of parts joined by +: effects, "unnamed", "compound", "levels", "kind:place", a mistake by its name; or ""."""
    names = parts.split("+") if parts else []
    spots = [name.split(":") for name in names if ":" in name]
    places: Any = tuple(
        SimpleNamespace(
            family=family,
            name=name,
            may_be_physics=False,
            direction="axial",
            frequency=(1.0,),
            amplitude=(name[0] == "1",),
        )
        for family, name in spots
    )
    mistakes: list[Any] = [SimpleNamespace(kind=MISTAKES[name], key=name) for name in names if name in MISTAKES]
    others = {"unnamed", "compound", "levels", *MISTAKES}
    effects = tuple(name for name in names if ":" not in name and name not in others)
    tests = SimpleNamespace(mistake=mistakes[0] if mistakes else None)
    linear = SimpleNamespace(p_value=lambda **_: p_value)
    state: Any = SimpleNamespace(effects=effects, faulty_parts=places, tests=tests, linear=linear)
    curve = Explanation("unnamed", "unnamed", "smooth all", None) if "unnamed" in names else None
    size = size if names else 0.0
    return Hypothesis(state, log(odds), size, curve, last, "compound" in names, "levels" in names)


def of(**odds: float) -> Finding:
    found = [one(parts.replace("__", "."), share) for parts, share in odds.items()]
    return decide_verdict(sorted(found, key=lambda each: -each.log_posterior), TOLERANCE)


def told(finding: Finding) -> dict[str, float]:
    """Parts and rounded probabilities of what is told."""
    return {"+".join(sorted(each.components)): round(each.probability, 2) for each in finding.reported}


@pytest.mark.parametrize(
    ("odds", "verdict", "expected"),
    [
        ({"": 0.2, "inertia": 0.8}, "consistent", {}),
        ({"": 0.01, "inertia": 0.99}, "named", {"inertia": 1.0}),
        ({"inertia": 0.6, "inertia+delay": 0.39, "": 0.01}, "named", {"inertia": 1.0}),
        ({"inertia": 0.35, "inertia+delay": 0.65}, "ambiguous", {"inertia": 0.35, "delay+inertia": 0.65}),
        ({"inertia+delay": 0.99, "inertia": 0.01}, "named", {"delay+inertia": 0.99}),
        ({"inertia+delay": 0.6, "inertia+viscous": 0.4}, "ambiguous", {"delay+inertia": 0.6, "inertia+viscous": 0.4}),
        ({"inertia": 0.69, "fixture_resonance": 0.31}, "named", {"inertia": 1.0}),
        ({"inertia": 0.31, "fixture_resonance": 0.69}, "ambiguous", {"fixture_resonance": 0.69, "inertia": 0.31}),
        ({"inertia": 0.6, "delay": 0.38, "viscous": 0.02}, "ambiguous", {"inertia": 0.6, "delay": 0.38}),
        ({"frequency:50 Hz": 0.7, "inertia": 0.3}, "ambiguous", {"part: frequency": 0.7, "inertia": 0.3}),
        ({"unnamed": 0.6, "inertia": 0.4}, "described", {"unnamed": 0.6, "inertia": 0.4}),
        ({"unnamed": 0.4, "inertia": 0.6}, "ambiguous", {"unnamed": 0.4, "inertia": 0.6}),
        ({"inertia": 0.69, "fixture_resonance+delay": 0.31}, "named", {"inertia": 1.0}),
        ({"inertia+level:1 mm": 0.6, "inertia": 0.4}, "partly", {"inertia+part: level": 0.6, "inertia": 0.4}),
        ({"frequency:50 Hz": 0.5, "frequency:45 to 55 Hz": 0.49, "": 0.01}, "unexplained", {"part: frequency": 1.0}),
        ({"levels": 0.99, "": 0.01}, "unexplained", {"levels": 1.0}),
        ({"kraus+levels": 0.99, "": 0.01}, "unexplained", {"levels": 1.0}),
        ({"delay+level:1 mm": 0.99, "delay": 0.01}, "unexplained", {"delay+part: level": 0.99}),
        ({"loop:1 mm+loop:2 mm": 0.99, "": 0.01}, "unexplained", {"part: loop": 1.0}),
        ({"loop:1 mm+loop:1 mm again": 0.99, "": 0.01}, "described", {"unnamed": 1.0}),
        ({"peak_to_peak": 0.99, "": 0.01}, "named", {"peak_to_peak": 1.0}),
        ({"peak_to_peak+kraus": 0.99, "": 0.01}, "partly", {"kraus+peak_to_peak": 1.0}),
        ({"peak_to_peak+kraus+compound": 0.99, "": 0.01}, "partly", {"peak_to_peak+unnamed": 1.0}),
    ],
    ids=str,
)
def test_verdicts(odds, verdict, expected):
    finding = of(**odds)
    assert (finding.verdict, told(finding)) == (verdict, expected)
    assert finding.nothing == pytest.approx(odds.get("", 0.0))
    if verdict == "ambiguous":  # what all have is certain, whatever else there is
        assert {*finding.names} == set.intersection(*({*name.split("+")} for name in odds)) - {"unnamed"}


def test_other_explanations_widen_the_uncertainty_by_their_probability(paper_model):
    covariance = Covariance(("mu",), np.array([[1e8]]))
    other = paper_model.with_values({"mu": paper_model.values["mu"] + 1e4})
    odds = Odds(0.4, (("one", 0.7), ("other", 0.3)), (None, (other, covariance)))
    widened = odds.widen(Result(paper_model, ("mu",), covariance)).covariance
    assert widened.stderr("mu") == pytest.approx(1e4 * np.sqrt(1.0 + 0.6 * 0.3))


def test_what_changes_less_than_the_tolerance_is_nothing():
    small, large = one("inertia", 0.2, size=0.009), one("inertia+delay", 0.8)
    assert decide_verdict([large, small], TOLERANCE).verdict == "consistent"
    finding = decide_verdict([large, small], 0.001)
    assert (finding.verdict, finding.nothing) == ("ambiguous", 0.0)


def test_of_more_than_can_be_told_it_is_described_by_what_nearly_all_have_in_common():
    others = ("inertia", "viscous", "maxwell", "high_pass", "clearance", "asymmetry")
    finding = of(**{f"delay+{name}": 1.0 for name in others})
    assert (finding.verdict, finding.leads, len(finding.reported)) == ("described", ("delay",), 4)
    assert of(**dict.fromkeys(others, 1.0)).leads == ()


@pytest.mark.parametrize(("last", "verdict"), [(0.002, "partly"), (0.02, "described")])
def test_names_stand_beside_what_has_none_where_they_change_most(last, verdict):
    finding = decide_verdict([one("inertia+unnamed", 0.99, size=0.05, last=last), one("inertia", 0.01)], TOLERANCE)
    assert finding.verdict == verdict
    assert finding.leads == ("inertia",)
    assert told(finding) == {"inertia+unnamed": 1.0}


@pytest.mark.parametrize(
    ("odds", "named", "beside_a_gap"),
    [
        ({"inertia": 0.99, "inertia+compound": 0.0099, "compound": 0.0001}, "inertia", ("partly", ("inertia",))),
        ({"inertia": 0.99, "inertia+compound": 0.006, "compound": 0.004}, "inertia", ("ambiguous", ())),
        ({"kraus": 0.99, "kraus+compound": 0.01}, "kraus", ("described", ())),
    ],
    ids=str,
)
def test_beside_a_gap_that_stays_a_name_must_be_sure_in_a_compound_that_deviates(odds, named, beside_a_gap):
    hypotheses = [one(parts, share) for parts, share in odds.items()]
    assert decide_verdict(hypotheses, TOLERANCE).names == (named,)
    finding = decide_verdict(hypotheses, TOLERANCE, gap_stays=True)
    assert (finding.verdict, finding.names) == beside_a_gap


@pytest.mark.parametrize("companion", ["inertia", "frequency:50 Hz+frequency:90 Hz"])
def test_a_mistake_that_does_not_close_the_gap_alone_is_a_lead(companion):
    finding = decide_verdict([one(f"peak_to_peak+{companion}", 0.99)], TOLERANCE)
    assert (finding.verdict, finding.leads[0]) == ("described", "peak_to_peak")


@pytest.mark.parametrize("parts", ["inertia+compound", "peak_to_peak", "peak_to_peak+compound", "level:1 mm"])
def test_what_does_not_fit_the_tests_is_a_lead_and_no_name(parts):
    finding = decide_verdict([one(parts, 0.99, p_value=1e-4)], TOLERANCE)
    leads = () if ":" in parts else (parts.partition("+")[0],)
    assert (finding.verdict, finding.names, finding.leads) == ("described", (), leads)
