"""Amplitudes and frequencies that the name of a file states, compared with what the file contains."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from bushfit import units
from bushfit.geometry import Place

#: A quantity in a name: "0.5mm", "0,5 mm", "0p5mm", "10Hz", "2deg"; not "10mm_min" nor the "18mm" of "abc18mm".
_LABEL = re.compile(
    r"(?<![A-Za-z0-9.,])(\d+(?:[.,p]\d+)?)[ _-]?(mm|um|µm|deg|grad|rad|mhz|hz)(?![A-Za-z])"
    r"(?![\s/_-]*(?:(?:per|pro|p)[\s_-]*)?(?:min|s|sec)(?![A-Za-z]))",
    re.IGNORECASE,
)
#: Units as names have them, in lower case, that are written in another way elsewhere.
_UNIT_SPELLINGS = {"grad": "deg", "um": "µm", "mhz": "mHz", "hz": "Hz"}
#: Relative difference up to which a file contains what its name states; chosen: rigs miss a level by that much.
_AGREEMENT = 0.03
#: Values that are listed one by one; chosen: of more a range says enough.
_MOST_LISTED = 4


def labelled(file: Path, expected: str) -> list[tuple[str, float]]:
    """The quantities in a file's name whose unit has the dimension of `expected`: as a text, and in SI."""
    found = [
        (float(re.sub("[,p]", ".", number)), _UNIT_SPELLINGS.get(unit.lower(), unit.lower()))
        for number, unit in _LABEL.findall(file.stem)
    ]
    return [
        (f"{value:g} {unit}", value * units.factor(unit, expected))
        for value, unit in found
        if units.agrees(unit, expected)
    ]


def wrong_labels(
    file: Path, direction: Place, amplitudes: Sequence[float], frequencies: Sequence[float]
) -> Iterator[str]:
    """A sentence where a file's name states an amplitude or a frequency that the file does not contain."""
    unit, factor = direction.display.displacement
    stated = labelled(file, direction.motion.displacement_unit)
    if stated and not any(_near(value, x) for _, value in stated for x in amplitudes):
        double = any(_near(value, 2.0 * x) for _, value in stated for x in amplitudes)
        found = _listed([factor * x for x in amplitudes])
        yield f"the name says {_or(stated)}, the amplitude is {found} {unit} zero-to-peak" + (
            ": the name may count peak-to-peak" if double else ""
        )
    stated = labelled(file, "Hz")
    if stated and not any(_near(value, f) for _, value in stated for f in frequencies):
        yield f"the name says {_or(stated)}, the frequency is {_listed(frequencies)} Hz"


def _near(one: float, other: float) -> bool:
    return abs(one - other) <= _AGREEMENT * other


def _or(stated: Sequence[tuple[str, float]]) -> str:
    return " or ".join(dict.fromkeys(text for text, _ in stated))


def _listed(values: Sequence[float]) -> str:
    texts = list(dict.fromkeys(f"{value:.4g}" for value in values))
    return ", ".join(texts) if len(texts) <= _MOST_LISTED else f"{texts[0]} to {texts[-1]}"
