"""Derivatives of a model's response with respect to its parameters.

In a model of branches alone the derivatives add up: the paper's three branches bring analytic ones, the others are
differenced one by one. Modifiers and layers mix everything, so with them the whole response is differenced, all
parameters in one call, with the values along a leading axis. The differences are one-sided: half the price of central
ones, and good to a millionth, which is more than the steps and errors of a fit need.
"""

from collections.abc import Callable, Sequence
from typing import cast

import numpy as np

from bushfit.effects import Branch, place_suffix, qualified_name
from bushfit.effects.contract import UNKNOWN, Array, Circumstances, Value, Values
from bushfit.effects.history import History
from bushfit.geometry import Place
from bushfit.model.model import Kind, Model
from bushfit.model.structure import seen_by

#: Step of the differences, relative to the value (log parameters) or to the typical size (linear ones);
#: chosen: the differences are good to about a millionth.
_RELATIVE_STEP = 1e-6


def stiffness_and_slopes(
    model: Model,
    direction: Place,
    frequency: Array,
    amplitude: Array,
    names: Sequence[str],
    kind: Kind = "sweep",
    under: Circumstances = UNKNOWN,
) -> tuple[Array, Array]:
    """The complex dynamic stiffness, (n,) [N/m or N m/rad], and its derivatives by parameters, (k, n) [per unit].

    Frequencies are in Hz, amplitudes zero-to-peak in m or rad, (n,) each.

    Args:
        model: model at whose values the derivatives are taken.
        direction: direction or specimen.
        frequency: [Hz], (n,).
        amplitude: zero-to-peak [m or rad], (n,).
        names: k parameters.
        kind: of test, "loop" or "sweep".
        under: circumstances of the points.

    Returns:
        Stiffness, complex (n,), and derivatives, complex (k, n).

    >>> _, slopes = stiffness_and_slopes(paper, "axial", np.array([5.0]), np.array([1e-4]), ["mu"])
    >>> slopes.round(4)
    array([[0.3634+0.j]])
    """
    if not model.only_branches:
        return _differences_at(
            direction,
            model,
            names,
            lambda values: model.stiffness(direction, frequency, amplitude, kind=kind, values=values, under=under),
        )
    test = 2.0 * np.pi * frequency, amplitude * model.unit_strain(direction)
    modulus, slopes = np.zeros(frequency.size), np.zeros((len(names), frequency.size), dtype=complex)
    for branch in model.structure.branches:
        modulus = modulus + branch.modulus(seen_by(branch, model.values), *test)
        _add_slopes(slopes, model, names, branch, branch.modulus, branch.modulus_sensitivities, test)
    factor = model.stiffness_per_modulus(direction)
    return factor * modulus, factor * slopes


def force_and_slopes(
    model: Model, direction: Place, displacement: History, names: Sequence[str], under: Circumstances = UNKNOWN
) -> tuple[Array, Array]:
    """The force of a loop along a history of displacement, (n,) [N or N m], and its derivatives by parameters, (k, n)
    [per unit].

    Args:
        model: model at whose values the derivatives are taken.
        direction: direction or specimen.
        displacement: history [m or rad] of n samples.
        names: k parameters.
        under: circumstances of the test.

    Returns:
        Force, (n,), and derivatives, (k, n).
    """
    if not model.only_branches:
        return _differences_at(
            direction,
            model,
            names,
            lambda values: model.force(direction, displacement, kind="loop", values=values, under=under),
        )
    per_displacement = model.unit_strain(direction)
    slopes, test = np.zeros((len(names), displacement.value.shape[-1])), (displacement.scaled(per_displacement),)
    for branch in model.structure.branches:
        _add_slopes(slopes, model, names, branch, branch.stress, branch.stress_sensitivities, test)
    force = model.force(direction, displacement, kind="loop", under=under)
    return force, model.stiffness_per_modulus(direction) / (2.0 * per_displacement) * slopes


def _add_slopes(
    slopes: Array,
    model: Model,
    names: Sequence[str],
    branch: Branch,
    respond: Callable[..., Array],
    sensitivities: Callable[..., dict[str, Array]] | None,
    test: tuple[object, ...],
) -> None:
    """Add the derivatives of a branch by parameters to `slopes`, (len(names), n).

    The response and its analytic derivatives, if the branch has them, take the values and the test.
    """
    row = {name: i for i, name in enumerate(names)}
    qualified = {parameter.name: qualified_name(branch, parameter) for parameter in branch.parameters}
    varied = [name for name in (*qualified.values(), *branch.uses) if name in row]
    if varied and sensitivities:
        analytic = sensitivities(seen_by(branch, model.values), *test)
        for short, name in qualified.items():
            if name in row:
                slopes[row[name]] += analytic[short]
    elif varied:
        by_value = differences(model, varied, lambda values: respond(seen_by(branch, values), *test))[1]
        slopes[[row[name] for name in varied]] += by_value


def _differences_at(
    place: Place, model: Model, names: Sequence[str], respond: Callable[[Values], Array]
) -> tuple[Array, Array]:
    """Call `differences` for the parameters of this direction; the derivatives by the others are 0."""
    local = [i for i, name in enumerate(names) if place_suffix(name) in (None, str(place))]
    response, local_slopes = differences(model, [names[i] for i in local], respond)
    slopes = np.zeros((len(names), response.size), dtype=response.dtype)
    slopes[local] = local_slopes
    return response, slopes


def differences(model: Model, names: Sequence[str], respond: Callable[[Values], Array]) -> tuple[Array, Array]:
    """Any response, (n,), and its derivatives by parameters, as one-sided differences away from the bounds, (k, n).

    `respond` gives the response, (..., n), for values with leading axes; it is called once.

    Args:
        model: model at whose values the derivatives are taken.
        names: k parameters.
        respond: function of values with leading axes.

    Returns:
        Response, (n,), and derivatives, (k, n).
    """
    count = len(names)
    stacked: dict[str, Value] = dict(model.values)
    steps = np.empty((count, 1))
    for i, name in enumerate(names):
        parameter, value = model.parameters[name], model.values[name]
        step = _RELATIVE_STEP * (abs(value) if parameter.log and value else parameter.typical)
        column = np.full((count + 1, 1), value)
        column[i] += step if value + step <= parameter.bounds[1] else -step
        stacked[name], steps[i] = column, column[i] - value
    responses = respond(cast(Values, stacked))
    responses = np.broadcast_to(responses, (count + 1, responses.shape[-1]))
    return responses[count], (responses[:count] - responses[count]) / steps
