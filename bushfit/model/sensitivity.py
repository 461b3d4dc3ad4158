"""Derivatives of a model's response with respect to its parameters.

In a model of branches alone the derivatives add up: the paper's three branches bring analytic ones, the others are
differenced one by one. Modifiers and layers mix everything, so with them the whole response is differenced, all
parameters in one call, with the values along a leading axis. The differences are one-sided: half the price of central
ones, and good to a millionth, which is more than the steps and errors of a fit need.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import cast

import numpy as np

from bushfit.effects import Branch, Parameter, place_suffix, qualified_name
from bushfit.effects.contract import UNKNOWN, Array, Circumstances, Value, Values
from bushfit.effects.history import History
from bushfit.geometry import Place
from bushfit.model.model import Kind, Model
from bushfit.model.structure import seen_by

#: Step of the differences, relative to the value (log parameters) or to the typical size (linear ones);
#: chosen: the differences are good to about a millionth.
_RELATIVE_STEP = 1e-6

#: Gives the response of a branch by values and test, and its analytic derivatives by its parameters' short names; None
#: in their place where it has none.
Face = Callable[[Branch], tuple[Callable[..., Array], Callable[..., dict[str, Array]] | None]]


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
    respond = partial(model.stiffness, direction, frequency, amplitude, kind=kind, under=under)
    if not model.only_branches:
        return _differences_at(direction, model, names, lambda values: respond(values=values))
    omega = 2.0 * np.pi * frequency
    strain = amplitude * model.unit_strain(direction)
    total = np.zeros((len(names), frequency.size), dtype=complex)
    _add(total, model, names, lambda branch: (branch.modulus, branch.modulus_sensitivities), (omega, strain))
    return respond(), model.stiffness_per_modulus(direction) * total


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
    respond = partial(model.force, direction, displacement, kind="loop", under=under)
    if not model.only_branches:
        return _differences_at(direction, model, names, lambda values: respond(values=values))
    per_displacement = model.unit_strain(direction)
    test = (displacement.scaled(per_displacement),)
    total = np.zeros((len(names), displacement.value.shape[-1]))
    _add(total, model, names, lambda branch: (branch.stress, branch.stress_sensitivities), test)
    return respond(), model.stiffness_per_modulus(direction) / (2.0 * per_displacement) * total


def _add(total: Array, model: Model, names: Sequence[str], face: Face, test: tuple[object, ...]) -> None:
    """Add the derivatives of all branches by parameters to `total`, (len(names), n); `test` follows the values."""

    def response(branch: Branch, values: Values) -> Array:
        return face(branch)[0](seen_by(branch, values), *test)

    row = {name: i for i, name in enumerate(names)}
    for branch in model.records:
        assert isinstance(branch, Branch)
        qualified = {parameter.name: qualified_name(branch, parameter) for parameter in branch.parameters}
        varied = [name for name in (*qualified.values(), *branch.uses) if name in row]
        if not varied:
            continue
        if sensitivities := face(branch)[1]:
            analytic = sensitivities(seen_by(branch, model.values), *test)
            slopes = {name: analytic[short] for short, name in qualified.items() if name in row}
        else:
            slopes = dict(zip(varied, differences(model, varied, partial(response, branch))[1], strict=True))
        for name, slope in slopes.items():
            total[row[name]] += slope


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
        column = np.full((count + 1, 1), model.values[name])
        column[i] += _step(model.parameters[name], model.values[name])
        stacked[name], steps[i] = column, column[i] - model.values[name]
    responses = respond(cast(Values, stacked))
    responses = np.broadcast_to(responses, (count + 1, responses.shape[-1]))
    return responses[count], (responses[:count] - responses[count]) / steps


def _step(parameter: Parameter, value: float) -> float:
    """Step of a difference [unit of the parameter], downward where a step up would leave the bounds."""
    step = _RELATIVE_STEP * (abs(value) if parameter.log and value else parameter.typical)
    return step if value + step <= parameter.bounds[1] else -step
