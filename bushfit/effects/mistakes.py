"""Mistakes that laboratories make: what a file, or the campaign, says is not what was measured. See mistakes.toml.

Each is an effect of the level `record` and has no parameter: it either is so or it is not. Nothing is mended unless the
user says so.
"""

import tomllib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np

from bushfit.effects import get_effect
from bushfit.effects.contract import Effect, Level
from bushfit.errors import ModelError
from bushfit.geometry import ROTATION, TRANSLATION, Bushing, Direction, Motion, Place
from bushfit.reading.measurement import Complex, Loop, Sweep

_Test = TypeVar("_Test", bound=Loop | Sweep)

#: Shear moduli of rubbers in use [Pa], and strain amplitudes of tests [-], at least and at most; chosen: a tenth of the
#: softest and ten times the stiffest compound, a tenth of the smallest and twice the largest test.
_MODULI, _STRAINS = (2e4, 3e8), (3e-4, 5.0)
#: Between the name of a mistake and that of the test it was made in.
SEPARATOR = ":"


@dataclass(frozen=True, kw_only=True)
class Mistake(Effect):
    """What the record says is not what was measured.

    `sentence` is what would be so, with a slot for the files: "the amplitudes of {files} are peak-to-peak".

    Args:
        line: what to write into the campaign, or to correct where no key does it.
        sweep_line: the same for a sweep, where it differs.
        kinds: tests in which it is made, sweeps unless told; none for one that is made in [bushing].
        motion: of the tests in which it is made; None for any.
        displacement, force, time: true value over the one stated; `displacement` of the radii, where it is made there.
        stiffness: true complex stiffness by the one stated, (n,) each, for what the three factors cannot say; of a
            sweep only.
        doubt: whether a complex stiffness as stated leaves room for the mistake; None for always.
        swaps: whether the direction is another one.
        scales: whether it is a power of 1000, made only where no rubber could have given the test as it is stated.
    """

    level: Level = Level.RECORD
    parameters: tuple[()] = ()
    source: str = "usage in test laboratories"
    line: str
    sweep_line: str = ""
    kinds: tuple[Literal["sweep", "loop"], ...] = ("sweep",)
    motion: Motion | None = None
    displacement: float = 1.0
    force: float = 1.0
    time: float = 1.0
    stiffness: Callable[[Complex], Complex] | None = None
    doubt: Callable[[Complex], bool] | None = None
    swaps: bool = False
    scales: bool = False

    def mended(self, test: _Test) -> _Test | None:
        """The test as it was measured if this mistake was made in it; None where it cannot have been made."""
        if not self.possible(test):
            return None
        direction = self._direction(test.direction)
        if isinstance(test, Loop):
            motion, force = self.displacement * test.displacement, self.force * test.force
            return replace(test, direction=direction, time=self.time * test.time, displacement=motion, force=force)
        return replace(
            test,
            direction=direction,
            amplitude=self.displacement * test.amplitude,
            reached=None if test.reached is None else self.displacement * test.reached,
            stiffness=self.force * (self.stiffness(test.stiffness) if self.stiffness else test.stiffness),
        )

    def mended_cycle(self, cycle: Sweep) -> Sweep:
        """The fundamental of a mended loop, from the fundamental of the loop as stated."""
        return replace(
            cycle,
            direction=self._direction(cycle.direction),
            frequency=cycle.frequency / self.time,
            amplitude=self.displacement * cycle.amplitude,
            stiffness=self.force / self.displacement * cycle.stiffness,
        )

    def possible(self, test: Loop | Sweep) -> bool:
        """Whether it can have been made in a test."""
        kind, place = "loop" if isinstance(test, Loop) else "sweep", test.direction
        fits = kind in self.kinds and self.motion in (None, place.motion)
        doubtful = self.doubt is None or (isinstance(test, Sweep) and self.doubt(test.stiffness))
        return fits and doubtful and not (self.swaps and other_direction(place) is None)

    def explains(self, test: Loop | Sweep, modulus: float, strain: float) -> bool:
        """Whether a rubber could have given a test only with this power of 1000; True for mistakes of another kind.

        Args:
            modulus: shear modulus that the test as stated implies [Pa].
            strain: largest strain amplitude as stated [-].
        """
        if not self.scales:
            return True
        factor = self.force / self.displacement if isinstance(test, Loop) else self.force
        return not _is_of_rubber(modulus, strain) and _is_of_rubber(factor * modulus, self.displacement * strain)

    def _direction(self, place: Place) -> Place:
        return (other_direction(place) if self.swaps else None) or place

    def mended_bushing(self, bushing: Bushing) -> Bushing:
        """The bushing as it is, if the mistake was made in its radii."""
        inner, outer = (self.displacement * radius for radius in (bushing.inner_radius, bushing.outer_radius))
        return replace(bushing, inner_radius=inner, outer_radius=outer)

    def corrected(self, test: Loop | Sweep | None) -> str:
        """What to write into the campaign for a test, or to correct in its file; None stands for the bushing."""
        if test is None:
            return self.line
        other = other_direction(test.direction) if self.swaps else None
        kind, line = ("loops", self.line) if isinstance(test, Loop) else ("sweeps", self.sweep_line or self.line)
        return f"[[{kind}]] of {file_or_name(test)}: {line.replace('{direction}', str(other))}"

    def in_words(self, test: Loop | Sweep) -> str:
        """That it was made in a test, and the line for the campaign that puts it right."""
        return f"{self.sentence.format(files=file_or_name(test))} (then, in the campaign: {self.corrected(test)})"


def file_or_name(test: Loop | Sweep) -> str:
    """The file of a test, or its name where it came from none.

    >>> file_or_name(Loop("slow", Direction.AXIAL, *np.ones((3, 9))))
    'slow'
    """
    return test.source.file.name if test.source else test.name


def other_direction(place: Place) -> Direction | None:
    """Radial for axial and the reverse; None for what cannot be taken for either."""
    if place is Direction.AXIAL:
        return Direction.RADIAL
    return Direction.AXIAL if place is Direction.RADIAL else None


def _is_of_rubber(modulus: float, strain: float) -> bool:
    """Whether a rubber can have a shear modulus [Pa], and a test of one a strain amplitude [-]."""
    return _MODULI[0] < modulus < _MODULI[1] and _STRAINS[0] < strain < _STRAINS[1]


def _loss(stiffness: Complex) -> float:
    """Median loss factor."""
    return float(np.median(stiffness.imag / stiffness.real))


def _times_loss(factor: float, stiffness: Complex) -> Complex:
    """The same |K|, and the loss factor times a factor."""
    loss = 1.0 + 1j * factor * stiffness.imag / stiffness.real
    return np.asarray(np.abs(stiffness) * loss / np.abs(loss))


def _sine(stiffness: Complex) -> Complex:
    """The same |K|, with K''/|K| where its loss factor was stated."""
    sine = np.clip(stiffness.imag / stiffness.real, -1.0, 1.0)
    return np.asarray(np.abs(stiffness) * (np.sqrt(1.0 - sine**2) + 1j * sine))


#: Laws that the table names: true complex stiffness by the one stated, whether it leaves room for a mistake, a motion.
_LAWS: dict[str, Any] = {
    # the phase is 90 deg less
    "complement": lambda k: 1j * np.conj(k),
    # the phase is in radians where it was read in degrees
    "turned": lambda k: np.abs(k) * np.exp(1j * np.degrees(1.0) * np.angle(k)),
    "hundredth_of_loss": partial(_times_loss, 0.01),
    "hundredfold_loss": partial(_times_loss, 100.0),
    "sine": _sine,
    # K' where |K| was stated
    "magnitude": lambda k: k * np.abs(k) / k.real,
    # |K| where K' was stated, beside the right K''
    "storage": lambda k: np.sqrt(np.maximum(k.real**2 - k.imag**2, 0.0)) + 1j * k.imag,
    # chosen: the least damping of filled rubbers have twice that
    "little_loss": lambda k: 0.0 < _loss(k) < 0.02,
    # chosen: the largest loss of a rubber in a bushing reaches that at no temperature of use
    "much_loss": lambda k: _loss(k) > 1.0,
    "translation": TRANSLATION,
    "rotation": ROTATION,
}


def _mistake(name: str, entry: dict[str, Any]) -> Mistake:
    """The mistake of an entry of mistakes.toml."""
    laws = {key: _LAWS[entry.pop(key)] for key in ("stiffness", "doubt", "motion") if key in entry}
    kinds, units = tuple(entry.pop("kinds", ["sweep"])), entry.pop("units", {}).items()
    stated = [
        f'units = {{ {what} = "{unit}" }}, and the same in the header if that states a unit' for what, unit in units
    ]
    entry |= laws | dict(zip(("line", "sweep_line"), stated, strict=False))
    return Mistake(name=name, kinds=kinds, **entry)


_TABLE = tomllib.loads(Path(__file__).with_name("mistakes.toml").read_text(encoding="utf-8"))
#: Every mistake by name, the most frequent first; of two that explain tests alike the first leads.
MISTAKES: dict[str, Mistake] = {name: _mistake(name, entry) for name, entry in _TABLE.items()}


def labelled(name: str, test: str | None) -> str:
    """A mistake with its test, as options take it; None for one that is made in no test."""
    return name if test is None else f"{name}{SEPARATOR}{test}"


def get_mistake(name: str) -> Mistake | None:
    """The mistake of a name such as peak_to_peak, or peak_to_peak:sweep_axial with its test; None where none is."""
    return MISTAKES.get(name.partition(SEPARATOR)[0])


def get_candidate(name: str) -> Effect:
    """The effect of the library, or the mistake, of that name; a mistake may have its test behind a colon.

    Raises:
        ModelError: there is none; the nearest name is suggested.

    >>> get_candidate("peak_to_peak:sweep_axial").sentence
    'the amplitudes of {files} are peak-to-peak'
    """
    mistake = get_mistake(name)
    if mistake is None and SEPARATOR in name:
        expected = f"MISTAKE{SEPARATOR}TEST with one of {', '.join(MISTAKES)}"
        raise ModelError("unknown mistake", found=name, expected=expected)
    return mistake or get_effect(name)
