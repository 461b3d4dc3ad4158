"""A small rig in time for the paper's bushing, written from the paper alone: nothing here comes from bushfit.

Motion is a sine at every operating point at once; the rubber's stress follows sample by sample, and the stiffness is
what a projection onto the first harmonic makes of force and displacement. So what it measures shares no law with what
bushfit fits. SI units; waves are (n, SAMPLES), a row an operating point, one steady cycle each.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.special import ive, kve

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

AXIAL, RADIAL, TORSION = DIRECTIONS = ("axial", "radial", "torsion")
#: Samples of a cycle: the springpot's backward differences are then good to 5e-5.
SAMPLES = 256
#: Friction is steady once a cycle ends where it began, relative to its largest stress; cycles until then at most.
_STEADY, _MOST_CYCLES = 1e-7, 200
#: Rounds in which a motion is found that gives way under its own force; each leaves the share that gives of the error.
_ROUNDS = 8


@dataclass(frozen=True)
class Bushing:
    """A rubber tube bonded between two sleeves: inner and outer radius, length [m]."""

    inner: float
    outer: float
    length: float

    def strain(self, direction: str) -> float:
        """Equivalent strain per displacement [1/m], or per angle [1/rad]: Eqs. 7 and 8."""
        a, b = self.inner, self.outer
        log = np.log(b / a)
        if direction == AXIAL:
            return float(1.0 / np.sqrt(2.0 * (b**2 - a**2) * log))
        if direction == RADIAL:
            return float(np.sqrt((a**2 + b**2) / ((b**4 - a**4) * log - (a**2 - b**2) ** 2)))
        return a * b / (b**2 - a**2)

    def stiffness(self, direction: str) -> float:
        """Stiffness per equivalent modulus [m], or [m^3] of torsion: Eqs. 10 to 12."""
        a, b, length = self.inner, self.outer, self.length
        log = np.log(b / a)
        if direction == AXIAL:
            return float(2.0 * np.pi * length / log)
        if direction == RADIAL:
            middle = 1.5 * (b**2 - a**2) / (b**2 + a**2)
            return float(10.0 * np.pi * length / (3.5 * log - middle + self._ends()))
        return 4.0 * np.pi * length * a**2 * b**2 / (b**2 - a**2)

    def _ends(self) -> float:
        """D of Eq. 12, what the free ends let go, by Bessel functions scaled with exp(+-x)."""
        a, b = self.inner, self.outer
        k = np.sqrt(60.0) / self.length
        grow = np.exp(-2.0 * k * (b - a))  # of I(ka) K(kb) beside I(kb) K(ka)

        def pair(upper: int, lower: int, sign: float) -> float:
            """I_upper(kb) K_lower(ka) + sign I_lower(ka) K_upper(kb), both over exp(k (b - a))."""
            return ive(upper, k * b) * kve(lower, k * a) + sign * grow * ive(lower, k * a) * kve(upper, k * b)

        across = ive(1, k * b) * kve(1, k * a) - grow * ive(1, k * a) * kve(1, k * b)
        outer = k * b * (b**2 + 3.0 * a**2) * pair(1, 0, 1.0)
        inner = k * a * (3.0 * b**2 + a**2) * (ive(0, k * b) * kve(1, k * a) + grow * ive(1, k * a) * kve(0, k * b))
        once = 4.0 * (b**2 + a**2) * np.exp(-k * (b - a))
        return float((once - outer - inner) / (k**2 * a * b * (b**2 + a**2) * across))


@dataclass(frozen=True)
class Rubber:
    """The five parameters: numbers, or arrays with one value a point, (n, 1)."""

    mu: float | Array
    m: float | Array
    alpha: float | Array
    sigma_fmax: float | Array
    eps_half: float | Array

    def times(self, **factors: float | Array) -> Rubber:
        """The rubber with some of its parameters times a factor."""
        values = {name: value * factors.get(name, 1.0) for name, value in vars(self).items()}
        return Rubber(**values)

    def stress(self, strain: Array, frequency: Array) -> Array:
        """Stress [Pa] over a steady cycle of the strain: Eq. 6."""
        elastic, viscous = 2.0 * self.mu * strain, springpot(strain, frequency, self.m, self.alpha)
        return elastic + viscous + friction(strain, self.sigma_fmax, self.eps_half)


def springpot(strain: Array, frequency: Array, m: float | Array, alpha: float | Array) -> Array:
    """m D^alpha e of a steady cycle, (n, SAMPLES), by backward differences over all cycles that went before.

    Eq. 3 with the differences of second order (Lubich 1986): the weights are those of
    ((3/2 - 2z + z^2/2)/dt)^alpha. Of a steady cycle their sum over the endless past is one factor a harmonic.
    """
    count = strain.shape[-1]
    z = np.exp(-2j * np.pi * np.arange(count // 2 + 1) / count)
    rate = (1.5 - 2.0 * z + 0.5 * z**2) * (count * frequency[:, None])
    return np.asarray(m * np.fft.irfft(rate**alpha * np.fft.rfft(strain), count))


def friction(strain: Array, largest: float | Array, half: float | Array) -> Array:
    """Smooth Coulomb friction [Pa] over a steady cycle of the strain, (n, SAMPLES), walked turn by turn: Eq. 5."""
    count = strain.shape[-1]
    rows = np.arange(strain.shape[0])
    lowest = np.argmin(strain, axis=-1)
    walk = (lowest[:, None] + np.arange(count + 1)) % count
    path = np.take_along_axis(strain, walk, axis=-1).T
    top, scale = (np.broadcast_to(np.ravel(value), rows.shape) for value in (largest, half))
    reach = np.ptp(path, axis=0) / (2.0 * scale)
    stress = -0.5 * top * (np.sqrt(reach**2 + 6.0 * reach + 1.0) - reach - 1.0)  # of a cycle with two turns
    steps = np.diff(path, axis=0)
    found = np.empty_like(path)
    for _ in range(_MOST_CYCLES):
        found[0] = stress
        turn, turned, sense = path[0].copy(), stress.copy(), np.ones(rows.size)
        for number, step in enumerate(steps, 1):
            now = np.where(step == 0.0, sense, np.sign(step))
            new = now != sense
            turn[new], turned[new], sense = path[number - 1][new], found[number - 1][new], now
            gone = path[number] - turn
            found[number] = turned + gone * (top - sense * turned) / (
                scale * (1.0 - sense * turned / top) + sense * gone
            )
        off = float(np.max(np.abs(found[-1] - stress) / top, initial=0.0))
        stress = found[-1].copy()
        if off < _STEADY:
            break
    back = np.empty_like(strain)
    np.put_along_axis(back, walk[:, :count], found[:count].T, axis=-1)
    return back


def first_harmonic(wave: Array) -> Complex:
    """First harmonic of a cycle, (n,): c of Re(c exp(i theta))."""
    return np.asarray(np.fft.rfft(wave)[:, 1] * (2.0 / wave.shape[-1]))


def harmonics(wave: Array, factor: Complex) -> Array:
    """A wave with each of its harmonics times a factor, (n, SAMPLES // 2 + 1): a linear filter of a steady cycle."""
    return np.fft.irfft(np.fft.rfft(wave) * factor, wave.shape[-1])


def of_harmonics(frequency: Array) -> Array:
    """Frequencies [Hz] of the harmonics of a cycle, (n, SAMPLES // 2 + 1)."""
    return frequency[:, None] * np.arange(SAMPLES // 2 + 1)


@dataclass(frozen=True)
class Tests:
    """Operating points in the order in which they were measured, the loops first; every array is (n,).

    Args:
        bushing: under test.
        frequency, amplitude: of the motion [Hz], [m].
        direction: index into DIRECTIONS.
        level: number of what a sweep holds, of a loop its own number.
        repeat: from 1.
        loop: whether the point is a loop.
    """

    __test__ = False  # no class of tests for pytest

    bushing: Bushing
    frequency: Array
    amplitude: Array
    direction: NDArray[np.int_]
    level: NDArray[np.int_]
    repeat: NDArray[np.int_]
    loop: NDArray[np.bool_]

    @property
    def turn(self) -> Array:
        """0 at the first point of the session, 1 at its last, (n,)."""
        return np.linspace(0.0, 1.0, self.frequency.size)

    @property
    def strain(self) -> Array:
        """Equivalent strain per displacement, (n, 1)."""
        return np.array([self.bushing.strain(name) for name in DIRECTIONS])[self.direction][:, None]

    @property
    def unit(self) -> Array:
        """Force over stress [m^2], (n, 1): K = unit stiffness times s/(2 e)."""
        return np.array([self.bushing.stiffness(name) for name in DIRECTIONS])[self.direction][:, None] / (
            2.0 * self.strain
        )

    def runs(self, *, repeats: bool = True) -> list[NDArray[np.int_]]:
        """Rows of what was recorded in one go, a loop by itself; without repeats, of all repeats of a level."""
        key = 1000 * (2 * self.direction + self.loop) + self.level + 10**6 * (self.repeat * repeats)
        return [np.flatnonzero(key == each) for each in np.unique(key)]

    def imposed(self) -> Array:
        """The motion asked for [m]: -X cos, at rest at a sample, so that turns are met."""
        return -self.amplitude[:, None] * np.cos(2.0 * np.pi * np.arange(SAMPLES) / SAMPLES)


def projected(motion: Array, force: Array) -> Complex:
    """Stiffness [N/m] by the first harmonics of displacement and force, (n,)."""
    return first_harmonic(force) / first_harmonic(motion)


@dataclass(frozen=True)
class Change:
    """What differs from the paper's bushing on a perfect rig; each step is given the waves before it.

    Args:
        motion: what moves the bushing, by what was asked for [m].
        rubber: factors of the five parameters, numbers or (n, 1).
        stress: beside the rubber's [Pa], by the strain.
        gives: what gives way in series with the bushing [m], by the force.
        force: as it is recorded [N], by motion and true force.
        reading: what the software makes of the motion asked for and the recorded force, K [N/m].
        record: K [N/m] as it stands in the file, by K with its noise, (n,).
        stated: the tests as the files state them, by the tests as they were run.
    """

    motion: Callable[[Array], Array] = lambda asked: asked
    rubber: Mapping[str, float | Array] = field(default_factory=dict)
    stress: Callable[[Array], Array] = np.zeros_like
    gives: Callable[[Array], Array] | None = None
    force: Callable[[Array, Array], Array] = lambda _, force: force
    reading: Callable[[Array, Array], Complex] = projected
    record: Callable[[Complex], Complex] = lambda stiffness: stiffness
    stated: Callable[[Tests], Tests] = lambda tests: tests


@dataclass(frozen=True)
class Response:
    """Displacement [m] and force [N] as recorded, (n, SAMPLES), and what the software made of them [N/m], (n,)."""

    motion: Array
    force: Array
    stiffness: Complex


def respond(tests: Tests, rubber: Rubber, change: Change | None = None) -> Response:
    """What the rig measures without any noise; the record has the motion that was asked for."""
    change = change or Change()
    asked = tests.imposed()
    motion = change.motion(asked)
    changed = rubber.times(**change.rubber)

    def force_of(moved: Array) -> Array:
        strain = moved * tests.strain
        return tests.unit * (changed.stress(strain, tests.frequency) + change.stress(strain))

    true = force_of(motion)
    if change.gives:
        for _ in range(_ROUNDS):
            true = force_of(motion - change.gives(true))
    force = change.force(motion, true)
    return Response(asked, force, change.reading(asked, force))
