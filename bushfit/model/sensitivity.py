"""Derivatives of a model's response with respect to its parameters, by differences.

The response is computed once, with the parameter values along a leading axis: one row for each parameter with a small
step, and one without. The differences are one-sided, which halves the cost of central differences; their relative error
of 1e-6 is small enough for a fit.
"""

from collections.abc import Sequence
from typing import cast

import numpy as np

from bushfit.effects import place_suffix
from bushfit.effects.contract import UNKNOWN, Array, RubberConditions, Values
from bushfit.effects.history import History
from bushfit.geometry import Place, Specimen
from bushfit.model.model import Model

#: Step of the differences, relative to the value (log parameters) or to the typical distance (linear parameters);
#: chosen: the differences are good to about a millionth.
_RELATIVE_STEP = 1e-6


def stiffness_and_slopes(
    model: Model,
    direction: Place,
    frequency: Array,
    amplitude: Array,
    names: Sequence[str],
    conditions: RubberConditions = UNKNOWN,
) -> tuple[Array, Array]:
    """Complex dynamic stiffness of a model in a sweep and its derivatives with respect to parameters.

    Args:
        model: model; the derivatives are taken at its parameter values.
        direction: direction or specimen.
        frequency: frequency [Hz], (n,).
        amplitude: zero-to-peak amplitude [m or rad], (n,).
        names: names of k parameters.
        conditions: temperature and history of the rubber at the points.

    Returns:
        Complex stiffness [N/m or N m/rad], (n,), and its derivatives per SI unit of each parameter, (k, n).

    >>> axial = paper.setting("axial").direction
    >>> _, slopes = stiffness_and_slopes(paper, axial, np.array([5.0]), np.array([1e-4]), ["mu"])
    >>> slopes.round(4)
    array([[0.3634+0.j]])
    """
    values, steps = stepped_values(model, names, direction)
    stack = model.stack(direction, "sweep", conditions, values)
    return difference_quotients(stack(2.0 * np.pi * frequency, amplitude), steps)


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
    values, steps = stepped_values(model, names, direction)
    stack = model.stack(direction, "loop", conditions, values)
    return difference_quotients(stack.force(displacement), steps)


def stepped_values(model: Model, names: Sequence[str], place: Place) -> tuple[Values, Array]:
    """Parameter values along a leading axis: one row for each parameter with a step, and a last row without.

    Args:
        model: model; the last row has its parameter values.
        names: names of k parameters.
        place: direction or specimen; parameters of other directions, such as `stiffness_factor.radial`, have no row,
            because their derivatives are 0.

    Returns:
        Values by name, numbers or (rows + 1, 1); and the step of each of the k parameters inside its bounds, or 0 for a
        parameter without a row, (k, 1).
    """
    labels = (None, *(place.labels if isinstance(place, Specimen) else (str(place),)))
    local = [index for index, name in enumerate(names) if place_suffix(name) in labels]
    parameters = [(model.parameters[names[index]], model.values[names[index]]) for index in local]
    scales = [abs(value) if parameter.log and value else parameter.typical for parameter, value in parameters]
    values, step = np.array([value for _, value in parameters]), _RELATIVE_STEP * np.array(scales)
    step = np.where(values + step <= [parameter.bounds[1] for parameter, _ in parameters], step, -step)
    columns, steps = np.tile(values, (len(local) + 1, 1)), np.zeros((len(names), 1))
    columns[:-1] += np.diag(step)
    steps[local, 0] = np.diag(columns) - values
    stacked = {names[index]: columns[:, row, None] for row, index in enumerate(local)}
    return cast(Values, {**model.values, **stacked}), steps


def difference_quotients(responses: Array, steps: Array) -> tuple[Array, Array]:
    """Response of a model, (n,), and its derivatives by k parameters, (k, n), from the result of `stepped_values`.

    Args:
        responses: responses for the stepped values, (rows + 1, n), or (n,) if no value is stepped or has an effect.
        steps: step of each parameter, 0 for those without a row, (k, 1).
    """
    stepped = steps[:, 0] != 0.0
    rows, slopes = int(np.count_nonzero(stepped)), np.zeros((len(steps), responses.shape[-1]), dtype=responses.dtype)
    responses = np.broadcast_to(responses, (rows + 1, responses.shape[-1]))
    slopes[stepped] = (responses[:rows] - responses[rows]) / steps[stepped]
    return responses[rows], slopes
