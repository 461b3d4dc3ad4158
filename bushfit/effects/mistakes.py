"""Mistakes that laboratories make: what a file, or the campaign, says is not what was measured. See mistakes.toml.

Each is an effect of the level `record` and has no parameter: it either is so or it is not. Nothing is mended unless the
user says so.
"""

import tomllib
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bushfit.effects import effect_named
from bushfit.effects.contract import Effect
from bushfit.effects.mistake import Mistake
from bushfit.errors import ModelError
from bushfit.geometry import ROTATION, TRANSLATION
from bushfit.reading.measurement import Complex

#: [deg] A radian.
_RADIAN = float(np.degrees(1.0))
#: Loss factor below which that of a filled rubber is in doubt; chosen: the least damping of them have twice that.
_LEAST_LOSS = 0.02
#: Loss factor above which that of a rubber in a bushing is in doubt; chosen: the largest reach it at no temperature of
#: use.
_MOST_LOSS = 1.0

#: What puts between the name of a mistake and that of the test it was made in.
SEPARATOR = ":"


def _loss(stiffness: Complex) -> float:
    """Median loss factor."""
    return float(np.median(stiffness.imag / stiffness.real))


def _little_loss(stiffness: Complex) -> bool:
    return 0.0 < _loss(stiffness) < _LEAST_LOSS


def _much_loss(stiffness: Complex) -> bool:
    return _loss(stiffness) > _MOST_LOSS


def _times_loss(factor: float, stiffness: Complex) -> Complex:
    """The same |K|, and the loss factor times a factor."""
    loss = 1.0 + 1j * factor * stiffness.imag / stiffness.real
    return np.asarray(np.abs(stiffness) * loss / np.abs(loss))


def _sine(stiffness: Complex) -> Complex:
    """The same |K|, with K''/|K| where its loss factor was stated."""
    sine = np.clip(stiffness.imag / stiffness.real, -1.0, 1.0)
    return np.asarray(np.abs(stiffness) * (np.sqrt(1.0 - sine**2) + 1j * sine))


def _magnitude(stiffness: Complex) -> Complex:
    """K' where |K| was stated."""
    return np.asarray(stiffness * np.abs(stiffness) / stiffness.real)


def _storage(stiffness: Complex) -> Complex:
    """|K| where K' was stated, beside the right K''."""
    storage = np.sqrt(np.maximum(stiffness.real**2 - stiffness.imag**2, 0.0))
    return np.asarray(storage + 1j * stiffness.imag)


def _turned(stiffness: Complex) -> Complex:
    """The same |K|, and the phase in radians where it was read in degrees."""
    return np.asarray(np.abs(stiffness) * np.exp(1j * _RADIAN * np.angle(stiffness)))


def _complement(stiffness: Complex) -> Complex:
    """The same |K|, and 90 deg less the phase."""
    return np.asarray(1j * np.conj(stiffness))


#: Laws that the table names: true complex stiffness by the one stated, whether it leaves room for a mistake, a motion.
_LAWS: dict[str, Any] = {
    "turned": _turned,
    "complement": _complement,
    "hundredth_of_loss": partial(_times_loss, 0.01),
    "hundredfold_loss": partial(_times_loss, 100.0),
    "sine": _sine,
    "magnitude": _magnitude,
    "storage": _storage,
    "little_loss": _little_loss,
    "much_loss": _much_loss,
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


def mistake_named(name: str) -> Mistake | None:
    """The mistake of a name such as peak_to_peak, or peak_to_peak:sweep_axial with its test; None where none is."""
    return MISTAKES.get(name.partition(SEPARATOR)[0])


def candidate_named(name: str) -> Effect:
    """The effect of the library, or the mistake, of that name; a mistake may have its test behind a colon.

    Raises:
        ModelError: there is none; the nearest name is suggested.
    """
    mistake = mistake_named(name)
    if mistake is None and SEPARATOR in name:
        expected = f"MISTAKE{SEPARATOR}TEST with one of {', '.join(MISTAKES)}"
        raise ModelError("unknown mistake", found=name, expected=expected)
    return mistake or effect_named(name)
