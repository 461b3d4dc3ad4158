"""Amplitudes and frequencies that the names of a file and its sheet state, compared with what the file contains."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from bushfit import units
from bushfit.geometry import Place
from bushfit.reading.names import Named, Said

#: Relative difference up to which a file contains what its name states; chosen: rigs miss a level by that much.
_AGREEMENT = 0.03
#: Values that are listed one by one; chosen: of more a range says enough.
_MOST_LISTED = 4


def wrong_labels(
    named: Said, direction: Place, amplitudes: Sequence[float], frequencies: Sequence[float]
) -> Iterator[str]:
    """A sentence where the name of a file states an amplitude or a frequency that the file does not contain."""
    unit, factor = direction.display.displacement
    expected = direction.motion.displacement_unit
    stated = [(each, _zero_to_peak(each, expected)) for each in named.of(expected)]
    if stated and not any(_near(value, x) for _, value in stated for x in amplitudes):
        double = any(_near(value, 2.0 * x) for _, value in stated for x in amplitudes)
        found = _listed([factor * x for x in amplitudes])
        yield f"the name says {_or(named.of(expected))}, the amplitude is {found} {unit} zero-to-peak" + (
            ": the name may count peak-to-peak" if double else ""
        )
    said = named.of("Hz")
    if said and not any(_near(units.quantity(each.text, "Hz"), f) for each in said for f in frequencies):
        yield f"the name says {_or(said)}, the frequency is {_listed(frequencies)} Hz"


def _zero_to_peak(each: Named, expected: str) -> float:
    """The amplitude that a name states [SI]."""
    return units.quantity(each.text, expected) / (2.0 if each.convention == "peak-to-peak" else 1.0)


def _near(one: float, other: float) -> bool:
    return abs(one - other) <= _AGREEMENT * other


def _or(stated: Sequence[Named]) -> str:
    words = (f"{each.text} {each.convention}" if each.convention else each.text for each in stated)
    return " or ".join(dict.fromkeys(words))


def _listed(values: Sequence[float]) -> str:
    texts = list(dict.fromkeys(f"{value:.4g}" for value in values))
    return ", ".join(texts) if len(texts) <= _MOST_LISTED else f"{texts[0]} to {texts[-1]}"
