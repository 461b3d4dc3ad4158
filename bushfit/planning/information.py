"""Information of tests on the parameters of a model: inner products of whitened columns, which add up over tests.

Notes:
    The stiffness is computed once at all operating points of a direction. Each run then takes its points, whitened as
    in a fit, where errors that all points of a run share are noise. Errors that all runs of a line share are not noise
    of a run: their unit columns remain until the runs of a line are added up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from bushfit.campaign.schema import SimulatedLoop, SimulatedSweep
from bushfit.diagnosis.propose import missing_effects, sensitivity
from bushfit.effects import Effect
from bushfit.effects.contract import UNKNOWN, Array, Circumstances
from bushfit.fitting.coordinates import Coordinates, jacobian
from bushfit.fitting.information import relative_sizes
from bushfit.fitting.preparation import MeasuredTest, new_loop, new_sweep, split_by_kind
from bushfit.geometry import Place
from bushfit.planning.contract import Knowledge, Test, operating_points

#: Rows of a loop's cycle that its sensitivities are taken at; chosen: its force is smooth over them.
_ROWS = 128
#: Rows of a cycle as rigs, and `simulate`, record it.
ROWS_PER_CYCLE = 1000


class Information(NamedTuple):
    """Inner products of k parameter columns and e further columns, for one choice of tests or several.

    Args:
        products: of the parameters with the parameters and the further columns, (choices, k, k + e).
        squares: of each further column, (choices, e).
    """

    products: Array
    squares: Array

    @property
    def parameters(self) -> Array:
        """Fisher information of the parameters, (choices, k, k)."""
        return self.products[..., : self.products.shape[-2]]

    def noncentralities(self) -> Array:
        """Expected chi-square by one unit of each further column after a refit of the parameters, (choices, e)."""
        cross = self.products[..., self.products.shape[-2] :]
        fitted = np.linalg.solve(self.parameters, cross)
        return np.maximum(self.squares - np.sum(cross * fitted, axis=-2), 0.0)


@dataclass(frozen=True, eq=False)
class ModelInformation:
    """Information of one run of each candidate test on the k parameters of one model, and on e further columns.

    Args:
        products: of the line's gain and phase errors, which come first, and the parameters with all columns,
            (tests, 2 + k, 2 + k + e).
        squares: of each further column, (tests, e).
        level: standard deviations of the gain and phase [rad] errors that all runs of a test share, (tests, 2).
        prior: information on relative changes of the parameters before the tests, (k, k).
        bounded: number of parameters at a bound, which are the last ones.
    """

    products: Array
    squares: Array
    level: Array
    prior: Array
    bounded: int = 0

    def of_runs(self, counts: Array) -> Information:
        """Information of a number of runs of each test, (tests,), test by test, with unknown errors of each line."""
        products, decrease = eliminate_line_errors(self.products * counts[:, None, None], self.level)
        return Information(products, self.squares * counts[:, None] - decrease)

    def total(self, counts: Array) -> Information:
        """Information of a number of runs of each test, (tests,), and of the prior, (1, ...)."""
        tests = self.of_runs(counts)
        products, k = tests.products.sum(axis=0, keepdims=True), len(self.prior)
        products[..., :k] += self.prior
        return Information(products, tests.squares.sum(axis=0, keepdims=True))

    def with_one_more(self, counts: Array) -> Information:
        """Information with one more run of each test in turn, (tests, ...)."""
        total, now, more = self.total(counts), self.of_runs(counts), self.of_runs(counts + 1)
        return Information(
            *(all_tests + (after - before) for all_tests, before, after in zip(total, now, more, strict=True))
        )

    def error_covariance(self, information: Information) -> Array:
        """Compute the expected squares and products of the errors of the parameters.

        Args:
            information: of the tests and the prior.

        Returns:
            Covariance of relative changes, (..., k, k).

        Notes:
            If the true value of a parameter is at its bound, noise would take half of the fits beyond the bound. In
            these the parameter stays there, and the others are fitted with it fixed, so half of its contribution to
            their squares is absent.
        """
        free = np.linalg.inv(information.parameters)
        first = free.shape[-1] - self.bounded
        bounded = free[..., first:]
        return free - 0.5 * bounded @ np.linalg.inv(bounded[..., first:, :]) @ bounded.mT


def eliminate_line_errors(products: Array, level: Array) -> tuple[Array, Array]:
    """Remove the columns of the gain and phase errors of each line, which are unknown within their class.

    Args:
        products: of these two columns and k parameters with all columns, (tests, 2 + k, 2 + k + e).
        level: standard deviations of the gain and phase [rad] errors, (tests, 2).

    Returns:
        Products of the parameters with the other columns, (tests, k, k + e), and the decrease of the square of each
        further column, (tests, e).

    Notes:
        With the line's columns U, of standard deviations T, a product a^T b becomes
        a^T b - a^T U T (1 + T U^T U T)^-1 T U^T b.
    """
    k = products.shape[-2] - 2
    line = level[..., None] * products[..., :2, :]
    solved = np.linalg.solve(np.eye(2) + line[..., :2] * level[..., None, :], line)
    remaining = products[..., 2:, 2:] - line[..., 2 : 2 + k].mT @ solved[..., 2:]
    return remaining, np.sum(line[..., 2 + k :] * solved[..., 2 + k :], axis=-2)


@dataclass(frozen=True, eq=False)
class CandidateGrid:
    """Candidate tests, and the data sets whose residuals they share.

    Args:
        knowledge: model whose stiffness the tests would measure, and noise of the rig.
        tests: runs of the rig.
        data_sets: one cycle of each loop, in units of its noise, then one sweep of all points of a direction, in ln K.
            The rubber has borne the largest strain so far.
        rows: numbers of each test's residuals among those of all data sets: (rows,) of a loop, and (2, points) of a
            sweep, gain and phase.
    """

    knowledge: Knowledge
    tests: tuple[Test, ...]
    data_sets: tuple[MeasuredTest, ...]
    rows: tuple[Array, ...]

    @classmethod
    def from_tests(cls, knowledge: Knowledge, tests: tuple[Test, ...]) -> CandidateGrid:
        """Compute the data sets of candidate tests.

        Args:
            knowledge: model whose stiffness the tests would measure, and noise of the rig.
            tests: runs of the rig.

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
                data_sets.append(new_loop(model, *motion, per_row, rows=_ROWS))
                loops[motion] = start + np.arange(_ROWS)
                start += _ROWS
            rows[test] = loops[motion]
        for place, place_sweeps in sweeps.items():
            parts = [np.stack(operating_points(sweep)[::-1], axis=-1) for sweep in place_sweeps]
            points, index = np.unique(np.concatenate(parts), axis=0, return_inverse=True)
            data_sets.append(new_sweep(model, place, points[:, 1], points[:, 0], (1.0, 1.0), (0.0, 0.0)))
            ends = np.cumsum([len(part) for part in parts])[:-1]
            for sweep, numbers in zip(place_sweeps, np.split(index.ravel(), ends), strict=True):
                rows[sweep] = start + np.stack((numbers, len(points) + numbers))
            start += 2 * len(points)
        under = Circumstances(strained=knowledge.strain) if knowledge.strain else UNKNOWN
        strained = tuple(replace(data_set, under=under) for data_set in data_sets)
        return cls(knowledge, tests, strained, tuple(rows[test] for test in tests))

    def information(self, knowledge: Knowledge, further: Array) -> ModelInformation:
        """Compute the information of one run of each test.

        Args:
            knowledge: model, its parameters, and the prior.
            further: further columns over the residuals of all data sets, (e, n).

        Returns:
            Information on the parameters and the further columns.
        """
        slopes = relative_slopes(knowledge, self.data_sets)
        columns, k = np.concatenate((slopes, further)), len(slopes)
        noise, loops = self.knowledge.noise, split_by_kind(self.data_sets)[0]
        scatter, shared = np.array(noise.scatter)[:, None], np.array(noise.shared)[:, None]
        products, squares, level = [], [], []
        for test, rows in zip(self.tests, self.rows, strict=True):
            if isinstance(test, SimulatedLoop):
                unit_gain = loops[rows[0] // _ROWS].unit_gain
                line = np.stack((unit_gain, np.zeros(_ROWS)))
                whitened = np.sqrt(test.cycles) * np.concatenate((line, columns[:, rows]))
            else:
                count = rows.shape[1]
                line = np.eye(2)[:, :, None] * np.ones(count)  # of gain and of phase
                parts = np.concatenate((line, columns[:, rows]))
                share = 1.0 - 1.0 / np.sqrt(1.0 + count * (shared / scatter) ** 2)
                whitened = ((parts - share * parts.mean(axis=-1, keepdims=True)) / scatter).reshape(len(parts), -1)
            products.append(whitened[: 2 + k] @ whitened.T)
            squares.append(np.square(whitened[2 + k :]).sum(axis=1))
            level.append((noise.level[0], 0.0 if isinstance(test, SimulatedLoop) else noise.level[1]))
        prior, bounded = knowledge.precision, len(knowledge.bounded)
        return ModelInformation(np.array(products), np.array(squares), np.array(level), prior, bounded)

    def effect_columns(self) -> tuple[list[Effect], Array]:
        """Sensitivity to the effects that the model lacks and these tests might show.

        Left out are effects that depend on the order of the tests or on their temperature, and effects that replace a
        branch, which have no small amount.

        Returns:
            Effect of each column, once for each of its shapes, and whitened changes of the residuals by its typical
            amount, (e, n).
        """
        model, places = self.knowledge.model, dict.fromkeys(str(test.direction) for test in self.tests)
        effects, columns = list[Effect](), [np.empty((0, sum(data_set.size for data_set in self.data_sets)))]
        for effect in missing_effects(model, places):
            if not (effect.replaces or effect.under):
                columns.append(sensitivity(model, self.data_sets, effect)[1])
                effects += [effect] * len(columns[-1])
        return effects, np.concatenate(columns)


def relative_slopes(knowledge: Knowledge, data_sets: Sequence[MeasuredTest]) -> Array:
    """Differentiate whitened residuals by the relative change of each parameter.

    Args:
        knowledge: model, its k free parameters and its b parameters at a bound.
        data_sets: with n residuals together.

    Returns:
        Derivatives, (k + b, n); those by a bounded parameter are per typical size.
    """
    model, bounded = knowledge.model, Coordinates.of_parameters(knowledge.model, knowledge.bounded)
    typical = np.array([parameter.typical for parameter in bounded.parameters]) / bounded.slopes(model.values)
    sizes = np.concatenate((relative_sizes(model, knowledge.names), typical))
    return jacobian(model, data_sets, (*knowledge.names, *knowledge.bounded)) * sizes[:, None]


def rival_chi_squares(rivals: Sequence[Information]) -> Array:
    """Expected chi-square between any two rivals after the best refit of either, (tests, rivals, rivals).

    Args:
        rivals: information on each rival, whose further columns are the differences of the other rivals in order.
    """
    rows = [np.insert(rival.noncentralities(), index, 0.0, axis=1) for index, rival in enumerate(rivals)]
    one_way = np.stack(rows, axis=1)
    return np.minimum(one_way, np.swapaxes(one_way, 1, 2))
