"""The fit that goes step by step: it ends where lmfit ends, on bounds too, and never climbs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import SimulatedLoop, SimulatedSweep, SimulateSettings
from bushfit.effects import BASE
from bushfit.errors import FitError
from bushfit.fitting.coordinates import Bounds, residual
from bushfit.fitting.data import Data
from bushfit.fitting.data_sets import DataSet
from bushfit.fitting.descent import Descent
from bushfit.fitting.solve import solve
from bushfit.fitting.starts import start_values
from bushfit.geometry import Direction
from bushfit.model.model import Model
from bushfit.simulation.measured import simulate

Rig = Callable[..., Campaign]


@pytest.fixture
def data_sets(rig: Rig, paper_model: Model, paper_noise: SimulateSettings) -> list[DataSet]:
    data = Data.of(rig(paper_model, paper_noise, 1))
    return [*data.loops, *data.sweeps]


def started(paper_model: Model, data_sets: list[DataSet], *effects: str) -> Model:
    start = start_values(paper_model.bushing, data_sets, {})
    return Model.started(paper_model.bushing, (*BASE, *effects), start)


@pytest.mark.parametrize("effects", [(), ("delay",), ("viscous", "strain_stiffening")], ids="+".join)
@pytest.mark.parametrize("bounds", [{}, {"alpha": (0.26, 0.5)}, {"mu": (None, 9e5)}], ids=str)
def test_it_ends_where_lmfit_ends(
    paper_model: Model, data_sets: list[DataSet], effects: tuple[str, ...], bounds: Bounds
) -> None:
    model = started(paper_model, data_sets, *effects)
    names = tuple(model.parameters)
    found = Descent.start(model, data_sets, names, bounds).finished(100)
    known = solve(model, data_sets, names, bounds)
    errors = np.sqrt(np.diag(np.linalg.pinv(known.jacobian @ known.jacobian.T)))
    points = [end.coordinates.point(end.model.values) for end in (found.solution, known)]
    off = np.abs(points[0] - points[1]) / errors
    print(f"{found.evaluations} evaluations, lmfit {known.evaluations}, apart by {off.max():.2g} standard errors")
    assert found.converged
    assert found.chi_square == pytest.approx(known.chi_square, abs=1e-2)
    assert off.max() < 0.05
    assert found.solution.at_bound == known.at_bound
    np.testing.assert_allclose(found.solution.jacobian, known.jacobian, atol=1e-2 * np.abs(known.jacobian).max())


def test_it_never_climbs_and_counts_its_evaluations(paper_model: Model, data_sets: list[DataSet]) -> None:
    model = started(paper_model, data_sets)
    here = Descent.start(model, data_sets, tuple(model.parameters), {})
    path = [here]
    while not here.converged:
        here = here.stepped()
        path.append(here)
    chi_square = [float(np.sum(residual(step.model, data_sets) ** 2)) for step in path]
    print(", ".join(f"{x:.6g}" for x in chi_square))
    assert chi_square == pytest.approx([step.chi_square for step in path], rel=1e-12)
    assert all(np.diff(chi_square) <= 0.0)
    assert [step.evaluations for step in path] == list(range(1, len(path) + 1))
    assert path[-1].expected_fall < 0.01 < path[0].expected_fall


def test_it_can_be_left_anywhere(paper_model: Model, data_sets: list[DataSet]) -> None:
    model = started(paper_model, data_sets)
    left = Descent.start(model, data_sets, tuple(model.parameters), {}).finished(3)
    assert left.evaluations == left.solution.evaluations == 3
    assert not left.converged


def test_what_is_not_seen_stays(paper_model: Model, data_sets: list[DataSet]) -> None:
    """An effect of no amount has no shape that data could tell."""
    model = started(paper_model, data_sets, "maxwell")
    first = Descent.start(model, data_sets, tuple(model.parameters), {"maxwell.mu1": (0.0, 1e-9)}).finished(100)
    assert first.model.values["maxwell.tau"] == pytest.approx(model.values["maxwell.tau"], rel=1e-9)
    assert first.solution.at_bound["maxwell.mu1"] in ("min", "max")


def test_too_few_points_are_refused(paper_model: Model, data_sets: list[DataSet]) -> None:
    sweep = data_sets[-1]
    few = replace(
        sweep,
        sweep=replace(
            sweep.sweep,
            **{  # type: ignore[union-attr]
                name: getattr(sweep.sweep, name)[:2]
                for name in ("frequency", "amplitude", "stiffness", "repeat")  # type: ignore[union-attr]
            },
        ),
    )
    with pytest.raises(FitError, match="too few points"):
        Descent.start(paper_model, [few], tuple(paper_model.parameters), {})


def test_it_follows_the_bend_of_a_valley(paper_model: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    """A delay and a Maxwell arm that stand in for a dashpot trade off with one another and with the springpot: straight
    steps creep along the valley that this makes of chi-square. Both ways end in its lowest place."""
    damped = paper_model.with_effect("viscous").with_values({"viscous.eta": 500.0})
    loop = SimulatedLoop(Direction.AXIAL, 1e-3, 0.1)
    sweep = SimulatedSweep(Direction.AXIAL, (1e-4, 2e-4, 5e-4), (5.0, 20.0, 60.0, 150.0))
    taken = []
    for seed in range(6):
        settings = SimulateSettings(
            loops=(loop,), sweeps=(sweep,), repeats=2, noise=0.003, force_noise=0.003, seed=seed
        )
        data = Data.of(simulate(damped, settings).campaign())
        data_sets = [*data.loops, *data.sweeps]
        model = started(paper_model, data_sets, "delay", "maxwell")
        bent = Descent.start(model, data_sets, tuple(model.parameters), {}).finished(400)
        with monkeypatch.context() as straight:
            straight.setattr("bushfit.fitting.descent._SAME_WAY", 2.0)
            known = Descent.start(model, data_sets, tuple(model.parameters), {}).finished(400)
        assert bent.converged
        assert bent.chi_square < known.chi_square + 0.05
        taken.append((bent.evaluations, known.evaluations))
    print(f"evaluations along the bend and straight: {taken}")
    assert sum(along for along, _ in taken) < 0.85 * sum(straight for _, straight in taken)
