"""Sentences on parameters that the tests do not determine: the reason, known combinations, and the best further test.

A direction is an eigenvector of the Fisher information, with parameters scaled by their size: a combination of relative
changes. Its standard error is one over the root of the eigenvalue. A direction is open, and so are the parameters that
it changes, if that error is above 15 %: the tests do not determine the combination.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from bushfit.effects import effect_name_of
from bushfit.fitting.assess import measured_range
from bushfit.fitting.coordinates import Coordinates
from bushfit.fitting.information import FisherInformation, further_test, percent, relative_sizes
from bushfit.fitting.preparation import MeasuredTest, split_by_kind
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
#: Relative step of a parameter into the complex plane: a derivative so taken is exact to rounding.
_COMPLEX_STEP = 1e-30
_FRICTION = ("sigma_fmax", "eps_half")
_SPRINGPOT = ("m", "alpha")


class _Combination(NamedTuple):
    """Combination of parameters, a modulus, that tests may determine even if they do not determine each parameter.

    Args:
        formula: formula in the names of the model's parameters.
        value: function from parameter values by name, with omega [rad/s], to the modulus [Pa]; accepts complex values.
        names: names of the parameters in the formula.
        open_with: names of parameters; the combination is reported if one is not determined. Empty: those in `names`.
        remark: meaning of the modulus.
    """

    formula: str
    value: Callable[[Mapping[str, Any]], Any]
    names: tuple[str, ...]
    open_with: tuple[str, ...] = ()
    remark: str = ""


_COMBINATIONS = (
    _Combination("sigma_fmax/eps_half", lambda p: p["sigma_fmax"] / p["eps_half"], _FRICTION),
    _Combination(
        "mu + sigma_fmax/eps_half",
        lambda p: p["mu"] + p["sigma_fmax"] / p["eps_half"],
        ("mu", *_FRICTION),
        remark=" (the friction of small amplitudes)",
    ),
    _Combination("m omega^alpha", lambda p: p["m"] * p["omega"] ** p["alpha"], _SPRINGPOT),
    _Combination(
        "m/2 omega^alpha sin(pi alpha/2)",
        lambda p: 0.5 * p["m"] * p["omega"] ** p["alpha"] * np.sin(np.pi * p["alpha"] / 2.0),
        _SPRINGPOT,
    ),
    _Combination(
        "mu + m/2 omega^alpha cos(pi alpha/2)",
        lambda p: p["mu"] + 0.5 * p["m"] * p["omega"] ** p["alpha"] * np.cos(np.pi * p["alpha"] / 2.0),
        ("mu", *_SPRINGPOT),
        open_with=_SPRINGPOT,
    ),
)


def undetermined_parameters(
    model: Model, data_sets: Sequence[MeasuredTest], names: Sequence[str], covariance: Covariance
) -> list[str]:
    """Warnings about parameters of a fitted model that the tests do not determine; none if all are determined.

    There is one sentence for each group of parameters that share open directions, with their standard errors.

    Args:
        model: fitted model.
        data_sets: tests.
        names: names of the fitted parameters.
        covariance: covariance of the fitted parameters.

    Returns:
        Sentences; empty if the tests determine every parameter.
    """
    if not names:
        return []
    information = FisherInformation.from_tests(model, data_sets, names)
    groups, lines = _groups(information), list[str]()
    changes = np.abs(Coordinates.of_parameters(model, names).slopes(model.values) * relative_sizes(model, names))
    errors = {name: (covariance.stderr(name) or 0.0) / float(c) for name, c in zip(names, changes, strict=True)}

    def is_zero(name: str) -> bool:
        """True if an amount of an added effect, given by name, is within noise of its neutral value."""
        neutral, noise = model.parameters[name].neutral, Z95 * (covariance.stderr(name) or 0.0)
        return "." in name and neutral is not None and abs(model.values[name] - neutral) < noise

    if zero := [name for group in groups for name in group if is_zero(name)]:
        amounts = [name for name in names if model.parameters[name].neutral is not None]
        idle = {effect_name_of(name) for name in zero}
        idle -= {effect_name_of(name) for name in amounts if not is_zero(name)}
        for name in zero:
            effect, neutral = effect_name_of(name), model.parameters[name].neutral
            unseen = f": these tests do not show {effect}" * (effect in idle)
            lines.append(f"{name} does not differ from {neutral:g}{unseen}")
        rest = [name for name in names if name not in zero and effect_name_of(name) not in idle]
        if not rest:
            return lines
        information = FisherInformation.from_tests(model, data_sets, rest)
        groups = _groups(information)
    if not groups:
        return []
    combinations: dict[str, None] = {}
    for group in groups:
        listed = ", ".join(f"{name} {percent(errors[name])}" for name in group)
        reasons = "; ".join(_reasons(model, data_sets, group)) or "these tests do not determine"
        meaning = f"{', '.join(group[:-1])} and {group[-1]} cannot be determined separately"
        if set(group) == set(_FRICTION) and information.error({"sigma_fmax": 1.0, "eps_half": -1.0}) < _KNOWN:
            meaning = "sigma_fmax and eps_half are determined only as a ratio"
        elif len(group) == 1:
            meaning = f"{group[0]} is not determined"
        lines.append(f"{reasons}: {meaning} (standard errors: {listed})")
        combinations |= dict.fromkeys(_known_combinations(model, data_sets, information, group))
    if combinations:
        lines.append("combinations that the tests determine: " + "; ".join(combinations))
    # what another test would tell beside an error of the model depends on what that error is
    missed = any(data_set.model_error for data_set in data_sets)
    return lines if missed else [*lines, *further_test(model, data_sets, information)]


def _groups(information: FisherInformation) -> list[list[str]]:
    """Group the names of the parameters that the tests do not determine.

    An open direction is a combination of parameters with a large standard error. The parameters of one open direction,
    and of all open directions that have a parameter in common with it, form a group.
    """
    errors, vectors = information.directions()
    groups: list[set[str]] = []
    for j in np.flatnonzero(errors > _OPEN):
        parts = np.abs(vectors[:, j]) * errors[j]
        threshold = min(_OPEN, _PARTNER * float(parts.max()))
        group = {name for name, part in zip(information.names, parts, strict=True) if part > threshold}
        for overlapping in [overlapping for overlapping in groups if overlapping & group]:
            groups.remove(overlapping)
            group |= overlapping
        groups.append(group)
    return [[name for name in information.names if name in group] for group in groups]


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
    model: Model, data_sets: Sequence[MeasuredTest], information: FisherInformation, involved: Sequence[str]
) -> Iterator[str]:
    """Yield texts (formula, value, relative standard error) on moduli that are known better than their parameters.

    Args:
        model: fitted model.
        data_sets: tests of the campaign.
        information: Fisher information of the tests on relative changes of the parameters.
        involved: names of the parameters in these moduli that the tests do not determine.
    """
    errors = dict(zip(information.names, information.errors(), strict=True))
    enough = min(_KNOWN, _BETTER * min(float(errors[name]) for name in involved))
    slow = measured_range(model, data_sets).frequency[0]
    values = {**model.values, "omega": 2.0 * np.pi * slow}
    for formula, function, names, open_with, remark in _COMBINATIONS:
        if not (set(names) <= set(information.names) and set(open_with or names) & set(involved)):
            continue
        modulus = function(values)
        stepped = {name: function({**values, name: values[name] * (1.0 + 1j * _COMPLEX_STEP)}) for name in names}
        error = information.error({name: float(x.imag / _COMPLEX_STEP / modulus) for name, x in stepped.items()})
        if error < enough:
            condition = f" at {slow:.3g} Hz" if "omega" in formula else ""
            yield f"{formula}{condition} = {format_range('Pa', modulus, digits=4)} to {percent(error)}{remark}"
