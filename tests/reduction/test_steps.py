"""Raw histories reduced to a sweep: found steps, accuracy against the closed form, and errors as large as stated."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bushfit.effects.contract import Array
from bushfit.effects.history import History
from bushfit.errors import MeasurementError
from bushfit.geometry import Direction
from bushfit.model.model import Model
from bushfit.reading.measurement import Loop
from bushfit.reduction.result import Reduction
from bushfit.reduction.steps import reduce

FREQUENCIES = (5.0, 25.0, 100.0, 101.0, 155.0)
#: The rig misses 0.1, 0.2 and 0.5 mm.
POINTS = [(f, a * (1.0 - 1e-4 * f)) for a in (1.02e-4, 1.99e-4, 4.9e-4) for f in FREQUENCIES]
TIME = np.arange(0.0, 30.0, 5e-4)
SLOW = 20.0 * np.exp(np.linspace(0.0, 0.6, TIME.size))
#: Time step of the simulated records [s].
TIME_STEP = 2e-5


#: Frequency [Hz] and zero-to-peak amplitude [m] of a step.
Point = tuple[float, float]


def stepped(model: Model, points: Sequence[Point]) -> Loop:
    """Simulate a record at 5 kHz, from rest: steps of 16 cycles, two cycles of growth and decay, and pauses."""
    pause = [np.zeros(round(0.2 / TIME_STEP))]
    parts = [*pause]
    for frequency, amplitude in points:
        turns = np.arange(round(20 / frequency / TIME_STEP)) * TIME_STEP * frequency
        envelope = np.clip(np.minimum(turns, 20 - turns) / 2.0, 0.0, 1.0)
        parts += [amplitude * envelope * np.sin(2.0 * np.pi * turns), *pause]
    motion = np.concatenate(parts)
    force = model.force(Direction.AXIAL, History(motion, TIME_STEP, periodic=False, frequency=points[0][0]))
    record = Loop("history", Direction.AXIAL, np.arange(motion.size) * TIME_STEP, motion, force)
    return record.select(slice(None, None, 10))


def measured(history: Loop, random: np.random.Generator, noise: float, drift: float = 0.0) -> Loop:
    """A history with white noise and a wandering zero in both channels, relative to their largest value."""
    turns = history.time / history.time[-1]
    wander = drift * (np.sin(2.3 * np.pi * turns + random.uniform(0, 6)) + turns)
    displacement, force = (
        values + np.abs(values).max() * (wander + noise * random.standard_normal(values.size))
        for values in (history.displacement, history.force)
    )
    return replace(history, displacement=displacement, force=force)


def settled(model: Model, points: Sequence[Point]) -> Array:
    """Complex stiffness of the steady first harmonic, with the springpot of the rig's time step:
    (1 - exp(-i omega step))^alpha/step^alpha in place of (i omega)^alpha."""
    frequency, amplitude = np.array(points).T
    omega, alpha = 2j * np.pi * frequency, model.values["alpha"]
    error = ((1.0 - np.exp(-omega * TIME_STEP)) / TIME_STEP) ** alpha - omega**alpha
    factor = model.bushing.stiffness_per_modulus(Direction.AXIAL) * model.values["m"] / 2.0
    return model.stiffness(Direction.AXIAL, frequency, amplitude) + factor * error


@pytest.fixture(scope="module")
def clean(paper_model) -> Loop:
    """Three levels at five frequencies, sampled at 5 kHz."""
    return stepped(paper_model, POINTS)


def column(reduction: Reduction, name: str) -> Array:
    """One quantity of all steps by its name in `Step`, (n,)."""
    return np.array([getattr(step, name) for step in reduction.steps])


def off_truth(reduction: Reduction, model: Model) -> Array:
    """ln of the stiffness over that of the closed form, at the frequencies and amplitudes reached, (steps,)."""
    reached = [(point.frequency, point.amplitude) for point in reduction.steps]
    return np.log(column(reduction, "stiffness") / settled(model, reached))


@pytest.mark.parametrize(
    ("kind", "limit"), [("even", 5e-5), ("uneven", 5e-5), ("coarse", 5e-5), ("coarse, nearly 8 rows per cycle", 5e-4)]
)
def test_every_step_has_the_stiffness_of_the_closed_form(clean, paper_model, kind, limit):
    count = clean.time.size
    rows = {
        "even": None,
        "uneven": np.sort(np.random.default_rng(5).choice(count, count // 2, replace=False)),
        "coarse": np.arange(0, count, 3),  # 10.8 rows per cycle at 155 Hz
        # the 7th and 9th overtone fold onto the fundamental of 155 Hz
        "coarse, nearly 8 rows per cycle": np.arange(0, count, 4),
    }[kind]
    reduction = reduce([clean if rows is None else clean.select(rows)])
    assert np.abs(off_truth(reduction, paper_model)).max() < limit
    assert any("rows per cycle" in line for line in map(str, reduction.warnings)) == kind.startswith("coarse")
    frequency, amplitude = np.array(POINTS).T
    np.testing.assert_allclose(column(reduction, "frequency"), frequency, rtol=1e-6)
    np.testing.assert_allclose(column(reduction, "amplitude"), amplitude, rtol=2e-4)
    assert np.unique(column(reduction, "level")).size == 3
    assert set(column(reduction, "repeat")) == {1}
    assert not any(skip.steady for skip in reduction.skipped)


@pytest.mark.parametrize("seeds", [8, pytest.param(30, marks=pytest.mark.slow)])
def test_stated_errors_are_those_made(clean, paper_model, seeds):
    """White noise and a wandering zero in both channels: 95 % of the points lie within 1.96 standard errors."""
    gain, phase = [], []
    for seed in range(seeds):
        reduction = reduce([measured(clean, np.random.default_rng(seed), 1e-3, drift=0.01)])
        assert len(reduction.steps) == len(POINTS)
        off = off_truth(reduction, paper_model)
        gain.append(off.real / column(reduction, "gain_error"))
        phase.append(off.imag / column(reduction, "phase_error"))
    held = [float(np.mean(np.abs(errors) < 1.96)) for errors in (gain, phase)]
    assert min(held) > 0.92
    assert max(held) < 0.98


def test_noise_that_is_not_white_is_told_by_the_cycles():
    """A force whose amplitude wanders from cycle to cycle is less certain than its rows would say."""
    random, time = np.random.default_rng(3), np.arange(0.0, 4.0, 1e-3)
    errors, stated = [], []
    for _ in range(40):
        wander = np.repeat(1.0 + 0.01 * random.standard_normal(40), 100)
        force = wander * np.sin(2.0 * np.pi * 10.0 * time + 0.1) + 1e-4 * random.standard_normal(time.size)
        motion = 1e-3 * np.sin(2.0 * np.pi * 10.0 * time) + 1e-7 * random.standard_normal(time.size)
        (step,) = reduce([Loop("x", Direction.AXIAL, time, motion, force)]).steps
        errors.append(abs(step.stiffness) / 1e3 - 1.0)
        stated.append(step.gain_error)
    assert np.median(stated) == pytest.approx(np.std(errors), rel=0.3)


#: How a controller brings the amplitude up, over the cycles since the start.
CONTROLLERS = {
    "at once": lambda cycles: np.ones_like(cycles),
    "slowly": lambda cycles: 1.0 - np.exp(-cycles / 2.0),
    "with overshoot": lambda cycles: 1.0 + 0.5 * np.exp(-cycles / 2.0) * np.cos(3.0 * cycles),
}
#: What a data logger may do to a record.
LOGGERS = {
    "plain": lambda values, _: values,
    "12 bit": lambda values, _: np.round(values / np.ptp(values) * 3000.0) * np.ptp(values) / 3000.0,
    "offset and drift": lambda values, _: values + np.ptp(values) * (2.0 + np.linspace(0.0, 0.3, values.size)),
    "outliers": lambda values, random: values + np.ptp(values) * 0.1 * (random.random(values.size) < 1e-4),
}


@pytest.mark.parametrize("logger", LOGGERS)
@pytest.mark.parametrize("controller", CONTROLLERS)
def test_whatever_controller_and_logger_do(controller, logger):
    """Eight steps of 20 cycles, of a bushing of constant stiffness, 0.05 % noise."""
    random, rate, stiffness = np.random.default_rng(4), 5000.0, 6e5 * np.exp(0.15j)
    points = [(f, a) for a in (2e-4, 1e-3) for f in (3.0, 20.0, 60.0, 155.0)]

    def channel(gain: complex, scale: float) -> Array:
        parts = []
        for frequency, amplitude in points:
            turns = np.arange(int(20.0 / frequency * rate)) / rate * frequency
            size = abs(gain) * amplitude * CONTROLLERS[controller](turns)
            parts += [size * np.sin(2.0 * np.pi * turns + np.angle(gain)), np.zeros(int(0.1 * rate))]
        values = np.concatenate(parts)
        return LOGGERS[logger](values + 5e-4 * scale * random.standard_normal(values.size), random)

    motion, force = channel(1.0, 2e-4), channel(stiffness, 120.0)
    reduction = reduce([Loop("x", Direction.AXIAL, np.arange(motion.size) / rate, motion, force)])
    assert [(round(step.frequency), float(f"{step.amplitude:.1g}")) for step in reduction.steps] == points
    assert np.abs(column(reduction, "stiffness") / stiffness - 1.0).max() < 1e-3


def test_repeats_and_levels(paper_model):
    """Two repeats in one record, a third in another; the rig misses its set point by up to 3 %."""
    first = stepped(paper_model, [(10.0, 0.97e-4), (30.0, 1.03e-4), (10.0, 1.0e-4), (30.0, 1.01e-4)])
    second = stepped(paper_model, [(10.0, 1.02e-4), (30.0, 0.98e-4)])
    reduction = reduce([first, second])
    assert column(reduction, "repeat").tolist() == [1, 1, 2, 2, 3, 3]
    assert np.unique(column(reduction, "level")).tolist() == [pytest.approx(column(reduction, "amplitude").mean())]
    named = reduce([first, second], levels=(0.97e-4, 1.03e-4))
    assert np.unique(column(named, "level")).tolist() == [0.97e-4, 1.03e-4]
    with pytest.raises(MeasurementError, match=r"the stated levels[\s\S]*0.097 mm at 10 Hz[\s\S]*30 % of 0.2 mm"):
        reduce([first], levels=(2e-4,))


def test_a_late_force_is_reported(paper_model):
    record = stepped(paper_model, [(10.0, 1e-4), (30.0, 1e-4)])
    late = replace(record, force=np.interp(record.time - 2e-3, record.time, record.force))
    assert any("2 of 2 points have a loss factor below zero" in line for line in map(str, reduce([late]).warnings))


@pytest.mark.parametrize(
    ("motion", "said"),
    [
        (np.sin(2.0 * np.pi * (5.0 * TIME + 2.0 * TIME**2)), "changes all the time"),
        (np.sin(2.0 * np.pi * np.cumsum(SLOW) * 5e-4), "changes all the time"),
        (np.sin(4.0 * np.pi * TIME) * (TIME < 1.4), "fewer than 3"),
        (np.zeros_like(TIME), "does not oscillate"),
    ],
    ids=["swept", "slowly swept", "too few cycles", "still"],
)
def test_what_is_no_steady_sine_makes_no_points(motion, said):
    with pytest.raises(MeasurementError, match="no steady sine was found") as error:
        reduce([Loop("x", Direction.AXIAL, TIME, 1e-3 * motion, motion)])
    assert said in str(error.value)


def test_equal_steps_with_a_rest_of_two_cycles_are_repeats():
    motion = np.sin(10.0 * np.pi * TIME) * ((TIME < 3.0) | (TIME >= 3.4))
    steps = reduce([Loop("x", Direction.AXIAL, TIME, 1e-3 * motion, motion)]).steps
    assert [step.repeat for step in steps] == [1, 2]


@given(
    frequency=st.floats(1.0, 150.0),
    amplitude=st.floats(1e-6, 1e-2),
    phase=st.floats(0.0, 6.28),
    lead=st.floats(-0.5, 1.4),
    mean=st.floats(-5.0, 5.0),
    drift=st.floats(-0.5, 0.5),
    cycles=st.floats(6.0, 40.0),
    rows=st.floats(7.0, 300.0),
)
def test_any_sine_gives_its_stiffness(frequency, amplitude, phase, lead, mean, drift, cycles, rows):
    """Any frequency, phase, preload and slow drift, whole cycles or not, with a rig that rests before and after."""
    turns = np.arange(int(cycles * rows)) / rows
    zero = mean + drift * turns / cycles
    motion = amplitude * (np.sin(2.0 * np.pi * turns + phase) + zero)
    force = 3e5 * amplitude * (np.sin(2.0 * np.pi * turns + phase + lead) + zero)
    (step,) = reduce([Loop("x", Direction.AXIAL, turns / frequency, motion, force)]).steps
    assert step.frequency == pytest.approx(frequency, rel=1e-6)
    assert step.amplitude == pytest.approx(amplitude, rel=1e-6)
    assert step.stiffness == pytest.approx(3e5 * np.exp(1j * lead), rel=1e-6)
