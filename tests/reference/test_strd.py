"""Levenberg-Marquardt against NIST's certified values, through the fits' own entry."""

import math
from dataclasses import replace

import numpy as np
import pytest
from agreement import digits
from strd import Problem, problems

from bushfit.fitting.assess import covariance
from bushfit.fitting.problem import FitProblem, FitResult
from tests.fits import solve

PROBLEMS = problems()
STARTS = [(problem, start) for problem in PROBLEMS for start in (1, 2)]
#: From its first start, far off, two of its exponentials run together; from the second one it is solved.
UNSOLVED = [("MGH17", 1)]
#: NIST's residuals of this one are 1e-13 of the data, less than double precision holds.
EXACT_DATA = "Lanczos1"
#: The fits' own tolerance is enough where chi-square has noise; this one is near what rounding leaves.
FINEST = 1e-14


def fitted(problem: Problem, start: int, tolerance: float | None = None) -> FitResult:
    names = tuple(problem.certified)
    stop = {} if tolerance is None else {"tolerance": tolerance}
    with np.errstate(over="ignore", invalid="ignore"):  # some starts lead astray before they lead home
        return solve(FitProblem(problem.curve(start), [problem.data_set()], names), evaluations=1000, **stop)


def test_the_files_are_whole():
    """The formula read off each file gives the certified residuals at the certified values."""
    assert len(PROBLEMS) == 27
    assert sorted(problem.level for problem in PROBLEMS) == ["average"] * 11 + ["higher"] * 8 + ["lower"] * 8
    for problem in PROBLEMS:
        off = problem.of(problem.certified) - problem.response
        scatter = math.sqrt(off @ off / (off.size - len(problem.certified)))
        if problem.name != EXACT_DATA:
            assert scatter == pytest.approx(problem.scatter, rel=1e-4), problem.name


@pytest.mark.slow
def test_certified_values_from_both_starts(agree):
    values, errors, default, apart = {}, {}, {}, {}
    for problem, start in STARTS:
        at = (problem.name, start)
        if at in UNSOLVED:
            continue
        names = tuple(problem.certified)
        certified, stderr = (np.array([table[name] for name in names]) for table in (problem.certified, problem.stderr))
        coarse = np.array([fitted(problem, start).model.values[name] for name in names])
        solution = fitted(problem, start, FINEST)
        found = np.array([solution.model.values[name] for name in names])
        scatter = math.sqrt(solution.chi_square / (problem.response.size - len(names)))
        cov = covariance(
            solution.model, [FitProblem(solution.model, [replace(problem.data_set(), noise=scatter)], names)]
        )
        default[at], values[at] = digits(coarse, certified), digits(found, certified)
        apart[at] = np.max(np.abs(coarse - certified) / stderr)
        errors[at] = digits([cov.stderr(name) for name in names], stderr)
        print(f"{problem.name} ({problem.level}), start {start}: values {default[at]:.1f} at the fits' tolerance, "
              f"{values[at]:.1f} at {FINEST:g}; standard errors {errors[at]:.1f} digits")  # fmt: skip
    exact = [at for at in values if at[0] == EXACT_DATA]
    print(f"standard errors of {EXACT_DATA}, whose data have no scatter: {min(errors.pop(at) for at in exact):.1f}")
    for at in exact:
        apart.pop(at)
    worst = max(apart, key=apart.__getitem__)
    print(f"at the fits' tolerance at most {apart[worst]:.1e} standard errors off, {worst}")
    assert apart[worst] < 2e-4
    agree("values, 53 of 54 starts, as fits stop", [min(default.values())])
    agree("values, 53 of 54 starts, stopped later", [min(values.values())])
    agree("standard errors, 53 of 54 starts", [min(errors.values())])


@pytest.mark.parametrize(("name", "start"), UNSOLVED)
def test_what_is_not_solved_has_an_error_beyond_all_values(name, start):
    problem = next(problem for problem in PROBLEMS if problem.name == name)
    names = tuple(problem.certified)
    solution = fitted(problem, start)
    cov = covariance(solution.model, [FitProblem(solution.model, [problem.data_set()], names)])
    relative = {each: cov.stderr(each) / abs(solution.model.values[each]) for each in names}
    print(f"{name}, start {start}: {relative}")
    assert max(relative.values()) > 100.0
