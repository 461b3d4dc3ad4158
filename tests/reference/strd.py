"""The nonlinear regression problems of the NIST Statistical Reference Datasets, as the fit's own entry takes them.

The files in `strd` are NIST's, to the letter; the formula of each problem is read off its file.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bushfit.effects import Parameter
from bushfit.effects.contract import Array
from bushfit.model.constraints import UNCONSTRAINED, Constraints

FOLDER = Path(__file__).with_name("strd")
#: How far from its start a parameter may go, in units of the start's size: bushfit's fits have bounds always.
_REACH = 1e7


@dataclass(frozen=True, eq=False)
class Curve:
    """Stands for the model: named values, each with its bounds and its scale; fitted as the paper's effects are."""

    values: Mapping[str, float]
    parameters: Mapping[str, Parameter]
    effects: tuple[str, ...] = ()
    constraints: Constraints = UNCONSTRAINED
    tied_names: tuple[str, ...] = ()

    def with_values(self, values: Mapping[str, float]) -> Curve:
        return replace(self, values={**self.values, **values})


@dataclass(frozen=True, eq=False)
class Problem:
    """One file: formula, data, two starts, certified values and their standard errors."""

    name: str
    level: str
    formula: Any
    predictors: Mapping[str, Array]
    response: Array
    starts: tuple[dict[str, float], dict[str, float]]
    certified: Mapping[str, float]
    stderr: Mapping[str, float]
    scatter: float

    @classmethod
    def read(cls, file: Path) -> Problem:
        text = file.read_text(encoding="ascii")
        level = re.search(r"(Lower|Average|Higher) Level of Difficulty", text)
        left, right = re.search(r"^ +(y|log\[y\]) +=(.*?)\+ +e *$", text, re.MULTILINE | re.DOTALL).groups()
        rows = re.findall(r"^ *(b\d) += +(\S+) +(\S+) +(\S+) +(\S+) *$", text, re.MULTILINE)
        table = {row[0]: [float(number) for number in row[1:]] for row in rows}
        head, data = text[text.rindex("Data:") :].split("\n", 1)
        columns = dict(zip(head.split()[1:], np.loadtxt(data.splitlines(), ndmin=2).T, strict=True))
        response = columns.pop("y")
        formula = " ".join(right.split()).replace("[", "(").replace("]", ")")
        return cls(
            file.stem,
            level[1].lower(),
            compile(formula, file.name, "eval"),
            columns,
            np.log(response) if left == "log[y]" else response,
            tuple({name: row[i] for name, row in table.items()} for i in (0, 1)),
            {name: row[2] for name, row in table.items()},
            {name: row[3] for name, row in table.items()},
            float(re.search(r"Residual Standard Deviation: +(\S+)", text)[1]),
        )

    def of(self, values: Mapping[str, Any]) -> Array:
        """The formula at the data's predictors."""
        known = {"exp": np.exp, "cos": np.cos, "sin": np.sin, "arctan": np.arctan, "pi": np.pi}
        return eval(self.formula, known, {**self.predictors, **values})

    def curve(self, start: int) -> Curve:
        """The problem from NIST's start 1 or 2. What starts and ends above zero moves in its logarithm, as the
        strictly positive parameters of a rubber do; the others move in units of their start."""
        values = self.starts[start - 1]
        return Curve(values, {name: _parameter(name, values[name], self._is_positive(name)) for name in values})

    def data_set(self) -> CurveTerm:
        return CurveTerm(self)

    def _is_positive(self, name: str) -> bool:
        return min(self.certified[name], *(start[name] for start in self.starts)) > 0.0


def _parameter(name: str, start: float, log: bool) -> Parameter:
    size = abs(start)
    bounds = (size / _REACH, size * _REACH) if log else (-size * _REACH, size * _REACH)
    return Parameter(name, "1", bounds, None, size, log=log, meaning="of a reference problem")


@dataclass(frozen=True, eq=False)
class CurveTerm:
    """The data of a problem as a data set of a fit: residual and Jacobian in units of `noise`."""

    problem: Problem
    noise: float = 1.0
    compliance_error: float = 0.0

    @property
    def size(self) -> int:
        return self.problem.response.size

    @property
    def residual_count(self) -> int:
        return self.size

    def noise_sensitivity(self, slopes: Array) -> dict[Any, Array]:
        """No variance of the noise was estimated beforehand."""
        return {}

    def response(self, curve: Curve) -> Array:
        return self.problem.of(curve.values)

    def residual_of(self, response: Array) -> Array:
        return (response - self.problem.response) / self.noise

    def residual(self, curve: Curve) -> Array:
        return self.residual_of(self.response(curve))

    def recall(self, _: str, curve: Curve, names: Sequence[str]) -> Array:
        """Residuals, then derivatives by complex steps, which lose no digits."""
        slopes = [self._slope(curve.values, name) / self.noise for name in names]
        return np.stack([self.residual(curve), *slopes])

    def _slope(self, values: Mapping[str, float], name: str) -> Array:
        step = 1e-20 * abs(values[name]) or 1e-20
        return np.imag(self.problem.of({**values, name: values[name] + 1j * step})) / step


def problems() -> list[Problem]:
    return [Problem.read(file) for file in sorted(FOLDER.glob("*.dat"))]
