"""Parameters as texts: significant digits, display units, intervals."""

import math
from collections.abc import Iterator
from typing import NamedTuple

from bushfit.diagnosis.document import EffectEntry
from bushfit.effects import get_parameter
from bushfit.model.result import Result
from bushfit.units import display_unit, format_aligned

#: Ratio of a value to its lower bound up to which the value is treated as being at the bound.
_BOUND_RATIO = 1.01
#: Significant digits of a value whose standard error is not known.
_PLAIN_DIGITS = 4
#: Smallest and largest number of significant digits of a value, whatever its standard error is.
_FEWEST_DIGITS = 2
_MOST_DIGITS = 6
#: Correlation of two parameters above which it is reported: the data determine only their combination.
_STRONG_CORRELATION = 0.9


class ParameterRow(NamedTuple):
    """One parameter of a model, as the texts of a table row.

    Args:
        name: name of the parameter.
        state: "fixed" in the fit, "tied", "prior", "at min" or "at max" (at a bound); empty otherwise.
        value: value in `unit`.
        error: standard error in `unit`; "fixed" if the parameter is tied to a constant; empty if it is not known.
        interval: 95 % interval in `unit`, "open to 1.10" or "not determined"; empty if it is not known.
        unit: display unit that value, error and interval share.
        meaning: description of the parameter.
    """

    name: str
    state: str
    value: str
    error: str
    interval: str
    unit: str
    meaning: str


def correlation_texts(result: Result, minimum: float = _STRONG_CORRELATION) -> str:
    """Pairs of parameters whose correlation is at least `minimum` in size, the strongest first: "mu/m -0.96, ..."."""
    pairs = [pair for pair in result.covariance.correlations() if abs(pair[2]) > minimum]
    return ", ".join(f"{first}/{second} {value:+z.2f}" for first, second, value in pairs)


def parameter_rows(result: Result) -> Iterator[ParameterRow]:
    """Format the parameters of a result with their standard errors and 95 % intervals.

    Args:
        result: fitted or given model; intervals by profile likelihood are used where the result has them.

    Returns:
        An iterator over rows of texts, one per parameter.
    """
    for name, parameter in result.model.parameters.items():
        value, stderr = result.model.values[name], result.covariance.stderr(name)
        interval = result.profile.get(name) or result.interval(name)
        if parameter.log and value <= _BOUND_RATIO * parameter.bounds[0]:  # no standard error at a bound
            stderr = interval = None
        elif stderr == 0.0:
            interval = None
        digits, (unit, factor) = _PLAIN_DIGITS, display_unit(parameter.unit, 1.0, value)
        if stderr and value:  # two significant digits of the standard error
            carried = math.floor(math.log10(abs(value))) - math.floor(math.log10(stderr)) + 2
            digits = min(max(carried, _FEWEST_DIGITS), _MOST_DIGITS)
        if interval == parameter.bounds:
            interval = (None, None)
        finite_ends = [end * factor for end in interval or () if end is not None]
        value_text, *texts = format_aligned([value * factor, *finite_ends], digits, minimum_digits=2)
        interval_text = " to ".join("open" if end is None else texts.pop(0) for end in interval or ())
        interval_text = "not determined" if interval_text == "open to open" else interval_text
        error = "fixed" * (stderr == 0.0) if not stderr else format_aligned([stderr * factor], 2)[0]
        state = "prior" if name in result.priors else "fixed" * (name not in result.fitted and not stderr)
        state = "tied" if name in result.ties else state
        state = f"at {result.at_bound[name]}" if name in result.at_bound else state
        yield ParameterRow(name, state, value_text, error, interval_text, unit, parameter.meaning)


def effect_sizes(effect: EffectEntry) -> list[tuple[str, str, str]]:
    """Format the parameters of an effect that a diagnosis named.

    Returns:
        Three texts per parameter: name, value with unit such as "1.2 MPa", and 95 % interval such as "1.1 to 1.3".
    """
    rows = []
    for name, size in effect["parameters"].items():
        unit, factor = display_unit(size["unit"], 1.0, size["value"])
        value, *ends = format_aligned([factor * x for x in (size["value"], *(size["ci95"] or ()))], 4, minimum_digits=2)
        end = get_parameter(name).reached_bound(size["value"])
        at_end = f" (at {end})" if end else ""
        rows.append((name, f"{value} {unit}".removesuffix(" -") + at_end, " to ".join(ends)))
    return rows
