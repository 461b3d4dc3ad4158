"""Tests at several temperatures: one fit of all, its shift factors, and what it predicts between and beyond.

The rig steps through time, so that the closed form of the fit made none of the data; both have the shift factors from
one formula, which tests/effects/test_limits.py holds against the constants of Williams, Landel and Ferry. That sweeps
which follow another law are told apart from it, a test here says.
"""

from dataclasses import replace

import numpy as np
import pytest

from bushfit.campaign.schema import PredictSettings, SimulatedLoop, SimulatedSweep, SimulateSettings
from bushfit.effects import BASE
from bushfit.effects.contract import Circumstances
from bushfit.fitting.data import Data
from bushfit.fitting.master_curve import master_curve
from bushfit.fitting.procedures import fit_joint
from bushfit.geometry import Direction, Specimen
from bushfit.jobs.fits import Fit
from bushfit.jobs.predict import Predict
from bushfit.model.arms import arm_rows, model_arms
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.prediction.stiffness import predict
from bushfit.report.artifacts import temperature_contents
from bushfit.simulation.measured import measure, simulate
from bushfit.simulation.undisturbed import Undisturbed, undisturbed
from bushfit.units import CELSIUS

VALUES = {"temperature.softening": 4e-3, "temperature.shift": 0.12}
DEGREES = (-10.0, 8.0, 23.0, 38.0, 53.0)
FREQUENCIES = tuple(np.geomspace(1.0, 100.0, 7).tolist())
SWEEPS = tuple(
    SimulatedSweep(Direction.AXIAL, (1e-4, 5e-4), FREQUENCIES, temperature=CELSIUS + degrees) for degrees in DEGREES
)
PLAN = SimulateSettings(
    loops=(SimulatedLoop(Direction.AXIAL, 1e-3, 0.1, cycles=2, temperature=CELSIUS + 23.0),),
    sweeps=SWEEPS,
    noise=3e-3,
    force_noise=2e-3,
    displacement_noise=1e-3,
)
SEEDS = 12


@pytest.fixture(scope="module")
def truth(paper_model: Model) -> Model:
    return paper_model.with_effect("temperature", VALUES)


@pytest.fixture(scope="module")
def clean(truth: Model) -> Undisturbed:
    return undisturbed(truth, PLAN)


def test_all_temperatures_are_fitted_at_once(clean: Undisturbed, truth: Model) -> None:
    """From what is read off the tests: the shift within its interval as often as it claims, and a stiffness between."""
    off, inside, bands, warm = [], 0, 0, CELSIUS + 30.0
    for seed in range(SEEDS):
        data = Data.of(measure(clean, replace(PLAN, seed=seed)).campaign())
        result = fit_joint(data, effects=(*BASE, "temperature"))
        assert not [line for line in result.warnings if "degC" in line]
        low, high = result.interval("temperature.shift") or (0.0, 0.0)
        off.append(result.model.values["temperature.shift"] / VALUES["temperature.shift"] - 1.0)
        inside += low < VALUES["temperature.shift"] < high
        found = predict(result, Direction.AXIAL, [30.0], [2e-4], temperature=warm).stiffness
        true = predict(replace(result, model=truth), Direction.AXIAL, [30.0], [2e-4], temperature=warm).stiffness
        bands += bool(found.low[0] < true.value[0] < found.high[0])
        assert found.value[0] == pytest.approx(true.value[0], rel=0.01)
    print(f"shift off by {100 * np.std(off):.1f} %, in its interval {inside}, stiffness at 30 degC {bands} of {SEEDS}")
    assert np.max(np.abs(off)) < 0.05
    assert min(inside, bands) >= SEEDS - 2  # 11.4 are expected; 3 misses or more come once in 50


def test_shift_factors_are_those_of_the_law_where_it_holds(clean: Undisturbed) -> None:
    data = Data.of(measure(clean, PLAN).campaign())
    result = fit_joint(data, effects=(*BASE, "temperature"))
    found = master_curve(result, data.sweeps)
    assert [round(each.temperature - CELSIUS) for each in found] == list(DEGREES)
    off = np.array([(each.own[0] - each.shift[0]) / np.hypot(each.own[1], each.shift[1] + 1e-3) for each in found])
    assert np.max(np.abs(off)) < 3.5
    for each in found:
        line = result.model.stiffness(Direction.AXIAL, each.reduced_frequency, each.sweep.amplitude)
        assert np.max(np.abs(each.reduced_stiffness / line - 1.0)) < 0.02
    tables = temperature_contents(result, "bushing", data.sweeps).tables
    factors, curve = (tables[name]() for name in ("shift_factors", "master_curve"))
    assert len(factors) == len(DEGREES)
    assert len(curve) == sum(each.sweep.frequency.size for each in found)
    assert factors["log10 a_T [-]"].to_numpy() == pytest.approx([each.shift[0] / np.log(10.0) for each in found])
    own = factors[["own log10 a_T [-]", "own log10 a_T [-], low", "own log10 a_T [-], high"]].to_numpy().T
    half = [1.96 * each.own[1] / np.log(10.0) for each in found]
    assert own[0] - own[1] == pytest.approx(half, rel=1e-3)
    assert own[2] - own[0] == pytest.approx(half, rel=1e-3)


def test_the_error_of_a_sweep_s_own_shift_factor_is_what_it_scatters_by(clean: Undisturbed, truth: Model) -> None:
    off = []
    for seed in range(SEEDS):
        sweeps = Data.of(measure(clean, replace(PLAN, seed=seed)).campaign()).sweeps
        off += [(each.own[0] - each.shift[0]) / each.own[1] for each in master_curve(Result(truth), sweeps)]
    print(f"{len(off)} shift factors off by {np.std(off):.2f} of their standard errors")
    assert 0.8 < np.std(off) < 1.25


def test_a_sweep_off_the_law_says_so(truth: Model) -> None:
    """That at 8 degC as if its chamber had been 8 K warmer than it says."""
    tested = [replace(sweep, temperature=CELSIUS + 16.0) if sweep is SWEEPS[1] else sweep for sweep in SWEEPS]
    simulated = simulate(truth, replace(PLAN, sweeps=tuple(tested))).campaign()
    pairs = zip(simulated.sweeps, DEGREES, strict=True)
    stated = tuple(replace(sweep, temperature=CELSIUS + at) for sweep, at in pairs)
    data = Data.of(replace(simulated, sweeps=stated))
    found = master_curve(fit_joint(data, effects=(*BASE, "temperature")), data.sweeps)
    off = np.array([(each.own[0] - each.shift[0]) / each.own[1] for each in found])
    assert np.argmax(np.abs(off)) == 1
    assert off[1] < -4.0


@pytest.mark.parametrize("degrees", [-10.0, 40.0])
def test_arms_stand_for_the_rubber_at_a_temperature(truth: Model, degrees: float) -> None:
    """Springs and dashpots, the spring and friction below all amplitudes are the model as cold or as warm."""
    under, compound = Circumstances(CELSIUS + degrees), Specimen("compound", "modulus")
    frequency = np.geomspace(1.0, 100.0, 9)
    arms = model_arms(truth, (1.0, 100.0), 1e-3, under)
    spring = arm_rows(truth, arms)[0][1]
    softer = np.exp(-VALUES["temperature.softening"] * (degrees - 23.0))
    friction = softer * truth.values["sigma_fmax"] / (2.0 * truth.values["eps_half"])
    found = spring + friction + sum(part.at(2.0 * np.pi * frequency) for part in arms)
    model = truth.stiffness(compound, frequency, np.full(frequency.shape, 1e-9), under=under)
    np.testing.assert_allclose(found, model, rtol=1e-3)


def test_a_sweep_of_amplitudes_has_no_shift_factor(truth: Model) -> None:
    """It goes into the fit, and neither its table nor its picture is promised or made."""
    amplitudes = tuple(np.geomspace(5e-5, 1e-3, 8).tolist())
    stepped = SimulatedSweep(Direction.AXIAL, amplitudes, (1.0, 30.0), stepped="amplitude", temperature=300.0)
    campaign = simulate(truth, replace(PLAN, loops=(), sweeps=(stepped,))).campaign()
    job = Fit(effects=("temperature",))
    assert job.kinds(campaign).tables == ("sweeps",)
    assert [*job.run(Data.of(campaign)).contents.tables] == ["sweeps"]
    mixed = simulate(truth, replace(PLAN, loops=(), sweeps=(stepped, *SWEEPS))).campaign()
    tables = job.run(Data.of(mixed)).contents.tables
    assert [*tables] == [*job.kinds(mixed).tables] == ["sweeps", "master_curve", "shift_factors"]
    assert len(tables["shift_factors"]()) == len(SWEEPS)


def test_only_tests_of_its_temperature_stand_beside_a_prediction(clean: Undisturbed) -> None:
    """At 38 degC one of five sweeps; all of them tell how well the model meets them."""
    campaign = measure(clean, PLAN).campaign()
    result = fit_joint(Data.of(campaign), effects=(*BASE, "temperature"))
    settings = PredictSettings(directions=("axial",), frequencies=FREQUENCIES, amplitudes=(5e-4,))
    at_38, at_30 = (Predict(settings, temperature=CELSIUS + at).run(result, campaign) for at in (38.0, 30.0))
    assert [len(at_38.beside), len(at_38.measured), len(at_30.beside)] == [1, len(SWEEPS), 0]
    measured, none = (found.predictions[0].measured for found in (at_38, at_30))
    assert measured is not None
    assert none is not None
    np.testing.assert_allclose(np.abs(measured), at_38.predictions[0].stiffness.value, rtol=0.03)
    assert np.isnan(none).all()


def test_what_lies_beyond_the_tested_temperatures_is_told(clean: Undisturbed) -> None:
    result = fit_joint(Data.of(measure(clean, PLAN).campaign()), effects=(*BASE, "temperature"))
    assert result.measured is not None
    assert result.measured.temperature == pytest.approx((CELSIUS - 10.0, CELSIUS + 53.0))
    for degrees, told in ((53.0, 0), (80.0, 1), (-30.0, 1)):
        found = predict(result, Direction.AXIAL, [30.0], [2e-4], temperature=CELSIUS + degrees)
        lines = [line for line in found.warnings if "degC" in line]
        assert len(lines) == told
        assert all(f"predicted at {degrees:g} degC, but fitted at -10 to 53 degC only" in line for line in lines)
