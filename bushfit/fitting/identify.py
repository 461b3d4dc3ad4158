"""Sentences on parameters that the tests do not determine: the reasons, and combinations that are determined.

A direction is an eigenvector of the Fisher information, with parameters scaled by their size: a combination of relative
changes. Its standard error is one over the root of the eigenvalue. If that error is above 15 %, the tests do not
determine the combination: the direction and the parameters that it changes are called open.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from bushfit.caveat import Caveat
from bushfit.effects import effect_name_of
from bushfit.effects.contract import Array
from bushfit.fitting.assess import measured_range
from bushfit.fitting.coordinates import Coordinates, coordinate_per_relative_change
from bushfit.fitting.preparation import MeasuredTest, split_by_kind
from bushfit.fitting.problem import FitProblem
from bushfit.model.covariance import Z95, Covariance
from bushfit.model.model import Model
from bushfit.units import format_range

#: Relative standard error beyond which a direction is open, and a parameter not determined.
_OPEN = 0.15
#: Share of the worst error from which on a parameter is open with it, however well it is known.
_PARTNER = 0.3
#: Ratio of the largest frequency, or strain, to the smallest up to which the tests have only one.
_ONE = 1.05
#: Ratio of the largest frequency to the smallest up to which the slope over frequency is poorly determined.
_NARROW_BAND = 5.0
#: Ratio of the largest strain to the smallest up to which friction is poorly determined.
_NARROW_STRAIN = 2.0
#: Relative standard error below which a combination is known.
_KNOWN = 0.1
#: Error of a combination over the smallest error of its parts, up to which the combination is reported.
_BETTER = 0.34
#: Relative standard error beyond which only "beyond 1000 %" is printed.
_BEYOND = 10.0
#: Relative step of a parameter into the complex plane: a derivative so taken is exact to rounding.
_COMPLEX_STEP = 1e-30
_FRICTION = ("sigma_fmax", "eps_half")
_SPRINGPOT = ("m", "alpha")


class _Combination(NamedTuple):
    """Modulus computed from several parameters, which tests may determine even if they do not determine each parameter.

    Args:
        formula: formula in the names of the model's parameters.
        value: function from parameter values by name, with omega [rad/s], to the modulus [Pa]; accepts complex values.
        names: names of the parameters in the formula.
        open_with: names of parameters; the modulus is reported if one of them is not determined. Empty for `names`.
        remark: meaning of the modulus.
    """

    formula: str
    value: Callable[[Mapping[str, Any]], Any]
    names: tuple[str, ...]
    open_with: tuple[str, ...] = ()


_COMBINATIONS = (
    _Combination("sigma_fmax/eps_half", lambda p: p["sigma_fmax"] / p["eps_half"], _FRICTION),
    _Combination("modulus at small amplitude", lambda p: p["mu"] + p["sigma_fmax"] / p["eps_half"], ("mu", *_FRICTION)),
    _Combination("modulus of the springpot", lambda p: p["m"] * p["omega"] ** p["alpha"], _SPRINGPOT),
    _Combination(
        "loss modulus of the springpot",
        lambda p: 0.5 * p["m"] * p["omega"] ** p["alpha"] * np.sin(np.pi * p["alpha"] / 2.0),
        _SPRINGPOT,
    ),
    _Combination(
        "storage modulus without friction",
        lambda p: p["mu"] + 0.5 * p["m"] * p["omega"] ** p["alpha"] * np.cos(np.pi * p["alpha"] / 2.0),
        ("mu", *_SPRINGPOT),
        open_with=_SPRINGPOT,
    ),
)


def undetermined_parameters(
    model: Model, data_sets: Sequence[MeasuredTest], names: Sequence[str], covariance: Covariance
) -> list[Caveat]:
    """Warnings about parameters of a fitted model that the tests do not determine; none if all are determined.

    There is one sentence, with standard errors, for each group of parameters whose errors are correlated.

    Args:
        model: fitted model.
        data_sets: tests.
        names: names of the fitted parameters.
        covariance: covariance of the fitted parameters.

    Returns:
        Warnings; empty if the tests determine every parameter.
    """
    if not names:
        return []
    _, slopes = FitProblem(model, data_sets, names).linearise(model)
    slopes = slopes[:, : sum(test.size for test in data_sets)] * coordinate_per_relative_change(model, names)[:, None]
    (rows, groups), lines = _open_groups(names, slopes), list[Caveat]()
    changes = np.abs(
        Coordinates.of_parameters(model, names).slopes(model.values) * coordinate_per_relative_change(model, names)
    )
    stderr = {name: covariance.stderr(name) or 0.0 for name in names}
    errors = {name: stderr[name] / float(change) for name, change in zip(names, changes, strict=True)}
    # neutral values of amounts of added effects, and the amounts that do not differ from them significantly
    neutral = {name: value for name in names if (value := model.parameters[name].neutral) is not None}
    idle = {name for name in neutral if "." in name and abs(model.values[name] - neutral[name]) < Z95 * stderr[name]}
    if zero := [name for group in groups for name in group if name in idle]:
        unseen = {effect_name_of(name) for name in zero} - {*map(effect_name_of, neutral.keys() - idle)}
        for name in zero:
            effect = effect_name_of(name)
            remark = f": these tests do not show {effect}" * (effect in unseen)
            lines.append(Caveat("no_difference", f"{name} is {neutral[name]:g} within its error{remark}"))
        visible = [i for i, name in enumerate(names) if name not in zero and effect_name_of(name) not in unseen]
        if not visible:
            return lines
        rows, groups = _open_groups([names[i] for i in visible], slopes[visible])
    if not groups:
        return []
    combinations = dict[str, None]()
    for group in groups:
        listed = ", ".join(f"{name} {_percent(errors[name])}" for name in group)
        reasons = "; ".join(_reasons(model, data_sets, group)) or "a limit of these tests"
        meaning = f"{', '.join(group[:-1])} and {group[-1]} cannot be determined separately"
        if set(group) == set(_FRICTION) and np.linalg.norm(rows["sigma_fmax"] - rows["eps_half"]) < _KNOWN:
            meaning = "sigma_fmax and eps_half are determined only as a ratio"
        elif len(group) == 1:
            meaning = f"{group[0]} is not determined"
        lines.append(Caveat("undetermined", f"{reasons}: {meaning} (standard errors: {listed})"))
        combinations |= dict.fromkeys(_known_combinations(model, data_sets, rows, group))
    if combinations:
        sentence = "combinations that the tests determine: " + "; ".join(combinations)
        lines.append(Caveat("known_combinations", sentence))
    # `plan` assumes that the model is correct, so it is not recommended if the model misses the tests
    missed = any(data_set.model_error for data_set in data_sets)
    advice = Caveat("determined_by_plan", "bushfit plan chooses further tests that determine these parameters")
    return lines if missed else [*lines, advice]


def _percent(error: float) -> str:
    """Format a relative standard error as text, such as "2.5 %" for 0.025."""
    return f"{float(f'{100.0 * error:.2g}'):g} %" if error < _BEYOND else "beyond 1000 %"


def _open_groups(names: Sequence[str], slopes: Array) -> tuple[dict[str, Array], list[list[str]]]:
    """Independent errors of the parameters, and groups of the parameters that the tests do not determine.

    The independent errors are the eigenvectors of the covariance, times the standard error of each. Those above 15 %
    are open. The parameters of one open error, and of all open errors that have a parameter in common with it, form a
    group.

    Args:
        names: names of the k parameters.
        slopes: derivatives of the n whitened residuals with respect to relative changes of the parameters, (k, n).

    Returns:
        By name, the relative change of a parameter due to each of the k independent errors, (k,); the sum of its
        squares is the variance of the parameter. And the names of the parameters in each group.
    """
    values, vectors = np.linalg.eigh(slopes @ slopes.T)
    directions = vectors / np.sqrt(np.maximum(values, np.finfo(float).eps * values.max()))
    groups: list[set[str]] = []
    for parts in np.abs(directions.T[np.linalg.norm(directions, axis=0) > _OPEN]):
        threshold = min(_OPEN, _PARTNER * float(parts.max()))
        group = {name for name, part in zip(names, parts, strict=True) if part > threshold}
        for overlapping in [overlapping for overlapping in groups if overlapping & group]:
            groups.remove(overlapping)
            group |= overlapping
        groups.append(group)
    return dict(zip(names, directions, strict=True)), [[name for name in names if name in group] for group in groups]


def _reasons(model: Model, data_sets: Sequence[MeasuredTest], involved: Sequence[str]) -> Iterator[str]:
    """Yield reasons why tests do not determine some parameters, such as missing frequencies, amplitudes or loops.

    Args:
        model: fitted model.
        data_sets: tests of the campaign.
        involved: names of the parameters that are not determined.
    """
    reach = measured_range(model, data_sets)
    (slow, fast), (small, large) = reach.frequency, reach.strain
    loops, _ = split_by_kind(data_sets)
    if set(involved) & set(_FRICTION) and "eps_half" in model.values:
        first, last = (strain / model.values["eps_half"] for strain in (small, large))
        if last < 1.0:
            yield f"amplitudes stop at {last:.2g} of eps_half"
        elif large < _ONE * small:
            yield "one amplitude"
        elif large < _NARROW_STRAIN * small:
            yield f"amplitudes span only {first:.2g} to {last:.2g} of eps_half"
        elif small > model.values["eps_half"]:
            yield f"amplitudes begin at {first:.2g} of eps_half"
    if set(involved) & {"mu", *_SPRINGPOT} and "alpha" in model.values:
        if fast < _ONE * slow:
            yield f"one {'loop rate' if len(loops) == len(data_sets) else 'frequency'}, {slow:.3g} Hz"
        elif fast < _NARROW_BAND * slow:
            yield f"frequencies span only {slow:.3g} to {fast:.3g} Hz"
    if not loops and set(involved) & {*_FRICTION, "mu"}:
        yield "there is no loop"


def _known_combinations(
    model: Model, data_sets: Sequence[MeasuredTest], rows: Mapping[str, Array], involved: Sequence[str]
) -> Iterator[str]:
    """Yield texts (formula, value, relative standard error) on moduli that are known better than their parameters.

    Args:
        model: fitted model.
        data_sets: tests of the campaign.
        rows: relative change of each parameter due to each of the k independent errors, by parameter name, (k,) each.
        involved: names of the parameters in these moduli that the tests do not determine.
    """
    enough = min(_KNOWN, _BETTER * min(float(np.linalg.norm(rows[name])) for name in involved))
    slow = measured_range(model, data_sets).frequency[0]
    values = {**model.values, "omega": 2.0 * np.pi * slow}
    for formula, function, names, open_with in _COMBINATIONS:
        if not (set(names) <= rows.keys() and set(open_with or names) & set(involved)):
            continue
        modulus = function(values)
        change = np.zeros(len(rows))
        for name in names:
            stepped = function({**values, name: values[name] * (1.0 + 1j * _COMPLEX_STEP)})
            change += stepped.imag / _COMPLEX_STEP / modulus * rows[name]
        if (error := float(np.linalg.norm(change))) < enough:
            condition = f" at {slow:.3g} Hz" if "alpha" in names else ""
            yield f"{formula}{condition} = {format_range('Pa', modulus, digits=4)} (standard error {_percent(error)})"
