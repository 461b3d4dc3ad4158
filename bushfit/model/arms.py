"""Maxwell arms (spring and dashpot in series) that replace viscoelastic branches in programs for transient simulation.

A springpot depends on the whole past motion, which most programs cannot store. Over a band of frequencies, a few
Maxwell arms have the same modulus within a stated error.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import itemgetter

import numpy as np

from bushfit.effects import Branch, qualified_name
from bushfit.effects.contract import UNKNOWN, Array, RubberConditions, Values
from bushfit.errors import ModelError
from bushfit.geometry import Specimen
from bushfit.model.model import Model
from bushfit.model.structure import values_for_effect
from bushfit.units import number

#: Default of the largest error of the arms, relative to the modulus: that of good tests.
ACCURACY = 0.01
#: Smallest error that may be requested; below it rounding dominates.
LEAST_ACCURACY = 1e-6
#: Maximum number of arms; an error of 0.001 over ten decades needs fewer.
_MOST_ARMS = 30
#: Ratio of errors with and without one more arm, below which the additional arm is an improvement.
_BETTER = 0.95
#: Successive additional arms without improvement after which the search ends.
_PATIENCE = 3
#: Frequencies per decade at which the error is computed: it has one ripple per arm, every half decade.
_PER_DECADE = 30
#: Number of reweighted least-squares fits that reduce the largest error; chosen: more do not help.
_ROUNDS = 25
#: Ratio of the error of a plain fit to the requested error, up to which reweighting is tried: it halves the error.
_WORTHWHILE = 4.0
#: Factor by which relaxation times may lie outside the band; there an arm is a spring or dashpot to seven digits.
_BEYOND = 1e7
#: Distances by which the initial relaxation times extend beyond the band, in ln time; the best depends on the number
#: of arms, so each is tried.
_OVERHANGS = (0.0, 1.0, 2.0)


@dataclass(frozen=True, eq=False)
class Arms:
    """Parallel Maxwell arms (spring and dashpot in series): mu^ = sum_k G_k i w tau_k/(1 + i w tau_k), G_k, tau_k > 0.

    Args:
        modulus: G_k [Pa], contributions to the shear modulus mu^, shortest relaxation time first, (k,).
        time: relaxation times tau_k [s], (k,).
        band: lowest and highest frequency [Hz] of the approximation.
        error: largest relative error of the complex modulus in the band.
        replaced_effects: names of the effects that the arms replace, such as "springpot"; empty for the whole rubber.
        size: name of the model parameter to which all moduli are proportional, as in files and reports; empty for none.
        conditions: temperature of the rubber; unknown for the reference temperature of the model.

    Notes: because all moduli and times are positive, the arms dissipate energy in any motion.
    """

    modulus: Array
    time: Array
    band: tuple[float, float]
    error: float
    replaced_effects: str = ""
    size: str = ""
    conditions: RubberConditions = UNKNOWN

    @property
    def sentence(self) -> str:
        """Sentence with the number of arms, the effects that they replace, and their error."""
        count, (low, high) = self.time.size, (number(end, 3) for end in self.band)
        arms = f"{count} Maxwell arm{'s' * (count > 1)} represent the {self.replaced_effects}"
        return f"{arms}: error at most {number(100.0 * self.error, 2)} % of its modulus from {low} to {high} Hz"


def fitted_arms(
    modulus: Callable[[Array], Array],
    band: tuple[float, float],
    accuracy: float = ACCURACY,
    *,
    spring: float = 0.0,
    overhang_factor: float = _BEYOND,
    closest: bool = False,
) -> Arms:
    """Fit the smallest number of Maxwell arms (spring and dashpot in series) that approximate a complex modulus.

    Args:
        modulus: complex modulus [Pa] at angular frequencies [rad/s], (n,) -> (n,).
        band: lowest and highest frequency [Hz].
        accuracy: largest relative error of the modulus.
        spring: modulus of a spring in parallel [Pa]; errors are relative to the sum of spring and modulus.
        overhang_factor: factor by which relaxation times may lie outside the band.
        closest: True to return the closest arms if no number of arms reaches the accuracy.

    Returns:
        Arms by ascending relaxation time, with their largest relative error.

    Raises:
        ModelError: no number of arms reaches the accuracy, or the accuracy is out of range.

    >>> arms = fitted_arms(lambda omega: 1e5 * (1j * omega) ** 0.24, (5.0, 155.0))
    >>> arms.time.size, round(float(arms.error), 4)
    (4, 0.0042)
    """
    if not LEAST_ACCURACY <= accuracy < 1.0:
        raise ModelError("no error for arms", found=f"{100.0 * accuracy:g} %", expected="0.0001 % up to 100 %")
    low, high = band
    count = max(40, int(_PER_DECADE * np.log10(high / low)))
    omega = 2.0 * np.pi * np.geomspace(low, high, count)
    target, best, stalled, arms = modulus(omega), (np.inf, np.empty(0), np.empty(0)), 0, 0
    total = target + spring
    while arms < _MOST_ARMS and stalled < _PATIENCE:
        arms += 1
        fits = [_fit(omega, target, total, overhang_factor, *start) for start in _starts(omega, target, arms)]
        error, moduli, times = min(fits, key=itemgetter(0))
        if error <= _WORTHWHILE * accuracy:
            error, moduli, times = _fit(omega, target, total, overhang_factor, moduli, times, _ROUNDS)
        stalled = 0 if error < _BETTER * best[0] else stalled + 1
        best = best if stalled else (error, moduli, times)
        if error <= accuracy:
            best = error, moduli, times
            break
    error, moduli, times = best
    if closest or error <= accuracy:
        order = np.argsort(times)
        return Arms(moduli[order], times[order], band, error)
    raise ModelError(
        "no set of springs and dashpots represents the frequency dependence closely enough",
        found=f"an error of {100.0 * error:.3g} % with up to {arms} arms",
        expected=f"{100.0 * accuracy:.3g} % from {low:g} to {high:g} Hz",
        hint="allow a larger error",
    )


def model_arms(
    model: Model, band: tuple[float, float], accuracy: float = ACCURACY, conditions: RubberConditions = UNKNOWN
) -> tuple[Arms, ...]:
    """Fit Maxwell arms to each linear viscoelastic part of a model, at the model's values, the springpot first.

    Effects whose moduli are proportional to the same parameter (`size`), such as the springpot and the spring in series
    with it, are one part. Parts whose size is 0 are left out.

    Args:
        model: model with its parameter values.
        band: lowest and highest frequency [Hz].
        accuracy: largest relative error of each modulus.
        conditions: temperature and strain history of the rubber in the test.

    Returns:
        Arms of each part.
    """
    parts: dict[str, list[str]] = {}
    for branch in model.structure.viscoelastic:
        parts.setdefault(qualified_size(branch), []).append(branch.name)
    fitted = []
    for size, names in parts.items():
        if model.values[size]:
            modulus = partial(part_modulus, model, size, conditions=conditions)
            arms = fitted_arms(modulus, band, accuracy)
            fitted.append(replace(arms, replaced_effects=" and ".join(names), size=size, conditions=conditions))
    return tuple(fitted)


def arm_rows(model: Model, arms: Sequence[Arms]) -> list[tuple[str, float, float]]:
    """Rows of a table of Maxwell arms: name of the replaced effect, modulus [Pa] and relaxation time [s] of each arm.

    The first row is the elastic branch, if the model has one, with the relaxation time nan.

    >>> [row[0] for row in arm_rows(paper, model_arms(paper, (5.0, 155.0)))]
    ['elastic', 'springpot', 'springpot', 'springpot', 'springpot']
    """
    values = values_under(model, arms[0].conditions) if arms else model.values
    at_rest = [("elastic", values["mu"], np.nan)] if "mu" in values else []
    springs = ((part.replaced_effects, *pair) for part in arms for pair in zip(part.modulus, part.time, strict=True))
    return at_rest + [(name, float(modulus), float(time)) for name, modulus, time in springs]


def qualified_size(branch: Branch) -> str:
    """Name, in files, of the parameter that the modulus of a viscoelastic branch is proportional to."""
    qualified_names = {parameter.name: qualified_name(branch, parameter) for parameter in branch.parameters}
    assert branch.size is not None
    return qualified_names.get(branch.size, branch.size)


def part_modulus(model: Model, size: str, omega: Array, conditions: RubberConditions = UNKNOWN) -> Array:
    """Complex modulus of the viscoelastic branches whose moduli are proportional to the same parameter.

    Args:
        model: model with its parameter values.
        size: name of this parameter in files and reports.
        omega: angular frequencies [rad/s], (n,).
        conditions: temperature and strain history of the rubber in the test.

    Returns:
        Complex modulus [Pa], (n,).
    """
    still, values = np.zeros_like(omega), values_under(model, conditions)
    reduced = omega * model.shift_factor(conditions)
    branches = (branch for branch in model.structure.viscoelastic if qualified_size(branch) == size)
    return np.asarray(sum(branch.modulus(values_for_effect(branch, values), reduced, still) for branch in branches))


def values_under(model: Model, conditions: RubberConditions) -> Values:
    """Parameter values [SI] by name of a model at the temperature of a test; unchanged if that is unknown."""
    if conditions.temperature is None:
        return model.values
    return model.without(*model.constant_modifiers).values_at(Specimen("compound", "modulus"), 1.0, 0.0, conditions)


def _starts(omega: Array, target: Array, arms: int) -> Iterator[tuple[Array, Array]]:
    """Yield start values of Maxwell arms: times evenly in ln over the band, moduli from the loss modulus.

    Args:
        omega: angular frequencies [rad/s], (n,).
        target: complex moduli [Pa], (n,).
        arms: number k of arms.

    Yields:
        Moduli [Pa] and relaxation times [s], (k,) each.

    Notes: arms spaced by d in ln tau have G = 2/pi G''(1/tau) d if the loss modulus G'' changes little (J. D. Ferry,
    Viscoelastic Properties of Polymers, 3rd ed., 1980, ch. 4).
    """
    for overhang in _OVERHANGS:
        first, last = -np.log(omega[-1]) - overhang, -np.log(omega[0]) + overhang
        spacing = max(1.0, (last - first) / arms)
        time = np.exp(first + (last - first) * (np.arange(arms) + 0.5) / arms)
        loss = np.interp(-np.log(time), np.log(omega), target.imag)
        yield np.maximum(2.0 / np.pi * loss * spacing, 1e-3 * np.abs(target).mean()), time


def _fit(
    omega: Array, target: Array, total: Array, overhang_factor: float, moduli: Array, time: Array, rounds: int = 1
) -> tuple[float, Array, Array]:
    """Fit moduli and times of Maxwell arms to complex moduli, for the smallest maximum relative error.

    Args:
        omega: angular frequencies [rad/s], (n,).
        target: complex moduli [Pa], (n,).
        total: complex moduli that errors are relative to [Pa], (n,).
        overhang_factor: factor by which relaxation times may lie outside the band.
        moduli: start moduli of the arms [Pa], (k,).
        time: start relaxation times [s], (k,).
        rounds: number of fits; the weights of each fit are multiplied by the errors of the fit before.

    Returns:
        Largest |error|/|total| over the frequencies, moduli [Pa] and relaxation times [s], (k,) each.

    Notes: repeated least squares in the logarithms, with weights multiplied by the error (Lawson's method for the
    smallest maximum error); the logarithms keep all moduli and times positive.
    """
    from scipy.optimize import least_squares

    count = time.size
    root = np.ones(omega.size)
    unit = np.abs(target).mean()

    def moduli_of(x: Array) -> Array:
        """Moduli [Pa] from their logs, (k,); steps that go too far are limited, as `exp` would give infinity or 0."""
        return unit * np.exp(np.clip(x[:count], -100.0, 100.0))

    def parts(x: Array) -> tuple[Array, Array]:
        """Modulus of each arm relative to the total, and its derivative by ln(time), (n, k) each."""
        turn = 1j * omega[:, None] * np.exp(x[count:])
        basis = turn / (1.0 + turn)
        arm = basis * moduli_of(x) / total[:, None]
        return arm, arm * (1.0 - basis)

    def residual(x: Array) -> Array:
        """Weighted relative errors of the arms' modulus, real then imaginary parts, (2 n,)."""
        error = root * (parts(x)[0].sum(axis=1) - target / total)
        return np.concatenate((error.real, error.imag))

    def slopes(x: Array) -> Array:
        """Derivatives of `residual` with respect to the logs of moduli and relaxation times, (2 n, 2 k)."""
        both = root[:, None] * np.concatenate(parts(x), axis=1)
        return np.concatenate((both.real, both.imag))

    ends = np.log([1.0 / (overhang_factor * omega[-1]), overhang_factor / omega[0]])
    low, high = (np.repeat([reach, end], count) for reach, end in zip((-np.inf, np.inf), ends, strict=True))
    x, best = np.concatenate((np.log(moduli / unit), np.log(time))), (np.inf, moduli, time)
    for _ in range(rounds):
        start = np.clip(x, low + 1e-9, high - 1e-9)  # a fit has to start inside
        x = least_squares(residual, start, slopes, bounds=(low, high), max_nfev=200).x  # ten times what it takes
        error = np.abs(parts(x)[0].sum(axis=1) - target / total)
        if error.max() < best[0]:
            best = error.max(), moduli_of(x), np.exp(x[count:])
        if error.max() < LEAST_ACCURACY:
            break
        root = root * np.sqrt(error / error.max() + 1e-3)  # a share stays where the error is 0
        root /= np.sqrt(np.mean(np.square(root)))
    return best
