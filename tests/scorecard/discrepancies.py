"""How each kind of discrepancy is made: by a bench, what changes in rig, rubber, software or record by an amount.

Amounts are about the share of |K| that changes at most; `kinds` brings them to a size.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.random import Generator
from time_rig import (
    Array,
    Change,
    Complex,
    Response,
    Rubber,
    Tests,
    harmonics,
    of_harmonics,
    projected,
    respond,
)

#: Frequencies [Hz] of mains, and cycles over which the software projects beside it.
_MAINS, _WINDOW = (50.0, 60.0), 8

Mask = np.ndarray[tuple[int], np.dtype[np.bool_]]


@dataclass(frozen=True)
class Bench:
    """What a kind is made for: the tests, the rubber, and draws that are its own."""

    tests: Tests
    rubber: Rubber
    random: Generator

    @cached_property
    def clean(self) -> Response:
        return respond(self.tests, self.rubber)

    @cached_property
    def size(self) -> Array:
        """|K| of every point [N/m]."""
        return np.abs(self.clean.stiffness)

    @property
    def sweeps(self) -> Mask:
        return ~self.tests.loop

    @property
    def steps(self) -> Array:
        return np.unique(self.tests.frequency[self.sweeps])

    @property
    def force(self) -> float:
        """Middle of the force amplitudes of the sweeps [N]."""
        return float(np.median((self.size * self.tests.amplitude)[self.sweeps]))

    def direction(self) -> int:
        """A direction that has sweeps."""
        return int(self.random.choice(np.unique(self.tests.direction[self.sweeps])))

    def level(self, least: int = 0) -> Mask:
        """The points of one level of one direction, all repeats of it; least is the lowest that may be."""
        mine = self.sweeps & (self.tests.direction == self.direction())
        levels = np.unique(self.tests.level[mine])
        return mine & (self.tests.level == self.random.choice(levels[min(least, levels.size - 1) :]))

    def strain(self) -> float:
        """A strain that the largest of the sweeps pass, and the smallest do not."""
        strains = (self.tests.strain[:, 0] * self.tests.amplitude)[self.sweeps]
        return float(self.random.uniform(0.35, 0.65) * strains.max())

    def sign(self) -> float:
        return float(self.random.choice([-1.0, 1.0]))


Sized = Callable[[float], Change]


def _gain(factor: Array) -> Change:
    """The force of each point times a factor, (n,)."""
    return Change(force=lambda _, force: force * factor[:, None])


def _read(factor: Array | Complex) -> Change:
    """What the software makes of each sweep's point times a factor, (n,)."""
    return Change(reading=lambda motion, force: projected(motion, force) * factor)


# Rig


def range_switch(bench: Bench) -> Sized:
    tests, sign = bench.tests, bench.sign()
    mine = tests.direction == bench.direction()
    force = bench.size * tests.amplitude
    levels = np.unique(tests.level[mine & bench.sweeps])
    middles = [float(np.median(force[mine & bench.sweeps & (tests.level == level)])) for level in levels]
    cut = int(bench.random.integers(max(len(middles) - 1, 1)))
    above = mine & (force > np.sqrt(middles[cut] * middles[min(cut + 1, len(middles) - 1)]))
    return lambda amount: _gain(1.0 + sign * amount * above)


def guide_sticks(bench: Bench) -> Sized:
    mine = bench.level(1)
    friction = np.pi / 4.0 * bench.size * bench.tests.amplitude * mine

    def force(motion: Array, true: Array, amount: float) -> Array:
        return true + amount * friction[:, None] * np.sign(np.roll(motion, -1, axis=-1) - np.roll(motion, 1, axis=-1))

    return lambda amount: Change(force=lambda motion, true: force(motion, true, amount))


def hum(bench: Bench) -> Sized:
    tests = bench.tests
    mains = min(_MAINS, key=lambda hum: float(np.min(np.abs(bench.steps / hum - 1.0))))
    turns = np.exp(2j * np.pi * bench.random.random((2, tests.frequency.size)))
    pairs = zip(((1.0, mains), (0.3, 3.0 * mains)), turns, strict=True)
    leaked = sum(share * turn * np.sinc((1.0 - hum / tests.frequency) * _WINDOW) for (share, hum), turn in pairs)
    added = leaked * bench.sweeps * bench.force / tests.amplitude / bench.clean.stiffness
    return lambda amount: _read(1.0 + amount * added)


def loosening(bench: Bench) -> Sized:
    start = bench.random.uniform(0.3, 0.6)
    slack = np.maximum(bench.tests.turn - start, 0.0)[:, None] / ((1.0 - start) * bench.size.max())
    return lambda amount: Change(gives=lambda force: amount * slack * force)


def anti_alias(bench: Bench) -> Sized:
    def change(amount: float) -> Change:
        s = 1j * of_harmonics(bench.tests.frequency) / (np.sqrt(2.0) * bench.steps[-1] / amount)
        return Change(force=lambda _, force: harmonics(force, 1.0 / (1.0 + np.sqrt(2.0) * s + s**2)))

    return change


def thermal_repeat(bench: Bench) -> Sized:
    tests = bench.tests
    mine = bench.sweeps & (tests.direction == bench.direction())
    rows = np.flatnonzero(mine & (tests.repeat == bench.random.integers(1, tests.repeat[mine].max() + 1)))
    cooled = np.zeros(mine.size)
    cooled[rows] = 1.0 - np.exp(-np.linspace(0.0, 1.0, rows.size) / bench.random.uniform(0.1, 0.5))
    return lambda amount: _gain(1.0 - amount * cooled)


def overshoot(bench: Bench) -> Sized:
    centre = bench.random.uniform(*np.quantile(bench.steps, (0.25, 0.85)))
    width = max(bench.random.uniform(0.05, 0.15) * centre, 0.5 * float(np.max(np.diff(bench.steps))))
    bell = 1.0 / (1.0 + ((bench.tests.frequency - centre) / width) ** 2)
    return lambda amount: Change(motion=lambda asked: asked * (1.0 + amount * bell)[:, None])


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


# Record


def row_shift(bench: Bench) -> Sized:
    """Small ones begin further down, large ones are of several rows."""
    chosen = bench.level()
    runs = [rows for rows in bench.tests.runs() if chosen[rows].all()]

    def change(amount: float) -> Change:
        slipped = max(1, round(50.0 * amount))

        def shifted(stiffness: Complex) -> Complex:
            made = stiffness.copy()
            for rows in runs:
                first = min(round(0.02 / amount), rows.size - 1)
                number = np.arange(rows.size)
                made[rows] = stiffness[rows[np.where(number < first, number, np.maximum(number - slipped, 0))]]
            return made

        return Change(record=shifted)

    return change


def rounded_stiffness(bench: Bench) -> Sized:
    mine = bench.sweeps & (bench.tests.direction == bench.direction())

    def change(amount: float) -> Change:
        step = 2.0 * amount * float(bench.size[mine].min())

        def rounded(stiffness: Complex) -> Complex:
            size = np.abs(stiffness)
            return np.where(mine, stiffness * np.maximum(np.round(size / step), 1.0) * step / size, stiffness)

        return Change(record=rounded)

    return change


def rounded_phase(bench: Bench) -> Sized:
    def change(amount: float) -> Change:
        def rounded(stiffness: Complex) -> Complex:
            turned = np.abs(stiffness) * np.exp(2j * amount * np.round(np.angle(stiffness) / (2.0 * amount)))
            return np.where(bench.sweeps, turned, stiffness)

        return Change(record=rounded)

    return change


def reversed_rows(bench: Bench) -> Sized:
    chosen = bench.level()
    runs = [rows for rows in bench.tests.runs() if chosen[rows].all()]
    start = bench.random.random()

    def change(amount: float) -> Change:
        def turned(stiffness: Complex) -> Complex:
            made = stiffness.copy()
            for rows in runs:
                count = int(np.clip(round(200.0 * amount), 2, rows.size))
                first = round(start * (rows.size - count))
                made[rows[first : first + count]] = stiffness[rows[first : first + count][::-1]]
            return made

        return Change(record=turned)

    return change


# Rubber


def adhesive(bench: Bench) -> Sized:
    order = bench.random.uniform(0.1, 0.25)
    with np.errstate(divide="ignore", invalid="ignore"):
        layer = (1j * of_harmonics(bench.tests.frequency) / 25.0) ** -order / bench.size.max()
    layer[:, 0] = 0.0
    return lambda amount: Change(gives=lambda force: harmonics(force, amount * layer))


def buckling(bench: Bench) -> Sized:
    limit, modulus = bench.strain(), 2.0 * bench.rubber.mu
    return lambda amount: Change(stress=lambda strain: -3.0 * amount * modulus * np.minimum(strain + limit, 0.0))


def ageing(bench: Bench) -> Sized:
    later = (bench.tests.direction == bench.tests.direction[-1])[:, None]
    return lambda amount: Change(
        rubber=dict.fromkeys(("mu", "m"), 1.0 + amount * later) | {"sigma_fmax": 1.0 + 2.0 * amount * later}
    )


def orifice(bench: Bench) -> Sized:
    tests = bench.tests
    speed = 2.0 * np.pi * tests.frequency * tests.amplitude
    constant = 1.2 / float(np.max(speed**2 / (bench.size * tests.amplitude)))

    def damped(motion: Array, force: Array, amount: float) -> Array:
        rate = harmonics(motion, 2j * np.pi * of_harmonics(tests.frequency))
        return force + amount * constant * np.abs(rate) * rate

    return lambda amount: Change(force=lambda motion, force: damped(motion, force, amount))


def cole_cole(bench: Bench) -> Sized:
    order, centre = bench.random.uniform(0.55, 0.75), bench.random.uniform(*np.quantile(bench.steps, (0.2, 0.8)))
    z = (1j * of_harmonics(bench.tests.frequency) / centre) ** order
    step = 2.0 * bench.rubber.mu * z / (1.0 + z)
    return lambda amount: Change(stress=lambda strain: harmonics(strain, amount * step))


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


def crystals(bench: Bench) -> Sized:
    limit, modulus = bench.strain(), 2.0 * bench.rubber.mu
    slow = 1.0 / (1.0 + bench.tests.frequency / bench.random.uniform(5.0, 30.0))[:, None]
    return lambda amount: Change(
        stress=lambda strain: 2.0 * amount * modulus * slow * np.sign(strain) * np.maximum(np.abs(strain) - limit, 0.0)
    )


def late_specimen(bench: Bench) -> Sized:
    mine, sign = bench.level(9)[:, None], bench.sign()
    return lambda amount: Change(
        rubber={
            "mu": 1.0 + sign * amount * mine,
            "m": 1.0 - sign * amount * mine,
            "sigma_fmax": 1.0 + 2.0 * sign * amount * mine,
        }
    )


# Software


def leakage(bench: Bench) -> Sized:
    record = (bench.random.integers(1, 4) + bench.random.uniform(0.2, 0.8)) / bench.steps[0]
    cycles = (bench.tests.frequency * record)[:, None]
    samples = bench.tests.imposed().shape[1]
    number = np.arange(samples)
    weight = np.floor(cycles) + (number < samples * (cycles % 1.0))
    weight[bench.tests.loop] = 1.0
    offset = (bench.force * bench.sweeps)[:, None]
    turn = np.exp(-2j * np.pi * number / samples)

    def read(motion: Array, force: Array, amount: float) -> Complex:
        return np.asarray(((force + amount * offset) * weight) @ turn / ((motion * weight) @ turn))

    return lambda amount: Change(reading=lambda motion, force: read(motion, force, amount))


def detrended(bench: Bench) -> Sized:
    """A straight line taken off n cycles of the force that begin at zero takes 6/(pi n)^2 off what is in phase."""

    def change(amount: float) -> Change:
        fewest = np.sqrt(6.0 / amount) / np.pi
        cycles = np.maximum(np.round(fewest * bench.tests.frequency / bench.steps[0]), 1.0)
        lost = np.where(bench.sweeps, 6.0 / (np.pi * cycles) ** 2, 0.0)

        def read(motion: Array, force: Array) -> Complex:
            stiffness = projected(motion, force)
            return stiffness - lost * stiffness.real

        return Change(reading=read)

    return change


def too_much_mass(bench: Bench) -> Sized:
    added = (2.0 * np.pi * of_harmonics(bench.tests.frequency)) ** 2
    mass = 1.0 / float(np.max(added[:, 1] / bench.size))
    return lambda amount: Change(
        force=lambda motion, force: force + harmonics(motion, amount * mass * added.astype(complex))
    )


def noise_floor(bench: Bench) -> Sized:
    reach = bench.tests.amplitude
    floor = reach[bench.sweeps].min()
    return lambda amount: _read(np.where(bench.sweeps, 1.0 / np.sqrt(1.0 + 2.0 * amount * (floor / reach) ** 2), 1.0))


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


def peak_picking(bench: Bench) -> Sized:
    lost = (bench.tests.frequency / bench.steps[-1]) ** 2 * bench.sweeps
    return lambda amount: _read(1.0 - amount * lost)


def loop_filter(bench: Bench) -> Sized:
    order = np.arange(bench.tests.imposed().shape[1] // 2 + 1)

    def change(amount: float) -> Change:
        share = amount / np.pi  # of a cycle, over which the force is averaged
        filtered = np.sinc(order * share) * np.exp(-1j * np.pi * order * share)
        factor = np.where(bench.tests.loop[:, None], filtered, 1.0)
        return Change(force=lambda _, force: harmonics(force, factor))

    return change


def too_much_compliance(bench: Bench) -> Sized:
    give = 1.0 / bench.size.max()
    return lambda amount: Change(gives=lambda force: -amount * give * force)
