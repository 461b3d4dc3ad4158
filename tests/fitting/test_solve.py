"""The least-squares problem: one minimum from anywhere, coordinates there and back, and parameters held at bounds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bushfit.campaign.campaign import load_campaign
from bushfit.errors import FitError
from bushfit.fitting.coordinates import Coordinates, jacobian, residual
from bushfit.fitting.data import Data
from bushfit.fitting.procedures import cautions, fit_joint
from bushfit.fitting.solve import solve
from bushfit.model.model import FIVE, Model


@pytest.fixture(scope="module")
def measured(root: Path) -> Data:
    return Data.of(load_campaign(root / "configs/cmp_15961.toml"))


def shown(values: np.ndarray) -> str:
    return ", ".join(f"{name} {100 * value:+.3g} %" for name, value in zip(FIVE, values, strict=True))


def test_coordinates_lead_there_and_back(paper_model: Model) -> None:
    model = paper_model.with_effect("inertia", {"inertia.mass": 0.02})
    coordinates = Coordinates.of(model, ["mu", "alpha", "inertia.mass"])
    point = coordinates.point(model.values)
    there = coordinates.values(point)
    assert there == pytest.approx({name: model.values[name] for name in coordinates.names}, rel=1e-12)
    step = 1e-6
    moved = np.array([list(coordinates.values(point + step * axis).values()) for axis in np.eye(3)]) - np.array(
        list(there.values())
    )
    np.testing.assert_allclose(np.diag(moved) / step, coordinates.slopes(model.values), rtol=1e-5)


def test_the_jacobian_is_that_of_the_residual(measured: Data, paper_model: Model) -> None:
    data_sets, names = measured.chosen(None), list(FIVE)
    coordinates = Coordinates.of(paper_model, names)
    point, slopes = coordinates.point(paper_model.values), jacobian(paper_model, data_sets, names)
    for number in range(5):
        high, low = (
            residual(paper_model.with_values(coordinates.values(point + sign * 1e-5 * np.eye(5)[number])), data_sets)
            for sign in (1.0, -1.0)
        )
        change = (high - low) / 2e-5
        np.testing.assert_allclose(slopes[number], change, atol=1e-5 * np.abs(change).max())


def test_a_parameter_pushed_against_a_bound_rests_on_it_and_is_named(measured: Data, paper_model: Model) -> None:
    solution = solve(paper_model, measured.chosen(None), list(FIVE), {"mu": (None, 1.05e6)})
    assert dict(solution.at_bound) == {"mu": "max"}
    assert solution.model.values["mu"] == pytest.approx(1.05e6, rel=1e-2)
    assert solution.flat
    free = solve(paper_model, measured.chosen(None), list(FIVE))
    assert not free.at_bound
    assert free.chi_square < solution.chi_square


def test_what_is_not_named_is_held(measured: Data, paper_model: Model) -> None:
    start = paper_model.with_values({"m": 2.2e5})
    found = solve(start, measured.chosen(None), ["mu"]).model.values
    assert found["mu"] != start.values["mu"]
    assert {name: found[name] for name in FIVE[1:]} == {name: start.values[name] for name in FIVE[1:]}


def test_a_solver_that_runs_out_of_evaluations_says_so(measured: Data, paper_model: Model) -> None:
    start = paper_model.with_values({name: 5.0 * paper_model.values[name] for name in ("mu", "sigma_fmax")})
    data_sets, names = measured.chosen(None), list(FIVE)
    stopped = solve(start, data_sets, names, evaluations=2, strict=False)
    assert stopped.stopped
    with pytest.raises(FitError):
        solve(start, data_sets, names, evaluations=2)


def test_a_fit_that_is_stopped_where_chi_square_is_flat_is_one_and_is_told(measured: Data) -> None:
    result = fit_joint(measured)
    data_sets, near = measured.chosen(None), result.model.with_values({"mu": 1.0001 * result.model.values["mu"]})
    stopped = solve(near, data_sets, list(FIVE), evaluations=2)
    assert (stopped.stopped, stopped.flat) == (True, True)
    notes = cautions(stopped.model, stopped, data_sets, {}, result.covariance)
    assert any(note.startswith("the fit was stopped after 2 evaluations") for note in notes)


@pytest.mark.parametrize("many", [10, pytest.param(100, marks=pytest.mark.slow)])
def test_random_starts_end_at_one_minimum(measured: Data, many: int) -> None:
    """Two decades per parameter: a tenth to ten times the answer, alpha over its own range.

    From a start that is far too stiff a fit may lose a branch for good. It then says that the branch rests on a bound,
    and `Data.started` takes no such start: it takes what is read off the tests where that meets them better.
    """
    best = fit_joint(measured)
    data_sets, names, rng = measured.chosen(None), list(FIVE), np.random.default_rng(1)
    read_off = residual(measured.started(measured.effects, data_sets, {}), data_sets)
    ends, costs, evaluations = [], [], []
    for _ in range(many):
        factor = dict(zip(names, 10.0 ** rng.uniform(-1.0, 1.0, 5), strict=True))
        start = {name: best.model.values[name] * factor[name] for name in names}
        start["alpha"] = np.clip(10.0 ** rng.uniform(-2.0, 0.0), *best.model.parameters["alpha"].bounds)
        solution = solve(best.model.with_values(start), data_sets, names)
        evaluations.append(solution.evaluations)
        if solution.at_bound:
            tried = residual(best.model.with_values(start), data_sets)
            assert tried @ tried > read_off @ read_off
        else:
            ends.append([solution.model.values[name] for name in names])
            costs.append(solution.chi_square)
    apart = np.abs(np.array(ends) / [best.model.values[name] for name in names] - 1.0).max(axis=0)
    stderr = np.array([(best.covariance.stderr(name) or 0.0) / best.model.values[name] for name in names])
    print(
        f"{many} starts, {len(ends)} of them to the minimum, apart by {shown(apart)}; "
        f"{np.median(evaluations):.0f} evaluations, at most {max(evaluations)}"
    )
    assert len(ends) >= 0.9 * many
    assert np.ptp(costs) < 1e-3
    assert np.all(apart < 0.02 * stderr)
