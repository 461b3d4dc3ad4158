"""What tests leave open, in words: from the singular values of the Jacobian, scaled by noise and parameter size.

A singular value s is the inverse of the relative standard error along its direction. Directions that noise leaves open
are named by the parameters in them, with the reason that lies in the tests, the combination that is known all the same,
and the further test that would help most.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bushfit.effects.contract import Array
from bushfit.fitting.assess import measured_range
from bushfit.fitting.data_sets import DataSet, LoopData, SweepData, parted
from bushfit.fitting.drive import Drive
from bushfit.fitting.solve import Coordinates, jacobian
from bushfit.model.covariance import Z95, Covariance
from bushfit.model.model import Model
from bushfit.reading.measurement import Loop, Sweep
from bushfit.units import modulus

#: Relative standard error beyond which a direction counts as open, and a parameter as not determined.
_OPEN = 0.15
#: Share of the worst error from which on a parameter is open with it, however well it is known.
_PARTNER = 0.3
#: Frequencies, or strains, that differ by less than this factor are one; by less than those, they tell little.
_ONE, _NARROW_RATE, _NARROW_STRAIN = 1.05, 5.0, 2.0
#: A combination is known where its error is below this, and below this share of that of its parts.
_KNOWN, _BETTER = 0.1, 0.34
#: A loop that is proposed where there is none: its rate [Hz], rows, and noise over half its force range.
_NEW_RATE, _ROWS, _FORCE_NOISE = 0.1, 400, 5e-3
#: Strain that a bushing can be asked to bear in a test.
_BEARABLE = 0.5
#: Relative standard error that is as good as none: a test that leaves so much is not worth its time.
_HOPELESS = 10.0
_FRICTION, _RATE = ("sigma_fmax", "eps_half"), ("mu", "m", "alpha")


@dataclass(frozen=True, eq=False)
class _Information:
    """What tests tell about parameters, each relative to its size: J J^T, (k, k)."""

    names: tuple[str, ...]
    matrix: Array

    @classmethod
    def of(cls, model: Model, data_sets: Sequence[DataSet], names: Sequence[str]) -> _Information:
        slope = jacobian(model, data_sets, names) * _sizes(model, names)[:, None]
        return cls(tuple(names), slope @ slope.T)

    def with_more(self, model: Model, data_sets: Sequence[DataSet]) -> _Information:
        return replace(self, matrix=self.matrix + _Information.of(model, data_sets, self.names).matrix)

    def directions(self) -> tuple[Array, Array]:
        """Relative standard error of each direction, (k,), and the directions, (k, k) by column."""
        values, vectors = np.linalg.eigh(self.matrix)
        return 1.0 / np.sqrt(np.maximum(values, np.finfo(float).eps * values.max())), vectors

    def errors(self) -> Array:
        """Relative standard error of each parameter, (k,)."""
        errors, vectors = self.directions()
        return np.linalg.norm(vectors * errors, axis=1)

    def error(self, weights: dict[str, float]) -> float:
        """Standard error of a sum of relative changes."""
        errors, vectors = self.directions()
        row = np.array([weights.get(name, 0.0) for name in self.names])
        return float(np.linalg.norm(row @ vectors * errors))


def _sizes(model: Model, names: Sequence[str]) -> Array:
    """From a fit's coordinates to changes relative to a parameter's size, (k,)."""
    sizes = []
    for name in names:
        parameter, value = model.parameters[name], abs(model.values[name])
        sizes.append(1.0 if parameter.log else max(value / parameter.typical, 0.05))
    return np.array(sizes)


def left_open(model: Model, data_sets: Sequence[DataSet], names: Sequence[str], covariance: Covariance) -> list[str]:
    """Sentences on what the tests leave open of a fitted model; none where everything is determined.

    Each group of parameters that share open directions has a sentence, with the standard errors of the covariance.
    """
    if not names:
        return []
    known = _Information.of(model, data_sets, names)
    slopes = Coordinates.of(model, names).slopes(model.values) * _sizes(model, names)
    stderr = np.array([covariance.stderr(name) or 0.0 for name in names])
    each = dict(zip(names, stderr / np.abs(slopes), strict=True))
    groups = _groups(known)
    zero = [name for group in groups for name in group if _is_zero(model, name, covariance)]
    lines = [f"{name} is no different from zero: these tests do not show {name.partition('.')[0]}" for name in zero]
    if zero:
        idle = {name.partition(".")[0] for name in zero}
        rest = [name for name in names if name.partition(".")[0] not in idle]
        if not rest:
            return lines
        known = _Information.of(model, data_sets, rest)
        groups = _groups(known)
    combinations: list[str] = []
    for group in groups:
        told = ", ".join(f"{name} {_percent(float(each[name]))}" for name in group)
        reasons = "; ".join(_reasons(model, data_sets, group)) or "these tests do not tell"
        lines.append(f"{reasons}: {_meaning(known, group)} (standard errors: {told})")
        combinations += [x for x in _combinations(model, data_sets, known, group) if x not in combinations]
    if combinations:
        lines.append("what is known all the same: " + "; ".join(combinations))
    return [*lines, *_next(model, data_sets, known)] if groups else []


def _groups(known: _Information) -> list[list[str]]:
    """Parameters of each open direction; directions that share one are one group."""
    errors, vectors = known.directions()
    groups: list[set[str]] = []
    for j in np.flatnonzero(errors > _OPEN):
        parts = np.abs(vectors[:, j]) * errors[j]
        least = min(_OPEN, _PARTNER * float(parts.max()))
        group = {name for name, part in zip(known.names, parts, strict=True) if part > least}
        for other in [other for other in groups if other & group]:
            groups.remove(other)
            group |= other
        groups.append(group)
    return [[name for name in known.names if name in group] for group in groups]


def _is_zero(model: Model, name: str, covariance: Covariance) -> bool:
    """Whether noise alone explains that the size of an added effect is not its neutral value."""
    neutral = model.parameters[name].neutral
    if "." not in name or neutral is None:
        return False
    return abs(model.values[name] - neutral) < Z95 * (covariance.stderr(name) or 0.0)


def _meaning(known: _Information, group: Sequence[str]) -> str:
    if set(group) == set(_FRICTION) and known.error(dict(zip(_FRICTION, (1.0, -1.0), strict=True))) < _KNOWN:
        return "sigma_fmax and eps_half are known only as a ratio"
    if len(group) > 1:
        return f"{', '.join(group[:-1])} and {group[-1]} cannot be told from one another"
    return f"{group[0]} is not determined"


def _percent(error: float) -> str:
    return f"{float(f'{100.0 * error:.2g}'):g} %" if error < 10.0 else "beyond 1000 %"


def _reasons(model: Model, data_sets: Sequence[DataSet], involved: Sequence[str]) -> Iterator[str]:
    reach = measured_range(model, data_sets)
    (slow, fast), (small, large) = reach.frequency, reach.strain
    loops, _ = parted(data_sets)
    if set(involved) & set(_FRICTION) and "eps_half" in model.values:
        ratio = large / model.values["eps_half"]
        span = f"{small / model.values['eps_half']:.2g} to {ratio:.2g} of eps_half"
        if ratio < 1.0:
            yield f"amplitudes stop at {ratio:.2g} of eps_half"
        elif large < _ONE * small:
            yield "one amplitude"
        elif large < _NARROW_STRAIN * small:
            yield f"amplitudes span only {span}"
        elif small > model.values["eps_half"]:
            yield f"amplitudes begin at {small / model.values['eps_half']:.2g} of eps_half"
    if set(involved) & set(_RATE) and "alpha" in model.values:
        if fast < _ONE * slow:
            yield f"one {'loop rate' if len(loops) == len(data_sets) else 'frequency'}, {slow:.3g} Hz"
        elif fast < _NARROW_RATE * slow:
            yield f"frequencies span only {slow:.3g} to {fast:.3g} Hz"
    if not loops and set(involved) & {*_FRICTION, "mu"}:
        yield "there is no loop"


def _combinations(
    model: Model, data_sets: Sequence[DataSet], known: _Information, involved: Sequence[str]
) -> Iterator[str]:
    """Combinations of what is open that are known well, with their errors."""
    values, worst = model.values, known.errors()
    least = min(float(worst[known.names.index(name)]) for name in involved)
    slow = measured_range(model, data_sets).frequency[0]
    if set(_FRICTION) <= set(known.names) and set(_FRICTION) & set(involved):
        error = known.error({"sigma_fmax": 1.0, "eps_half": -1.0})
        if error < min(_KNOWN, _BETTER * least):
            yield f"sigma_fmax/eps_half = {modulus(values['sigma_fmax'] / values['eps_half'], 4)} to {_percent(error)}"
    if {"mu", *_FRICTION} <= set(known.names) and {"mu", *_FRICTION} & set(involved):
        ratio = values["sigma_fmax"] / values["eps_half"]
        total = values["mu"] + ratio
        weights = {"mu": values["mu"] / total, "sigma_fmax": ratio / total, "eps_half": -ratio / total}
        error = known.error(weights)
        if error < min(_KNOWN, _BETTER * least):
            known_as = "the friction of small amplitudes"
            yield f"mu + sigma_fmax/eps_half = {modulus(total, 4)} to {_percent(error)} ({known_as})"
    if not {"m", "alpha"} & set(involved) or "alpha" not in values:
        return
    omega = 2.0 * np.pi * slow
    power, turn = omega ** values["alpha"], np.pi * values["alpha"] / 2.0
    if {"m", "alpha"} <= set(known.names):
        error = known.error({"m": 1.0, "alpha": values["alpha"] * float(np.log(omega))})
        if error < min(_KNOWN, _BETTER * least):
            yield f"m omega^alpha at {slow:.3g} Hz = {modulus(values['m'] * power, 4)} to {_percent(error)}"
        loss = 0.5 * values["m"] * power * np.sin(turn)
        slope = values["alpha"] * (np.log(omega) + np.pi / 2.0 / np.tan(turn))
        error = known.error({"m": 1.0, "alpha": float(slope)})
        if error < min(_KNOWN, _BETTER * least):
            yield f"m/2 omega^alpha sin(pi alpha/2) at {slow:.3g} Hz = {modulus(loss, 4)} to {_percent(error)}"
    if {"mu", "m", "alpha"} <= set(known.names):
        storage = values["mu"] + 0.5 * values["m"] * power * np.cos(turn)
        share = 0.5 * values["m"] * power / storage
        slope = values["alpha"] * (np.log(omega) * np.cos(turn) - np.pi / 2.0 * np.sin(turn))
        error = known.error({"mu": values["mu"] / storage, "m": share * np.cos(turn), "alpha": float(share * slope)})
        if error < min(_KNOWN, _BETTER * least):
            yield f"mu + m/2 omega^alpha cos(pi alpha/2) at {slow:.3g} Hz = {modulus(storage, 4)} to {_percent(error)}"


def _next(model: Model, data_sets: Sequence[DataSet], known: _Information) -> list[str]:
    """The further test that shrinks the worst error most, and to what."""
    before = known.errors()
    worst = int(np.argmax(before))
    bearable = max(_BEARABLE, measured_range(model, data_sets).strain[1])
    after = {
        words: known.with_more(model, more).errors()
        for words, more in _further(model, data_sets)
        if measured_range(model, more).strain[1] <= bearable
    }
    best = min(after, key=lambda words: float(after[words].max()))
    if after[best].max() > min(0.8 * before[worst], _HOPELESS):
        return []
    return [
        f"the further test that would help most: {best}; the standard error of {known.names[worst]} would fall from "
        f"{_percent(float(before[worst]))} to {_percent(float(after[best][worst]))}"
    ]


def _further(model: Model, data_sets: Sequence[DataSet]) -> Iterator[tuple[str, list[DataSet]]]:
    """Tests a lab could add, each as the data sets it would make, with the campaign's own noise."""
    loops, sweeps = parted(data_sets)
    yield "every test once more", list(data_sets)
    if loops:
        largest = max(
            loops, key=lambda data_set: data_set.drive.amplitude * model.bushing.unit_strain(data_set.direction)
        )
        for factor in (3.0, 10.0):
            yield f"a loop of {factor:g} times the largest amplitude", [_loop(largest, model, amplitude=factor)]
        for words, factor in (("a tenth of", 0.1), ("ten times", 10.0)):
            yield f"a loop at {words} the rate", [_loop(largest, model, rate=factor)]
    else:
        for times, words in ((1.0, ""), (3.0, "three times "), (10.0, "ten times ")):
            yield f"a loop at {_NEW_RATE} Hz of {words}the largest amplitude", [_new_loop(model, data_sets, times)]
    reach = measured_range(model, data_sets)
    direction = data_sets[0].direction
    strain = model.bushing.unit_strain(direction)
    small, large = (x / strain for x in reach.strain)
    slow, fast = reach.frequency
    band = (5.0, 150.0) if fast < 2.0 else (slow, fast)
    if sweeps:
        yield (
            f"a sweep to {2.0 * fast:.3g} Hz",
            [_sweep(model, sweeps, data_sets[-1], (fast, 2.0 * fast), (small, large))],
        )
        yield (
            f"a sweep down to {slow / 10.0:.3g} Hz",
            [_sweep(model, sweeps, data_sets[-1], (slow / 10.0, slow), (small, large))],
        )
    yield (
        f"a sweep from {band[0]:.3g} to {band[1]:.3g} Hz at a tenth and all of the largest amplitude",
        [_sweep(model, sweeps, data_sets[-1], band, (0.1 * large, large))],
    )
    yield (
        f"a sweep from {band[0]:.3g} to {band[1]:.3g} Hz at three times the largest amplitude",
        [_sweep(model, sweeps, data_sets[-1], band, (3.0 * large,))],
    )


def _loop(data_set: LoopData, model: Model, *, amplitude: float = 1.0, rate: float = 1.0) -> LoopData:
    drive = data_set.drive
    moved = replace(drive, coefficients=drive.coefficients * amplitude, frequency=drive.frequency * rate)
    fresh = LoopData(moved).noise_free(model)
    noise = drive.noise / drive.half_range * fresh.drive.half_range
    return LoopData(replace(fresh.drive, noise=noise))


def _new_loop(model: Model, data_sets: Sequence[DataSet], times: float) -> LoopData:
    """Two cycles of a slow sine where the campaign has no loop, with the noise of most force sensors."""
    direction = data_sets[0].direction
    amplitude = times * max(
        float(data_set.amplitude.max()) for data_set in data_sets if data_set.direction is direction
    )
    phase = 2.0 * np.arange(_ROWS) / _ROWS
    motion, nil = amplitude * np.sin(2.0 * np.pi * phase), np.zeros(_ROWS)
    loop = Loop("new", direction, phase / _NEW_RATE, motion, nil)
    coefficients = np.array([0.0, -1j * amplitude])
    silent = Drive(loop, _NEW_RATE, 2.0, True, phase, nil, np.ones(_ROWS), 1.0, coefficients, 1.0)
    fresh = LoopData(silent).noise_free(model)
    return LoopData(replace(fresh.drive, noise=_FORCE_NOISE * fresh.drive.half_range))


def _sweep(
    model: Model, sweeps: Sequence[SweepData], like: DataSet, band: tuple[float, float], amplitudes: Sequence[float]
) -> SweepData:
    """Nine frequencies at each amplitude, with the noise of the campaign's sweeps, or that of most rigs."""
    from bushfit.fitting.noise import ASSUMED_SHARED, SweepNoise

    frequency, amplitude = (x.ravel() for x in np.meshgrid(np.geomspace(*band, 9), amplitudes))
    direction = sweeps[0].direction if sweeps else like.direction
    stiffness = model.stiffness(direction, frequency, amplitude)
    shared = sweeps[0].noise.shared if sweeps else ASSUMED_SHARED
    random = sweeps[0].relative_noise if sweeps else ASSUMED_SHARED[0]
    noise = SweepNoise({("new", float(x)): (random, random) for x in amplitudes}, shared, "stated", 0)
    return SweepData(Sweep("new", direction, frequency, amplitude, stiffness), noise)
