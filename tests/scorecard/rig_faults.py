"""Faults of rigs, software and handling that no page of bushfit lists."""

from functools import partial
from itertools import pairwise

import numpy as np
from kinds import Bench, Kind, Rows, Sized, gain, read, reordered
from time_rig import Array, Change, Complex, Tests, harmonics, of_harmonics, projected, respond

#: Frequencies [Hz] of mains, and cycles over which the software projects beside it.
_MAINS, _WINDOW = (50.0, 60.0), 8

RIG_FAULTS: dict[str, Kind] = {}
kind = partial(Kind.into, RIG_FAULTS)


@kind("the amplifier of one direction has another gain above a force", place=("level",))
def range_switch(bench: Bench) -> Sized:
    tests, sign = bench.tests, bench.sign()
    mine = tests.direction == bench.direction()
    force = bench.size * tests.amplitude
    levels = np.unique(tests.level[mine & bench.sweeps])
    middles = [float(np.median(force[mine & bench.sweeps & (tests.level == level)])) for level in levels]
    cut = int(bench.random.integers(max(len(middles) - 1, 1)))
    above = mine & (force > np.sqrt(middles[cut] * middles[min(cut + 1, len(middles) - 1)]))
    return lambda amount: gain(1.0 + sign * amount * above)


@kind("a guide rubs at one level of one direction", place=("level",))
def guide_sticks(bench: Bench) -> Sized:
    mine = bench.level(1)
    friction = np.pi / 4.0 * bench.size * bench.tests.amplitude * mine

    def force(motion: Array, true: Array, amount: float) -> Array:
        return true + amount * friction[:, None] * np.sign(np.roll(motion, -1, axis=-1) - np.roll(motion, 1, axis=-1))

    return lambda amount: Change(force=lambda motion, true: force(motion, true, amount))


@kind("mains hum leaks into the force near its frequencies", place=("frequency",))
def mains_hum(bench: Bench) -> Sized:
    tests = bench.tests
    mains = min(_MAINS, key=lambda hum: float(np.min(np.abs(bench.steps / hum - 1.0))))
    turns = np.exp(2j * np.pi * bench.random.random((2, tests.frequency.size)))
    pairs = zip(((1.0, mains), (0.3, 3.0 * mains)), turns, strict=True)
    leaked = sum(share * turn * np.sinc((1.0 - hum / tests.frequency) * _WINDOW) for (share, hum), turn in pairs)
    added = leaked * bench.sweeps * bench.force / tests.amplitude / bench.clean.stiffness
    return lambda amount: read(1.0 + amount * added)


@kind("a clamp loosens from the middle of the session on", right=("drift",))
def loosening(bench: Bench) -> Sized:
    start = bench.random.uniform(0.3, 0.6)
    slack = np.maximum(bench.tests.turn - start, 0.0)[:, None] / ((1.0 - start) * bench.size.max())
    return lambda amount: Change(gives=lambda force: amount * slack * force)


@kind("the stiffness column of one level slipped down some rows", place=("level",))
def row_shift(bench: Bench) -> Sized:
    """Small ones begin further down, large ones are of several rows."""
    runs = bench.runs_of_a_level()

    def order(count: int, amount: float) -> Rows:
        number, slipped = np.arange(count), max(1, round(50.0 * amount))
        first = min(round(0.02 / amount), count - 1)
        return np.where(number < first, number, np.maximum(number - slipped, 0))

    return lambda amount: reordered(runs, lambda count: order(count, amount))


@kind("the stiffness of one file was rounded", place=("direction",))
def rounded_stiffness(bench: Bench) -> Sized:
    mine = bench.sweeps & (bench.tests.direction == bench.direction())

    def change(amount: float) -> Change:
        step = 2.0 * amount * float(bench.size[mine].min())

        def rounded(stiffness: Complex) -> Complex:
            size = np.abs(stiffness)
            return np.where(mine, stiffness * np.maximum(np.round(size / step), 1.0) * step / size, stiffness)

        return Change(record=rounded)

    return change


@kind("the adhesive flexes in series, with a springpot of its own", right=("sleeve_compliance", "rig_compliance"))
def adhesive(bench: Bench) -> Sized:
    order = bench.random.uniform(0.1, 0.25)
    with np.errstate(divide="ignore", invalid="ignore"):
        layer = (1j * of_harmonics(bench.tests.frequency) / 25.0) ** -order / bench.size.max()
    layer[:, 0] = 0.0
    return lambda amount: Change(gives=lambda force: harmonics(force, amount * layer))


@kind("in one sense the rubber softens beyond a strain", right=("asymmetry",))
def buckling(bench: Bench) -> Sized:
    limit, modulus = bench.strain(), 2.0 * bench.rubber.mu
    return lambda amount: Change(stress=lambda strain: -3.0 * amount * modulus * np.minimum(strain + limit, 0.0))


@kind(
    "the rubber aged before its second direction",
    right=("stiffness_factor", "transducer_gain", "preload_stiffening", "elastic_preload"),
    place=("direction",),
    needs=("both",),
)
def ageing(bench: Bench) -> Sized:
    later = (bench.tests.direction == bench.tests.direction[-1])[:, None]
    return lambda amount: Change(
        rubber=dict.fromkeys(("mu", "m"), 1.0 + amount * later) | {"sigma_fmax": 1.0 + 2.0 * amount * later}
    )


@kind("liquid is pressed through an orifice: a force that goes with the square of the speed")
def orifice(bench: Bench) -> Sized:
    tests = bench.tests
    speed = 2.0 * np.pi * tests.frequency * tests.amplitude
    constant = 1.2 / float(np.max(speed**2 / (bench.size * tests.amplitude)))

    def damped(motion: Array, force: Array, amount: float) -> Array:
        rate = harmonics(motion, 2j * np.pi * of_harmonics(tests.frequency))
        return force + amount * constant * np.abs(rate) * rate

    return lambda amount: Change(force=lambda motion, force: damped(motion, force, amount))


@kind("records with an offset are cut off within a cycle", place=("frequency",))
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


@kind("a straight line was taken off the force of few cycles", place=("frequency",))
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


@kind("the software makes up for more mass than moves")
def too_much_mass(bench: Bench) -> Sized:
    added = (2.0 * np.pi * of_harmonics(bench.tests.frequency)) ** 2
    mass = 1.0 / float(np.max(added[:, 1] / bench.size))
    return lambda amount: Change(
        force=lambda motion, force: force + harmonics(motion, amount * mass * added.astype(complex))
    )


@kind("noise counts as displacement", place=("level",))
def noise_floor(bench: Bench) -> Sized:
    reach = bench.tests.amplitude
    floor = reach[bench.sweeps].min()
    return lambda amount: read(np.where(bench.sweeps, 1.0 / np.sqrt(1.0 + 2.0 * amount * (floor / reach) ** 2), 1.0))


# Which kinds follow was fixed before any was diagnosed: no verdict on these is looked at while anything is tuned.


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
