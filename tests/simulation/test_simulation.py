"""Simulated campaigns: the plan is what is measured, noise is as large as it was asked for, and files lead back."""

from dataclasses import replace

import numpy as np
import pytest

from bushfit.campaign.simulated import SimulatedLoop, SimulatedSweep, SimulateSettings
from bushfit.effects import BASE, LIBRARY, History, get_effect, qualified_name
from bushfit.geometry import Direction, Specimen
from bushfit.model.model import Model
from bushfit.simulation import rig
from bushfit.simulation.exact import ExactTests, simulate_exact
from bushfit.simulation.measured import measure

LOOP = SimulatedLoop(Direction.AXIAL, 1e-3, 0.1, cycles=2)
SWEEP = SimulatedSweep(Direction.AXIAL, (1e-4, 5e-4), (5.0, 50.0, 155.0))
PLAN = SimulateSettings(loops=(LOOP,), sweeps=(SWEEP,))
COUPON = Specimen("DMA", "modulus")
STRAINS = tuple(np.geomspace(1e-3, 0.1, 12).tolist())
STRAIN_SWEEP = SimulatedSweep(COUPON, STRAINS, (1.0, 10.0, 100.0), stepped="amplitude", reached=0.02)


@pytest.fixture(scope="module")
def clean(paper_model) -> ExactTests:
    return simulate_exact(paper_model, PLAN)


@pytest.fixture(scope="module")
def coupon(paper_model) -> ExactTests:
    return simulate_exact(Model(None, BASE, paper_model.values), SimulateSettings(sweeps=(STRAIN_SWEEP,)))


@pytest.mark.parametrize(
    "name",
    [name for name, effect in LIBRARY.items() if not (effect.harmonic_only or effect.is_transient or name in BASE)],
)
def test_a_small_loop_is_that_of_the_closed_form_with_any_effect(paper_model, name):
    """What went before a loop is gone from it: the rig's first harmonic is the closed form's, within its own error."""
    model = paper_model.with_effect(name)
    effect = get_effect(name)
    if not effect.replaces:
        model = model.with_values({qualified_name(effect, effect.amount): effect.amount.value_at_share(0.1)})
    small = SimulatedLoop(Direction.AXIAL, 2e-6, 1.0, cycles=1)
    ((_, record),) = simulate_exact(model, SimulateSettings(loops=(small,))).loops
    closed = model.stiffness(Direction.AXIAL, 1.0, 2e-6, kind="loop")
    assert rig.lock_in(record, 1.0) == pytest.approx(closed, rel=5e-4)
    if not model.structure.modifiers:  # whose loops have no motion of a larger amplitude before
        steady = model.force(Direction.AXIAL, History.steady(record.displacement[:-1], 1.0), kind="loop")
        assert abs(np.mean(record.force[:-1] - steady)) < 1e-3 * np.ptp(steady)


def test_noise_is_as_large_as_asked_for(clean):
    ideal = measure(clean, PLAN)
    noisy = measure(clean, replace(PLAN, repeats=2000, noise=0.01, force_noise=0.02, displacement_noise=0.001))
    stiffness = noisy.sweeps[0].stiffness.reshape(2, 2000, 3)
    off = stiffness / ideal.sweeps[0].stiffness.reshape(2, 1, 3) - 1.0
    assert np.std(off.real) == pytest.approx(0.01, rel=0.05)
    assert np.std(off.imag) == pytest.approx(0.01, rel=0.05)
    force = noisy.loops[0].force - ideal.loops[0].force
    assert np.std(force) == pytest.approx(0.02 * np.ptp(ideal.loops[0].force) / 2.0, rel=0.05)
    assert np.std(noisy.loops[0].displacement - ideal.loops[0].displacement) == pytest.approx(1e-6, rel=0.05)


@pytest.mark.parametrize("correlation", [0.5, 0.98])
def test_noise_of_a_loop_is_correlated_as_asked_for(clean, correlation):
    ideal = measure(clean, PLAN).loops[0].force
    plan = replace(PLAN, force_noise=0.02, force_correlation=correlation)
    unit = 0.02 * np.ptp(ideal) / 2.0
    noise = np.array([measure(clean, replace(plan, seed=seed)).loops[0].force - ideal for seed in range(300)]) / unit
    for rows in (noise[:, :2], noise[:, -2:]):  # as large from the first row on
        assert np.std(rows) == pytest.approx(1.0, abs=0.1)
        assert np.mean(rows[:, 0] * rows[:, 1]) == pytest.approx(correlation, abs=0.2)
    assert np.mean(noise[:, 1:] * noise[:, :-1]) == pytest.approx(correlation, abs=0.05)


@pytest.mark.parametrize("shared_by", ["run at an amplitude", "run at a frequency", "level"])
def test_gain_and_phase_errors_are_shared(clean, coupon, shared_by):
    """One factor for each run (one repeat at one held value), or for all repeats of a level."""
    test, stiffness = (coupon if shared_by == "run at a frequency" else clean).sweeps[0]
    ideal = replace(clean, loops=(), sweeps=((replace(test, reached=0.0), stiffness),))
    of_level, errors = shared_by == "level", {"gain_error": 0.01, "phase_error": 0.02}
    plan = SimulateSettings(repeats=4 if of_level else 2000)
    plan = replace(plan, **({f"level_{name}": error for name, error in errors.items()} if of_level else errors))
    seeds = range(300 if of_level else 1)
    measured = [measure(ideal, replace(plan, seed=seed)).sweeps[0].stiffness for seed in seeds]
    factors = np.log(np.array(measured).reshape(len(seeds), len(test.levels), plan.repeats, -1) / stiffness[:, None])
    shared = (2, 3) if of_level else 3
    assert np.abs(np.ptp(factors.real, axis=shared)).max() < 1e-12
    assert np.abs(np.ptp(factors.imag, axis=shared)).max() < 1e-12
    assert np.std(factors.real) == pytest.approx(0.01, rel=0.1)
    assert np.std(factors.imag) == pytest.approx(0.02, rel=0.1)
    if of_level:
        assert abs(np.corrcoef(factors[:, :, 0, 0].real.T)[0, 1]) < 0.2


def test_an_amplitude_sweep_has_the_stiffness_at_the_amplitudes_reached(coupon):
    """It is carried there from the nominal amplitudes, to 1e-5 of what the rig measures there itself."""
    (sweep,) = measure(coupon, SimulateSettings(repeats=2, seed=1)).sweeps
    assert sweep.stepped == "amplitude"
    some = np.s_[3::11]
    points = sweep.frequency[some], sweep.amplitude_reached[some]
    itself = rig.dynamic_stiffness(coupon.truth, COUPON, *points)
    assert np.abs(sweep.stiffness[some] / itself - 1.0).max() < 2e-5
    closed = coupon.truth.stiffness(COUPON, sweep.frequency, sweep.amplitude_reached)
    np.testing.assert_allclose(sweep.stiffness, closed, rtol=2e-3)
