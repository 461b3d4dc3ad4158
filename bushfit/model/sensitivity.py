"""Derivatives of a model's response with respect to its parameters.

In a model of branches alone the derivatives of the branches add up: the paper's three branches have analytic
derivatives, the others finite differences. With modifiers or layers, the derivatives are finite differences of the
whole response, computed in one call with the parameter values along a leading axis. The differences are one-sided,
which halves the cost of central differences; their relative error of 1e-6 is small enough for a fit.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import cast

import numpy as np

from bushfit.effects import Branch, place_suffix, qualified_name
from bushfit.effects.contract import UNKNOWN, Array, RubberConditions, Value, Values
from bushfit.effects.history import History
from bushfit.geometry import Place, Specimen
from bushfit.model.model import Kind, Model
from bushfit.model.structure import values_for_effect

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
    if not model.only_branches:
        respond = partial(model.stiffness, direction, frequency, amplitude, kind=kind, conditions=conditions)
        return differences(model, names, lambda values: respond(values=values), direction)
    test = 2.0 * np.pi * frequency, amplitude * model.unit_strain(direction)
    modulus, slopes = np.zeros(frequency.size), np.zeros((len(names), frequency.size), dtype=complex)
    for branch in model.structure.branches:
        modulus = modulus + branch.modulus(values_for_effect(branch, model.values), *test)
        _add_slopes(slopes, model, names, branch, branch.modulus, branch.modulus_sensitivities, test)
    factor = model.stiffness_per_modulus(direction)
    return factor * modulus, factor * slopes


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
    respond = partial(model.force, direction, displacement, kind="loop", conditions=conditions)
    if not model.only_branches:
        return differences(model, names, lambda values: respond(values=values), direction)
    return respond(), force_slopes_of_branches(model, direction, displacement, names)


def force_slopes_of_branches(model: Model, direction: Place, displacement: History, names: Sequence[str]) -> Array:
    """Derivatives of the force with respect to parameters, for a model that consists of branches alone.

    Args:
        model: model without modifiers and layers.
        direction: direction or specimen.
        displacement: displacement history [m or rad] of n samples.
        names: names of k parameters.

    Returns:
        Derivatives per SI unit of each parameter, (k, n).
    """
    per_displacement = model.unit_strain(direction)
    slopes, test = np.zeros((len(names), displacement.value.shape[-1])), (displacement.scaled(per_displacement),)
    for branch in model.structure.branches:
        _add_slopes(slopes, model, names, branch, branch.stress, branch.stress_sensitivities, test)
    return model.stiffness_per_modulus(direction) / (2.0 * per_displacement) * slopes


def _add_slopes(
    slopes: Array,
    model: Model,
    names: Sequence[str],
    branch: Branch,
    respond: Callable[..., Array],
    sensitivities: Callable[..., dict[str, Array]] | None,
    test: tuple[object, ...],
) -> None:
    """Add the derivatives of a branch's response with respect to the named parameters to those of the whole response.

    Args:
        slopes: derivatives with respect to each parameter, changed in place, (len(names), n).
        model: model; the derivatives are taken at its parameter values.
        names: names of the parameters.
        branch: effect that adds a stress.
        respond: function of the parameter values and `test` that returns the branch's response, (n,).
        sensitivities: function that returns the derivatives by parameter name; None for numerical derivatives.
        test: further arguments of both functions.
    """
    row = {name: i for i, name in enumerate(names)}
    qualified = {parameter.name: qualified_name(branch, parameter) for parameter in branch.parameters}
    varied = [name for name in (*qualified.values(), *branch.uses) if name in row]
    if varied and sensitivities:
        analytic = sensitivities(values_for_effect(branch, model.values), *test)
        for short, name in qualified.items():
            if name in row:
                slopes[row[name]] += analytic[short]
    elif varied:
        by_value = differences(model, varied, lambda values: respond(values_for_effect(branch, values), *test))[1]
        slopes[[row[name] for name in varied]] += by_value


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
