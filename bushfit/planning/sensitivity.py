"""Information of each candidate test: inner products of whitened sensitivities, which add up over tests.

Notes:
    The stiffness is computed once at all operating points of a direction. Each run then takes its points, whitened as
    in a fit (`fitting.whitening`), where errors that all points of a run share are noise. Errors that all runs of a
    line share are not noise of a run: their unit columns remain until the runs of a line are added up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bushfit.campaign.schema import SimulatedLoop, SimulatedSweep
from bushfit.diagnosis.propose import missing_effects, sensitivity
from bushfit.effects import Effect
from bushfit.effects.contract import UNKNOWN, Array, Circumstances
from bushfit.fitting.coordinates import Coordinates, jacobian
from bushfit.fitting.information import relative_sizes
from bushfit.fitting.noise import SweepNoise
from bushfit.fitting.preparation import MeasuredTest, new_loop, new_sweep, split_by_kind
from bushfit.fitting.whitening import Whitening
from bushfit.geometry import Place
from bushfit.planning.contract import Knowledge, Test, operating_points

#: Rows of a loop's cycle that its sensitivities are taken at; chosen: its force is smooth over them.
_ROWS = 128
#: Rows of a cycle as rigs, and `simulate`, record it.
ROWS_PER_CYCLE = 1000


@dataclass(frozen=True, eq=False)
class Information:
    """Inner products of whitened columns: k parameters, gain and phase errors of a line, and e further columns.

    Information adds up over tests, which are the first axis.

    Args:
        parameters: products among parameters and line errors, (tests, k + 2, k + 2).
        cross: products of these with the further columns, (tests, k + 2, e).
        squares: square of each further column, (tests, e).
    """

    parameters: Array
    cross: Array
    squares: Array

    def __add__(self, added: Information) -> Information:
        return Information(self.parameters + added.parameters, self.cross + added.cross, self.squares + added.squares)

    def __sub__(self, less: Information) -> Information:
        return Information(self.parameters - less.parameters, self.cross - less.cross, self.squares - less.squares)

    def scaled(self, counts: Array) -> Information:
        """Information of a number of runs of each test, (tests,)."""
        factor = counts[:, None, None]
        return Information(self.parameters * factor, self.cross * factor, self.squares * counts[:, None])

    def summed(self) -> Information:
        """Information of all tests together, (1, ...)."""
        return Information(*(part.sum(axis=0, keepdims=True) for part in (self.parameters, self.cross, self.squares)))

    def with_line_error(self, level: Array) -> Information:
        """Information on the parameters that remains with unknown gain and phase errors of each line.

        Args:
            level: standard deviations of the gain and phase [rad] errors, (tests, 2).

        Returns:
            Information without the two columns of the line, (tests, k, k) and so on.

        Notes:
            With the line's columns U, of standard deviations T, a product a^T b becomes
            a^T b - a^T U T (1 + T U^T U T)^-1 T U^T b.
        """
        k = self.parameters.shape[-1] - 2
        line = level[..., None] * np.concatenate((self.parameters[..., k:, :], self.cross[..., k:, :]), axis=-1)
        solved = np.linalg.solve(np.eye(2) + line[..., k : k + 2] * level[..., None, :], line)
        chosen = np.swapaxes(line[..., :k], -1, -2)
        return Information(
            self.parameters[..., :k, :k] - chosen @ solved[..., :k],
            self.cross[..., :k, :] - chosen @ solved[..., k + 2 :],
            self.squares - np.sum(line[..., k + 2 :] * solved[..., k + 2 :], axis=-2),
        )


@dataclass(frozen=True, eq=False)
class EffectColumn:
    """Whitened sensitivity to an effect that a model lacks, in one shape of the effect.

    Args:
        effect: of the library.
        values: change of the residuals by a typical amount of the effect, (n,).
    """

    effect: Effect
    values: Array

    @property
    def maximum_amount(self) -> float:
        """Largest amount that a bushing or a rig can have, in typical amounts."""
        amount = self.effect.amount
        return max(abs(end - (amount.neutral or 0.0)) for end in amount.bounds) / amount.typical


@dataclass(frozen=True, eq=False)
class Grid:
    """Candidate tests and the data sets that they share: one for each loop, and one for all points of a direction.

    Args:
        knowledge: model whose stiffness the tests would measure, and noise of the rig.
        tests: runs of the rig.
    """

    knowledge: Knowledge
    tests: tuple[Test, ...]

    @cached_property
    def data_sets(self) -> list[MeasuredTest]:
        """One cycle of each loop, in units of its noise, and one sweep of all points at each direction, in ln K.

        The rubber has borne the largest strain so far.
        """
        model, noise = self.knowledge.model, self.knowledge.noise
        per_row = noise.force * float(np.sqrt(_ROWS * noise.rows_as_one / ROWS_PER_CYCLE))
        loops = [new_loop(model, *motion, per_row, rows=_ROWS) for motion in self.loops]
        sweeps = [
            new_sweep(model, place, points[:, 1], points[:, 0], (1.0, 1.0), (0.0, 0.0))
            for place, points in self.points.items()
        ]
        under = Circumstances(strained=self.knowledge.strain) if self.knowledge.strain else UNKNOWN
        return [*(replace(loop, under=under) for loop in loops), *(replace(sweep, under=under) for sweep in sweeps)]

    @cached_property
    def loops(self) -> list[tuple[Place, float, float]]:
        """Direction, frequency [Hz] and amplitude [m or rad, or strain] of the distinct loops."""
        loops = [test for test in self.tests if isinstance(test, SimulatedLoop)]
        return list(dict.fromkeys((test.direction, test.frequency, test.amplitude) for test in loops))

    @cached_property
    def points(self) -> dict[Place, Array]:
        """Amplitude and frequency of the distinct points of all sweeps at each direction, (n, 2), sorted."""
        by_place: dict[Place, list[Array]] = {}
        for test in self.tests:
            if isinstance(test, SimulatedSweep):
                by_place.setdefault(test.direction, []).append(np.stack(operating_points(test)[::-1], axis=-1))
        return {place: np.unique(np.concatenate(points), axis=0) for place, points in by_place.items()}

    def information(self, parameters: Array, further: Array) -> Information:
        """Compute the information of each test from columns over the residuals of all data sets.

        Args:
            parameters: columns of the k parameters, (k, n).
            further: further columns, (e, n).

        Returns:
            Information of one run of each test, with the columns of the line's gain and phase errors.
        """
        ends = np.cumsum([data_set.size for data_set in self.data_sets])
        parts = np.split(np.concatenate((parameters, further)), ends[:-1], axis=-1)
        loops = dict(zip(self.loops, zip(split_by_kind(self.data_sets)[0], parts, strict=False), strict=True))
        sweeps = dict(zip(self.points, parts[len(self.loops) :], strict=True))
        k, products, squares = len(parameters), [], []
        for test in self.tests:
            if isinstance(test, SimulatedLoop):
                loop, rows = loops[test.direction, test.frequency, test.amplitude]
                cycles = float(np.sqrt(test.cycles))
                rows, line = cycles * rows, cycles * np.array([loop.unit_gain, np.zeros(loop.size)])
            else:
                rows, line = self._whiten_run(test, sweeps[test.direction])
            chosen = np.concatenate((rows[:k], line))
            products.append(chosen @ np.concatenate((chosen, rows[k:])).T)
            squares.append(np.square(rows[k:]).sum(axis=1))
        both = np.array(products)
        return Information(both[..., : k + 2], both[..., k + 2 :], np.array(squares))

    def _whiten_run(self, test: SimulatedSweep, rows: Array) -> tuple[Array, Array]:
        """Columns of a direction, and those of the line's gain and phase errors, whitened at the points of one run."""
        numbers = {tuple(point): number for number, point in enumerate(self.points[test.direction].tolist())}
        frequency, amplitude = operating_points(test)
        chosen = [numbers[point] for point in zip(amplitude.tolist(), frequency.tolist(), strict=True)]
        first, random = np.array([0]), np.repeat(np.array(self.knowledge.noise.scatter)[:, None], len(chosen), axis=1)
        noise = SweepNoise({}, self.knowledge.noise.shared, "stated", 0)
        whitening = Whitening(first, first, random, noise, np.ones(len(chosen)), np.arange(len(chosen)))
        gain, phase = np.split(rows, 2, axis=-1)
        line = np.array([[1.0], [1.0j]]) * np.ones(len(chosen))
        return whitening.whiten(gain[:, chosen] + 1j * phase[:, chosen]), whitening.whiten(line)

    @cached_property
    def level(self) -> Array:
        """Standard deviations of the gain and phase errors that all runs of a test share, (tests, 2); a loop has none
        in phase."""
        gain, phase = self.knowledge.noise.level
        return np.array([(gain, 0.0 if isinstance(test, SimulatedLoop) else phase) for test in self.tests])

    @cached_property
    def columns(self) -> list[EffectColumn]:
        """Effects that the model lacks and these tests might show, one column for each shape.

        Left out are effects that depend on the order of the tests or on their temperature, and effects that replace a
        branch, which have no small amount.
        """
        model, places = self.knowledge.model, dict.fromkeys(str(test.direction) for test in self.tests)
        missing = [effect for effect in missing_effects(model, places) if not (effect.replaces or effect.under)]
        shapes = [(effect, sensitivity(model, self.data_sets, effect)[1]) for effect in missing]
        return [EffectColumn(effect, row) for effect, rows in shapes for row in rows]


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
