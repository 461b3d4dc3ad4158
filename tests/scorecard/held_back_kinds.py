"""Kinds of discrepancy that are held back: which these are was fixed before any was diagnosed."""

from functools import partial
from itertools import pairwise

import numpy as np
from kinds import Bench, Kind, Rows, Sized, gain, read, reordered
from time_rig import Array, Change, Complex, Tests, harmonics, of_harmonics, respond

HELD_BACK: dict[str, Kind] = {}
kind = partial(Kind.into, HELD_BACK)


@kind("the force alone goes through a low-pass", right=("delay",))
def anti_alias(bench: Bench) -> Sized:
    def change(amount: float) -> Change:
        s = 1j * of_harmonics(bench.tests.frequency) / (np.sqrt(2.0) * bench.steps[-1] / amount)
        return Change(force=lambda _, force: harmonics(force, 1.0 / (1.0 + np.sqrt(2.0) * s + s**2)))

    return change


@kind("one repeat warms up while it runs", place=("repeat",), needs=("repeats",))
def thermal_repeat(bench: Bench) -> Sized:
    tests = bench.tests
    mine = bench.sweeps & (tests.direction == bench.direction())
    rows = np.flatnonzero(mine & (tests.repeat == bench.random.integers(1, tests.repeat[mine].max() + 1)))
    cooled = np.zeros(mine.size)
    cooled[rows] = 1.0 - np.exp(-np.linspace(0.0, 1.0, rows.size) / bench.random.uniform(0.1, 0.5))
    return lambda amount: gain(1.0 - amount * cooled)


@kind("the controller overshoots in a band, and the command is recorded", place=("frequency",))
def overshoot(bench: Bench) -> Sized:
    centre = bench.random.uniform(*np.quantile(bench.steps, (0.25, 0.85)))
    width = max(bench.random.uniform(0.05, 0.15) * centre, 0.5 * float(np.max(np.diff(bench.steps))))
    bell = 1.0 / (1.0 + ((bench.tests.frequency - centre) / width) ** 2)
    return lambda amount: Change(motion=lambda asked: asked * (1.0 + amount * bell)[:, None])


@kind(
    "the specimen of one direction was clamped tilted",
    right=("stiffness_factor", "transducer_gain", "preload_stiffening"),
    place=("direction",),
    needs=("both",),
)
def tilted(bench: Bench) -> Sized:
    tests = bench.tests
    direction = bench.direction()
    mine = (tests.direction == direction)[:, None]
    other = np.full_like(tests.direction, 1 - direction)
    across = respond(
        Tests(tests.bushing, tests.frequency, tests.amplitude, other, tests.level, tests.repeat, tests.loop),
        bench.rubber,
    ).force
    return lambda amount: Change(force=lambda _, force: np.where(mine, force + amount * (across - force), force))


@kind("phases were rounded")
def rounded_phase(bench: Bench) -> Sized:
    def change(amount: float) -> Change:
        def rounded(stiffness: Complex) -> Complex:
            turned = np.abs(stiffness) * np.exp(2j * amount * np.round(np.angle(stiffness) / (2.0 * amount)))
            return np.where(bench.sweeps, turned, stiffness)

        return Change(record=rounded)

    return change


@kind("some rows of one level stand in reverse", place=("level", "frequency"))
def reversed_rows(bench: Bench) -> Sized:
    runs, start = bench.runs_of_a_level(), bench.random.random()

    def order(size: int, amount: float) -> Rows:
        count = int(np.clip(round(200.0 * amount), 2, size))
        first = round(start * (size - count))
        number = np.arange(size)
        number[first : first + count] = number[first : first + count][::-1]
        return number

    return lambda amount: reordered(runs, lambda count: order(count, amount))


@kind("the second phase of a blend relaxes over a broad band", right=("maxwell", "second_springpot"))
def cole_cole(bench: Bench) -> Sized:
    order, centre = bench.random.uniform(0.55, 0.75), bench.random.uniform(*np.quantile(bench.steps, (0.2, 0.8)))
    z = (1j * of_harmonics(bench.tests.frequency) / centre) ** order
    step = 2.0 * bench.rubber.mu * z / (1.0 + z)
    return lambda amount: Change(stress=lambda strain: harmonics(strain, amount * step))


@kind("the bonded edges slip beyond a strain", right=("sliders",))
def edge_slip(bench: Bench) -> Sized:
    limit, modulus = bench.strain(), 2.0 * bench.rubber.mu

    def held(strain: Array) -> Array:
        """What an edge that slips beyond the limit still follows of the strain."""
        kept, now = np.empty_like(strain), np.zeros(strain.shape[0])
        steps = np.diff(strain, axis=-1, prepend=strain[:, -1:])
        for number in (*range(strain.shape[-1]), *range(strain.shape[-1])):
            now = np.clip(now + steps[:, number], -limit, limit)
            kept[:, number] = now
        return kept - np.mean(kept, axis=-1, keepdims=True)

    return lambda amount: Change(stress=lambda strain: amount * modulus * (held(strain) - strain))


@kind("slow tests have time to crystallise beyond a strain")
def crystals(bench: Bench) -> Sized:
    limit, modulus = bench.strain(), 2.0 * bench.rubber.mu
    slow = 1.0 / (1.0 + bench.tests.frequency / bench.random.uniform(5.0, 30.0))[:, None]
    return lambda amount: Change(
        stress=lambda strain: 2.0 * amount * modulus * slow * np.sign(strain) * np.maximum(np.abs(strain) - limit, 0.0)
    )


@kind("the columns were smoothed across the ends of runs")
def smoothed_across(bench: Bench) -> Sized:
    tests = bench.tests
    files = [np.flatnonzero(bench.sweeps & (tests.direction == each)) for each in np.unique(tests.direction)]

    def change(amount: float) -> Change:
        kept = min(2.0 * amount, 0.95)

        def smoothed(stiffness: Complex) -> Complex:
            made = stiffness.copy()
            for rows in files:
                for before, row in pairwise(rows.tolist()):
                    made[row] = kept * made[before] + (1.0 - kept) * stiffness[row]
            return made

        return Change(record=smoothed)

    return change


@kind("peaks of the force are read off few samples")
def peak_picking(bench: Bench) -> Sized:
    lost = (bench.tests.frequency / bench.steps[-1]) ** 2 * bench.sweeps
    return lambda amount: read(1.0 - amount * lost)


@kind("the force of the loops alone was averaged over some samples", place=("loop",), needs=("loop",))
def loop_filter(bench: Bench) -> Sized:
    order = np.arange(bench.tests.imposed().shape[1] // 2 + 1)

    def change(amount: float) -> Change:
        share = amount / np.pi  # of a cycle, over which the force is averaged
        filtered = np.sinc(order * share) * np.exp(-1j * np.pi * order * share)
        factor = np.where(bench.tests.loop[:, None], filtered, 1.0)
        return Change(force=lambda _, force: harmonics(force, factor))

    return change


@kind("the software makes up for more give than there is")
def too_much_compliance(bench: Bench) -> Sized:
    give = 1.0 / bench.size.max()
    return lambda amount: Change(gives=lambda force: -amount * give * force)


@kind("the top level was tested on another specimen", place=("level",))
def late_specimen(bench: Bench) -> Sized:
    mine, sign = bench.level(9)[:, None], bench.sign()
    return lambda amount: Change(
        rubber={
            "mu": 1.0 + sign * amount * mine,
            "m": 1.0 - sign * amount * mine,
            "sigma_fmax": 1.0 + 2.0 * sign * amount * mine,
        }
    )
