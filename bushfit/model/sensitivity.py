"""Derivatives of a model's response with respect to its parameters, by finite differences.

All differences come from one evaluation of the model, with the parameter values along a leading axis. They are
one-sided: half the cost of central differences, and accurate to a millionth, which is enough for a fit.
"""

from collections.abc import Sequence

import numpy as np

from bushfit.effects import place_suffix
from bushfit.effects.contract import UNKNOWN, Array, RubberConditions, Value
from bushfit.effects.history import History
from bushfit.geometry import Place
from bushfit.model.model import Kind, Model

#: Step of the differences, relative to the value (log parameters) or to the typical distance (linear parameters);
#: chosen: the differences are good to about a millionth.
_RELATIVE_STEP = 1e-6


def stiffness_and_slopes(
    model: Model,
    direction: Place,
    frequency: Array,
    amplitude: Array,
    names: Sequence[str],
    kind: Kind = "sweep",
    conditions: RubberConditions = UNKNOWN,
) -> tuple[Array, Array]:
    """Complex dynamic stiffness of a model and its derivatives by parameters, for the Jacobian of a fit.

    Args:
        model: model; the derivatives are taken at its parameter values.
        direction: direction or specimen.
        frequency: frequency [Hz], (n,).
        amplitude: zero-to-peak amplitude [m or rad], (n,).
        names: names of k parameters.
        kind: kind of test, "loop" or "sweep".
        conditions: temperature and history of the rubber at the points.

    Returns:
        Complex stiffness [N/m or N m/rad], (n,), and its derivatives per SI unit of each parameter, (k, n).

    >>> axial = paper.setting("axial").direction
    >>> _, slopes = stiffness_and_slopes(paper, axial, np.array([5.0]), np.array([1e-4]), ["mu"])
    >>> slopes.round(4)
    array([[0.3634+0.j]])
    """
    values, steps = stepped_values(model, direction, names)
    responses = model.stiffness(direction, frequency, amplitude, kind=kind, values=values, conditions=conditions)
    return difference_quotients(responses, steps)


def force_and_slopes(
    model: Model, direction: Place, displacement: History, names: Sequence[str], conditions: RubberConditions = UNKNOWN
) -> tuple[Array, Array]:
    """Force of a loop over time and its derivatives by parameters, for the Jacobian of a fit.

    Args:
        model: model; the derivatives are taken at its parameter values.
        direction: direction or specimen.
        displacement: displacement history [m or rad] of n samples.
        names: names of k parameters.
        conditions: temperature and history of the rubber in the test.

    Returns:
        Force [N or N m], (n,), and its derivatives per SI unit of each parameter, (k, n).
    """
    values, steps = stepped_values(model, direction, names)
    responses = model.force(direction, displacement, kind="loop", values=values, conditions=conditions)
    return difference_quotients(responses, steps)


def stepped_values(model: Model, place: Place, names: Sequence[str]) -> tuple[dict[str, Value], Array]:
    """Parameter values for one-sided differences: each row has a step in one parameter, the last row has no step.

    Args:
        model: model, whose values are stepped within their bounds.
        place: direction or specimen of the response. Parameters of others, such as `stiffness_factor.radial` in axial
            tests, do not change it: they have no row.
        names: names of k parameters.

    Returns:
        Values by name, those of r parameters as arrays (r + 1, 1); and the step of each parameter [SI], (k,), 0 for
        parameters without a row.
    """
    varied = [name for name in names if place_suffix(name) in (None, *place.labels)]
    values, steps = dict[str, Value](model.values), np.zeros(len(names))
    for row, name in enumerate(varied):
        parameter, value = model.parameters[name], model.values[name]
        step = _RELATIVE_STEP * (abs(value) if parameter.log and value else parameter.typical)
        column = np.full((len(varied) + 1, 1), value)
        column[row] += step if value + step <= parameter.bounds[1] else -step
        values[name], steps[names.index(name)] = column, column[row, 0] - value
    return values, steps


def difference_quotients(responses: Array, steps: Array) -> tuple[Array, Array]:
    """Response of a model and its derivatives, from its responses for the values by `stepped_values`.

    Args:
        responses: responses for r stepped parameters, and then without a step, (r + 1, n), or (n,) if all are equal.
        steps: step of each of k parameters [SI], 0 for those without a row, (k,).

    Returns:
        Response without a step, (n,), and its derivatives per SI unit of each parameter, (k, n).
    """
    has_row = steps != 0.0
    responses = np.broadcast_to(responses, (int(has_row.sum()) + 1, responses.shape[-1]))
    slopes = np.zeros((steps.size, responses.shape[-1]), dtype=responses.dtype)
    slopes[has_row] = (responses[:-1] - responses[-1]) / steps[has_row, None]
    return responses[-1], slopes
