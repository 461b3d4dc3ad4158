"""Parameters as texts: significant digits, common units, intervals."""

import math
from collections.abc import Iterator
from typing import NamedTuple

from bushfit.model.result import Result
from bushfit.units import display_unit, format_aligned

#: A value below its least possible value times this is shown as resting there: logarithms tell no more apart.
_AT_LEAST = 1.01
#: Digits of a value whose standard error is not known.
_PLAIN_DIGITS = 4
#: Fewest and most digits of a value, however small or large its standard error.
_FEWEST_DIGITS = 2
_MOST_DIGITS = 6


class ParameterRow(NamedTuple):
    """One parameter as texts.

    Args:
        name: of the parameter.
        state: "held", "at min" or "at max"; empty otherwise.
        value: in the unit.
        error: standard error; empty where it is not known.
        interval: ends of the 95 % interval; empty where it is not known.
        unit: common unit.
        meaning: of the parameter.
    """

    name: str
    state: str
    value: str
    error: str
    interval: str
    unit: str
    meaning: str

    @property
    def label(self) -> str:
        """Name with the state in brackets."""
        return f"{self.name} ({self.state})" if self.state else self.name


def interval_kind(result: Result) -> str:
    """Kind of the intervals of a result, as a heading."""
    return "95 % by profile" if result.profile else "95 % interval"


def parameter_rows(result: Result) -> Iterator[ParameterRow]:
    """Rows of the parameters of a result with standard errors and 95 % intervals, by profile if there are any.

    Args:
        result: fitted or given model.

    Returns:
        An iterator over rows, one per parameter.
    """
    for name, parameter in result.model.parameters.items():
        value, stderr = result.model.values[name], result.covariance.stderr(name)
        interval = result.profile.get(name) or result.interval(name)
        if parameter.log and value <= _AT_LEAST * parameter.bounds[0]:  # a slope there tells nothing of its error
            stderr = interval = None
        elif interval == parameter.bounds:
            interval = None
        digits, (unit, factor) = _PLAIN_DIGITS, display_unit(parameter.unit, 1.0, value)
        if stderr and value:  # two of the standard error
            carried = math.floor(math.log10(abs(value))) - math.floor(math.log10(stderr)) + 2
            digits = min(max(carried, _FEWEST_DIGITS), _MOST_DIGITS)
        finite_ends = [end * factor for end in interval or () if end is not None]
        value_text, *texts = format_aligned([value * factor, *finite_ends], digits, minimum_digits=2)
        ends = ["open" if end is None else texts.pop(0) for end in interval or ()]
        error = "" if stderr is None else format_aligned([stderr * factor], 2)[0]
        state = f"at {result.at_bound[name]}" if name in result.at_bound else "held" * (name not in result.fitted)
        yield ParameterRow(name, state, value_text, error, " to ".join(ends), unit, parameter.meaning)
