"""Types of `batch.json`, the JSON file of a batch, which `bushfit batch --json` also prints."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

#: Value of the key `schema`, which names the layout of the file.
BATCH_SCHEMA: Literal["bushfit/batch/2"] = "bushfit/batch/2"
#: Result of the comparison of a part with its limits.
LimitResult = Literal["pass", "conditional pass", "not judged", "conditional fail", "fail"]


@dataclass(frozen=True)
class QuantityTable:
    """Scatter, limits and process capability of one quantity over the parts of a batch, in the unit of its column.

    Args:
        parts: number of parts with a value of the quantity and without a poor fit.
        median: median of the quantity over the parts.
        sigma: standard deviation over the parts, estimated from the median absolute deviation.
        detectable: smallest deviation that is beyond chance for this number of parts; null for fewer than five.
        min: lower limit; null without one.
        max: upper limit; null without one.
        cp: Cp with its 95 % interval; null without two fixed limits.
        cpk: Cpk with its 95 % interval; null without a fixed limit.
    """

    parts: int
    median: float
    sigma: float
    detectable: float | None
    min: float | None
    max: float | None
    cp: tuple[float, float, float] | None
    cpk: tuple[float, float, float] | None

    @property
    def limits(self) -> list[float]:
        """Lower and upper limit; empty without limits."""
        return [limit for limit in (self.min, self.max) if limit is not None]


@dataclass(frozen=True, kw_only=True)
class PartTable:
    """Entry of batch.json for one part: result by the limits, values, and deviations in standard deviations.

    Args:
        name: name of the part.
        folder: folder with the results of the part; empty if the row failed.
        error: reason why the row failed; empty if it is done.
        result: result against the limits; null without limits.
        misses: sentence on each limit that the part misses, by quantity.
        doubtful: sentence on each conditional pass and each limit that was not judged, by quantity.
        poor_fit: sentence on a model that misses its tests; empty if the model fits.
        deviations: quantities by which the part differs beyond chance, in standard deviations of the others.
        differs: text on these quantities, relative to the median of the other parts.
        warnings: warnings of the fit and of the predictions.
        warning_kinds: kind of each warning, as in bushfit/caveat.toml.
        labels: further texts in the table row of the part, by column.
        values: values of the part, in the order of `quantities`; null if not known.
        curve: measured stiffness, in the order of `curve_points`.
    """

    name: str
    folder: str
    error: str
    result: LimitResult | None
    misses: Mapping[str, str]
    doubtful: Mapping[str, str]
    poor_fit: str
    deviations: Mapping[str, float]
    differs: str
    warnings: Sequence[str]
    warning_kinds: Sequence[str] = ()
    labels: Mapping[str, str]
    values: Sequence[float | None]
    curve: Sequence[float] | None


@dataclass(frozen=True, kw_only=True)
class BatchFile:
    """Results of a batch, as in batch.json and, with two more fields, in the output of `--json`.

    Args:
        schema: name and version of the layout of this file.
        title: title of the batch.
        rows: number of rows in the manifest.
        done: number of rows with results.
        kept: number of rows kept from an earlier run; in `--json` only.
        seconds: time of the run [s]; in `--json` only.
        failed: names of the rows that failed.
        limits: number of parts by result against the limits.
        missed: names of the parts that miss a limit.
        conditional: names of the parts that pass conditionally.
        not_judged: names of the parts that were not judged.
        differ: names of the parts that differ from the others.
        headline: outcome in one sentence.
        warnings: warnings on the batch, the important ones first.
        warning_kinds: kind of each warning, as in bushfit/caveat.toml.
        detectable: smallest deviation of an outlying part, in standard deviations; null below five parts.
        quantities: scatter, limits and capability of each quantity, by column of the table.
        curve_points: names of the columns of the batch table with the measured stiffness at each frequency.
        parts: all parts, in the order of the manifest.
    """

    schema: Literal["bushfit/batch/2"] = BATCH_SCHEMA
    title: str
    rows: int
    done: int
    kept: int | None = None
    seconds: float | None = None
    failed: Sequence[str]
    limits: Mapping[str, int]
    missed: Sequence[str]
    conditional: Sequence[str]
    not_judged: Sequence[str]
    differ: Sequence[str]
    headline: str
    warnings: Sequence[str]
    warning_kinds: Sequence[str] = ()
    detectable: float | None
    quantities: Mapping[str, QuantityTable]
    curve_points: Sequence[str]
    parts: Sequence[PartTable]
