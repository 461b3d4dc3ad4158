"""How fast, as ratios within one run:

    pytest tests/benchmarks --benchmark-enable -s

In the ordinary test run each is called once, so that it cannot rot. No time is asserted; the ratios are printed.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from scipy.optimize import leastsq

from bushfit import rig
from bushfit.campaign import load_campaign
from bushfit.fitting.data import Data
from bushfit.fitting.procedures import STATIC, fit_dynamic, fit_joint, fit_two_step
from bushfit.fitting.solve import Coordinates, jacobian, residual
from bushfit.fitting.terms import SweepTerm
from bushfit.geometry import Direction
from bushfit.model import FIVE, Model
from bushfit.results import Result


@pytest.fixture(scope="module")
def data(root: Path) -> Data:
    return Data.of(load_campaign(root / "configs/cmp_15961.toml"))


@pytest.fixture(scope="module")
def static(data: Data) -> Result:
    return fit_two_step(data).result


def seconds(work: Callable[[], Any], repeats: int) -> float:
    """Least time of a call."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    return min(times)


def by_time_stepping(term: SweepTerm, static: Result, start: dict[str, float]) -> dict[str, float]:
    """The paper's dynamic fit: every residual puts every operating point on the rig, steps Eqs. 3 and 5 through a
    run-in and a cycle, and locks in; MINPACK differences it. Run-in and steps are those that keep the rig within
    1e-4 of the steady state, because m and alpha answer with ten times that."""
    base = static.model

    def misfit(point: np.ndarray) -> np.ndarray:
        model = base.with_values({"m": float(np.exp(point[0])), "alpha": float(np.clip(point[1], 0.02, 1.0))})
        points, where = np.unique(np.stack((term.frequency, term.amplitude)), axis=1, return_inverse=True)
        stiffness = rig.dynamic_stiffness(model, term.direction, *points)
        return term.whiten(stiffness[where.ravel()] / term.measured - 1.0)

    best, _ = leastsq(misfit, [np.log(start["m"]), start["alpha"]], epsfcn=1e-6, xtol=1e-6, ftol=1e-8)
    return {"m": float(np.exp(best[0])), "alpha": float(best[1])}


def test_fit_dynamic_against_time_stepping(benchmark: BenchmarkFixture, data: Data, static: Result) -> None:
    term = data.smallest_sweep()
    start = {"m": 0.5 * static.model.values["m"], "alpha": 0.3}
    begin = time.perf_counter()
    stepped = by_time_stepping(term, static, start)
    slow = time.perf_counter() - begin
    found = benchmark(fit_dynamic, data, static)
    fast = seconds(lambda: fit_dynamic(data, static), 5)
    apart = max(abs(found.model.values[name] / stepped[name] - 1.0) for name in ("m", "alpha"))
    print(
        f"\nfit-dynamic {1e3 * fast:.1f} ms, by time stepping {1e3 * slow:.0f} ms: 1/{slow / fast:.0f} of the time; "
        f"same answer within {100 * apart:.2f} %"
    )
    benchmark.extra_info["time stepping over closed form"] = slow / fast
    assert apart < 0.005
    assert set(STATIC) | {"m", "alpha"} == set(found.model.values)


def test_dynamic_stiffness_against_bare_numpy(benchmark: BenchmarkFixture, paper_model: Model) -> None:
    """What the house of effects costs over the closed form written out, for 100 000 operating points."""
    frequency, amplitude = np.linspace(5.0, 155.0, 100_000), np.linspace(1e-5, 1e-3, 100_000)
    p, bushing = paper_model.values, paper_model.bushing
    factor, per = bushing.stiffness_per_modulus(Direction.AXIAL), bushing.unit_strain(Direction.AXIAL)

    def bare() -> np.ndarray:
        e0, omega = per * amplitude, 2.0 * np.pi * frequency
        x = e0 / p["eps_half"]
        y = (np.sqrt(x * x + 6.0 * x + 1.0) - x - 1.0) / 2.0
        scale, c = p["sigma_fmax"] * (1.0 + y), p["eps_half"] * (1.0 + y)
        big = 1.0 + c / e0
        in_phase = 2.0 * scale * (c / e0) * (big / np.sqrt(big * big - 1.0) - 1.0)
        quadrature = 2.0 / np.pi * (2.0 * p["sigma_fmax"] - scale * (c / e0) * np.log((big + 1.0) / (big - 1.0)))
        modulus = p["mu"] + 0.5 * p["m"] * (1j * omega) ** p["alpha"] + (in_phase + 1j * quadrature) / (2.0 * e0)
        return factor * modulus

    found = benchmark(paper_model.stiffness, Direction.AXIAL, frequency, amplitude)
    np.testing.assert_allclose(found, bare(), rtol=1e-8)
    ratio = seconds(lambda: paper_model.stiffness(Direction.AXIAL, frequency, amplitude), 5) / seconds(bare, 5)
    print(f"\nModel.stiffness over bare NumPy, 100 000 points: {ratio:.2f} times the time")
    benchmark.extra_info["over bare NumPy"] = ratio


def test_joint_fit_against_bare_minpack(benchmark: BenchmarkFixture, data: Data) -> None:
    """What lmfit, covariance and advice cost over MINPACK with the same residual and Jacobian and start."""
    found = benchmark(fit_joint, data)
    terms = data.chosen(None)
    coordinates = Coordinates.of(found.model, FIVE)
    start = coordinates.point({**found.model.values, "mu": 1e6, "m": 1e5, "alpha": 0.3, "sigma_fmax": 3e4})

    def model_at(point: np.ndarray) -> Model:
        return found.model.with_values(coordinates.values(point))

    def bare() -> np.ndarray:
        best, _ = leastsq(
            lambda point: residual(model_at(point), terms),
            start,
            Dfun=lambda point: jacobian(model_at(point), terms, FIVE),
            col_deriv=True,
            ftol=1e-9,
            xtol=1e-9,
        )
        return np.asarray(best)

    best = coordinates.values(bare())
    for name in FIVE:
        assert best[name] == pytest.approx(found.model.values[name], rel=1e-4)
    ratio = seconds(lambda: fit_joint(data), 5) / seconds(bare, 5)
    print(f"\njoint fit over bare MINPACK: {ratio:.2f} times the time")
    benchmark.extra_info["over bare MINPACK"] = ratio


def test_a_sweep_of_a_thousand_bootstraps_is_one_call(benchmark: BenchmarkFixture, paper_model: Model) -> None:
    rng, count = np.random.default_rng(0), 1000
    frequency, amplitude = np.tile(np.arange(5.0, 156.0, 10.0), 3), np.repeat([1e-4, 2e-4, 5e-4], 16)
    stacked = {n: v * (1.0 + 0.01 * rng.standard_normal((count, 1))) for n, v in paper_model.values.items()}
    found = benchmark(paper_model.stiffness, Direction.AXIAL, frequency, amplitude, values=stacked)
    assert found.shape == (count, 48)
    models = [replace(paper_model, values={n: float(v[i, 0]) for n, v in stacked.items()}) for i in range(50)]
    one = seconds(lambda: [m.stiffness(Direction.AXIAL, frequency, amplitude) for m in models], 3) * count / len(models)
    both = seconds(lambda: paper_model.stiffness(Direction.AXIAL, frequency, amplitude, values=stacked), 3)
    print(f"\n{count} models in one call: {one / both:.1f} times as fast as one by one")
