"""Terms beside all parameters: what a stiffness that is added over frequency and motion does to the residuals, and
whether it stands where it was not fitted."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.holdout import HoldOut, Part
from bushfit.effects.contract import Array
from bushfit.fitting.data_sets import DataSet, SweepData, parted
from bushfit.fitting.solve import Coordinates, jacobian, residual
from bushfit.geometry import STRAINING
from bushfit.model.model import Model

#: What a term counts in: N/m (or N m/rad) over displacement, Pa over strain, or shares of the stiffness over strain.
Measure = Literal["stiffness", "modulus", "gain"]
#: Squared standard error of a coordinate at the largest, inverse: coordinates are of order one, and what the tests
#: leave open stays open a thousand times that.
_LEAST_PRECISION = 1e-6
#: Share of the excess over the noise floor that may be left of what was held out.
_HALF = 0.5
#: How much the gap of a single part may grow: chance makes about a tenth.
_MOST_WORSENED = 1.1


@dataclass(frozen=True, eq=False)
class Terms:
    """The operating points of all tests that a term acts on: the bushing's and specimens', but no moduli of coupons.

    Args:
        measure: what the term counts in.
    """

    evidence: Evidence
    measure: Measure

    @cached_property
    def data_sets(self) -> list[DataSet]:
        """The tests that it acts on."""
        return [data_set for data_set in self.evidence.data_sets if data_set.direction.motion is not STRAINING]

    @property
    def sensible(self) -> bool:
        """Whether such a term means one thing: one stiffness cannot be added to displacement and to rotation."""
        motions = {data_set.direction.motion for data_set in self.data_sets}
        return len(motions) == 1 if self.measure == "stiffness" else bool(motions)

    @cached_property
    def place(self) -> list[slice]:
        """Where the points of each test stand."""
        ends = np.cumsum([data_set.frequency.size for data_set in self.data_sets]).tolist()
        return [slice(end - each.frequency.size, end) for end, each in zip(ends, self.data_sets, strict=True)]

    @cached_property
    def directions(self) -> Array:
        """Of each point, by name, (p,)."""
        return np.concatenate([[str(each.direction)] * each.frequency.size for each in self.data_sets])

    @cached_property
    def points(self) -> Array:
        """Logarithms of frequency [Hz] and motion [m, rad or 1] of each point, (p, 2)."""
        model = self.evidence.model
        per = [1.0 if self.measure == "stiffness" else model.unit_strain(each.direction) for each in self.data_sets]
        axes = [(each.frequency, each.amplitude * factor) for each, factor in zip(self.data_sets, per, strict=True)]
        return np.log(np.concatenate(axes, axis=-1).T)

    @cached_property
    def stiffness(self) -> Array:
        """Of the model at each point, complex, (p,) [N/m or N m/rad]."""
        return np.concatenate([each.noise_free(self.evidence.model).measured for each in self.data_sets])

    def unit(self, model: Model) -> Array:
        """What one unit of the term adds at each point, (p,) [N/m or N m/rad]."""
        units = []
        for each in self.data_sets:
            test = each.direction, each.frequency, each.amplitude
            match self.measure:
                case "gain":
                    units.append(model.stiffness(*test, kind=each.kind))
                case "modulus":
                    units.append(np.full(each.frequency.size, model.stiffness_per_modulus(each.direction)))
                case "stiffness":
                    units.append(np.ones(each.frequency.size))
        return np.concatenate(units)

    def columns(self, values: Array, model: Model, beside: Array | None = None) -> Array:
        """What small values of the term at the points, complex (c, p), do to the whitened residuals, (c, n), beside a
        value that it has already, (p,)."""
        unit, moved = self.unit(model), np.zeros((len(values), self.evidence.residual.size))
        change, there = values * unit, np.zeros_like(unit) if beside is None else beside * unit
        for each, place in zip(self.data_sets, self.place, strict=True):
            moved[:, self.evidence.place[each]] = each.moved(change[:, place], model, there[place])
        return moved

    def residual(self, value: Array, model: Model) -> Array:
        """Whitened residuals of a model with the term of a value at the points, complex (p,), exact, (n,)."""
        left, added = residual(model, self.evidence.data_sets), value * self.unit(model)
        for each, place in zip(self.data_sets, self.place, strict=True):
            left[self.evidence.place[each]] = each.residual_with(added[place], model)
        return left

    def jacobian(self, value: Array, model: Model, names: Sequence[str]) -> Array:
        """Derivatives of these by fit coordinate of the model, (len(names), n)."""
        rows, added = jacobian(model, self.evidence.data_sets, names), value * self.unit(model)
        slopes = Coordinates.of(model, names).slopes(model.values)[:, None]
        for each, place in zip(self.data_sets, self.place, strict=True):
            own = each.jacobian_with(added[place], model, names, as_share=self.measure == "gain")
            rows[:, self.evidence.place[each]] = slopes * own
        return rows

    def centre(self, shape: Array) -> Array:
        """Where the tests see most of a term of this shape, (p,): points weighted by the residuals they have, (2,)."""
        moved = self.columns(shape[None].astype(complex), self.evidence.model)[0]
        weights = np.square(np.abs(shape * self.unit(self.evidence.model) / self.stiffness))
        for each, place in zip(self.data_sets, self.place, strict=True):
            seen = np.sum(np.square(moved[self.evidence.place[each]]))
            weights[place] *= seen / weights[place].sum()
        return np.average(self.points, axis=0, weights=weights)


def predicted(residual: Array, columns: Array, precision: Array, chosen: Array) -> tuple[Array, Array]:
    """Residuals of the chosen rows, (n,) bool, with the amounts of columns fitted to the others, and their variance.

    Args:
        residual: whitened, (n,).
        columns: what a unit of each amount does to them, (c, n).
        precision: of what is known of each amount beforehand, inverse variances, (c,).
    """
    rest = columns[:, ~chosen]
    scale = 1.0 / np.sqrt(np.sum(np.square(rest), axis=1) + precision + _LEAST_PRECISION)
    information = (rest * scale[:, None]) @ (rest * scale[:, None]).T
    information += np.diag((precision + _LEAST_PRECISION) * scale**2)
    covariance = np.linalg.inv(information) * np.outer(scale, scale)
    own = columns[:, chosen]
    left = residual[chosen] - (rest @ residual[~chosen]) @ covariance @ own
    return left, 1.0 + np.sum((covariance @ own) * own, axis=0)


def log_score(left: Array, variance: Array) -> float:
    """Mean logarithm of the density that a prediction gave to residuals, but for a constant; higher is better."""
    return float(-0.5 * np.mean(np.square(left) / variance + np.log(variance)))


def halves(held: HoldOut) -> bool:
    """Whether the excess of what was held out over the noise floor at least halves, and no part grows."""
    if held.before is None or held.after is None:
        return False
    halved = max(held.after - 1.0, 0.0) <= _HALF * max(held.before - 1.0, 0.0)
    return halved and all(part.after <= _MOST_WORSENED * max(part.before, 1.0) for part in held.parts)


def inner_parts(data_sets: Sequence[DataSet]) -> Iterator[Part]:
    """Whole runs inside the range: every third frequency, the middle level, a repeat."""
    yield from _parts(data_sets, _inside)


def end_parts(data_sets: Sequence[DataSet]) -> Iterator[Part]:
    """The ends of the range: the lowest and the highest third of the steps, the smallest and the largest level."""
    yield from _parts(data_sets, _ends)


def _inside(sweep: SweepData) -> dict[str, Array]:
    levels, level = np.unique(sweep.held, return_inverse=True)
    between = np.zeros(level.size, dtype=bool)
    for each in range(levels.size):
        _, step = np.unique(sweep.step[level == each], return_inverse=True)
        between[level == each] = (step % 3 == 1) & (step < step.max())
    middle = (level == levels.size // 2) & (levels.size > 2)
    last = (sweep.repeat == sweep.repeat.max()) & (sweep.repeat.min() < sweep.repeat.max())
    return {
        f"every third {sweep.sweep.stepped or 'point'}": between,
        "the middle of what is held": middle,
        "the last repeat": last,
    }


def _ends(sweep: SweepData) -> dict[str, Array]:
    what = sweep.sweep.stepped or "point"
    low, high = np.quantile(sweep.step, (1.0 / 3.0, 2.0 / 3.0))
    several = np.unique(sweep.held).size > 1
    return {
        f"the lowest third of each {what}": sweep.step < low,
        f"the highest third of each {what}": sweep.step > high,
        "the least of what is held": (sweep.held == sweep.held.min()) & several,
        "the largest of what is held": (sweep.held == sweep.held.max()) & several,
    }


def _parts(data_sets: Sequence[DataSet], of: Callable[[SweepData], dict[str, Array]]) -> Iterator[Part]:
    """Parts that all sweeps have points of, by name."""
    chosen: dict[str, dict[DataSet, Array]] = {}
    for sweep in parted(data_sets)[1]:
        for name, points in of(sweep).items():
            if points.any():
                chosen.setdefault(name, {})[sweep] = points
    nothing = {data: np.zeros(data.size // data.parts, dtype=bool) for data in data_sets}
    for name, own in chosen.items():
        yield Part(name, list((nothing | own).values()))
