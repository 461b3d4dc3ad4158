"""From probabilities to a verdict, on hypotheses written by hand."""

from math import log
from types import SimpleNamespace
from typing import Any

import pytest

from bushfit.diagnosis.hypotheses import Hypothesis
from bushfit.diagnosis.verdict import Finding, decide_verdict
from bushfit.effects.mistakes import MISTAKES

TOLERANCE = 0.01


def one(parts: str, odds: float, *, size: float = 0.05, last: float = 0.0, p_value: float = 0.5) -> Hypothesis:
    """Of parts joined by +: effects, "unnamed", "compound", "levels", "kind:place", a mistake by its name; or ""."""
    names = parts.split("+") if parts else []
    spots = [name.split(":") for name in names if ":" in name]
    places: Any = tuple(SimpleNamespace(family=family, name=name, extreme=False) for family, name in spots)
    claims: list[Any] = [SimpleNamespace(mistake=MISTAKES[name], key=name) for name in names if name in MISTAKES]
    others = {"unnamed", "compound", "levels", *MISTAKES}
    effects = tuple(name for name in names if ":" not in name and name not in others)
    state: Any = SimpleNamespace(effects=effects, linear=SimpleNamespace(p_value=lambda **_: p_value))
    claim, curve = claims[0] if claims else None, "smooth all" if "unnamed" in names else ""
    size, bent = size if names else 0.0, "compound" in names
    curve = "compound" if bent else curve
    return Hypothesis(effects, claim, places, curve, "levels" in names, log(odds), size, last, state, bent)


def of(**odds: float) -> Finding:
    found = [one(parts.replace("__", "."), share) for parts, share in odds.items()]
    return decide_verdict(sorted(found, key=lambda each: -each.log_posterior), TOLERANCE)


def told(finding: Finding) -> dict[str, float]:
    """Parts and rounded probabilities of what is told."""
    return {"+".join(sorted(each.parts)): round(each.probability, 2) for each in finding.reported}


@pytest.mark.parametrize(
    ("odds", "verdict", "expected"),
    [
        ({"": 0.2, "inertia": 0.8}, "consistent", {}),
        ({"": 0.01, "inertia": 0.99}, "named", {"inertia": 1.0}),
        ({"inertia": 0.6, "inertia+delay": 0.39, "": 0.01}, "named", {"inertia": 1.0}),
        ({"inertia": 0.35, "inertia+delay": 0.65}, "named", {"inertia": 0.35, "delay+inertia": 0.65}),
        ({"inertia+delay": 0.99, "inertia": 0.01}, "named", {"delay+inertia": 0.99}),
        ({"inertia": 0.69, "fixture_resonance": 0.31}, "named", {"inertia": 1.0}),
        ({"inertia": 0.31, "fixture_resonance": 0.69}, "ambiguous", {"fixture_resonance": 0.69, "inertia": 0.31}),
        ({"inertia": 0.6, "delay": 0.38, "viscous": 0.02}, "ambiguous", {"inertia": 0.6, "delay": 0.38}),
        ({"frequency:50 Hz": 0.7, "inertia": 0.3}, "ambiguous", {"part: frequency": 0.7, "inertia": 0.3}),
        ({"unnamed": 0.6, "inertia": 0.4}, "described", {"unnamed": 0.6, "inertia": 0.4}),
        ({"unnamed": 0.4, "inertia": 0.6}, "ambiguous", {"unnamed": 0.4, "inertia": 0.6}),
        ({"unnamed": 0.99, "inertia": 0.01}, "described", {"unnamed": 0.99}),
        ({"frequency:50 Hz": 0.5, "frequency:45 to 55 Hz": 0.49, "": 0.01}, "unexplained", {"part: frequency": 1.0}),
        ({"levels": 0.99, "": 0.01}, "unexplained", {"levels": 1.0}),
        ({"delay+level:1 mm": 0.99, "delay": 0.01}, "unexplained", {"delay+part: level": 0.99}),
        ({"peak_to_peak": 0.99, "": 0.01}, "named", {"peak_to_peak": 1.0}),
    ],
    ids=str,
)
def test_verdicts(odds, verdict, expected):
    finding = of(**odds)
    assert (finding.verdict, told(finding)) == (verdict, expected)
    assert finding.nothing == pytest.approx(odds.get("", 0.0))


def test_what_changes_less_than_the_tolerance_is_nothing():
    small, large = one("inertia", 0.2, size=0.009), one("inertia+delay", 0.8)
    assert decide_verdict([large, small], TOLERANCE).verdict == "consistent"
    finding = decide_verdict([large, small], 0.001)
    assert (finding.verdict, finding.nothing) == ("named", 0.0)


def test_of_more_than_can_be_told_it_is_described_by_what_nearly_all_have_in_common():
    others = ("inertia", "viscous", "maxwell", "high_pass", "clearance", "asymmetry")
    finding = of(**{f"delay+{name}": 1.0 for name in others})
    assert (finding.verdict, finding.leads, len(finding.reported)) == ("described", ("delay",), 4)
    assert of(**dict.fromkeys(others, 1.0)).leads == ()


@pytest.mark.parametrize(("last", "verdict"), [(0.002, "partly"), (0.02, "described")])
def test_names_stand_beside_what_has_none_where_they_change_most(last, verdict):
    finding = decide_verdict([one("inertia+unnamed", 0.99, size=0.05, last=last), one("inertia", 0.01)], TOLERANCE)
    assert finding.verdict == verdict
    assert finding.leads == (("inertia",) if verdict == "described" else ())
    assert told(finding) == {"inertia+unnamed": 1.0}


@pytest.mark.parametrize(
    ("odds", "named", "beside_a_gap"),
    [
        ({"inertia": 0.99, "inertia+compound": 0.0099, "compound": 0.0001}, "inertia", ("partly", ("inertia",))),
        ({"inertia": 0.99, "inertia+compound": 0.006, "compound": 0.004}, "inertia", ("described", ())),
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


@pytest.mark.parametrize("parts", ["inertia+compound", "peak_to_peak", "peak_to_peak+compound"])
def test_what_does_not_fit_the_tests_is_a_lead_and_no_name(parts):
    finding = decide_verdict([one(parts, 0.99, p_value=1e-4)], TOLERANCE)
    assert (finding.verdict, finding.names, finding.leads) == ("described", (), (parts.partition("+")[0],))
