"""Derivatives of a model's response with respect to its parameters, by differences.

The response is computed once, with the parameter values along a leading axis: one row for each parameter with a small
step, and one without. The differences are one-sided, which halves the cost of central differences; their relative error
of 1e-6 is small enough for a fit.
"""

from collections.abc import Callable, Sequence
from typing import cast

import numpy as np

from bushfit.effects import place_suffix
from bushfit.effects.contract import UNKNOWN, Array, RubberConditions, Value, Values
from bushfit.effects.history import History
from bushfit.geometry import Place, Specimen
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
    """Complex dynamic stiffness of a model and its derivatives with respect to parameters, for the Jacobian of a fit.

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

    def respond(values: Values) -> Array:
        return model.stiffness(direction, frequency, amplitude, kind=kind, values=values, conditions=conditions)

    return differences(model, names, respond, direction)


def force_and_slopes(
    model: Model, direction: Place, displacement: History, names: Sequence[str], conditions: RubberConditions = UNKNOWN
) -> tuple[Array, Array]:
    """Force of a loop over time and its derivatives with respect to parameters, for the Jacobian of a fit.

    Args:
        model: model; the derivatives are taken at its parameter values.
        direction: direction or specimen.
        displacement: displacement history [m or rad] of n samples.
        names: names of k parameters.
        conditions: temperature and history of the rubber in the test.

    Returns:
        Force [N or N m], (n,), and its derivatives per SI unit of each parameter, (k, n).
    """

    def respond(values: Values) -> Array:
        return model.force(direction, displacement, kind="loop", values=values, conditions=conditions)

    return differences(model, names, respond, direction)


def differences(
    model: Model, names: Sequence[str], respond: Callable[[Values], Array], place: Place | None = None
) -> tuple[Array, Array]:
    """Response of a model and its derivatives with respect to parameters, by one-sided differences inside the bounds.

    Args:
        model: model; the derivatives are taken at its parameter values.
        names: names of k parameters.
        respond: function from parameter values to the response, (..., n), called once; the values are numbers, or
            arrays with one more entry than there are derivatives to compute.
        place: direction or specimen of the response; derivatives with respect to parameters of other directions, such
            as `stiffness_factor.radial`, are 0 and are not computed. None to compute all.

    Returns:
        Response, (n,), and its derivatives per SI unit of each parameter, (k, n).
    """
    labels = place.labels if isinstance(place, Specimen) else (str(place),)
    local = [i for i, name in enumerate(names) if place is None or place_suffix(name) in (None, *labels)]
    count, stacked = len(local), dict[str, Value](model.values)
    steps = np.empty((count, 1))
    for row, name in enumerate(names[i] for i in local):
        parameter, value = model.parameters[name], model.values[name]
        step = _RELATIVE_STEP * (abs(value) if parameter.log and value else parameter.typical)
        column = np.full((count + 1, 1), value)
        column[row] += step if value + step <= parameter.bounds[1] else -step
        stacked[name], steps[row] = column, column[row] - value
    responses = respond(cast(Values, stacked))
    responses = np.broadcast_to(responses, (count + 1, responses.shape[-1]))
    slopes = np.zeros((len(names), responses.shape[-1]), dtype=responses.dtype)
    slopes[local] = (responses[:count] - responses[count]) / steps
    return responses[count], slopes
