"""Fisher information of tests on parameters, standard errors, and the further test that would help most.

Each test that a lab could add is simulated with the noise of the campaign, and its Fisher information is added to that
of the campaign.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bushfit.effects.contract import Array
from bushfit.fitting.assess import measured_range
from bushfit.fitting.preparation import MeasuredTest, planned_loop, planned_sweep, split_by_kind
from bushfit.fitting.problem import FitProblem
from bushfit.fitting.rig_class import ASSUMED
from bushfit.model.model import Model

#: Least size of a parameter, relative to its typical value, that a relative change is counted from.
_LEAST_SIZE = 0.05
#: Relative standard error beyond which only "beyond 1000 %" is printed.
_BEYOND = 10.0
#: Rate of a proposed loop where there is none [Hz]: quasi-static on most rigs.
_NEW_RATE = 0.1
#: Its noise over half its force range: that of most force sensors.
_FORCE_NOISE = 5e-3
#: Band of a proposed sweep where nothing fast was measured [Hz]: that of most rigs.
_NEW_BAND = (5.0, 150.0)
#: Highest frequency of the tests below which nothing fast was measured [Hz].
_SLOW = 2.0
#: Strain that a bushing can be asked to bear in a test.
_BEARABLE = 0.5
#: Largest ratio of the worst standard error after a test to the one before, for a test to be proposed.
_LEAST_GAIN_RATIO = 0.8
#: Largest worst relative standard error after a test, for a test to be proposed.
_HOPELESS = 10.0


@dataclass(frozen=True, eq=False)
class FisherInformation:
    """Fisher information of tests on relative changes of parameters, from which standard errors follow.

    Args:
        names: names of the k parameters.
        matrix: Fisher information J J^T, (k, k), where J holds the derivatives of the whitened residuals by relative
            change of each parameter.
    """

    names: tuple[str, ...]
    matrix: Array

    @classmethod
    def from_tests(cls, model: Model, data_sets: Sequence[MeasuredTest], names: Sequence[str]) -> "FisherInformation":
        """Compute the Fisher information of tests on relative changes of a model's parameters.

        Args:
            model: model at whose values the information is computed.
            data_sets: tests.
            names: names of the k parameters.
        """
        slope = FitProblem(model, data_sets, names).jacobian(model, with_priors=False)
        slope *= relative_sizes(model, names)[:, None]
        return cls(tuple(names), slope @ slope.T)

    def directions(self) -> tuple[Array, Array]:
        """Relative standard errors along the eigenvectors of the information, (k,), and the eigenvectors as columns."""
        values, vectors = np.linalg.eigh(self.matrix)
        return 1.0 / np.sqrt(np.maximum(values, np.finfo(float).eps * values.max())), vectors

    def errors(self) -> Array:
        """Relative standard error of each of the k parameters if all are fitted together, (k,)."""
        errors, vectors = self.directions()
        return np.linalg.norm(vectors * errors, axis=1)

    def error(self, weights: Mapping[str, float]) -> float:
        """Relative standard error of a weighted sum of relative parameter changes; `weights` by parameter name."""
        errors, vectors = self.directions()
        row = np.array([weights.get(name, 0.0) for name in self.names])
        return float(np.linalg.norm(row @ vectors * errors))


def relative_sizes(model: Model, names: Sequence[str]) -> Array:
    """Derivative of each parameter's fit coordinate by its relative change dp/p, (k,): 1 if the coordinate is ln p."""
    pairs = [(model.parameters[name], abs(model.values[name])) for name in names]
    return np.array(
        [1.0 if parameter.log else max(value / parameter.typical, _LEAST_SIZE) for parameter, value in pairs]
    )


def percent(error: float) -> str:
    """Format a relative standard error as text, such as "2.5 %" for 0.025."""
    return f"{float(f'{100.0 * error:.2g}'):g} %" if error < _BEYOND else "beyond 1000 %"


def further_test(model: Model, data_sets: Sequence[MeasuredTest], information: FisherInformation) -> list[str]:
    """Sentence on the further test that reduces the largest standard error most; none if no test helps.

    Args:
        model: fitted model.
        data_sets: tests of the campaign.
        information: Fisher information of these tests on the fitted parameters.

    Returns:
        At most one sentence.
    """
    before, names = information.errors(), information.names
    worst = int(np.argmax(before))
    bearable = max(_BEARABLE, measured_range(model, data_sets).strain[1])
    after = dict[str, Array]()
    for words, tests in _candidates(model, data_sets):
        if measured_range(model, tests).strain[1] <= bearable:
            further = FisherInformation.from_tests(model, tests, names)
            after[words] = FisherInformation(names, information.matrix + further.matrix).errors()
    best = min(after, key=lambda words: float(after[words].max()))
    if after[best].max() > min(_LEAST_GAIN_RATIO * before[worst], _HOPELESS):
        return []
    return [
        f"the most helpful further test: {best}; the standard error of {names[worst]} would fall "
        f"from {percent(float(before[worst]))} to {percent(float(after[best][worst]))}"
    ]


def _candidates(model: Model, data_sets: Sequence[MeasuredTest]) -> Iterator[tuple[str, list[MeasuredTest]]]:
    """Yield possible further tests: a description, and simulated tests with the noise of the campaign or of most rigs.

    The tests are a repeat of every test, the loop of the largest strain at other amplitudes and rates (or slow loops if
    the campaign has no loop), and sweeps beyond and within the frequencies and amplitudes of the campaign.
    """
    loops, sweeps = split_by_kind(data_sets)
    yield "a repeat of every test", list(data_sets)
    if loops:
        largest = max(loops, key=lambda loop: loop.prepared.amplitude * model.unit_strain(loop.direction))
        for words, amplitude, rate in (
            ("of 3 times the largest amplitude", 3.0, 1.0),
            ("of 10 times the largest amplitude", 10.0, 1.0),
            ("at a tenth of the rate", 1.0, 0.1),
            ("at ten times the rate", 1.0, 10.0),
        ):
            coefficients, frequency = largest.prepared.coefficients * amplitude, largest.prepared.frequency * rate
            prepared = replace(largest.prepared, coefficients=coefficients, frequency=frequency)
            changed = replace(largest, prepared=prepared).noise_free(model)
            yield f"a loop {words}", [changed.with_noise(largest.relative_noise)]
    else:
        direction = data_sets[0].direction
        widest = max(float(sweep.amplitude.max()) for sweep in sweeps if sweep.direction == direction)
        for times, words in ((1.0, ""), (3.0, "three times "), (10.0, "ten times ")):
            motion = model, direction, _NEW_RATE, times * widest, _FORCE_NOISE
            loop = planned_loop(*motion, cycles=2.0, rows=400, from_rest=True)
            yield f"a loop at {_NEW_RATE} Hz of {words}the largest amplitude", [replace(loop, gain_error=ASSUMED[0])]
    reach = measured_range(model, data_sets)
    small, large = (strain / model.unit_strain(data_sets[0].direction) for strain in reach.strain)
    slow, fast = reach.frequency
    low, high = _NEW_BAND if fast < _SLOW else (slow, fast)
    prefix = f"a sweep from {low:.3g} to {high:.3g} Hz at" if low < high else f"a sweep at {low:.3g} Hz and"
    planned = [
        (f"a sweep to {2.0 * fast:.3g} Hz", (fast, 2.0 * fast), (small, large)),
        (f"a sweep down to {slow / 10.0:.3g} Hz", (slow / 10.0, slow), (small, large)),
        (f"{prefix} a tenth and all of the largest amplitude", (low, high), (0.1 * large, large)),
        (f"{prefix} three times the largest amplitude", (low, high), (3.0 * large,)),
    ]
    direction = sweeps[0].direction if sweeps else data_sets[-1].direction
    scatter, shared = (sweeps[0].relative_noise, sweeps[0].noise.shared) if sweeps else (ASSUMED[0], ASSUMED)
    for words, band, amplitudes in planned if sweeps else planned[2:]:
        frequencies, levels = (x.ravel() for x in np.meshgrid(np.geomspace(*band, 9), amplitudes))
        yield words, [planned_sweep(model, direction, frequencies, levels, (scatter, scatter), shared)]
