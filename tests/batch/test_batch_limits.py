"""Limits: the four verdicts, limits of every kind, and one error for what they may not say."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bushfit.batch.limits import Judge, Limits, Verdict, judge, read_limits
from bushfit.batch.quantities import at_point, parameter_quantities
from bushfit.errors import BushfitError
from bushfit.reduction.scatter import scatter

NAN = math.nan
finite = st.floats(-1e3, 1e3)


@pytest.mark.parametrize(
    ("value", "half", "verdict"),
    [(1.0, 0.5, "pass"), (1.8, 0.5, "conditional pass"), (2.2, 0.5, "conditional fail"), (-0.6, 0.5, "fail")],
)
def test_four_verdicts(value: float, half: float, verdict: str) -> None:
    assert str(judge((value, value - half, value + half), 0.0, 2.0)) == verdict


@given(finite, st.floats(0, 1e3), finite, st.floats(0, 1e3))
def test_verdicts_follow_value_and_interval(value: float, half: float, low: float, width: float) -> None:
    high = low + width
    verdict = judge((value, value - half, value + half), low, high)
    assert (verdict <= Verdict.CONDITIONAL_PASS) == (low <= value <= high)
    assert judge((-value, -value - half, -value + half), -high, -low) is verdict
    assert judge((value, NAN, NAN), low, high) in (Verdict.PASS, Verdict.FAIL)
    wider = judge((value, value - 2 * half, value + 2 * half), low, high)
    assert (wider in (Verdict.PASS, Verdict.FAIL)) <= (verdict is wider)


def limits(folder: Path, text: str) -> Limits:
    (folder / "limits.toml").write_text(text, encoding="utf-8")
    return read_limits(folder / "limits.toml")


ALL = """
nrmse = "2 %"
reduced_chi_square = 1.5
verdicts = ["consistent", "named"]
[parameters.mu]
min = "1 MPa"
max = "1.2 MPa"
[parameters.alpha]
nominal = 0.24
tolerance = "5 %"
[parameters.sigma_fmax]
sigma = 3
at_least = 5
[[stiffness]]
at = "axial 25 Hz 0.1 mm"
min = "550 N/mm"
max = "0.65 kN/mm"
[[stiffness]]
at = "torsion 10 Hz 1 deg"
max = "100 N m/rad"
[[loss_factor]]
at = "axial 25 Hz 0.1 mm"
max = 0.12
"""


def test_limits_of_every_kind(tmp_path: Path) -> None:
    read = limits(tmp_path, ALL)
    values = np.array([1.0, 1.01, 0.99, 1.02, 0.98, 7.0]) * 1e4
    columns = {"sigma_fmax": values}
    quantities = {q.name: q for q in parameter_quantities(["mu", "alpha", "sigma_fmax"])}
    judged = Judge(read, columns, quantities | {q.name: q for q in (at_point(p, "stiffness") for p in read.points)})
    assert judged.allowed["mu"] == (1e6, 1.2e6)
    assert judged.allowed["alpha"] == pytest.approx((0.228, 0.252))
    assert judged.allowed["stiffness axial 25 Hz 0.1 mm"] == (550e3, 650e3)
    assert judged.allowed["stiffness torsion 10 Hz 1 deg"] == (-math.inf, 100.0)
    assert judged.allowed["loss factor axial 25 Hz 0.1 mm"] == (-math.inf, 0.12)
    assert judged.allowed["NRMSE"] == (-math.inf, 0.02)
    middle, spread = scatter(values)
    assert judged.allowed["sigma_fmax"] == pytest.approx((middle - 3 * spread, middle + 3 * spread))
    assert judged.allowed["sigma_fmax"][1] < 1.2e4, "one far out must not widen the limits"
    assert judged.notes == []


def test_the_batch_s_own_scatter_needs_bushings_that_differ(tmp_path: Path) -> None:
    read = limits(tmp_path, "[parameters.mu]\nsigma = 3\n")
    few = Judge(read, {"mu": np.array([1.0, 2.0, np.nan])}, {})
    assert "2 bushings, and at_least = 10" in few.notes[0]
    same = Judge(read, {"mu": np.ones(12)}, {})
    assert "agree to the digit" in same.notes[0]
    assert few.allowed == same.allowed == {"mu": (-math.inf, math.inf)}


FEW = """
verdicts = ["consistent", "named"]
[parameters.mu]
min = "1 MPa"
max = "1.2 MPa"
[parameters.alpha]
nominal = 0.24
tolerance = "5 %"
"""
QUANTITIES = {q.name: q for q in parameter_quantities(["mu", "alpha", "eps_half"])}


def test_a_bushing_is_as_good_as_its_worst_and_the_words_say_why(tmp_path: Path) -> None:
    known = {"mu": [1.19e6, 1.17e6, 1.21e6], "alpha": [0.26, 0.25, 0.27]}
    judged = Judge(limits(tmp_path, FEW), {}, QUANTITIES)
    found = judged(known, {"verdict": "named"})
    assert found.verdict is Verdict.CONDITIONAL_FAIL
    assert dict(found.missed) == {"alpha": "alpha = 0.26 (0.25 to 0.27), min 0.228 max 0.252: conditional fail"}
    assert dict(found.edge) == {"mu": "mu = 1.19 (1.17 to 1.21) MPa, min 1 max 1.2: conditional pass"}
    partly = judged(known, {"verdict": "partly"})
    assert partly.verdict is Verdict.FAIL
    assert partly.missed["verdict"] == "verdict partly, allowed consistent, named"
    guarded = Judge(limits(tmp_path, "guard = true\n" + FEW), {}, QUANTITIES)
    assert set(guarded(known, {"verdict": "named"}).missed) == {"mu", "alpha"}
    unknown = judged({"mu": [1.1e6, NAN, NAN]}, {})
    assert unknown.verdict is Verdict.FAIL
    assert dict(unknown.missed) == {
        "alpha": "alpha is not known: fail",
        "verdict": "verdict is not known, allowed consistent, named",
    }


def test_a_value_at_rest_on_a_bound_of_its_fit_is_no_plain_pass(tmp_path: Path) -> None:
    known = {"mu": [1.1e6, NAN, NAN], "eps_half": [0.01, 0.009, 0.011]}
    record = {"at_bound": {"mu": "max", "eps_half": "min"}}
    text = "[parameters.mu]\nmin = '1 MPa'\nmax = '1.2 MPa'\n"
    found = Judge(limits(tmp_path, text), {}, QUANTITIES)(known, record)
    assert found.verdict is Verdict.CONDITIONAL_PASS
    assert not found.missed
    assert dict(found.edge) == {
        "mu": "mu = 1.1 MPa, min 1 max 1.2, at the max of its fit: conditional pass",
        "eps_half": "eps_half = 0.01 (0.009 to 0.011), at the min of its fit: conditional pass",
    }
    guarded = Judge(limits(tmp_path, "guard = true\n" + text), {}, QUANTITIES)
    assert set(guarded(known, record).missed) == {"mu", "eps_half"}
    out = Judge(limits(tmp_path, "[parameters.mu]\nmax = '1 MPa'\n"), {}, QUANTITIES)(known, record)
    assert out.missed["mu"] == "mu = 1.1 MPa, max 1, at the max of its fit: fail"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[parameters.mi]\nmax = '1 MPa'", ["parameters", "mi", "unknown key"]),
        ("[parameters.mu]\nmax = 1e6", ["parameters.mu.max", "without a unit"]),
        ("[parameters.mu]\nnominal = '1 MPa'", ["make no limit", "tolerance"]),
        ("[parameters.mu]\nmin = '2 MPa'\nmax = '1 MPa'", ["hold no value"]),
        ("[[stiffness]]\nat = 'axial 25 Hz 0.1 mm'\nmax = '1 N'", ["stiffness #1.max", "a stiffness"]),
        ("[[stiffness]]\nat = 'axial 25'\nmax = '1 N/mm'", ["stiffness #1.at", "no operating point"]),
        (
            "[[stiffness]]\nat = 'axial 25 Hz 0.1 mm'\nmax = '9 N/mm'\n"
            "[[stiffness]]\nat = 'axial 0.025 kHz 100 um'\nsigma = 3",
            ["2 tables for one point", "stiffness axial 25 Hz 0.1 mm", "put them in one table"],
        ),
        ("verdict = ['named']", ["unknown key", 'mean "verdicts"']),
        ("verdicts = ['good']", ["verdicts #1"]),
        ("nrmse = 2", ["nrmse", "found: 2", "less than 1"]),
        ("guard = true", ["there is no limit"]),
    ],
)
def test_bad_limits_have_one_clear_error(tmp_path: Path, text: str, words: list[str]) -> None:
    with pytest.raises(BushfitError) as caught:
        limits(tmp_path, text)
    assert all(word in str(caught.value) for word in ("limits.toml", *words)), str(caught.value)
