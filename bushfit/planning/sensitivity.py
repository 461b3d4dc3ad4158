"""Information of each candidate test: inner products of whitened sensitivities, which add up over tests.

Notes:
    The stiffness is asked once at all operating points of a place. Each run then takes its points, whitened as a fit
    whitens them (`fitting.whitening`): what all its points share is counted as noise there. An error that all runs of a
    line share is no noise of a run; its unit columns stay beside the parameters until the runs of a line are added up.
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
    """Inner products of the whitened columns of tests: k parameters, gain and phase of a line, and e further columns.

    They add up over tests, along the first axis.

    Args:
        own: of parameters and line, (tests, k + 2, k + 2).
        cross: of these with the further columns, (tests, k + 2, e).
        size: of each further column with itself, (tests, e).
    """

    own: Array
    cross: Array
    size: Array

    def __add__(self, other: Information) -> Information:
        return Information(self.own + other.own, self.cross + other.cross, self.size + other.size)

    def __sub__(self, other: Information) -> Information:
        return Information(self.own - other.own, self.cross - other.cross, self.size - other.size)

    def times(self, counts: Array) -> Information:
        """Each test so many times, (tests,)."""
        by = counts[:, None, None]
        return Information(self.own * by, self.cross * by, self.size * counts[:, None])

    def total(self) -> Information:
        """All tests together, (1, ...)."""
        return Information(*(part.sum(axis=0, keepdims=True) for part in (self.own, self.cross, self.size)))

    def beside(self, level: Array) -> Information:
        """Less what an error of the line, gain and phase of these standard deviations, takes away; parameters alone.

        Args:
            level: of each, (tests, 2).

        Notes: with U the line's columns, of standard deviations T, a product a^T b becomes
        a^T b - a^T U T (1 + T U^T U T)^-1 T U^T b.
        """
        k = self.own.shape[-1] - 2
        line = level[..., None] * np.concatenate((self.own[..., k:, :], self.cross[..., k:, :]), axis=-1)
        solved = np.linalg.solve(np.eye(2) + line[..., k : k + 2] * level[..., None, :], line)
        chosen = np.swapaxes(line[..., :k], -1, -2)
        return Information(
            self.own[..., :k, :k] - chosen @ solved[..., :k],
            self.cross[..., :k, :] - chosen @ solved[..., k + 2 :],
            self.size - np.sum(line[..., k + 2 :] * solved[..., k + 2 :], axis=-2),
        )


@dataclass(frozen=True, eq=False)
class DesignColumn:
    """An effect that a model lacks, in one shape: its whitened sensitivity, (n,) per typical amount."""

    effect: Effect
    values: Array

    @property
    def reach(self) -> float:
        """Largest amount that a bushing or a rig can have, in typical amounts."""
        amount = self.effect.amount
        return max(abs(end - (amount.neutral or 0.0)) for end in amount.bounds) / amount.typical


@dataclass(frozen=True, eq=False)
class Grid:
    """Tests that are not made yet, and the data sets that they share: a loop each, and all points of each place.

    Args:
        knowledge: its model's stiffness is what the tests would measure.
        tests: runs of the rig.
    """

    knowledge: Knowledge
    tests: tuple[Test, ...]

    @cached_property
    def data_sets(self) -> list[MeasuredTest]:
        """A cycle of each loop, in units of its noise, and of each place one sweep of all points, in units of ln K;
        after the largest strain so far."""
        model, noise = self.knowledge.model, self.knowledge.noise
        per_row = noise.force * float(np.sqrt(_ROWS * noise.rows_as_one / ROWS_PER_CYCLE))
        loops = [new_loop(model, *motion, per_row, rows=_ROWS) for motion in self._loops]
        sweeps = [
            new_sweep(model, place, points[:, 1], points[:, 0], (1.0, 1.0), (0.0, 0.0))
            for place, points in self._points.items()
        ]
        under = Circumstances(strained=self.knowledge.strain) if self.knowledge.strain else UNKNOWN
        return [*(replace(loop, under=under) for loop in loops), *(replace(sweep, under=under) for sweep in sweeps)]

    @cached_property
    def _loops(self) -> list[tuple[Place, float, float]]:
        """Place, frequency and amplitude of the distinct loops."""
        loops = [test for test in self.tests if isinstance(test, SimulatedLoop)]
        return list(dict.fromkeys((test.direction, test.frequency, test.amplitude) for test in loops))

    @cached_property
    def _points(self) -> dict[Place, Array]:
        """Amplitude and frequency of the distinct operating points of all sweeps at each place, (n, 2), sorted."""
        of_place: dict[Place, list[Array]] = {}
        for test in self.tests:
            if isinstance(test, SimulatedSweep):
                of_place.setdefault(test.direction, []).append(_points_of(test))
        return {place: np.unique(np.concatenate(points), axis=0) for place, points in of_place.items()}

    def information(self, own: Array, further: Array) -> Information:
        """Information of each test, from columns of all residuals: of parameters, (k, n), and further ones, (e, n)."""
        ends = np.cumsum([data_set.size for data_set in self.data_sets])
        parts = np.split(np.concatenate((own, further)), ends[:-1], axis=-1)
        of_loops = dict(zip(self._loops, zip(split_by_kind(self.data_sets)[0], parts, strict=False), strict=True))
        of_places = dict(zip(self._points, parts[len(self._loops) :], strict=True))
        k, products, size = len(own), [], []
        for test in self.tests:
            if isinstance(test, SimulatedLoop):
                loop, rows = of_loops[test.direction, test.frequency, test.amplitude]
                cycles = float(np.sqrt(test.cycles))
                rows, line = cycles * rows, cycles * np.array([loop.unit_gain, np.zeros(loop.size)])
            else:
                rows, line = self._whitened(test, of_places[test.direction])
            chosen = np.concatenate((rows[:k], line))
            products.append(chosen @ np.concatenate((chosen, rows[k:])).T)
            size.append(np.square(rows[k:]).sum(axis=1))
        both = np.array(products)
        return Information(both[..., : k + 2], both[..., k + 2 :], np.array(size))

    def _whitened(self, test: SimulatedSweep, rows: Array) -> tuple[Array, Array]:
        """The columns of a place, and those of gain and phase of the line, at the points of one run; whitened."""
        knowledge = {tuple(point): number for number, point in enumerate(self._points[test.direction].tolist())}
        chosen = [knowledge[tuple(point)] for point in _points_of(test).tolist()]
        first, random = np.array([0]), np.repeat(np.array(self.knowledge.noise.scatter)[:, None], len(chosen), axis=1)
        noise = SweepNoise({}, self.knowledge.noise.shared, "stated", 0)
        whitening = Whitening(first, first, random, noise, np.ones(len(chosen)), np.arange(len(chosen)))
        gain, phase = np.split(rows, 2, axis=-1)
        line = np.array([[1.0], [1.0j]]) * np.ones(len(chosen))
        return whitening.whiten(gain[:, chosen] + 1j * phase[:, chosen]), whitening.whiten(line)

    @cached_property
    def level(self) -> Array:
        """Standard deviations of what all runs of a test share, gain and phase, (tests, 2); a loop's lag is known."""
        gain, phase = self.knowledge.noise.level
        return np.array([(gain, 0.0 if isinstance(test, SimulatedLoop) else phase) for test in self.tests])

    @cached_property
    def columns(self) -> list[DesignColumn]:
        """Effects that the model lacks and these tests might show, a column for each shape.

        What depends on the order of the tests or on their temperature is not among them, nor an effect that replaces a
        branch: it has no amount that could be small.
        """
        model, places = self.knowledge.model, dict.fromkeys(str(test.direction) for test in self.tests)
        missing = [effect for effect in missing_effects(model, places) if not (effect.replaces or effect.under)]
        of_effects = [(effect, sensitivity(model, self.data_sets, effect)[1]) for effect in missing]
        return [DesignColumn(effect, row) for effect, rows in of_effects for row in rows]


def relative_slopes(knowledge: Knowledge, data_sets: Sequence[MeasuredTest]) -> Array:
    """Derivatives of whitened residuals by relative change of each parameter, of the bounded by typical size, (k + b,
    n)."""
    model, bounded = knowledge.model, Coordinates.of_parameters(knowledge.model, knowledge.bounded)
    typical = np.array([parameter.typical for parameter in bounded.parameters]) / bounded.slopes(model.values)
    sizes = np.concatenate((relative_sizes(model, knowledge.names), typical))
    return jacobian(model, data_sets, (*knowledge.names, *knowledge.bounded)) * sizes[:, None]


def _points_of(test: SimulatedSweep) -> Array:
    """Amplitude and frequency of each point of a run, (n, 2)."""
    return np.stack(operating_points(test)[::-1], axis=-1)
