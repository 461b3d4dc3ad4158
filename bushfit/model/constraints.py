"""Constraints of a model's parameters that do not come from its tests: priors from earlier knowledge, and ties."""

import ast
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from bushfit.effects import get_parameter, is_parameter, library_parameters
from bushfit.effects.contract import Array
from bushfit.errors import ModelError
from bushfit.validation import unknown_key

#: Functions of an expression; all are analytic, as the complex steps of their derivatives require.
_FUNCTIONS = {"exp": np.exp, "log": np.log, "sqrt": np.sqrt}
#: Parts of Python's grammar that an expression may have; attributes, subscripts and texts are not among them.
_GRAMMAR = {"module", "expr", "expression", "binop", "unaryop", "call", "name", "constant"}
#: Name of a parameter in an expression, with the name of a body after a dot; a function has a bracket behind it.
_NAME = r"(?<![\w.])[A-Za-z_]\w*(?:\.(?:(?:{bodies})(?!\w)|[\w.]*))?(?!\w*\s*\()"
#: Relative step into the complex plane: a derivative so taken is exact to rounding.
_STEP = 1e-30
#: Factor on the standard deviation of a prior that is weak beside any test.
_WEAK = 100.0


@dataclass(frozen=True, eq=False)
class Prior:
    """Normal distribution of parameters known before the tests, such as from an earlier campaign.

    Args:
        names: names of the k parameters.
        mean: expected values [SI], (k,).
        covariance: covariance of the errors of these values [SI], (k, k), positive definite.
        source: earlier knowledge as the user stated it, such as "0.24 +- 0.03".
    """

    names: tuple[str, ...]
    mean: Array
    covariance: Array
    source: str


@dataclass(frozen=True)
class Tie:
    """Parameter whose value follows from other parameters.

    Args:
        name: name of the tied parameter.
        expression: expression of other parameters [SI], such as "0.5 * mu".
        names: names of these parameters, in the order of their first use.
        code: expression with p0, p1 and so on in place of these names.
        file: campaign file of the tie, for errors.
    """

    name: str
    expression: str
    names: tuple[str, ...]
    code: str
    file: Path | None = None

    @classmethod
    def from_expression(cls, name: str, expression: str, bodies: Sequence[str] = (), file: Path | None = None) -> "Tie":
        """Parse the expression of a tie.

        Args:
            name: name of the tied parameter.
            expression: numbers, parameters, + - * / ** and brackets, exp, log and sqrt.
            bodies: names of bushings, specimens and directions, which may contain blanks and other characters.
            file: campaign file of the tie.

        Returns:
            The tie.

        Raises:
            CampaignError: a name is unknown.
            ModelError: the expression has another element.
        """
        longest_first = sorted(map(re.escape, bodies), key=len, reverse=True)
        pattern = re.compile(_NAME.format(bodies="|".join(longest_first) or "(?!)"))
        names = tuple(dict.fromkeys(pattern.findall(expression)))
        for used in names:
            if not is_parameter(used):
                hint = "expressions have values in SI units, without the units"
                raise unknown_key(used, library_parameters(), hint)
        code = pattern.sub(lambda match: f"p{names.index(match[0])}", expression)
        tie = cls(name, expression, names, code, file)
        tie.value({used: get_parameter(used).typical + 0j for used in names})  # complex, as for derivatives
        return tie

    def value(self, values: Mapping[str, Any]) -> Any:
        """Value of the tied parameter, from parameter values [SI] by name.

        Returns:
            Value [SI]; complex if a parameter value is complex.

        Raises:
            ModelError: the expression has no value, or no real value of real parameters.
        """
        try:
            with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
                symbols = {f"p{i}": values[name] for i, name in enumerate(self.names)}
                ast.parse(self.code.strip(), mode="eval")  # asteval also takes several expressions
                interpreter = _interpreter()
                interpreter.symtable.update(symbols)
                interpreter.error = []
                # a text or a function is no number
                value = interpreter(self.code, show_errors=False, raise_errors=True) + 0.0
            if not any(isinstance(number, complex) for number in symbols.values()) and not np.isfinite(float(value)):
                raise ValueError(value)
        except Exception as error:
            raise ModelError(
                "this expression has no value",
                file=self.file,
                place=f"fit.{self.name}",
                found=self.expression,
                expected="numbers, names of parameters, + - * / ** ( ), exp, log and sqrt",
                hint="write ** for a power" if "^" in self.expression else None,
            ) from error
        return value


@cache
def _interpreter() -> Any:
    """Interpreter (asteval, as in lmfit) of the expressions of ties, restricted to arithmetic; created once."""
    from asteval import Interpreter
    from asteval.asteval import ALL_NODES

    refused = dict.fromkeys(set(ALL_NODES) - _GRAMMAR, False)
    return Interpreter(symtable=dict(_FUNCTIONS), minimal=True, use_numpy=False, config=refused)


@dataclass(frozen=True, eq=False)
class Constraints:
    """Constraints that apply to every fit of a model.

    Args:
        priors: independent priors of parameters; a prior applies to those of its parameters that a model has.
        ties: ties of parameters, each after the ties of the parameters that it uses. A tie applies to models that have
            all its parameters.
    """

    priors: Sequence[Prior] = ()
    ties: Sequence[Tie] = ()

    def active_ties(self, values: Mapping[str, Any]) -> list[Tie]:
        """Ties that apply to a model with the given parameters."""
        return [tie for tie in self.ties if {tie.name, *tie.names} <= values.keys()]

    def weaken(self, *weak: Prior) -> "Constraints":
        """Return the constraints with some priors made so wide that they matter only for undetermined parameters."""
        priors = [
            replace(prior, covariance=_WEAK**2 * prior.covariance) if prior in weak else prior for prior in self.priors
        ]
        return replace(self, priors=priors)

    def tied_values(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Parameter values [SI] by name, with the values of tied parameters computed from the others."""
        tied = dict(values)
        for tie in self.active_ties(values):
            tied[tie.name] = tie.value(tied)
        return tied

    def slopes(self, values: Mapping[str, float], names: Sequence[str]) -> Array:
        """Derivatives of the t tied parameters with respect to other parameters, by complex steps.

        Args:
            values: parameter values [SI] by name.
            names: names of the k other parameters.

        Returns:
            Derivatives, (k, t).
        """
        tied = [tie.name for tie in self.active_ties(values)]
        slopes = np.zeros((len(names), len(tied)))
        for i, name in enumerate(names if tied else ()):
            step = _STEP * (abs(values[name]) or 1.0)
            stepped = self.tied_values({**values, name: values[name] + 1j * step})
            slopes[i] = [np.imag(stepped[tie]) / step for tie in tied]
        return slopes


#: Constraints of a model that only its tests determine.
UNCONSTRAINED = Constraints()
