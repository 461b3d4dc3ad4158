"""The rig's steps through time against the closed form, with which they share no formula."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from bushfit.geometry import Direction
from bushfit.model import rig
from bushfit.model.model import Model


def measured(model: Model, at: tuple[Direction, float, float], steps: int, run_in: int) -> complex:
    """Stiffness by lock-in, over that of the closed form, less 1."""
    record = rig.record(model, *at, cycles=1, run_in=run_in, steps_per_cycle=steps)
    return rig.lock_in(record, at[1]) / complex(model.stiffness(*at)) - 1.0


def test_the_rig_meets_the_closed_form_at_first_order(paper_model: Model) -> None:
    """Gruenwald-Letnikov is first order in the step; a long run-in leaves no transient."""
    at = (Direction.AXIAL, 20.0, 5e-4)
    errors = np.abs([measured(paper_model, at, steps, 60) for steps in (128, 256, 512, 1024, 2048)])
    print(f"from the closed form: {errors}")
    np.testing.assert_allclose(np.log2(errors[:-1] / errors[1:]), 1.0, atol=0.1)
    assert errors[-1] < 3e-4


def test_extrapolated_to_no_step_and_no_transient_it_is_the_closed_form(paper_model: Model) -> None:
    errors = [measured(paper_model, (Direction.RADIAL, 5.0, 2e-4), steps, 200) for steps in (256, 512, 1024)]
    first = [2.0 * fine - coarse for coarse, fine in pairwise(errors)]
    gap = abs(4.0 * first[1] - first[0]) / 3.0
    print(f"extrapolated: {gap:.1e} from the closed form")
    assert gap < 2e-6


def test_the_loop_of_table_1_peaks_at_458_newton(paper_model: Model) -> None:
    """The figure is of an independent computation in time; the paper prints none."""
    loop = rig.record(paper_model, Direction.AXIAL, 0.1, 1e-3, cycles=1, run_in=3)
    assert loop.force.max() == pytest.approx(458.0, rel=1e-2)


@pytest.mark.parametrize(("cycles", "error"), [(3, 2e-3), (6, 6e-4), (12, 5e-5)])
def test_friction_settles_from_rest_as_it_should(paper_model: Model, cycles: int, error: float) -> None:
    """First harmonic after so many cycles at e0/eps_half = 0.5."""
    only = paper_model.with_values({"m": 0.0})
    amplitude = 0.5 * only.values["eps_half"] / only.bushing.unit_strain(Direction.AXIAL)
    gap = abs(measured(only, (Direction.AXIAL, 1.0, amplitude), 4096, cycles - 1))
    print(f"cycle {cycles}: {gap:.1e} from the steady state")
    assert gap == pytest.approx(error, rel=0.5)


def test_lock_in_drops_mean_and_overtones() -> None:
    time = np.arange(4096) / 4096
    phase = 2.0 * np.pi * 5.0 * time
    displacement = 2.0 * np.cos(phase)
    force = 7.0 + 6.0 * np.cos(phase + 0.3) + 4.0 * np.cos(3.0 * phase) + 1.0 * np.sin(2.0 * phase)
    found = rig.lock_in(rig.Record(time, displacement, force), 5.0)
    assert found == pytest.approx(3.0 * np.exp(0.3j), rel=1e-10)


def test_record_keeps_the_last_cycles(paper_model: Model) -> None:
    whole = rig.record(paper_model, Direction.AXIAL, 1.0, 1e-3, cycles=4, steps_per_cycle=64)
    kept = rig.record(paper_model, Direction.AXIAL, 1.0, 1e-3, cycles=1, run_in=3, steps_per_cycle=64)
    assert kept.time[0] == 0.0
    np.testing.assert_allclose(kept.time[-1], 1.0)
    np.testing.assert_allclose(kept.force, whole.force[3 * 64 :], rtol=1e-9, atol=1e-9)


def test_a_triangle_is_not_a_sine(paper_model: Model) -> None:
    """The two of one amplitude meet at the peaks, where friction has gone as far, but not between them."""
    phase = np.array([0.0, 0.125, 0.25, 0.5, 0.75, 1.0, 1.25])
    np.testing.assert_allclose(rig.wave("triangle", phase), [0.0, 0.5, 1.0, 0.0, -1.0, 0.0, 1.0], atol=1e-12)
    sine, triangle = (
        rig.record(paper_model, Direction.AXIAL, 0.1, 1e-3, cycles=1, run_in=4, waveform=waveform)
        for waveform in ("sine", "triangle")
    )
    assert triangle.displacement.max() == pytest.approx(1e-3, rel=1e-9)
    assert triangle.force.max() == pytest.approx(sine.force.max(), rel=1e-2)
    middle = np.argmin(np.abs(sine.displacement - 5e-4))
    assert abs(triangle.displacement[middle] - 5e-4) > 5e-5
