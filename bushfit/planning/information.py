"""Fisher information of tests on the parameters of a model: inner products that add up over tests.

Notes:
    A column is the derivative of all residuals with respect to a parameter, or their change due to an effect; whitened
    means divided by the noise. The stiffness is computed once at all operating points of a direction. Each run then
    takes its points, whitened as in a fit, which treats errors shared by all points of a run as noise. Errors shared by
    all runs of a test remain as columns of unit gain and unit phase until the runs of the test are added up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from bushfit.campaign.simulated import SimulatedLoop, SimulatedSweep
from bushfit.diagnosis.propose import missing_effects, sensitivity
from bushfit.effects import Effect
from bushfit.effects.contract import UNKNOWN, Array, RubberConditions
from bushfit.fitting.coordinates import Coordinates, coordinate_per_relative_change
from bushfit.fitting.preparation import MeasuredTest, planned_loop, planned_sweep, split_by_kind
from bushfit.fitting.problem import FitProblem
from bushfit.geometry import Place, shared_labels
from bushfit.planning.contract import Knowledge, Test, operating_points

#: Rows per cycle at which the force of a loop is differentiated; chosen: the force is smooth over them.
_ROWS = 128
#: Rows per cycle that rigs, and `simulate`, record.
ROWS_PER_CYCLE = 1000


class Information(NamedTuple):
    """Fisher information of alternative sets of tests on k parameters, and visibility of e departures from the model.

    A departure is the change of the residuals due to a missing effect of typical amount, or due to a rival model.

    Args:
        parameters: Fisher information on relative changes of the parameters, (choices, k, k).
        cross: inner products of the residuals' derivatives by parameter with the departures, (choices, k, e).
        squares: sum of squares of each departure over the residuals, (choices, e).
    """

    parameters: Array
    cross: Array
    squares: Array

    def noncentralities(self) -> Array:
        """Expected increase of chi-square by each of e missing effects or rivals after a refit, (choices, e)."""
        fitted = np.linalg.solve(self.parameters, self.cross)
        return np.maximum(self.squares - np.sum(self.cross * fitted, axis=-2), 0.0)


@dataclass(frozen=True, eq=False)
class ModelInformation:
    """Fisher information of one run of each candidate test on k parameters and e departures from the model.

    Args:
        products: inner products of changes of the residuals, (tests, 2 + k, 2 + k + e): of the first 2 + k with all.
            The changes are by a gain error, a phase error, k parameters, and e departures (missing effects or rival
            models).
        squares: sum of squares of each departure over the residuals of a run, (tests, e).
        class_ratios: largest change of the response by each departure at any point of a test, divided by the accuracy
            class of the rig, (tests, e).
        level: standard deviations of the gain [1] and phase [rad] errors that all runs of a test share, the accuracy
            class of the rig, (2,).
        prior: information matrix of the parameters' relative changes before the tests, (k, k).
        bounded: number of parameters at a bound; these are the last of the k parameters.
    """

    products: Array
    squares: Array
    class_ratios: Array
    level: Array
    prior: Array
    bounded: int = 0

    def of_runs(self, counts: Array) -> Information:
        """Fisher information of the runs of each test by itself, without the tests so far.

        Args:
            counts: number of runs of each test, (tests,).

        Returns:
            Information with one entry (choice) for each test.

        Notes:
            The gain and phase errors that all runs of a test share are eliminated: with their columns U and standard
            deviations T, an inner product a^T b becomes a^T b - a^T U T (1 + T U^T U T)^-1 T U^T b.
        """
        products, k = self.products * counts[:, None, None], len(self.prior)
        shared = self.level[:, None] * products[..., :2, :]
        solved = np.linalg.solve(np.eye(2) + shared[..., :2] * self.level, shared)
        remaining = products[..., 2:, 2:] - shared[..., 2 : 2 + k].mT @ solved[..., 2:]
        decrease = np.sum(shared[..., 2 + k :] * solved[..., 2 + k :], axis=-2)
        return Information(remaining[..., :k], remaining[..., k:], self.squares * counts[:, None] - decrease)

    def total(self, counts: Array, *, one_more: bool = False) -> Information:
        """Fisher information of the prior and all runs together.

        Args:
            counts: number of runs of each candidate test, (tests,).
            one_more: True to add one more run of each test in turn.

        Returns:
            Information with one entry (choice); with `one_more`, with an entry for each test that is run once more.
        """
        runs = self.of_runs(counts)
        total = [part.sum(axis=0, keepdims=True) for part in runs]
        if one_more:
            total = [part + (more - now) for part, now, more in zip(total, runs, self.of_runs(counts + 1), strict=True)]
        return Information(total[0] + self.prior, *total[1:])

    def error_covariance(self, information: Information) -> Array:
        """Compute the covariance of the parameters' relative errors that a fit of the tests will have.

        Args:
            information: information of the tests and the prior.

        Returns:
            Covariance with the effect of bounds, (choices, k, k).

        Notes:
            If the true value of a parameter is at its bound, noise pushes half of the fits against the bound. In these
            fits the parameter stays at the bound and the others are fitted with it fixed, so half of its contribution
            to their covariance is absent.
        """
        free = np.linalg.inv(information.parameters)
        first = free.shape[-1] - self.bounded
        bounded = free[..., first:]
        return free - 0.5 * bounded @ np.linalg.inv(bounded[..., first:, :]) @ bounded.mT


@dataclass(frozen=True, eq=False)
class CandidateGrid:
    """Responses of all candidate tests to changes of the model, with each operating point computed once.

    Args:
        knowledge: model whose stiffness the tests would measure, and noise of the rig.
        tests: candidate runs of the rig.
        data_sets: one cycle of each distinct loop, in units of its noise, then one sweep with all points of each
            direction, in ln K. All assume the largest strain that the rubber has borne so far.
        rows: indices of each test's residuals among the n residuals of all data sets: (rows,) for a loop; (2, points)
            for a sweep, gain and phase.
    """

    knowledge: Knowledge
    tests: tuple[Test, ...]
    data_sets: tuple[MeasuredTest, ...]
    rows: tuple[Array, ...]

    @classmethod
    def from_tests(cls, knowledge: Knowledge, tests: tuple[Test, ...]) -> CandidateGrid:
        """Simulate the data sets of candidate tests.

        Args:
            knowledge: model whose stiffness the tests would measure, and noise of the rig.
            tests: candidate runs of the rig.

        Returns:
            Grid with a data set for each distinct loop and for the sweeps of each direction.
        """
        model, noise = knowledge.model, knowledge.noise
        per_row = noise.force * float(np.sqrt(_ROWS * noise.rows_as_one / ROWS_PER_CYCLE))
        data_sets: list[MeasuredTest] = []
        rows: dict[Test, Array] = {}
        start, loops, sweeps = 0, dict[tuple[Place, float, float], Array](), dict[Place, list[SimulatedSweep]]()
        for test in tests:
            if isinstance(test, SimulatedSweep):
                sweeps.setdefault(test.direction, []).append(test)
                continue
            motion = test.direction, test.frequency, test.amplitude
            if motion not in loops:
                data_sets.append(planned_loop(model, *motion, per_row, rows=_ROWS))
                loops[motion] = start + np.arange(_ROWS)
                start += _ROWS
            rows[test] = loops[motion]
        for place, place_sweeps in sweeps.items():
            parts = [np.stack(operating_points(sweep)[::-1], axis=-1) for sweep in place_sweeps]
            points, index = np.unique(np.concatenate(parts), axis=0, return_inverse=True)
            data_sets.append(planned_sweep(model, place, points[:, 1], points[:, 0], (1.0, 1.0), (0.0, 0.0)))
            ends = np.cumsum([len(part) for part in parts])[:-1]
            for sweep, numbers in zip(place_sweeps, np.split(index.ravel(), ends), strict=True):
                rows[sweep] = start + np.stack((numbers, len(points) + numbers))
            start += 2 * len(points)
        conditions = RubberConditions(largest_strain=knowledge.strain) if knowledge.strain else UNKNOWN
        strained = tuple(replace(data_set, test_conditions=conditions) for data_set in data_sets)
        return cls(knowledge, tests, strained, tuple(rows[test] for test in tests))

    def information(self, knowledge: Knowledge, departures: Array) -> ModelInformation:
        """Compute the Fisher information of one run of each test on a model.

        Args:
            knowledge: model, names of its parameters, and prior covariance.
            departures: changes of the n residuals by e missing effects or rival models, (e, n).

        Returns:
            Information of each test on the parameters and the departures.
        """
        slopes = relative_slopes(knowledge, self.data_sets)
        columns, k = np.concatenate((slopes, departures)), len(slopes)
        noise, loops = self.knowledge.noise, split_by_kind(self.data_sets)[0]
        random, shared = np.array(noise.random)[:, None], np.array(noise.shared)[:, None]
        class_errors = np.maximum(noise.level, np.finfo(float).tiny)[:, None]  # of gain and phase
        products, squares, class_ratios = [], [], []
        for test, rows in zip(self.tests, self.rows, strict=True):
            if isinstance(test, SimulatedLoop):
                unit_gain = loops[rows[0] // _ROWS].gain_and_offset()[0]
                unit_errors = np.stack((unit_gain, np.zeros(_ROWS)))
                whitened = np.sqrt(test.cycles) * np.concatenate((unit_errors, columns[:, rows]))
                unit = np.abs(unit_gain).max() * class_errors[0]
            else:
                count = rows.shape[1]
                unit_errors = np.eye(2)[:, :, None] * np.ones(count)  # of gain and of phase
                parts = np.concatenate((unit_errors, columns[:, rows]))
                share = 1.0 - 1.0 / np.sqrt(1.0 + count * (shared / random) ** 2)
                unit = class_errors
                whitened = ((parts - share * parts.mean(axis=-1, keepdims=True)) / random).reshape(len(parts), -1)
            products.append(whitened[: 2 + k] @ whitened.T)
            squares.append(np.square(whitened[2 + k :]).sum(axis=1))
            class_ratios.append((np.abs(departures[:, rows]) / unit).reshape(len(departures), -1).max(axis=1))
        tests = np.array(products), np.array(squares), np.array(class_ratios)
        return ModelInformation(*tests, np.array(noise.level), knowledge.precision, len(knowledge.bounded))

    def effect_columns(self) -> tuple[list[Effect], Array]:
        """Compute the changes of the residuals by effects of the library that the model lacks.

        An effect occurs once for each choice of its shape parameters, such as the frequency of a resonance. Effects of
        the order or temperature of tests, and effects that cannot be small, are left out.

        Returns:
            The e effects, and the change of the n residuals due to a typical amount of each, (e, n).
        """
        model, places = self.knowledge.model, shared_labels(test.direction for test in self.tests)
        effects, columns = list[Effect](), [np.empty((0, sum(data_set.size for data_set in self.data_sets)))]
        for effect in missing_effects(model, places):
            if not (effect.replaces or effect.depends_on):
                columns.append(sensitivity(model, self.data_sets, effect)[1])
                effects += [effect] * len(columns[-1])
        return effects, np.concatenate(columns)


def relative_slopes(knowledge: Knowledge, data_sets: Sequence[MeasuredTest]) -> Array:
    """Derivatives of the whitened residuals of tests with respect to the relative change of each parameter.

    Args:
        knowledge: model, and the names of its k free parameters and its b parameters at a bound.
        data_sets: tests with n residuals together.

    Returns:
        Derivatives, (k + b, n); the last b are with respect to bounded parameters in units of their typical values.
    """
    model, bounded = knowledge.model, Coordinates.of_parameters(knowledge.model, knowledge.bounded)
    typical = np.array([parameter.typical for parameter in bounded.parameters]) / bounded.slopes(model.values)
    sizes = np.concatenate((coordinate_per_relative_change(model, knowledge.names), typical))
    problem = FitProblem(model, data_sets, (*knowledge.names, *knowledge.bounded))
    return problem.linearise(model)[1][:, : sum(test.size for test in data_sets)] * sizes[:, None]


def rival_chi_squares(rivals: Sequence[Information]) -> Array:
    """Compute the expected chi-square by which planned tests separate any two rival models.

    Chi-square is the misfit of one rival, with its parameters refitted, to tests of the other rival; the smaller of the
    two values is used.

    Args:
        rivals: information on each rival, with the other rivals in order as its departures from the model.

    Returns:
        Symmetric matrix of expected chi-square for each choice of tests, (choices, rivals, rivals).
    """
    rows = [np.insert(rival.noncentralities(), index, 0.0, axis=1) for index, rival in enumerate(rivals)]
    one_way = np.stack(rows, axis=1)
    return np.minimum(one_way, np.swapaxes(one_way, 1, 2))
