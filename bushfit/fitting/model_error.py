"""Model error: what a fit counts beside noise where the model misses the tests by more than that.

A smooth error of the model bends its parameters to the quietest test if noise is all that weighs, and their intervals
are far too narrow. Counted as what it is, tests weigh by what they can tell, and intervals are as wide as is true.

Notes:
    The relative error c of the complex stiffness is a Gaussian process over ln frequency and ln strain, alike in phase
    and in quadrature, which tests share (M. C. Kennedy, A. O'Hagan, J. R. Statist. Soc. B 63 (2001) 425-464). It is
    smooth over a decade at the most, as its prior has to say what it may not do (J. Brynjarsdottir, A. O'Hagan, Inverse
    Problems 30 (2014) 114007): what is smoother is what the parameters are for. Its size and lengths are those of most
    restricted likelihood (H. D. Patterson, R. Thompson, Biometrika 58 (1971) 545-554): with columns U of the whitened
    residuals by its amounts, and the parameters projected out, twice the logarithm gains
    sum(v^2 b^2/(1 + v^2 l) - ln(1 + v^2 l)) by a size v, l the eigenvalues of U^T P U and b the components of U^T P r
    along its eigenvectors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, product

import numpy as np
from scipy.linalg import block_diag
from scipy.special import logsumexp

from bushfit.campaign.schema import UNSTATED, RigSettings
from bushfit.effects import BASE
from bushfit.effects.contract import Array
from bushfit.effects.temperature import REFERENCE
from bushfit.effects.unnamed import Patch, Unnamed
from bushfit.errors import FitError
from bushfit.fitting.common_error import CommonError, Joined, Seen
from bushfit.fitting.coordinates import ROUNDING, Bounds, Solution, anderson, coordinate_bounds
from bushfit.fitting.data_sets import DataSet, LoopData, log_slopes, parted, reached, rows_of
from bushfit.fitting.levels import level_errors_of
from bushfit.fitting.rig_class import of_class
from bushfit.fitting.robust import Estimate
from bushfit.fitting.solve import solve
from bushfit.fitting.starts import start_values
from bushfit.gaussian_process import MAXIMUM_NODES, RestrictedLikelihood, coordinates, in_lengths, patterns
from bushfit.model.model import Model
from bushfit.units import number

#: Sizes tried, relative to |K|: from what the best rigs repeat to what no one calls a fit.
_SIZES = np.geomspace(1e-3, 0.4, 25)
#: Lengths tried, in ln frequency and ln strain: from next points apart to a decade; the parameters are for what is
#: smoother.
_LENGTHS = (0.4, 0.9, 2.0)
#: Odds beforehand of something smooth that the model lacks, against nothing; as `diagnose` has them.
_ODDS = 0.2
#: Gain of the logarithm of the likelihood by an error of middling lengths, up to which no others are tried; chosen: of
#: clean campaigns three in four stay below. And its nodes: few, as it is but looked for.
_SHOWS, _FEW = 0.5, 16
#: Difference of the logarithm of the likelihood from the best, beyond which an error is tried no more.
_FAR = 12.0
#: Rounds in which error and parameters follow each other, at most, and the share of a standard error by which the
#: parameters still move when they have settled.
_MOST_ROUNDS, _SETTLED = 12, 0.1

#: Directions and specimens, by name, in groups.
_Groups = tuple[tuple[str, ...], ...]


@dataclass(frozen=True, eq=False)
class _FittedTests:
    """A fitted model and its tests, as far as errors beside it are concerned.

    Args:
        solution: residuals and derivatives in noise alone.
        errors: of each test, whitened residuals that one standard deviation of each of the rig's errors makes, (w, n).
    """

    solution: Solution
    data_sets: Sequence[DataSet]
    errors: Sequence[Array]

    @cached_property
    def names(self) -> Array:
        """Direction or specimen of each point, (p,)."""
        return np.repeat(
            [str(each.direction) for each in self.data_sets], [each.frequency.size for each in self.data_sets]
        )

    @cached_property
    def directions(self) -> tuple[str, ...]:
        """Each of these once."""
        return tuple(dict.fromkeys(self.names.tolist()))

    @cached_property
    def points(self) -> Array:
        """Place of each point, (p, 2 or 3)."""
        return coordinates(*self.conditions)

    @cached_property
    def conditions(self) -> list[Array]:
        """Frequency [Hz] and equivalent strain of each point, and its temperature [K] if the model knows of it."""
        model = self.solution.model
        found = [*reached(model.bushing, self.data_sets)]
        if model.knows_temperature:
            known = [REFERENCE if (at := each.circumstances.temperature) is None else at for each in self.data_sets]
            pairs = zip(known, self.data_sets, strict=True)
            found.append(np.concatenate([np.broadcast_to(kelvin, each.frequency.shape) for kelvin, each in pairs]))
        return found

    @property
    def moving(self) -> Array:
        """Derivatives of the residuals by coordinate of the parameters that rest on no bound, (k, n)."""
        return self.solution.jacobian[self.solution.moving]

    @cached_property
    def slopes(self) -> Array:
        """Derivatives of ln K at the points by coordinate, of the parameters that rest on no bound, complex (k, p)."""
        model, coordinates = self.solution.model, self.solution.coordinates
        names = [coordinates.names[i] for i in self.solution.moving]
        found = np.concatenate([log_slopes(model, each, names) for each in self.data_sets], axis=-1)
        return found * coordinates.slopes(model.values)[self.solution.moving, None]

    @cached_property
    def seen(self) -> Seen:
        """What changes of the tests' stiffness can move of the residuals: all of a sweep, two numbers of a loop."""
        pairs = zip(rows_of(self.data_sets), self._loops, strict=True)
        return Seen([(own, None if loop is None else loop[0]) for own, loop in pairs])

    def made(self, shapes: Array) -> Array:
        """Of the residuals that relative changes of the stiffness make, complex (c, p), what is seen, (c, d)."""
        found, first, changes = [], 0, shapes * self._stiffness
        for each, loop in zip(self.data_sets, self._loops, strict=True):
            change = changes[:, first : first + each.frequency.size]
            parts = np.concatenate((change.real, change.imag), axis=-1)
            found.append(each.moved(change, self.solution.model) if loop is None else parts @ loop[1])
            first += each.frequency.size
        return np.concatenate(found, axis=-1)

    @cached_property
    def _stiffness(self) -> Array:
        """Of the model at each point, complex, (p,)."""
        return np.concatenate([each.noise_free(self.solution.model).measured for each in self.data_sets])

    @cached_property
    def _loops(self) -> list[tuple[Array, Array] | None]:
        """Of each loop orthonormal directions of these residuals, (n, 2), and what 1 and i of a change make along them,
        (2, 2); None of a sweep."""
        both, found = np.array([[1.0], [1.0j]]), list[tuple[Array, Array] | None]()
        for each in self.data_sets:
            if each.kind == "loop":
                along, made = np.linalg.qr(each.moved(both, self.solution.model).T)
                found.append((along, made.T))
            else:
                found.append(None)
        return found

    @cached_property
    def left(self) -> tuple[Array, Array]:
        """Of what the parameters and the rig's errors make, orthonormal but for what is known of the latter, and of
        what both leave, the part that is seen, (k, d) and (d,)."""
        rows, residual, owns = self.solution.jacobian, self.solution.residual, rows_of(self.data_sets)
        across = np.concatenate([rows[:, own] @ each.T for own, each in zip(owns, self.errors, strict=True)], axis=1)
        among = block_diag(*(each @ each.T for each in self.errors))
        information = np.block([[rows @ rows.T, across], [across.T, among + np.eye(len(among))]])
        scale = np.sqrt(np.maximum(np.diag(information), np.finfo(float).tiny))
        size, vectors = np.linalg.eigh(information / np.outer(scale, scale))
        known = size > ROUNDING * size.max(initial=0.0)
        mixed = (vectors[:, known] / np.sqrt(size[known])).T / scale
        seen = block_diag(*(self.seen.of_part(number, each) for number, each in enumerate(self.errors)))
        span = mixed @ np.concatenate((self.seen.of(rows), seen))
        along = [rows @ residual, *(each @ residual[own] for own, each in zip(owns, self.errors, strict=True))]
        return span, self.seen.of(residual) - (mixed @ np.concatenate(along)) @ span


@dataclass(frozen=True, eq=False)
class _Prior:
    """A smooth error of some tests, whatever model is fitted to them.

    Args:
        groups: directions and specimens that share it, by name.
        lengths: over which it changes, in ln frequency and ln strain.
        nodes: of each group, numbers of points, (m,).
        shapes: the error at the points by its amounts, (q, p).
    """

    groups: _Groups
    lengths: tuple[float, float]
    nodes: Sequence[Array]
    shapes: Array

    @classmethod
    def of(
        cls, tests: _FittedTests, groups: _Groups, lengths: tuple[float, float], most: int = MAXIMUM_NODES
    ) -> _Prior:
        """The error at the points of some tests, by so many nodes at most."""
        nodes, shapes = [], []
        for group in groups:
            inside = np.flatnonzero(np.isin(tests.names, group))
            own, near = patterns(in_lengths(tests.points[inside], lengths), most)
            here = np.zeros((len(near), len(tests.points)))
            here[:, inside] = near
            nodes.append(inside[own])
            shapes.append(here)
        return cls(groups, lengths, nodes, np.concatenate(shapes))


@dataclass(frozen=True, eq=False)
class _Error:
    """A smooth error beside a fitted model."""

    tests: _FittedTests
    prior: _Prior

    @cached_property
    def shapes(self) -> Array:
        """The error at the points by a unit of each amount, in phase, then in quadrature, complex (2 q, p)."""
        return np.concatenate((self.prior.shapes, 1j * self.prior.shapes))

    @cached_property
    def _likelihood(self) -> RestrictedLikelihood:
        span, left = self.tests.left
        return RestrictedLikelihood.of(self.tests.made(self.shapes), left, span)

    @cached_property
    def _gains(self) -> Array:
        """Of the logarithm of the restricted likelihood at each size, (sizes,)."""
        return self._likelihood.gains(_SIZES)

    @property
    def best(self) -> tuple[float, float]:
        """The largest gain, and the size that brings it."""
        return float(self._gains.max()), float(_SIZES[self._gains.argmax()])

    @property
    def log_evidence(self) -> float:
        """Of the tests with it, all sizes as likely, over that without."""
        return self._likelihood.log_evidence(_SIZES)

    def joined(self, data_sets: Sequence[DataSet]) -> Joined:
        """The tests, with weights of their own, and the error that they share."""
        tests = replace(self.tests, data_sets=data_sets)
        error = CommonError(self.best[1] * tests.made(self.shapes), tests.seen)
        return Joined(tuple(data_sets), error, self._likelihood.freedom(self.best[1]))

    def data(self, size: float) -> Unnamed:
        """The error, of a size, as the tests leave it."""
        columns, rows = self.tests.made(self.shapes), self.tests.moving
        inverse = np.linalg.inv(columns @ columns.T + np.eye(len(columns)) / size**2)
        value = (-inverse @ columns @ self.tests.seen.of(self.tests.solution.residual)) @ self.shapes
        both = np.concatenate((columns, self.tests.seen.of(rows)))
        information = both @ both.T
        information[len(columns) :, len(columns) :] = rows @ rows.T  # loops tell more than by a change of stiffness
        information[np.diag_indices(len(columns))] += 1.0 / size**2
        scale = 1.0 / np.sqrt(np.maximum(np.diag(information), np.finfo(float).tiny))
        known, vectors = np.linalg.eigh(information * np.outer(scale, scale))
        root = (vectors / np.sqrt(np.maximum(known, ROUNDING))).T * scale
        whole = root @ np.concatenate((self.shapes, self.tests.slopes))
        errors = np.linalg.norm(whole.real, axis=0), np.linalg.norm(whole.imag, axis=0)
        patches = []
        for group, nodes in zip(self.prior.groups, self.prior.nodes, strict=True):
            lists = (value[nodes].real, value[nodes].imag, *(error[nodes] for error in errors))
            frequency, strain, *kelvin = (tuple(axis[nodes].tolist()) for axis in self.tests.conditions)
            patches.append(Patch(group, frequency, strain, *(tuple(one.tolist()) for one in lists), *kelvin))
        return Unnamed(size, self.prior.lengths, tuple(patches))


def with_model_error(found: Estimate, bounds: Bounds, rig: RigSettings = UNSTATED) -> tuple[Estimate, Unnamed | None]:
    """A fit with an error of the model beside the noise, and that error, where the tests are likelier with it; else the
    fit as it was, and None. Likelier, that is, than with what a rig of the class makes.
    """
    names = found.solution.coordinates.names
    if not names:
        return found, None
    tests = _FittedTests(found.solution, found.minimised, _of_class(found.minimised, rig))
    together = _Prior.of(tests, (tests.directions,), _LENGTHS[1:3], _FEW)
    if _Error(tests, together).best[0] <= _SHOWS:
        return found, None
    tried = _tried(tests)
    if float(logsumexp([each.log_evidence for each in tried])) - np.log(len(tried)) + np.log(_ODDS) < 0.0:
        return found, None
    asked, answered = list[Array](), list[Array]()
    for _ in range(_MOST_ROUNDS):
        error = max(tried, key=lambda each: each.best[0])
        if error.best[1] >= _SIZES[-1]:  # that is no error of a model, but another thing than it
            return found, None
        before, shaped = tests.solution, _shaped(found.minimised, error.best[1])
        joined, starts = error.joined(shaped), [before.model] if asked else [before.model, *_alive(before, shaped)]
        ends = [solve(start, joined, names, bounds, strict=False) for start in starts]
        after = min(ends, key=lambda each: each.chi_square)
        asked.append(before.coordinates.point(before.model.values))
        answered.append(after.coordinates.point(after.model.values))
        if float(np.linalg.norm((answered[-1] - asked[-1]) @ after.jacobian)) < _SETTLED:
            break
        ahead = np.clip(anderson(asked, answered), *coordinate_bounds(after.coordinates, bounds))
        tests = _at(after, after.coordinates.possible(ahead), shaped)
        tried = [_Error(tests, each.prior) for each in tried]
        if len(asked) > 1:  # about a model that the error no longer bends
            best = max(each.best[0] for each in tried)
            tried = [each for each in tried if each.best[0] > best - _FAR]
    tests = _at(after, after.model.values, shaped)
    size = error.best[1]
    data = replace(error, tests=tests).data(size)
    if data.typical >= _SIZES[-1]:
        return found, None
    each = found.data_sets, found.minimised, found.weighed
    made = {id(part): error.joined(_shaped(part, size)) for part in each}  # mostly the same tests
    whole, minimised, weighed = (made[id(part)] for part in each)
    return Estimate(after, whole, minimised, weighed, found.outliers), data


def log_likelihood(found: Estimate, known: Mapping[str, float]) -> float:
    """The logarithm of the restricted likelihood of a fit, the parameters that rest on no bound integrated.

    Args:
        known: precision beforehand of parameters, by coordinate; of the others it is 0.
    """
    solution, tests = found.solution, found.minimised
    rows = solution.jacobian[solution.moving]
    beforehand = [known.get(solution.coordinates.names[i], 0.0) for i in solution.moving]
    size = sum(loop.log_size for loop in parted(tests)[0]) + (
        tests.error.log_size if isinstance(tests, Joined) else 0.0
    )
    size += float(np.linalg.slogdet(rows @ rows.T + np.diag(beforehand))[1])
    return -0.5 * (solution.chi_square + size)


def _alive(solution: Solution, data_sets: Sequence[DataSet]) -> list[Model]:
    """A model to start from, its branches as read off the tests: a fit bent by noise may have lost one for good."""
    model, moved = solution.model, solution.coordinates.names
    known = {name: value for name, value in model.values.items() if name not in moved}
    with suppress(FitError):  # tests that no rubber gives
        paper = Model.with_defaults(model.bushing, BASE, start_values(model.bushing, data_sets, known))
        others = [paper.starts(effect)[0].items() for effect in model.records]
        values = {**paper.values, **dict(chain.from_iterable(others))}
        return [model.with_values({name: values[name] for name in moved if name in values})]
    return []


def _at(solution: Solution, values: Mapping[str, float], data_sets: Sequence[DataSet]) -> _FittedTests:
    """A fit with its parameters at other values, and the tests in noise alone."""
    found = solution.at(solution.model.with_values(values), data_sets)
    return _FittedTests(found, data_sets, [np.empty((0, each.size)) for each in data_sets])


def _of_class(data_sets: Sequence[DataSet], rig: RigSettings) -> list[Array]:
    """Whitened residuals of each test that the errors of a rig of the class make beside what is counted: the gain of a
    loop, and gain and phase of each level, (w, n)."""
    found = []
    for each in data_sets:
        if isinstance(each, LoopData):
            own = each.gain_error * each.unit_gain[None]
            found.append(own[:0] if each.gain_weighs else own)
        else:
            beyond = np.sqrt(np.maximum(np.square(of_class(rig)) - np.square(each.noise.level), 0.0))
            columns = level_errors_of(each)
            found.append(columns * np.tile(beyond, len(columns) // 2)[:, None])
    return found


def _shaped(data_sets: Sequence[DataSet], size: float) -> list[DataSet]:
    """The same tests, the shape of loops off by as much as their stiffness."""
    return [replace(each, shape_error=size) if isinstance(each, LoopData) else each for each in data_sets]


def _tried(tests: _FittedTests) -> list[_Error]:
    """Errors of all tests together, and of each direction by itself, of all lengths."""
    shared = dict.fromkeys([(tests.directions,), tuple((name,) for name in tests.directions)])
    pairs = product(shared, product(_LENGTHS, _LENGTHS))
    return [_Error(tests, _Prior.of(tests, groups, lengths, MAXIMUM_NODES)) for groups, lengths in pairs]


def model_error_warning(error: Unnamed) -> str:
    """What is said of a model error, for people."""
    reached = np.ptp(np.concatenate([each.nodes[:, :2] for each in error.patches]), axis=0)
    lengths = zip(error.lengths, reached, strict=True)
    smooth = [
        f"{number(length / np.log(10.0), 1)} decades of {axis}"
        for axis, (length, reach) in zip(("frequency", "strain"), lengths, strict=True)
        if reach > 0.0
    ]
    over = f", smooth over {' and '.join(smooth)}," if smooth else ""
    return (
        "the model misses the data by more than their noise: a model error of "
        f"{number(100.0 * error.typical, 2)} % of |K|{over} counts beside it, in all intervals and bands"
    )
