"""Grids on the command line: "5:155:10 Hz" or "0.1, 0.2, 0.5 mm"."""

from __future__ import annotations

import re

from bushfit.errors import BushfitError, UnitError
from bushfit.units import quantity

#: Values of a grid at most: more is a typing error in the step.
_MOST_VALUES = 100_000


def parse_grid(text: str | None, option: str, unit: str) -> tuple[float, ...] | None:
    """Values of an option in SI, or None where it was not given.

    Raises:
        UnitError: no numbers, no unit, or a unit of another dimension.
    """
    if text is None:
        return None
    expected = 'such as "5:155:10 Hz" (start:stop:step) or "0.1, 0.2, 0.5 mm", with one unit at the end'
    if re.search(r"\d,\d", text):
        raise UnitError(
            "a comma between two digits may part numbers or be a decimal comma",
            place=option,
            found=repr(text),
            expected=expected,
            hint='write decimals with a point, "0.5", and numbers of a list apart, "1, 5"',
        )
    parts = re.fullmatch(r"\s*([-+0-9.eE,:\s]*[0-9.])\s*([^-+\d\s:,.].*)", text)
    if not parts:
        raise UnitError("these are no values with a unit", place=option, found=repr(text), expected=expected)
    numbers, suffix = parts.groups()
    try:
        if ":" in numbers:
            start, stop, step = (quantity(f"{number} {suffix}", unit) for number in numbers.split(":"))
            if not (step > 0 and stop >= start > 0 and (stop - start) / step < _MOST_VALUES):
                raise UnitError("start:stop:step does not count upward", place=option, found=text, expected=expected)
            count = int((stop - start) / step * (1 + 1e-9)) + 1
            return tuple(start + i * step for i in range(count))
        values = tuple(quantity(f"{number} {suffix}", unit) for number in numbers.split(","))
        if min(values) <= 0.0:
            raise UnitError("frequencies and amplitudes are above zero", place=option, found=text, expected=expected)
        return values
    except ValueError:
        raise UnitError("these are no values with a unit", place=option, found=repr(text), expected=expected) from None
    except BushfitError as error:
        error.place = option
        raise
