"""Mistakes in the record: a file or campaign states something else than was measured. See mistakes.toml.

A mistake is an effect of the level `record` without parameters. `diagnose` proposes it; a test is corrected only if the
user adopts the mistake.
"""

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np

from bushfit.effects import get_effect
from bushfit.effects.contract import Effect, Level
from bushfit.errors import ModelError
from bushfit.geometry import ROTATION, TRANSLATION, Bushing, Direction, Motion, Place
from bushfit.reading.measurement import Complex, Loop, Sweep, loss_factor

_Test = TypeVar("_Test", bound=Loop | Sweep)

#: Ranges of plausible shear moduli of rubber [Pa] and strain amplitudes of tests [-]; chosen: a tenth of the softest to
#: ten times the stiffest compound, a tenth of the smallest to twice the largest test.
_MODULI, _STRAINS = (2e4, 3e8), (3e-4, 5.0)
#: Dynamic shear modulus of the rubber of bushings [Pa] and standard deviation of its natural log: 35 to 80 IRHD (P. B.
#: Lindley, Engineering Design with Natural Rubber, 1974). Of two mistakes that make the tests agree alike, the one that
#: gives such a rubber is more probable.
USUAL_MODULUS = 1.2e6, 0.8
#: The direction that a test may have been exchanged with, by its direction.
_EXCHANGED: Mapping[Place, Direction] = {Direction.AXIAL: Direction.RADIAL, Direction.RADIAL: Direction.AXIAL}
#: Separator between the name of a mistake and the name of the test, in options.
SEPARATOR = ":"


@dataclass(frozen=True, kw_only=True)
class Mistake(Effect):
    """Kind of recording mistake in a test or in the dimensions of the bushing, such as a wrong unit.

    `sentence` states the mistake, with a placeholder for the files: "the amplitudes of {files} are peak-to-peak".

    Args:
        line: line for the campaign file that corrects the mistake, or the correction of the data file.
        sweep_line: `line` for a sweep, if it differs.
        kinds: kinds of tests in which the mistake occurs; empty for a mistake in [bushing].
        motion: type of motion of these tests (translation or rotation); None for any.
        displacement, force, time: ratios of the true to the stated quantity in a test. The stiffness of a sweep was
            computed from force and displacement, so its ratio is force/displacement; that of its frequency is 1/time.
        amplitude: ratio of the true to the stated amplitude of a sweep whose stiffness is true.
        inner_radius, outer_radius, length: ratios of the true to the stated dimension in [bushing].
        stiffness: function from the stated to the true complex stiffness of a sweep, (n,) -> (n,) [N/m], for mistakes
            that these ratios cannot describe; the identity otherwise.
        doubt: function that returns True if the stated complex stiffness, (n,), permits the mistake; None for always.
        swaps: True if axial and radial are interchanged.
        scales: True for a factor that is a power of 1000, which is possible only if the test as stated is implausible
            for rubber.
        is_estimated: True if `force` is unknown, and estimated from the other tests.
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
    amplitude: float = 1.0
    inner_radius: float = 1.0
    outer_radius: float = 1.0
    length: float = 1.0
    stiffness: Callable[[Complex], Complex] = np.positive
    doubt: Callable[[Complex], bool] | None = None
    swaps: bool = False
    scales: bool = False
    is_estimated: bool = False

    def corrected_test(self, test: _Test) -> _Test:
        """Correct a test, or the first harmonic of a loop as a sweep of one point, in which the mistake is possible.

        Returns:
            The corrected test.
        """
        direction = self._direction(test.direction)
        if isinstance(test, Loop):
            motion, force = self.displacement * test.displacement, self.force * test.force
            return replace(test, direction=direction, time=self.time * test.time, displacement=motion, force=force)
        factor, stiffness = self.displacement * self.amplitude, self.stiffness(test.stiffness)
        return replace(
            test,
            direction=direction,
            frequency=test.frequency / self.time,
            amplitude=factor * test.amplitude,
            reached=None if test.reached is None else factor * test.reached,
            stiffness=self.force / self.displacement * stiffness,
        )

    def is_possible(self, test: Loop | Sweep) -> bool:
        """True if a test of this kind, motion, direction and stiffness can have the mistake."""
        kind, place = "loop" if isinstance(test, Loop) else "sweep", test.direction
        fits = kind in self.kinds and self.motion in (None, place.motion)
        doubtful = self.doubt is None or (isinstance(test, Sweep) and self.doubt(test.stiffness))
        return fits and doubtful and not (self.swaps and place not in _EXCHANGED)

    def explains(self, modulus: float, strain: float) -> bool:
        """True if the correction of a factor of 1000 makes a recording plausible that is implausible for rubber.

        Args:
            modulus: shear modulus that the test as stated implies [Pa].
            strain: largest strain amplitude as stated [-].

        Returns:
            True if the recording becomes plausible; always True for mistakes that are not a factor of a power of 1000.
        """
        corrected = self.force / self.displacement * modulus, self.displacement * self.amplitude * strain
        return not self.scales or (_is_of_rubber(*corrected) and not _is_of_rubber(modulus, strain))

    def _direction(self, place: Place) -> Place:
        """True direction of a test that states `place`: the other one if the mistake swaps axial and radial."""
        return _EXCHANGED.get(place, place) if self.swaps else place

    def corrected_bushing(self, bushing: Bushing) -> Bushing:
        """Return a bushing with its dimensions corrected for this mistake, such as a diameter given as a radius.

        Raises:
            ModelError: the mistake is not possible, because no bushing has the corrected dimensions.
        """
        return replace(
            bushing,
            inner_radius=self.inner_radius * bushing.inner_radius,
            outer_radius=self.outer_radius * bushing.outer_radius,
            length=self.length * bushing.length,
        )

    def correction_line(self, test: Loop | Sweep | None) -> str:
        """Line of the campaign file that corrects the mistake in a test, or in the bushing if `test` is None."""
        if test is None:
            return self.line
        kind, line = ("loops", self.line) if isinstance(test, Loop) else ("sweeps", self.sweep_line or self.line)
        return (
            f"[[{kind}]] of {file_or_name(test)}: {line.replace('{direction}', str(self._direction(test.direction)))}"
        )

    def sentence_for(self, test: Loop | Sweep) -> str:
        """Sentence that states the mistake in a test, with the line of the campaign file that corrects the mistake."""
        return f"{self.sentence.format(files=file_or_name(test))} (then, in the campaign: {self.correction_line(test)})"


def file_or_name(test: Loop | Sweep) -> str:
    """Name of the file that a test was read from, or the name of the test if it has no file.

    >>> file_or_name(Loop("slow", Direction.AXIAL, *np.ones((3, 9))))
    'slow'
    """
    return test.source.file.name if test.source else test.name


def _is_of_rubber(modulus: float, strain: float) -> bool:
    """Return True if the shear modulus [Pa] and the strain amplitude [1] are possible in a test of rubber."""
    return _MODULI[0] < modulus < _MODULI[1] and _STRAINS[0] < strain < _STRAINS[1]


def _scale_loss(factor: float, stiffness: Complex) -> Complex:
    """Complex stiffnesses, (n,), with unchanged magnitudes |K| and with loss factors multiplied by `factor`."""
    loss = 1.0 + 1j * factor * stiffness.imag / stiffness.real
    return np.asarray(np.abs(stiffness) * loss / np.abs(loss))


#: Functions and motions by their names in mistakes.toml: true stiffness from stated stiffness, condition, or motion.
_LAWS: dict[str, Any] = {
    # the phase is 90 deg less
    "complement": lambda k: 1j * np.conj(k),
    # the phase is in radians where it was read in degrees
    "turned": lambda k: np.abs(k) * np.exp(1j * np.degrees(1.0) * np.angle(k)),
    "hundredth_of_loss": partial(_scale_loss, 0.01),
    "hundredfold_loss": partial(_scale_loss, 100.0),
    # the stated loss factor is the sine of the loss angle
    "sine": lambda k: np.abs(k) * np.exp(1j * np.arcsin(np.clip(k.imag / k.real, -1.0, 1.0))),
    # K' was given as |K|
    "magnitude": lambda k: k * np.abs(k) / k.real,
    # |K| was given as K', with the correct K''
    "storage": lambda k: np.sqrt(np.maximum(k.real**2 - k.imag**2, 0.0)) + 1j * k.imag,
    # chosen: the least damping of filled rubbers have twice that
    "little_loss": lambda k: 0.0 < np.median(loss_factor(k)) < 0.02,
    # chosen: the largest loss of a rubber in a bushing reaches that at no temperature of use
    "much_loss": lambda k: np.median(loss_factor(k)) > 1.0,
    "translation": TRANSLATION,
    "rotation": ROTATION,
}


def _build_mistake(name: str, entry: dict[str, Any]) -> Mistake:
    """Build a mistake from its name and its table in mistakes.toml."""
    laws = {key: _LAWS[entry.pop(key)] for key in ("stiffness", "doubt", "motion") if key in entry}
    kinds, units = tuple(entry.pop("kinds", ["sweep"])), entry.pop("units", [])
    lines = [f"units = {{ {stated} }}, and the same in the header, if any" for stated in units]
    entry |= laws | dict(zip(("line", "sweep_line"), lines, strict=False))
    return Mistake(name=name, kinds=kinds, **entry)


_TABLE = tomllib.loads(Path(__file__).with_name("mistakes.toml").read_text(encoding="utf-8"))
#: All mistakes by name, the most frequent first.
MISTAKES: dict[str, Mistake] = {name: _build_mistake(name, entry) for name, entry in _TABLE.items()}


def option_label(name: str, test: str | None) -> str:
    """Name of a mistake as in the option --adopt: `mistake:test`, or `mistake` if `test` is None."""
    return name if test is None else f"{name}{SEPARATOR}{test}"


def get_mistake(name: str) -> Mistake | None:
    """Return the mistake with a name such as `peak_to_peak` or `peak_to_peak:sweep_axial`; None for other names."""
    return MISTAKES.get(name.partition(SEPARATOR)[0])


def get_candidate(name: str) -> Effect:
    """Return the effect or mistake with the given name; the name of a mistake may end with a colon and a test.

    Raises:
        ModelError: the name is unknown; the message suggests the most similar name.

    >>> get_candidate("peak_to_peak:sweep_axial").sentence
    'the amplitudes of {files} are peak-to-peak'
    """
    mistake = get_mistake(name)
    if mistake is None and SEPARATOR in name:
        expected = f"MISTAKE{SEPARATOR}TEST with one of {', '.join(MISTAKES)}"
        raise ModelError("unknown mistake", found=name, expected=expected)
    return mistake or get_effect(name)
