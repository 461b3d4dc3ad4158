"""What a fit found: a model with its uncertainty, and the JSON file that holds both."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any, Literal, cast, get_args

import numpy as np
from scipy.special import stdtrit

from bushfit import __version__
from bushfit.effects.contract import Array
from bushfit.errors import BushfitError, ModelError
from bushfit.geometry import Direction
from bushfit.model.file import read_model_file
from bushfit.model.model import Model
from bushfit.reading.measurement import Source

SCHEMA = "bushfit/model/1"
#: Half width of a 95 % interval in standard deviations, where these are known.
Z95 = 1.959963984540054
#: Beyond the one, degrees of freedom make no difference; below the other, an estimated variance says next to nothing.
_MOST_FREEDOM, _LEAST_FREEDOM = 1e6, 2.0
_PACKAGES = ("numpy", "scipy", "lmfit")

#: An end of a parameter's range.
End = Literal["min", "max"]


@dataclass(frozen=True, eq=False)
class Covariance:
    """Covariance matrix of parameter values, (k, k), in their SI units, and how well it is known itself.

    Args:
        names: of the parameters.
        matrix: (k, k).
        spread: per variance behind the matrix that was itself estimated, how far the matrix moves when that variance
            moves by its own standard error, (k, k) each.
    """

    names: tuple[str, ...] = ()
    matrix: Array = field(default_factory=lambda: np.empty((0, 0)))
    spread: tuple[Array, ...] = ()

    def stderr(self, name: str) -> float | None:
        """Standard error; None where the parameter was held at an exact value."""
        if name not in self.names:
            return None
        i = self.names.index(name)
        return float(np.sqrt(self.matrix[i, i]))

    @cached_property
    def root(self) -> Array:
        """B with B B^T the covariance, so that |B^T slope| is a standard error however ill-conditioned it is."""
        return _root(self.matrix)

    @cached_property
    def _spread_roots(self) -> list[Array]:
        return [_root(part) for part in self.spread]

    def half_width(self, slopes: Array) -> Array:
        """Half width of the 95 % interval of quantities with these slopes by parameter, (k, n) -> (n,).

        Student's t with the effective degrees of freedom of Satterthwaite (1946): 2 v^2 over the variance of v, which
        is the sum of squares of what each spread adds to the quantity's variance v.
        """
        variance = np.sum(np.square(self.root.T @ slopes), axis=0)
        moved = [np.sum(np.square(root.T @ slopes), axis=0) for root in self._spread_roots]
        unsure = np.sqrt(np.sum(np.square(moved), axis=0)) if moved else np.zeros_like(variance)
        least = np.sqrt(2.0 / _MOST_FREEDOM)
        share = np.divide(unsure, variance, out=np.zeros_like(variance), where=variance > 0.0)
        freedom = np.maximum(2.0 / np.square(np.maximum(share, least)), _LEAST_FREEDOM)
        return stdtrit(freedom, 0.975) * np.sqrt(variance)

    def correlations(self) -> list[tuple[str, str, float]]:
        """All pairs, the most correlated first."""
        sigma = np.sqrt(np.diag(self.matrix))
        pairs = [
            (self.names[i], self.names[j], float(self.matrix[i, j] / (sigma[i] * sigma[j])))
            for i in range(len(self.names))
            for j in range(i + 1, len(self.names))
            if sigma[i] * sigma[j] > 0.0
        ]
        return sorted(pairs, key=lambda pair: -abs(pair[2]))

    def restricted(self, names: Sequence[str]) -> Covariance:
        """The part of some names, in this covariance's order."""
        kept = [i for i, name in enumerate(self.names) if name in names]
        square = np.ix_(kept, kept)
        names = tuple(self.names[i] for i in kept)
        return Covariance(names, self.matrix[square], tuple(part[square] for part in self.spread))


def _root(matrix: Array) -> Array:
    sigma = np.sqrt(np.diag(matrix))
    safe = np.where(sigma > 0.0, sigma, 1.0)
    values, vectors = np.linalg.eigh(matrix / np.outer(safe, safe))
    return sigma[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))


@dataclass(frozen=True)
class Quality:
    """How well a model meets the data it was fitted to.

    Args:
        nrmse: root mean square difference, relative to half a loop's force range and to |K|.
        reduced_chi_square: mean square residual in units of noise; 1 is the floor.
        points: number of residuals.
        noise: standard deviation of one point, relative, root mean square over all.
    """

    nrmse: float
    reduced_chi_square: float
    points: int
    noise: float


@dataclass(frozen=True)
class Range:
    """What was fitted: frequencies [Hz] and equivalent strain amplitudes, least and largest, and directions; of these
    none where an older file does not say which."""

    frequency: tuple[float, float]
    strain: tuple[float, float]
    directions: tuple[Direction, ...] = ()


@dataclass(frozen=True)
class Outlier:
    """A point that lies farther off than noise explains, beside neighbours that do not.

    Args:
        test: name of the loop or sweep.
        file: it came from, as the campaign names it; None for a test that came from no file.
        row: of its data, from 1; header, comments and blank lines do not count.
        column: displacement, force or stiffness.
        distance: from where it should be, in units of noise.
    """

    test: str
    file: str | None
    row: int
    column: str
    distance: float

    @property
    def place(self) -> str:
        """Where it lies but for the row."""
        return f"{self.file or self.test}, {self.column}"


@dataclass(frozen=True, eq=False)
class Result:
    """A fitted model, or one given by hand, as the JSON files hold it.

    Args:
        model: bushing, effects and values.
        fitted: names of the parameters the fit moved.
        covariance: of the fitted parameters, and of held ones whose error is known.
        quality: None where the model was not fitted.
        measured: reach of the tests that were fitted; None where the model was not fitted.
        warnings: what a user must know before using the numbers.
        inputs: the files behind it.
        outliers: points that lie farther off than noise explains.
        profile: 95 % intervals by profile likelihood, where they were asked for; None is an open end.
        at_bound: parameters that came to rest on the least or largest value they may have, and on which.
    """

    model: Model
    fitted: tuple[str, ...] = ()
    covariance: Covariance = field(default_factory=Covariance)
    quality: Quality | None = None
    measured: Range | None = None
    warnings: tuple[str, ...] = ()
    inputs: tuple[Source, ...] = ()
    outliers: tuple[Outlier, ...] = ()
    profile: Mapping[str, tuple[float | None, float | None]] = field(default_factory=dict)
    at_bound: Mapping[str, End] = field(default_factory=dict)

    def interval(self, name: str) -> tuple[float, float] | None:
        """95 % interval of a parameter, within its bounds: symmetric in the logarithm for strictly positive ones."""
        stderr, value = self.covariance.stderr(name), self.model.values[name]
        if stderr is None:
            return None
        parameter = self.model.parameters[name]
        half = float(self.covariance.half_width(np.array(self.covariance.names)[:, None] == name)[0])
        low, high = value - half, value + half
        if parameter.log and value > 0.0:
            factor = float(np.exp(min(half / value, 300.0)))
            low, high = value / factor, value * factor
        least, most = parameter.bounds
        return max(low, min(least, value)), min(high, max(most, value))

    def to_document(self) -> dict[str, Any]:
        """JSON-ready data in the schema bushfit/model/1."""
        document: dict[str, Any] = {"schema": SCHEMA, **self.model.to_document()}
        for name, entry in document["parameters"].items():
            interval = self.interval(name)
            entry["stderr"] = self.covariance.stderr(name)
            entry["ci95"] = None if interval is None else list(interval)
            if name in self.profile:
                entry["profile95"] = list(self.profile[name])
            if name in self.at_bound:
                entry["at_bound"] = self.at_bound[name]
            entry["vary"] = name in self.fitted
        document["covariance"] = {
            "names": list(self.covariance.names),
            "matrix": self.covariance.matrix.tolist(),
            "spread": [part.tolist() for part in self.covariance.spread],
        }
        document["fit"] = None
        if self.quality and self.measured:
            document["fit"] = {
                "nrmse": self.quality.nrmse,
                "reduced_chi_square": self.quality.reduced_chi_square,
                "points": self.quality.points,
                "noise": self.quality.noise,
                "frequency_Hz": list(self.measured.frequency),
                "strain": list(self.measured.strain),
                "directions": [str(direction) for direction in self.measured.directions],
            }
        document["warnings"] = list(self.warnings)
        document["outliers"] = [asdict(outlier) for outlier in self.outliers]
        document["provenance"] = {
            "bushfit": __version__,
            "inputs": [{"file": str(source.file), "sha256": source.sha256} for source in self.inputs],
            "packages": dict(_versions()),
        }
        return document

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Result:
        """The result of `to_document`.

        Raises:
            ModelError: a key that is missing or of the wrong kind.
        """
        model = Model.from_document(document)
        try:
            fit, covariance = document.get("fit"), document.get("covariance") or {"names": [], "matrix": []}
            names = tuple(str(name) for name in covariance["names"])
            matrix, *spread = (
                np.array(part, dtype=float).reshape(len(names), len(names))
                for part in (covariance["matrix"], *covariance.get("spread", ()))
            )
            if not np.all(np.isfinite([matrix, *spread])) or not set(names) <= model.parameters.keys():
                raise ModelError("the covariance does not belong to the parameters", place="covariance")
            return cls(
                model,
                tuple(name for name, entry in document["parameters"].items() if entry.get("vary")),
                Covariance(names, matrix, tuple(spread)),
                Quality(float(fit["nrmse"]), float(fit["reduced_chi_square"]), int(fit["points"]), float(fit["noise"]))
                if fit
                else None,
                _range(fit) if fit and "strain" in fit else None,
                tuple(str(line) for line in document.get("warnings", ())),
                tuple(
                    Source(Path(entry["file"]), str(entry["sha256"]))
                    for entry in document.get("provenance", {}).get("inputs", ())
                ),
                tuple(_outlier(entry) for entry in document.get("outliers", ())),
                {
                    name: _ends(entry["profile95"])
                    for name, entry in document["parameters"].items()
                    if entry.get("profile95") is not None
                },
                {
                    name: _end(entry["at_bound"])
                    for name, entry in document["parameters"].items()
                    if "at_bound" in entry
                },
            )
        except KeyError as missing:
            raise ModelError("a key is missing", place=str(missing.args[0])) from None
        except (TypeError, ValueError, AttributeError) as wrong:
            raise ModelError("a key holds the wrong kind of value", found=str(wrong)) from None


@cache
def _versions() -> dict[str, str]:
    """Of the packages that the numbers rest on; reading them takes as long as a tenth of a fit."""
    return {name: importlib.metadata.version(name) for name in _PACKAGES}


def _outlier(entry: Mapping[str, Any]) -> Outlier:
    file = entry["file"]
    return Outlier(
        str(entry["test"]),
        None if file is None else str(file),
        int(entry["row"]),
        str(entry["column"]),
        float(entry["distance"]),
    )


def _ends(values: Sequence[float | None]) -> tuple[float | None, float | None]:
    low, high = (None if value is None else float(value) for value in values)
    return low, high


def _end(word: object) -> End:
    if word not in get_args(End):
        raise ValueError(f"at_bound = {word!r}")
    return cast("End", word)


def _range(fit: Mapping[str, Any]) -> Range:
    directions = tuple(Direction(name) for name in fit.get("directions", ()))
    return Range(_pair(fit["frequency_Hz"]), _pair(fit["strain"]), directions)


def _pair(values: Sequence[float]) -> tuple[float, float]:
    low, high = values
    return float(low), float(high)


def load_result(file: Path) -> Result:
    """Read a model file.

    Raises:
        ModelError: a file that is missing, is no JSON, or is no model; it names the file.
    """
    document = read_model_file(file, SCHEMA)
    try:
        return Result.from_document(document)
    except BushfitError as error:
        error.file = file
        raise
