"""Rig faults as they come: each in turn, hardly seen to plain. What may be said of them stands beside each."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from bushfit.effects.contract import Array, ForceBelow, Setting
from bushfit.effects.history import History
from bushfit.geometry import Direction
from bushfit.reading.measurement import Sweep
from bushfit.simulation.measured import Simulated
from cards.awkward import each_loop, each_sweep, wild
from cards.recipe import MIDDLE, Around, Bench, Recipe


def _late(bench: Bench) -> Around:
    """The true motion is ahead of that which is recorded."""
    late = bench.size / (2.0 * np.pi * MIDDLE)

    def around(below: ForceBelow, history: History, _: Setting) -> Array:
        time = np.arange(history.value.size) * history.step
        ahead = time + late
        ahead[ahead > time[-1]] -= 1.0 / history.frequency  # as it was one cycle before
        return below(history.with_value(np.interp(ahead, time, history.value)))

    return around


def _only(direction: Direction, fault: Around) -> Around:
    """A fault of the tests of one direction."""
    return lambda below, history, setting: (
        fault(below, history, setting) if setting.direction == direction else below(history)
    )


def _preload(bench: Bench) -> Around:
    """Stiffening with the cube of the displacement, around a preload of the radial tests."""
    preload = 3.0 * bench.levels(Direction.RADIAL).max()
    slope = bench.size * bench.stiffness(Direction.RADIAL) / (3.0 * preload**2)
    return _only(
        Direction.RADIAL,
        lambda below, history, _: below(history) + slope * ((history.value + preload) ** 3 - preload**3),
    )


def _either(bench: Bench) -> Direction:
    return Direction.AXIAL if bench.random.random() < 0.5 else Direction.RADIAL


def _signed(bench: Bench) -> float:
    return 1.0 + bench.size * float(bench.random.choice([-1.0, 1.0]))


def _gain(bench: Bench) -> Around:
    gain = _signed(bench)
    return _only(_either(bench), lambda below, history, _: gain * below(history))


def _displacement_gain(bench: Bench) -> Around:
    gain = _signed(bench)
    return lambda below, history, _: below(history.with_value(gain * history.value))


def _compliance(bench: Bench) -> Around:
    direction = _either(bench)
    compliance = bench.size / bench.stiffness(direction)

    def around(below: ForceBelow, history: History, _: Setting) -> Array:
        reached = history
        for _round in range(5):  # each leaves a tenth of the error
            reached = history.with_value(history.value - compliance * below(reached))
        return below(reached)

    return _only(direction, around)


def _charge_amplifier(bench: Bench) -> Around:
    """A first-order high-pass on the force of the sweeps, by the bilinear transform."""
    corner = 2.0 * np.pi * min(bench.plan.sweeps[0].frequencies) * bench.size

    def around(below: ForceBelow, history: History, setting: Setting) -> Array:
        half = corner * history.step / 2.0
        force = below(history)
        return force if setting.kind == "loop" else np.asarray(lfilter([1.0, -1.0], [1.0 + half, half - 1.0], force))

    return around


def _saturation(bench: Bench) -> Around:
    """Rails of the dynamic chain a little below its largest force: the loops have one of their own."""
    largest = max(bench.stiffness(place) * bench.levels(place).max() for place in (Direction.AXIAL, Direction.RADIAL))
    limit = bench.between(0.85, 0.97) * largest
    return lambda below, history, setting: (
        below(history) if setting.kind == "loop" else np.clip(below(history), -limit, limit)
    )


def _mislabelled(bench: Bench) -> Around:
    """One level of one sweep ran at another amplitude than its label says."""
    direction, factor = _either(bench), float(bench.random.choice((0.5, 0.6, 1.6, 2.0)))
    level = bench.random.choice(bench.levels(direction))

    def around(below: ForceBelow, history: History, setting: Setting) -> Array:
        mine = (
            setting.direction == direction
            and setting.kind == "sweep"
            and abs(float(history.amplitude[0]) / level - 1.0) < 0.01
        )
        return below(history.with_value(factor * history.value)) / factor if mine else below(history)

    return around


def _guide(bench: Bench) -> Around:
    friction = np.pi / 4.0 * bench.size * bench.stiffness() * float(np.median(bench.levels()))
    return lambda below, history, _: below(history) + friction * history.sense


def _play(bench: Bench) -> Around:
    play = 0.5 * bench.size * float(np.median(bench.levels(Direction.RADIAL)))
    return lambda below, history, _: below(history.with_value(history.value - np.clip(history.value, -play, play)))


def band(history: History, centre: float, width: float) -> Array:
    """Values after a band-pass of unit gain at its centre, both in Hz, by the bilinear transform.

    Nothing passes where the samples are too few for the centre, as in a slow loop.
    """
    if centre * history.step > 0.2:
        return np.zeros(history.value.shape)
    warped = 2.0 / history.step * np.tan(np.pi * centre * history.step)
    scale, loss = 2.0 / history.step, 2.0 * np.pi * width
    numerator = loss * scale * np.array([1.0, 0.0, -1.0])
    middle = 2.0 * (warped**2 - scale**2)
    denominator = [scale**2 + loss * scale + warped**2, middle, scale**2 - loss * scale + warped**2]
    return np.asarray(lfilter(numerator, denominator, history.value))


def _resonance(bench: Bench) -> Around:
    centre, width = bench.random.uniform(25.0, 135.0), bench.random.uniform(3.0, 6.0)

    def around(below: ForceBelow, history: History, _: Setting) -> Array:
        force = below(history)
        return force + bench.size * band(history.with_value(force), centre, width)

    return around


def _drift(measured: Simulated, bench: Bench) -> Simulated:
    """A gain that creeps from the first to the last point of the session; the loops go first."""
    count = sum(sweep.step.size for sweep in measured.sweeps)
    starts = iter(np.cumsum([0, *[sweep.step.size for sweep in measured.sweeps]]).tolist())
    slope = _signed(bench) - 1.0

    def creeping(sweep: Sweep) -> Array:
        return np.asarray(1.0 + slope * (next(starts) + np.arange(sweep.step.size)) / count)

    return each_sweep(measured, creeping)


def _clock(measured: Simulated, bench: Bench) -> Simulated:
    factor = bench.between(2.0, 30.0) ** float(bench.random.choice([-1.0, 1.0]))
    return each_loop(measured, lambda loop: replace(loop, time=factor * loop.time))


def _repeat_differs(measured: Simulated, bench: Bench) -> Simulated:
    direction, repeat, gain = _either(bench), int(bench.random.integers(1, 4)), _signed(bench)
    return each_sweep(
        measured, lambda sweep: np.where((sweep.direction == direction) & (sweep.repeat == repeat), gain, 1.0)
    )


def _wild(measured: Simulated, bench: Bench) -> Simulated:
    return wild(measured, bench, int(bench.random.integers(3, 9)), bench.size)


def _in_rig(sentence: str, rig: Callable[[Bench], Around], *truths: str) -> Recipe:
    return Recipe(sentence, truths, rig=rig)


#: Every fault by name.
FAULTS: dict[str, Recipe] = {
    "displacement_late": _in_rig("the displacement is recorded late", _late, "delay"),
    "session_drift": Recipe("the gain drifts over the session", ("drift",), file=_drift),
    "preload": _in_rig(
        "the radial tests are preloaded", _preload, "stiffness_factor", "preload_stiffening", "elastic_preload"
    ),
    "transducer_gain": _in_rig(
        "the load cell's gain is off in one direction", _gain, "stiffness_factor", "transducer_gain"
    ),
    "displacement_gain": _in_rig("the displacement's gain is off", _displacement_gain, "displacement_gain"),
    "loop_rate": Recipe("the loops' clock is wrong by any factor", ("loop_clock",), file=_clock),
    "wild_points": Recipe("several points are off", file=_wild),
    "repeat_differs": Recipe("one repeat differs from the others", file=_repeat_differs),
    "compliance": _in_rig("a rig gives in one direction", _compliance, "rig_compliance.axial", "rig_compliance.radial"),
    "charge_amplifier": _in_rig(
        "a charge amplifier takes away what is slow in the sweeps", _charge_amplifier, "high_pass"
    ),
    "force_saturation": _in_rig("the force is cut off at the amplifier's rails", _saturation, "force_saturation"),
    "mislabelled_level": _in_rig("one level ran at another amplitude than its label says", _mislabelled),
    "guide_friction": _in_rig("a guide rubs", _guide, "interface_slip", "guide_friction"),
    "fixture_play": _in_rig("the fixture has play", _play, "clearance", "fixture_play"),
    "narrow_resonance": _in_rig("a mode of the rig inside the band", _resonance, "fixture_resonance"),
}
