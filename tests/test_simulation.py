"""Simulated campaigns: the plan is what is measured, noise is as large as it was asked for, and files lead back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bushfit.campaign.campaign import Campaign, load_campaign
from bushfit.campaign.schema import SimulatedLoop, SimulatedSweep, SimulateSettings
from bushfit.errors import CampaignError, ModelError
from bushfit.fitting.data_sets import loop_data, sources
from bushfit.geometry import Bushing, Direction
from bushfit.model.file import load_result
from bushfit.model.model import FIVE, Model
from bushfit.simulation import Undisturbed, measure, model_of, simulate, to_files, undisturbed

LOOP = SimulatedLoop(Direction.AXIAL, 1e-3, 0.1, cycles=2)
SWEEP = SimulatedSweep(Direction.AXIAL, (1e-4, 5e-4), (5.0, 50.0, 155.0))
PLAN = SimulateSettings(loops=(LOOP,), sweeps=(SWEEP,))


@pytest.fixture(scope="module")
def clean(paper_model: Model) -> Undisturbed:
    return undisturbed(paper_model, PLAN)


def test_an_ideal_rig_measures_the_closed_form(clean: Undisturbed, paper_model: Model) -> None:
    (sweep,), (loop,) = measure(clean, PLAN).sweeps, measure(clean, PLAN).loops
    assert sweep.frequency.size == 6
    closed = paper_model.stiffness(Direction.AXIAL, sweep.frequency, sweep.amplitude)
    np.testing.assert_allclose(sweep.stiffness, closed, rtol=2e-3)
    assert loop.time[-1] == pytest.approx(20.0, abs=0.02)
    assert np.ptp(loop.displacement) / 2.0 == pytest.approx(1e-3, rel=1e-5)


def test_every_repeat_measures_every_point(clean: Undisturbed) -> None:
    (sweep,) = measure(clean, replace(PLAN, repeats=3)).sweeps
    points = {*zip(sweep.amplitude, sweep.repeat, sweep.frequency, strict=True)}
    assert points == {(a, r, f) for a in SWEEP.amplitudes for r in (1, 2, 3) for f in SWEEP.frequencies}
    assert sweep.frequency.size == 18


def test_the_seed_alone_settles_the_noise(clean: Undisturbed) -> None:
    plan = replace(PLAN, noise=0.01, force_noise=0.01, seed=3)
    one, same, other = (measure(clean, each) for each in (plan, plan, replace(plan, seed=4)))
    assert np.array_equal(one.sweeps[0].stiffness, same.sweeps[0].stiffness)
    assert np.array_equal(one.loops[0].force, same.loops[0].force)
    assert not np.array_equal(one.sweeps[0].stiffness, other.sweeps[0].stiffness)


def test_noise_is_as_large_as_asked_for(clean: Undisturbed) -> None:
    ideal = measure(clean, PLAN)
    noisy = measure(clean, replace(PLAN, repeats=2000, noise=0.01, force_noise=0.02, displacement_noise=0.001))
    stiffness = noisy.sweeps[0].stiffness.reshape(2, 2000, 3)
    off = stiffness / ideal.sweeps[0].stiffness.reshape(2, 1, 3) - 1.0
    assert np.std(off.real) == pytest.approx(0.01, rel=0.05)
    assert np.std(off.imag) == pytest.approx(0.01, rel=0.05)
    force = noisy.loops[0].force - ideal.loops[0].force
    assert np.std(force) == pytest.approx(0.02 * np.ptp(ideal.loops[0].force) / 2.0, rel=0.05)
    assert np.std(noisy.loops[0].displacement - ideal.loops[0].displacement) == pytest.approx(1e-6, rel=0.05)


def test_gain_and_phase_errors_are_shared_by_a_block(clean: Undisturbed) -> None:
    """A block is one repeat at one amplitude: its points are off by one factor, those of other blocks by others."""
    ideal = measure(clean, PLAN).sweeps[0].stiffness.reshape(2, 1, 3)
    plan = replace(PLAN, repeats=2000, gain_error=0.01, phase_error=0.02)
    off = np.log(measure(clean, plan).sweeps[0].stiffness.reshape(2, 2000, 3) / ideal)
    assert np.ptp(off.real, axis=-1).max() < 1e-12
    assert np.ptp(off.imag, axis=-1).max() < 1e-12
    assert np.std(off.real) == pytest.approx(0.01, rel=0.1)
    assert np.std(off.imag) == pytest.approx(0.02, rel=0.1)


def test_files_are_a_campaign_that_says_nothing_of_the_truth(
    clean: Undisturbed, paper_model: Model, tmp_path: Path
) -> None:
    simulated = measure(clean, replace(PLAN, noise=0.005, repeats=2))
    for name, content in to_files(simulated).items():
        (tmp_path / name).write_bytes(content)
    campaign = load_campaign(tmp_path / "campaign.toml")
    assert campaign.bushing == paper_model.bushing
    np.testing.assert_allclose(campaign.sweeps[0].stiffness, simulated.sweeps[0].stiffness, rtol=1e-6)
    np.testing.assert_allclose(campaign.loops[0].force, simulated.loops[0].force, rtol=1e-5, atol=1e-3)
    assert load_result(tmp_path / "truth.json").model.values == pytest.approx(paper_model.values, rel=1e-12)
    text = (tmp_path / "campaign.toml").read_text()
    assert [name for name in FIVE if f"{name} =" in text] == []


def test_a_programme_is_one_file_of_several_loops(paper_model: Model, tmp_path: Path) -> None:
    sizes, rates = (2e-4, 1e-3), (0.1, 0.3)
    loop = SimulatedLoop(Direction.AXIAL, cycles=4, amplitudes=sizes, frequencies=rates, pause=5.0)
    simulated = simulate(paper_model, SimulateSettings(loops=(loop,)))
    (record,) = simulated.loops
    assert record.time[-1] == pytest.approx(2 * 4 / 0.1 + 2 * 4 / 0.3 + 3 * 5.0, abs=0.02)
    for name, content in to_files(simulated).items():
        (tmp_path / name).write_bytes(content)
    read, in_memory = load_campaign(tmp_path / "campaign.toml").loops, simulated.campaign().loops
    for loops in (read, in_memory):
        assert [part.name for part in loops] == [f"loop_axial_1_part_{number}" for number in (1, 2, 3, 4)]
        assert [np.ptp(part.displacement) / 2.0 for part in loops] == pytest.approx([*sizes, *sizes], rel=1e-3)
    assert sources(loop_data(read)) == (read[0].source,)


def test_a_programme_too_long_to_simulate_is_refused(paper_model: Model) -> None:
    loop = SimulatedLoop(Direction.AXIAL, 1e-3, frequencies=(1e-3, 10.0))
    with pytest.raises(CampaignError, match="too long to simulate"):
        simulate(paper_model, SimulateSettings(loops=(loop,)))


def test_sweeps_of_one_direction_have_names_of_their_own(paper_model: Model) -> None:
    plan = SimulateSettings(sweeps=(SWEEP, replace(SWEEP, amplitudes=(2e-4,))))
    assert [sweep.name for sweep in simulate(paper_model, plan).sweeps] == ["sweep_axial_1", "sweep_axial_2"]


def test_the_model_is_that_of_the_simulate_table(bushing: Bushing, table_1: dict[str, float]) -> None:
    settings = SimulateSettings(parameters=table_1, effects={"inertia": {"mass": 0.1}})
    model = model_of(Campaign("c", Path("c.toml"), bushing, simulate=settings))
    assert model.values == {**table_1, "inertia.mass": 0.1}


def test_what_a_simulate_table_lacks_is_said(bushing: Bushing, table_1: dict[str, float]) -> None:
    def campaign(settings: SimulateSettings | None) -> Campaign:
        return Campaign("c", Path("c.toml"), bushing, simulate=settings)

    with pytest.raises(CampaignError, match="nothing says what to simulate"):
        model_of(campaign(None))
    lacking = {name: table_1[name] for name in FIVE if name != "alpha"}
    with pytest.raises(CampaignError, match=r"parameters without a value[\s\S]*no alpha"):
        model_of(campaign(SimulateSettings(parameters=lacking)))
    with pytest.raises(ModelError, match=r"c.toml[\s\S]*friktion"):
        model_of(campaign(SimulateSettings(parameters=table_1, effects={"friktion": {"x": 1.0}})))
