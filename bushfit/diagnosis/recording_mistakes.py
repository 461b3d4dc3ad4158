"""Mistakes in the record of a campaign (wrong units, conventions, dimensions), and the misfit without them.

A mistake has no free parameter, so its only penalty is the logarithm of the number of mistakes considered. A mistake is
reported if its correction closes the whole gap and if it is more probable than every effect and every fault. The user
decides whether to correct it.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.ndimage import zoom
from scipy.optimize import minimize_scalar

from bushfit.caveat import Caveat, join_names
from bushfit.effects import BASE
from bushfit.effects.contract import Array
from bushfit.effects.mistakes import MISTAKES, Mistake, file_or_name, get_mistake, option_label
from bushfit.errors import ModelError
from bushfit.fitting.preparation import MeasuredSweep, MeasuredTest, prepare_loops, with_gain_errors
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.geometry import Bushing, Place, stiffness_per_modulus, unit_strain
from bushfit.model.model import Model
from bushfit.reading.measurement import Loop, Sweep
from bushfit.units import format_aligned

#: Values of alpha that are tried before any fit: those of all rubbers.
_ALPHA = np.linspace(0.05, 0.6, 10)
#: Values of eps_half that are tried before any fit: those of all filled rubbers, with a margin of a factor of 2.
_EPS_HALF = np.geomspace(2e-4, 0.2, 24)
#: Number of steps into which a cubic spline divides each step of this grid, to find the smallest misfit.
_FINER = 5
#: Least relative error of a point before any fit: the error of the grid of values.
_COARSE = 1e-3
#: Range of the natural log of an unknown factor: one decade each way. Larger factors are powers of 1000.
FACTOR_RANGE = (-np.log(10.0), np.log(10.0))
#: Maximum number of points of a test that are used before any fit: enough to show the shape of its curves.
_MOST_POINTS = 60
#: Misfit with a mistake corrected, relative to the misfit of the tests as recorded, up to which a fit follows; above 1
#: because the grid is coarse.
_LARGEST_RATIO = 1.3
#: Smallest relative change of the misfit of a mistake; a smaller change is equivalent to a change of parameters.
_LEAST_CHANGE = 1e-6
#: Relative term on the diagonal of the normal equations that keeps three similar columns solvable.
_RIDGE = 1e-12


@dataclass(frozen=True, eq=False)
class RecordingMistake:
    """Possible recording mistake: a wrong unit, convention or dimension in some tests or in [bushing].

    Args:
        data: the campaign as it was read.
        kind: kind of mistake, such as amplitudes stated peak-to-peak, with its correction.
        tests: indices of the affected tests, loops before sweeps; empty for a mistake in [bushing].
        interval: 95 % interval of the factor by which the forces are wrong, if that is estimated; else None.
    """

    data: PreparedCampaign
    kind: Mistake
    tests: tuple[int, ...]
    interval: tuple[float, float] | None = None

    @property
    def key(self) -> tuple[str, tuple[int, ...]]:
        """Name of the kind and indices of the affected tests, which identify the mistake."""
        return self.kind.name, self.tests

    @property
    def affected_tests(self) -> list[MeasuredTest]:
        """Affected tests; empty for a mistake in [bushing]."""
        return [self.data.data_sets[index] for index in self.tests]

    @property
    def labels(self) -> tuple[str, ...]:
        """Values of the option --adopt that correct the mistake, "mistake:test" for each affected test."""
        labels = tuple(option_label(self.kind.name, test.name) for test in self.affected_tests)
        return labels or (self.kind.name,)

    @property
    def sentence(self) -> str:
        """Sentence that states the mistake, with the files of the affected tests, or with their names."""
        files = [file_or_name(test.test) for test in self.affected_tests]
        if len({*files}) < len(files):
            files = [test.name for test in self.affected_tests]
        factor, *ends = format_aligned([1.0 / self.kind.force, *(self.interval or ())], 3)
        factor += f" (95 % interval {ends[0]} to {ends[1]})" if ends else ""
        return self.kind.sentence.format(files=join_names(files), factor=factor)

    @property
    def corrections(self) -> tuple[str, ...]:
        """Lines to write into the campaign file to correct the mistake, one for each affected test."""
        return tuple(self.kind.correction_line(test.test) for test in self.affected_tests) or (
            self.kind.correction_line(None),
        )

    def with_force(self, ratio: float) -> RecordingMistake:
        """Return this mistake with another ratio of the true to the stated force."""
        return replace(self, kind=replace(self.kind, force=ratio))

    def corrected_campaign(self) -> PreparedCampaign:
        """Correct this mistake in a copy of the campaign: in the affected tests, or in the dimensions of the bushing.

        Returns:
            The corrected campaign.
        """
        data = self.data
        if not self.tests:
            bushing = data.campaign.bushing and self.kind.corrected_bushing(data.campaign.bushing)
            return replace(data, campaign=replace(data.campaign, bushing=bushing)).with_rubber_conditions()
        loops, sweeps, count = list(data.loops), [sweep.test for sweep in data.sweeps], len(data.loops)
        for index, affected in zip(self.tests, self.affected_tests, strict=True):
            test = self.kind.corrected_test(affected.test)
            if isinstance(test, Loop):
                loops[index] = prepare_loops([test], data.campaign.rig, without_outliers=data.robust)[0]
            elif isinstance(test, Sweep):
                sweeps[index - count] = test
        data = replace(data, loops=tuple(with_gain_errors(loops, data.campaign.rig)))
        if any(index >= count for index in self.tests):
            data = data.with_sweeps(sweeps)
        return data.with_rubber_conditions()


def correct_adopted(data: PreparedCampaign, names: Collection[str]) -> tuple[PreparedCampaign, list[Caveat]]:
    """Correct the recording mistakes that the user confirms with the option --adopt.

    Args:
        data: the campaign as it was read.
        names: values of --adopt, "mistake:test" or "mistake".

    Returns:
        The corrected campaign, and one warning for each mistake.

    Raises:
        ModelError: the named mistake cannot be corrected in this test, or the campaign has no such test.
    """
    messages = []
    for name in names:
        mistakes = [mistake for mistake in possible_mistakes(data, ()) if not mistake.kind.is_estimated]
        possible = {mistake.labels: mistake for mistake in mistakes if mistake.kind is get_mistake(name)}
        if (mistake := possible.get((name,))) is None:
            expected = ", ".join(labels[0] for labels in possible if len(labels) == 1)
            raise ModelError(
                "this mistake cannot be corrected in this test",
                found=name,
                expected=f"one of {expected}" if expected else "another mistake: no test can be corrected for this one",
            )
        sentence = f"read as if {mistake.sentence}; {mistake.corrections[0]}"
        messages.append(Caveat("corrected_record", sentence).about(f"corrected by --adopt {name}"))
        data = mistake.corrected_campaign()
    return data, messages


def possible_mistakes(data: PreparedCampaign, without: Collection[str]) -> list[RecordingMistake]:
    """List possible recording mistakes, each in one test, in all tests of one kind or direction, or in all tests.

    Args:
        data: the campaign as it was read.
        without: values of the option --without, "mistake" or "mistake:test", which are left out.

    Returns:
        Mistakes without duplicates.
    """
    data_sets, bushing, found = data.data_sets, data.campaign.bushing, list[RecordingMistake]()
    shared = [(data_set.kind, data_set.direction) for data_set in data_sets]
    marks = dict.fromkeys([*(test_kind for test_kind, _ in shared), *(place for _, place in shared)])
    moduli = [np.median(np.abs(x.measured)) / stiffness_per_modulus(bushing, x.direction) for x in data_sets]
    strains = [np.max(x.amplitude) * unit_strain(bushing, x.direction) for x in data_sets]
    for kind in MISTAKES.values():
        if kind.name in without:
            continue
        if not kind.kinds:
            with suppress(ModelError):  # no bushing has the corrected dimensions
                if bushing and kind.corrected_bushing(bushing) != bushing:
                    found.append(RecordingMistake(data, kind, ()))
            continue
        indices = [
            index
            for index, data_set in enumerate(data_sets)
            if option_label(kind.name, data_set.name) not in without
            and kind.is_possible(data_set.test)
            and kind.explains(float(moduli[index]), float(strains[index]))
        ]
        groups: list[tuple[int, ...]] = [(index,) for index in indices]
        groups += [tuple(index for index in indices if mark in shared[index]) for mark in marks]
        # a factor of one half of the tests is the inverse factor of the other half: the smaller half is listed
        limit = len(data_sets) if kind.is_estimated else np.inf
        distinct = filter(None, dict.fromkeys([*groups, tuple(indices)]))
        found += [RecordingMistake(data, kind, group) for group in distinct if 2 * len(group) - (0 in group) < limit]
    return found


@dataclass(frozen=True, eq=False)
class MistakeScreening:
    """Screening of recording mistakes by the misfit of the five-parameter model to the corrected tests.

    Args:
        data: the campaign as it was read.

    Notes:
        The stiffness is linear in mu, m and sigma_fmax; alpha and eps_half are tried on a grid. The normal equations
        are sums over tests, so each test is evaluated once for each mistake.
    """

    data: PreparedCampaign
    _products: dict[tuple[int, str, Bushing | None], Array] = field(default_factory=dict)

    def best(self, candidates: Sequence[RecordingMistake], limit: int) -> list[RecordingMistake]:
        """Select the recording mistakes whose correction lowers the misfit of a coarse fit most, the best first.

        A correction that leaves the misfit as it is, such as one common factor of all stiffnesses, is not selected, nor
        is one that another correction of the same tests surpasses.

        Args:
            candidates: mistakes to compare.
            limit: maximum number of mistakes to select.

        Returns:
            At most `limit` mistakes, by increasing misfit after correction.
        """
        candidates = [self._with_factor(mistake) if mistake.kind.is_estimated else mistake for mistake in candidates]
        before, misfits = self.misfit(None), np.array([self.misfit(mistake) for mistake in candidates])
        changed = np.abs(misfits - before) > _LEAST_CHANGE * before
        smallest, selected = dict[tuple[int, ...], float](), list[RecordingMistake]()
        for index in np.argsort(misfits, kind="stable"):
            mistake, misfit = candidates[index], float(misfits[index])
            if changed[index] and misfit < _LARGEST_RATIO * min(before, smallest.setdefault(mistake.tests, misfit)):
                selected.append(mistake)
        return selected[:limit]

    def _with_factor(self, mistake: RecordingMistake) -> RecordingMistake:
        """Estimate the unknown factor of a mistake, by the smallest misfit."""
        best = minimize_scalar(lambda log: self.misfit(mistake.with_force(np.exp(log))), bounds=FACTOR_RANGE)
        return mistake.with_force(float(np.exp(best.x)))

    def misfit(self, mistake: RecordingMistake | None) -> float:
        """Smallest sum of squared residuals of the five-parameter model (mu, m, alpha, sigma_fmax, eps_half).

        Args:
            mistake: mistake that is corrected first; None for the tests as recorded.

        Returns:
            Sum of squared differences of the complex stiffness, divided by a coarse noise; infinite if the model has no
            finite response.
        """
        bushing = self.data.campaign.bushing
        if mistake and not mistake.tests and bushing:
            bushing = mistake.kind.corrected_bushing(bushing)
        data_sets = self.data.data_sets
        kinds = [mistake.kind if mistake and index in mistake.tests else None for index in range(len(data_sets))]
        try:
            parts = [self._test_products(index, test, kinds[index], bushing) for index, test in enumerate(data_sets)]
        except ModelError:  # a shape for which a formula was not checked
            return np.inf
        whole = np.sum(parts, axis=0)
        gram, products, total = whole[:, :3, :3], whole[:, :3, 3], whole[:, 3, 3]
        amounts = np.linalg.solve(gram * (1.0 + _RIDGE * np.eye(3)), products[..., None])[..., 0]
        explained = np.einsum("gi,gi->g", products, amounts)
        misfits = (total - explained).reshape(_EPS_HALF.size, _ALPHA.size)
        return max(float(zoom(misfits, _FINER).min()), 0.0)

    def _test_products(
        self, index: int, data_set: MeasuredTest, mistake: Mistake | None, bushing: Bushing | None
    ) -> Array:
        """Normal equations by which one test contributes to the fit of mu, m and sigma_fmax in `misfit`.

        Args:
            index: index of the test, loops before sweeps.
            data_set: the test.
            mistake: mistake that is corrected in the test; None for the test as recorded.
            bushing: bushing with its dimensions, corrected if the mistake is in them; None without a bushing.

        Returns:
            Inner products over the points of the test, for g pairs of alpha and eps_half, (g, 4, 4), of four rows: the
            stiffness per unit of mu, of m and of sigma_fmax, and the measured stiffness.
        """
        if mistake and mistake.is_estimated:
            scale = np.array([*[1.0 / mistake.force] * 3, 1.0])
            return self._test_products(index, data_set, None, bushing) * np.outer(scale, scale)
        key = (index, mistake.name if mistake else "", bushing)
        if key not in self._products:
            direction, frequency, amplitude, stiffness, error = _corrected_points(data_set, mistake)
            columns = _responses(bushing, direction, frequency, amplitude) / (stiffness * error)
            wanted = np.broadcast_to(1.0 / error, (len(columns), 1, error.size))
            rows = np.concatenate((columns, wanted), axis=1)
            rows = np.concatenate((rows.real, rows.imag), axis=-1)
            self._products[key] = rows @ rows.transpose(0, 2, 1)
        return self._products[key]


def _responses(bushing: Bushing | None, direction: Place, frequency: Array, amplitude: Array) -> Array:
    """Complex stiffness per unit of mu, m and sigma_fmax for g pairs of alpha and eps_half, (g, 3, n).

    Args:
        bushing: bushing with its dimensions; None for tests of specimens.
        direction: direction or specimen.
        frequency: [Hz], (n,).
        amplitude: zero-to-peak [m or rad, or strain], (n,).
    """
    axes = {"mu": {}, "m": {"alpha": _ALPHA[:, None]}, "sigma_fmax": {"eps_half": _EPS_HALF[:, None, None]}}
    model, shape = Model.with_defaults(bushing, BASE, {}), (_EPS_HALF.size, _ALPHA.size, frequency.size)
    responses = [
        model.stiffness(
            direction, frequency, amplitude, values={**model.values, **dict.fromkeys(axes, 0.0), name: 1.0, **axis}
        )
        for name, axis in axes.items()
    ]
    columns = np.stack([np.broadcast_to(response, shape) for response in responses], axis=2)
    return columns.reshape(-1, len(axes), frequency.size)


def _corrected_points(data_set: MeasuredTest, mistake: Mistake | None) -> tuple[Place, Array, Array, Array, Array]:
    """Operating points of a test in which a mistake is corrected; repeated points are averaged.

    Args:
        data_set: the test as it was recorded.
        mistake: kind of mistake; None for the test as recorded.

    Returns:
        Direction, and frequency [Hz], amplitude [m or rad], complex stiffness and its relative error at n points, at
        most `_MOST_POINTS`, (n,) each.
    """
    if isinstance(data_set, MeasuredSweep):
        sweep, noise = data_set.test, np.hypot(data_set.relative_noise, max(data_set.noise.shared))
    else:
        columns = data_set.frequency, data_set.amplitude, data_set.measured
        sweep, noise = Sweep(data_set.name, data_set.direction, *columns), data_set.gain_error
    mended = mistake.corrected_test(sweep) if mistake else sweep
    points = np.stack((mended.frequency, mended.amplitude_reached))
    distinct, index, count = np.unique(points, axis=1, return_inverse=True, return_counts=True)
    index = index.ravel()
    mean = (np.bincount(index, mended.stiffness.real) + 1j * np.bincount(index, mended.stiffness.imag)) / count
    thin = np.unique(np.linspace(0, count.size - 1, min(count.size, _MOST_POINTS)).round().astype(int))
    error = np.hypot(noise / np.sqrt(count[thin]), _COARSE)
    return mended.direction, *distinct[:, thin], mean[thin], error
