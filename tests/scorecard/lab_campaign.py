"""Campaigns as a laboratory writes them: a random bushing and plan, a kind of discrepancy or none, noise, files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from kinds import Bench, Kind, Place, sized
from listed_kinds import LISTED
from mistaken_records import MISTAKEN
from numpy.random import Generator
from other_rubbers import HELD_BACK_RUBBERS, WORKING_RUBBERS
from rig_faults import RIG_FAULTS
from rubber_in_time import StrainHistory, StressLaw
from scipy.signal import lfilter
from time_rig import DIRECTIONS, SAMPLES, Array, Bushing, Change, Response, Rubber, Tests, respond
from visibility import CYCLES, ROUNDS, Noise, seen

#: Every kind by name.
KINDS = RIG_FAULTS | LISTED | MISTAKEN
#: Rubbers of other laws, and the effects of a list that describe their difference from the paper's rubber truly.
RUBBERS = WORKING_RUBBERS | HELD_BACK_RUBBERS
TRUE_OF_RUBBER: dict[str, tuple[str, ...]] = {
    "log_normal_sliders": ("distributed_sliders", "sliders"),
    "two_springpots": ("second_springpot", "viscous", "sliders", "distributed_sliders"),
    "filler_breakdown": ("kraus", "coupled_breakdown"),
    "stiffening_with_dry_friction": ("strain_stiffening", "fifth_power_stiffening"),
    "rate_dependent_sliders": ("rate_dependent_friction", "distributed_sliders", "sliders"),
    "intrinsic_time": ("intrinsic_time",),
    "bouc_wen": (),
    "uniform_sliders": ("sliders", "distributed_sliders", "fractional_zener"),
    "softening_prony_series": ("maxwell", "second_maxwell", "coupled_breakdown"),
    "process_dependent_viscosity": ("maxwell", "second_maxwell", "intrinsic_time"),
}
#: The class of the rig: gain, and phase [rad], of which each run has errors.
CLASS = (5e-3, float(np.radians(0.25)))
#: Scatter of an amplitude that was reached.
_REACHED = 0.02
#: Scatter of a loop's displacement, of its amplitude.
_JITTER = 2e-4
#: Levels of a sweep beside the largest, and how likely they are planned.
_LEVELS, _PLANNED = ((0.2, 0.4), (0.1, 0.3), (0.25, 0.5, 0.7), (0.4,)), (0.5, 0.2, 0.2, 0.1)
#: Strain of the top level, frequency of a loop [Hz], and scatter of a point and of a loop's force.
_STRAIN, _LOOP, _SCATTER, _FORCE = (0.03, 0.06), 0.1, (0.003, 0.006), (0.002, 0.004)
#: What a clean campaign has.
NOTHING = Kind("nothing", lambda _: lambda _: Change())


@dataclass(frozen=True)
class Plan:
    """How a campaign is measured.

    Args:
        directions: that have sweeps; loops are of the first.
        levels: amplitudes over the largest.
        steps: frequencies of a sweep [Hz].
        repeats: of every level.
        loops: amplitudes of loops over the largest of the sweeps.
        by_amplitude: whether sweeps step the amplitude at a few frequencies.
        missing: whether the last direction lacks its first level.
        reached: scatter of the amplitudes, relative.
        tails: degrees of freedom of Student's t, infinite for Gauss.
        repeats_last: whether all levels are repeated one after the other, instead of each at once.
        noise: of a rig of its class.
    """

    directions: tuple[int, ...]
    levels: tuple[float, ...]
    steps: Array
    repeats: int
    loops: tuple[float, ...]
    noise: Noise
    by_amplitude: bool = False
    missing: bool = False
    reached: float = 0.0
    tails: float = np.inf
    repeats_last: bool = False


@dataclass(frozen=True)
class Answer:
    """The truth of a campaign, and how well it can be seen.

    Args:
        kind: of discrepancy; "" of a clean campaign.
        size: to which it was to be brought, of |K| at its largest.
        right: effects that describe it truly.
        place: parts of the tests that alone are off.
        left: largest share of |K| that the best clean model leaves.
        misfit: chi-square that it leaves without noise, with errors of the rig's class free.
        law: of the rubber; "" for the paper's.
        also: effects that describe the law of the rubber truly, beside a kind.
        points: of the sweeps as stated: direction, frequency [Hz], amplitude [mm], and 1 where the kind changes the
            stated stiffness by more than the scatter of a point, or a condition that is stated.
    """

    kind: str
    size: float
    right: tuple[str, ...] = ()
    place: tuple[Place, ...] = ()
    left: float = 0.0
    misfit: float = 0.0
    law: str = ""
    also: tuple[str, ...] = ()
    points: tuple[tuple[str, float, float, int], ...] = ()

    @property
    def visible(self) -> bool:
        """Whether what is left is 2 % of |K| and plain beside noise, wherever one looks."""
        return self.left >= 0.02 and self.misfit >= 40.0


@dataclass(frozen=True)
class OtherRubber:
    """A rubber that follows a law of its own; `mu` is the modulus that sizes are relative to."""

    law: StressLaw
    mu: float

    def times(self, **factors: object) -> OtherRubber:
        assert not factors  # the paper's parameters are none of this rubber
        return self

    def stress(self, strain: Array, frequency: Array) -> Array:
        """Stress [Pa] over a steady cycle of the strain."""
        return self.law(StrainHistory(strain, 1.0 / (SAMPLES * frequency[:, None]), periodic=True))


def draw(kind: str, seed: int, law: str) -> tuple[Plan, Rubber, Bench]:
    """Plan, the paper's rubber, and the tests with the rubber that is in them, of the arguments of `campaign`."""
    random = np.random.default_rng([seed, 2007])
    bushing, paper = a_specimen(random)
    plan = _plan(random, KINDS.get(kind, NOTHING).needs)
    if not (kind or law):
        plan = awkward(plan, random)
    tests = _tests(bushing, plan, random)
    rubber = OtherRubber(RUBBERS[law](random), paper.mu) if law else paper
    return plan, paper, Bench(tests, rubber, random)


def campaign(kind: str, size: float, seed: int, folder: Path, *, law: str = "") -> Answer:
    """Write one campaign into a folder, bushing.toml and its tables, and return the truth; the same seed, the same.

    Args:
        kind: a name of KINDS; "" for none.
        size: share of |K| that changes at most.
        seed: of everything random.
        folder: made where there is none.
        law: a name of RUBBERS; "" for the paper's rubber, whose plan is awkward where there is no kind.
    """
    plan, paper, bench = draw(kind, seed, law)
    tests, rubber, known = bench.tests, bench.rubber, KINDS.get(kind, NOTHING)
    change = sized(bench, known, size) if kind else Change()
    response = respond(tests, rubber, change)
    stated = change.stated(tests)
    left, misfit = 0.0, 0.0
    if kind or law:
        stiffness = change.record(response.stiffness)
        left, misfit = seen(stated, paper, stiffness, response.force, plan.noise, rounds=ROUNDS * (3 if law else 1))
    answer = Answer(
        kind,
        size,
        known.right if kind else TRUE_OF_RUBBER.get(law, ()),
        known.place,
        float(f"{left:.3g}"),
        float(f"{misfit:.3g}"),
        law,
        TRUE_OF_RUBBER[law] if kind and law else (),
        _points(bench, change, response, stated, np.sqrt(2.0) * plan.noise.scatter) if kind else (),
    )
    form = bench.random.integers(3) if known.form is None else known.form
    _write(folder, tests, plan, change, response, int(form), bench.random)
    return answer


def _points(
    bench: Bench, change: Change, response: Response, stated: Tests, scatter: float
) -> tuple[tuple[str, float, float, int], ...]:
    """Operating points of the sweeps, repeats taken together, and whether the kind shows at each; as of `Answer`."""
    tests = bench.tests
    changed = np.abs(change.record(response.stiffness) - bench.clean.stiffness) > scatter * bench.size
    for name in ("frequency", "amplitude", "direction"):
        changed |= getattr(stated, name) != getattr(tests, name)
    changed |= stated.bushing != tests.bushing
    key = np.column_stack([tests.direction, tests.level, tests.frequency])
    points = []
    for row in np.unique(key[bench.sweeps], axis=0):
        rows = np.flatnonzero(bench.sweeps & np.all(key == row, axis=1))
        amplitude = 1e3 * float(np.mean(stated.amplitude[rows]))
        place = DIRECTIONS[stated.direction[rows[0]]]
        points.append((place, float(row[2]), float(f"{amplitude:.4g}"), int(changed[rows].any())))
    return tuple(points)


def a_specimen(random: Generator) -> tuple[Bushing, Rubber]:
    """A bushing and a rubber as there are many."""
    inner = float(f"{random.uniform(6e-3, 22e-3):.3g}")
    outer = float(f"{inner * random.uniform(1.4, 2.3):.3g}")
    mu = float(np.exp(random.uniform(*np.log((0.6e6, 1.8e6)))))
    rubber = Rubber(
        mu,
        mu * random.uniform(0.1, 0.3),
        random.uniform(0.15, 0.3),
        mu * random.uniform(0.008, 0.022),
        random.uniform(0.007, 0.02),
    )
    return Bushing(inner, outer, float(f"{random.uniform(0.02, 0.07):.3g}")), rubber


def _plan(random: Generator, needs: Sequence[str]) -> Plan:
    both = "both" in needs or random.random() < 0.75
    steps = (
        np.arange(5.0, 156.0, 10.0)
        if random.random() < 0.4
        else np.linspace(random.uniform(1.0, 8.0), random.uniform(90.0, 200.0), int(random.integers(18, 31)))
        if random.random() < 0.6
        else np.geomspace(random.uniform(0.5, 3.0), random.uniform(90.0, 200.0), int(random.integers(18, 31)))
    )
    repeats = int(random.choice([1, 2, 3], p=[0.2, 0.3, 0.5]))
    loops = ((1.0, 2.0), (1.5,), ())[int(random.choice(3, p=[0.5, 0.35, 0.15]))]
    return Plan(
        (0, 1) if both else (int(random.random() < 0.3),),
        (*_LEVELS[int(random.choice(len(_LEVELS), p=_PLANNED))], 1.0),
        np.round(steps, 1),
        max(repeats, 2 * ("repeats" in needs)),
        loops or (1.5,) * ("loop" in needs),
        Noise(
            scatter=random.uniform(*_SCATTER),
            force=random.uniform(*_FORCE),
            correlation=float(random.choice([0.0, 0.9, 0.98])),
            run=CLASS,
            level=0.5 * (random.random() < 0.5),
        ),
        reached=_REACHED * (random.random() < 0.25),
        repeats_last=random.random() < 0.5,
    )


def _few_steps(plan: Plan, count: int) -> Array:
    """So many of a plan's frequencies, evenly spread."""
    return plan.steps[np.linspace(0, plan.steps.size - 1, count).round().astype(int)]


#: What people plan who have no time, or another habit.
HABITS: dict[str, Callable[[Plan, Generator], dict[str, Any]]] = {
    "few_steps": lambda plan, random: {"steps": _few_steps(plan, int(random.integers(3, 6)))},
    "one_repeat": lambda *_: {"repeats": 1},
    "heavy_tails": lambda *_: {"tails": 3},
    "as_reached": lambda *_: {"reached": _REACHED},
    "strain_sweep": lambda plan, _: {
        "by_amplitude": True,
        "levels": tuple(np.geomspace(0.03, 1.0, 10).tolist()),
        "steps": _few_steps(plan, 3),
    },
    "level_missing": lambda *_: {"missing": True},
    "one_way": lambda plan, _: {"directions": plan.directions[:1]},
    "no_loop": lambda *_: {"loops": ()},
}


def awkward(plan: Plan, random: Generator) -> Plan:
    """The plan with one to three habits of real ones."""
    for habit in random.choice(list(HABITS), int(random.integers(1, 4)), replace=False):
        plan = replace(plan, **HABITS[habit](plan, random))
    return plan


def _tests(bushing: Bushing, plan: Plan, random: Generator) -> Tests:
    """The session's points: loops, then each direction, run by run."""
    strain = random.uniform(*_STRAIN)
    top = {each: float(f"{strain / bushing.strain(DIRECTIONS[each]):.2g}") for each in plan.directions}
    rows: list[tuple[float, float, int, int, int, bool]] = [
        (_LOOP, factor * top[plan.directions[0]], plan.directions[0], number, 1, True)
        for number, factor in enumerate(plan.loops)
    ]
    for direction in plan.directions:
        amplitudes = [float(f"{factor * top[direction]:.4g}") for factor in plan.levels]
        if plan.missing and direction == plan.directions[-1] and len(amplitudes) > 1:
            amplitudes = amplitudes[1:]
        stepped = [(float(f), x) for x in amplitudes for f in plan.steps]
        held = [amplitudes.index(x) for _, x in stepped]
        if plan.by_amplitude:
            stepped = [(float(f), x) for f in plan.steps for x in amplitudes]
            held = [list(plan.steps).index(f) for f, _ in stepped]
        points = [
            (f, x, direction, level, repeat, False)
            for repeat in range(1, plan.repeats + 1)
            for (f, x), level in zip(stepped, held, strict=True)
        ]
        rows += points if plan.repeats_last else sorted(points, key=lambda point: point[3])
    frequency, amplitude, direction, level, repeat, loop = (np.array(column) for column in zip(*rows, strict=True))
    reached = np.where(loop, 1.0, 1.0 + plan.reached * random.standard_normal(loop.size))
    return Tests(bushing, frequency, amplitude * reached, direction, level, repeat, loop)


def _write(
    folder: Path, tests: Tests, plan: Plan, change: Change, response: Response, form: int, random: Generator
) -> None:
    noise, count = plan.noise, tests.frequency.size

    def scatter() -> Array:
        if not np.isfinite(plan.tails):
            return random.standard_normal(count)
        return random.standard_t(plan.tails, count) / np.sqrt(plan.tails / (plan.tails - 2.0))

    shared = [np.zeros(count), np.zeros(count)]
    for size, groups in ((1.0, tests.runs()), (noise.level, tests.runs(repeats=False))):
        for rows in groups:
            for part, error in zip(shared, noise.run, strict=True):
                part[rows] += size * error * random.standard_normal()
    gain, phase = shared
    white = scatter() + 1j * scatter()
    measured = response.stiffness * (1.0 + gain) * np.exp(1j * phase) * (1.0 + noise.scatter * white)
    stiffness, stated = change.record(measured), change.stated(tests)
    motion = response.motion * (stated.amplitude / tests.amplitude)[:, None]
    response, tests = replace(response, motion=motion), stated
    folder.mkdir(parents=True, exist_ok=True)
    text = ["[bushing]", 'name = "tested"']
    for name, value in (("inner_radius", "inner"), ("outer_radius", "outer"), ("length", "length")):
        text.append(f'{name} = "{1e3 * getattr(tests.bushing, value):.6g} mm"')
    for number, row in enumerate(np.flatnonzero(tests.loop), 1):
        name = f"loop_{DIRECTIONS[tests.direction[row]]}_{number}.csv"
        _write_loop(folder / name, tests, row, response, 1.0 + gain[row], noise, random)
        text += ["", "[[loops]]", f'file = "{name}"', f'direction = "{DIRECTIONS[tests.direction[row]]}"']
    for direction in plan.directions:
        name = f"sweep_{DIRECTIONS[direction]}.csv"
        rows = np.flatnonzero(~tests.loop & (tests.direction == direction))
        _write_sweep(folder / name, tests, rows, stiffness, form, repeats=plan.repeats > 1)
        text += ["", "[[sweeps]]", f'file = "{name}"', f'direction = "{DIRECTIONS[direction]}"']
    (folder / "bushing.toml").write_text("\n".join(text) + "\n", encoding="utf-8")


def _write_loop(
    file: Path, tests: Tests, row: int, response: Response, gain: float, noise: Noise, random: Generator
) -> None:
    count = CYCLES * SAMPLES
    keep = noise.correlation
    white = random.standard_normal(count + SAMPLES)
    coloured = lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], white)[SAMPLES:]
    force, motion = (np.tile(wave[row], CYCLES) for wave in (response.force, response.motion))
    force = gain * force + noise.force * 0.5 * np.ptp(force) * coloured
    motion = motion + _JITTER * tests.amplitude[row] * random.standard_normal(count)
    time = np.arange(count) / (SAMPLES * tests.frequency[row])
    lines = [f"{t:.5f},{1e3 * x:.6f},{f:.4f}" for t, x, f in zip(time, motion, force, strict=True)]
    file.write_text("\n".join(["time [s],displacement [mm],force [N]", *lines]) + "\n", encoding="utf-8")


def _write_sweep(file: Path, tests: Tests, rows: Array, stiffness: Array, form: int, *, repeats: bool) -> None:
    """A table in one of three forms: |K| beside loss factor or phase, or storage beside loss stiffness."""
    k = 1e-3 * stiffness[rows]
    names, values = (
        ("stiffness [N/mm],loss factor [-]", (np.abs(k), k.imag / k.real)),
        ("stiffness [N/mm],phase [deg]", (np.abs(k), np.degrees(np.angle(k)))),
        ("storage stiffness [N/mm],loss stiffness [N/mm]", (k.real, k.imag)),
    )[form]
    lines = [f"frequency [Hz],amplitude [mm],{'repeat,' * repeats}{names}"]
    for row, first, second in zip(rows, *values, strict=True):
        number = f"{tests.repeat[row]}," * repeats
        lines.append(f"{tests.frequency[row]:g},{1e3 * tests.amplitude[row]:.5g},{number}{first:.6g},{second:.6g}")
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
