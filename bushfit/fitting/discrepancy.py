"""Discrepancy between a fitted model and its tests: a Gaussian process of the relative error, conditioned on the tests.

The process has a size (standard deviation relative to |K|) and correlation lengths (in ln frequency and ln strain).
Both maximise the restricted likelihood, see `gaussian_process`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from scipy.special import stdtrit

from bushfit.effects.contract import Array
from bushfit.effects.temperature import REFERENCE
from bushfit.effects.unnamed import Patch, SmoothCorrection
from bushfit.fitting.coordinates import ROUNDING
from bushfit.fitting.preparation import MeasuredTest, log_slopes, operating_conditions, residual_slices
from bushfit.fitting.problem import FitResult
from bushfit.fitting.shared_errors import SharedErrors
from bushfit.gaussian_process import MAXIMUM_NODES, RestrictedLikelihood, coordinates, in_lengths, patterns
from bushfit.model.covariance import Z95

#: Candidate sizes, relative to |K|: from the repeatability of the best rigs to far beyond any acceptable fit.
SIZES = np.geomspace(1e-3, 0.4, 25)
#: Lengths of the deviation of a compound from a model of few parameters: relaxation extends over decades of frequency,
#: and breakdown over more than one decade of strain.
COMPOUND_LENGTHS = (8.0, 3.0)
#: Candidate lengths, in ln frequency and in ln strain: from the distance of neighbouring points to `COMPOUND_LENGTHS`.
OVER_FREQUENCY, OVER_STRAIN = (0.15, 0.4, 1.0, 3.0, 8.0), (0.4, 1.0, 3.0)
#: Smallest likelihood, relative to the largest, of a process that enters the average; chosen for time.
_COUNTS = 0.05
#: Smallest number of degrees of freedom of a size: with fewer, Student's t has no variance.
_MINIMUM_FREEDOM = 3.0

#: Names of directions or specimens, in groups whose members share one relative error of the model.
Groups = tuple[tuple[str, ...], ...]


@dataclass(frozen=True, eq=False)
class FittedTests:
    """A fitted model and its tests at p operating points, to convert changes of stiffness into changes of residuals.

    A change of the stiffness changes all residuals of a sweep, but only two combinations of the residuals of a loop.
    The residuals of all tests are therefore reduced to d components: all residuals of a sweep, two numbers of a loop.

    Args:
        solution: result of the fit, with each test whitened separately.
        rig_errors: for each test, errors of the rig that its noise lacks, but by which the residuals are whitened as
            well; empty without such errors.
    """

    solution: FitResult
    rig_errors: Sequence[SharedErrors] = ()

    @property
    def data_sets(self) -> Sequence[MeasuredTest]:
        """Tests that the model was fitted to."""
        return self.solution.problem.tests

    @cached_property
    def directions(self) -> Array:
        """Name of the direction or specimen at each operating point, (p,)."""
        counts = [data_set.frequency.size for data_set in self.data_sets]
        return np.repeat([str(data_set.direction) for data_set in self.data_sets], counts)

    @cached_property
    def conditions(self) -> list[Array]:
        """Frequency [Hz], equivalent strain and, if the model uses it, temperature [K] of the points, (p,) each."""
        model = self.solution.model
        axes = [*operating_conditions(model.bushing, self.data_sets)]
        if "temperature" in model.depends_on:
            pairs = [(test.conditions.temperature, test.frequency.shape) for test in self.data_sets]
            kelvin = [np.broadcast_to(REFERENCE if value is None else value, shape) for value, shape in pairs]
            axes.append(np.concatenate(kelvin))
        return axes

    @property
    def free_jacobian(self) -> Array:
        """Derivatives of the whitened residuals with respect to the k parameter coordinates not at a bound, (k, n)."""
        return self.solution.jacobian[self.solution.inner_indices]

    @cached_property
    def slopes(self) -> Array:
        """Derivatives of ln K at the p points with respect to the k parameter coordinates not at a bound, (k, p)."""
        model, moving = self.solution.model, self.solution.inner_indices
        names = [self.solution.names[i] for i in moving]
        slopes = [log_slopes(model, data_set, names) for data_set in self.data_sets]
        return np.concatenate(slopes, axis=-1) * self.solution.coordinates.slopes(model.values)[moving, None]

    @cached_property
    def _loop_factors(self) -> dict[int, tuple[Array, Array]]:
        """QR factors, (n, 2) and (2, 2), of the two changes that the n residuals of a loop can have, by its index."""
        units = np.ones(self.directions.size) * np.array([[1.0], [1.0j]])
        changes = self.residual_changes(units / self._stiffness)
        blocks = residual_slices(self.data_sets)
        loops = [index for index, test in enumerate(self.data_sets) if test.kind == "loop"]
        return {index: np.linalg.qr(changes[:, blocks[index]].T) for index in loops}

    def project(self, rows: Array) -> Array:
        """Reduce whitened residuals of all tests, (..., n), to the d components that the model's stiffness can change.

        Returns:
            Components, (..., d): all residuals of a sweep, and two combinations of the residuals of a loop.
        """
        parts = [rows[..., block] for block in residual_slices(self.data_sets)]
        for index, (basis, _) in self._loop_factors.items():
            parts[index] = parts[index] @ basis
        return np.concatenate(parts, axis=-1)

    def residual_changes(self, shapes: Array, *, reduced: bool = False) -> Array:
        """Convert relative changes of the stiffness into changes of the whitened residuals.

        Args:
            shapes: c patterns of relative change of the stiffness at the operating points, complex (c, p).
            reduced: True for the changes of the d components of `project`, False for those of all n residuals.

        Returns:
            Changes, (c, n) or (c, d).
        """
        ends = np.cumsum([test.frequency.size for test in self.data_sets])[:-1]
        changes = list[Array]()
        for index, change in enumerate(np.split(shapes * self._stiffness, ends, axis=1)):
            if reduced and index in self._loop_factors:
                changes.append(np.concatenate((change.real, change.imag), axis=-1) @ self._loop_factors[index][1].T)
            else:
                rows = self.data_sets[index].residual_change(change, self.solution.model)
                changes.append(self.rig_errors[index].whiten(rows) if self.rig_errors else rows)
        return np.concatenate(changes, axis=-1)

    @cached_property
    def _stiffness(self) -> Array:
        """Stiffness of the fitted model at the operating points, complex (p,) [N/m or N m/rad]."""
        return np.concatenate([data_set.noise_free(self.solution.model).measured for data_set in self.data_sets])

    @cached_property
    def split_by_parameters(self) -> tuple[Array, Array]:
        """Changes of the residuals that the fitted parameters can cause, and the residuals that remain without them.

        Returns:
            Basis of the changes that e independent combinations of the parameters cause, orthonormal over all n
            residuals, given in the d components of `project`, (e, d); and the components of the residuals after their
            part along this basis is subtracted, (d,).
        """
        rows, residual = self.solution.jacobian, self.solution.residual
        information = rows @ rows.T
        scale = np.sqrt(np.maximum(np.diag(information), np.finfo(float).tiny))
        size, vectors = np.linalg.eigh(information / np.outer(scale, scale))
        determined = size > ROUNDING * size.max(initial=0.0)
        mixed = (vectors[:, determined] / np.sqrt(size[determined])).T / scale
        span = mixed @ self.project(rows)
        return span, self.project(residual) - (mixed @ (rows @ residual)) @ span


@dataclass(frozen=True, eq=False)
class Discrepancy:
    """Gaussian process of the relative error of a fitted model, over frequency, strain and temperature.

    Args:
        tests: fitted model and its tests, with p operating points.
        groups: groups of directions or specimens; the members of a group share one error.
        lengths: correlation lengths in ln frequency and ln strain.
        nodes: for each group, indices of the m operating points that represent the process (its nodes), (m,).
        shapes: relative error at the operating points in each of q independent patterns whose squares sum to the
            variance of the process of size 1, (q, p).
        sizes: candidate standard deviations of the process, relative to |K|, ascending, (s,).
    """

    tests: FittedTests
    groups: Groups
    lengths: tuple[float, float]
    nodes: Sequence[Array]
    shapes: Array
    sizes: Array

    @classmethod
    def over_tests(
        cls, tests: FittedTests, groups: Groups, lengths: tuple[float, float], maximum_nodes: int
    ) -> Discrepancy:
        """Build the Gaussian process of a model's error over the operating points of tests.

        Args:
            tests: fitted model and tests.
            groups: groups of directions or specimens; the members of a group share one error.
            lengths: correlation lengths in ln frequency and ln strain.
            maximum_nodes: largest number of nodes per group.

        Returns:
            The process, not yet conditioned.
        """
        nodes, shapes = [], []
        for group in groups:
            inside = np.flatnonzero(np.isin(tests.directions, group))
            chosen, near = patterns(in_lengths(coordinates(*tests.conditions)[inside], lengths), maximum_nodes)
            nodes.append(inside[chosen])
            shapes.append(np.zeros((len(near), tests.directions.size)))
            shapes[-1][:, inside] = near
        return cls(tests, groups, lengths, nodes, np.concatenate(shapes), SIZES)

    @cached_property
    def complex_shapes(self) -> Array:
        """Relative changes of the complex stiffness in q patterns of the process, first in phase, then in quadrature.

        Returns:
            Changes at the p operating points, complex (2 q, p).
        """
        return np.concatenate((self.shapes, 1j * self.shapes))

    @cached_property
    def columns(self) -> Array:
        """Changes of the residuals, reduced to d components, by the q patterns in phase and in quadrature, (2 q, d)."""
        return self.tests.residual_changes(self.complex_shapes, reduced=True)

    @cached_property
    def likelihood(self) -> RestrictedLikelihood:
        """Restricted likelihood of the standard deviation of the model's error, relative to |K|, given the tests."""
        span, remainder = self.tests.split_by_parameters
        return RestrictedLikelihood.from_columns(self.columns, remainder, span)

    @cached_property
    def maximum(self) -> tuple[float, float]:
        """Largest increase of the log likelihood by an error of the model, over `sizes`, and the size that gives it."""
        gains = self.likelihood.gains(self.sizes)
        return float(gains.max()), float(self.sizes[gains.argmax()])

    def condition(self) -> tuple[Array, Array]:
        """Condition the Gaussian process of the model's error, at its likeliest size, on the tests.

        Returns:
            Mean relative error of the model at the operating points, complex (p,), and the standard deviation of its
            real and imaginary parts, errors of the parameters included, (2, p).
        """
        size, columns, rows = self.maximum[1], self.columns, self.tests.free_jacobian
        inverse = np.linalg.inv(columns @ columns.T + np.eye(len(columns)) / size**2)
        mean = (-inverse @ columns @ self.tests.project(self.tests.solution.residual)) @ self.complex_shapes
        both = np.concatenate((columns, self.tests.project(rows)))
        information = both @ both.T
        information[len(columns) :, len(columns) :] = rows @ rows.T  # the higher harmonics of loops add information
        information[np.diag_indices(len(columns))] += 1.0 / size**2
        scale = 1.0 / np.sqrt(np.maximum(np.diag(information), np.finfo(float).tiny))
        information_values, vectors = np.linalg.eigh(information * np.outer(scale, scale))
        root = (vectors / np.sqrt(np.maximum(information_values, ROUNDING))).T * scale
        whole = root @ np.concatenate((self.complex_shapes, self.tests.slopes))
        return mean, np.array([np.linalg.norm(whole.real, axis=0), np.linalg.norm(whole.imag, axis=0)])


def average_processes(processes: Sequence[Discrepancy]) -> SmoothCorrection:
    """Average Gaussian processes of a model's error, weighted by likelihood, into one correction of the stiffness.

    Only processes that group directions as the likeliest process does are averaged, because the members of a group
    share one error. Lengths are geometric means. Few degrees of freedom determine the size, so standard deviations are
    enlarged until a normal 95 % interval is as wide as that of Student's t.

    Returns:
        Correction at the nodes, with its standard deviation, both relative to the stiffness.
    """
    best = max(processes, key=lambda process: process.maximum[0])
    lower_limit = best.maximum[0] + np.log(_COUNTS)
    processes = [process for process in processes if process.groups == best.groups and process.maximum[0] > lower_limit]
    share = np.exp([process.maximum[0] - best.maximum[0] for process in processes])
    share /= share.sum()
    freedom = float(share @ [process.likelihood.freedom(process.maximum[1]) for process in processes])
    wider = float(stdtrit(max(freedom, _MINIMUM_FREEDOM), 0.975)) / Z95
    means, errors = zip(*(process.condition() for process in processes), strict=True)
    mean = share @ np.array(means)
    deviations = np.array([[np.square((one - mean).real), np.square((one - mean).imag)] for one in means])
    error = wider * np.sqrt(np.tensordot(share, np.square(errors) + deviations, 1))
    lengths = np.exp(share @ np.log([process.lengths for process in processes]))
    size = wider * float(np.exp(share @ np.log([process.maximum[1] for process in processes])))
    patches = []
    for group, nodes in zip(best.groups, best.nodes, strict=True):
        lists = (mean[nodes].real, mean[nodes].imag, *error[:, nodes])
        frequency, strain, *kelvin = (tuple(axis[nodes].tolist()) for axis in best.tests.conditions)
        patches.append(Patch(group, frequency, strain, *(tuple(row.tolist()) for row in lists), *kelvin))
    return SmoothCorrection(size, (float(lengths[0]), float(lengths[1])), tuple(patches))


def candidate_processes(tests: FittedTests) -> list[Discrepancy]:
    """Build the 15 or 30 Gaussian processes that may describe a model's misfit, to be compared by likelihood.

    For each pair of correlation lengths, in ln frequency and in ln strain, the list has two processes: one error for
    all directions, and independent errors of the directions.
    """
    names = tuple(dict.fromkeys(tests.directions.tolist()))
    shared = dict.fromkeys([(names,), tuple((name,) for name in names)])
    pairs = product(shared, product(OVER_FREQUENCY, OVER_STRAIN))
    return [Discrepancy.over_tests(tests, groups, lengths, MAXIMUM_NODES) for groups, lengths in pairs]
