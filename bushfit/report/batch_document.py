"""Types of `batch.json`, the JSON file of a batch, which `bushfit batch --json` also prints."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

#: Value of the key `schema`, which names the layout of the file.
BATCH_SCHEMA: Literal["bushfit/batch/2"] = "bushfit/batch/2"
#: Result of the comparison of a part with its limits.
LimitResult = Literal["pass", "conditional pass", "not judged", "conditional fail", "fail"]


@dataclass(frozen=True)
class QuantityTable:
    """Scatter, limits and process capability of one quantity over the parts of a batch, in the unit of its column."""

    parts: Annotated[int, Field(description="Number of parts with a value of the quantity and without a poor fit.")]
    median: Annotated[float, Field(description="Median of the quantity over the parts.")]
    sigma: Annotated[
        float, Field(description="Standard deviation over the parts, estimated from the median absolute deviation.")
    ]
    detectable: Annotated[
        float | None,
        Field(
            description="Smallest deviation that is beyond chance for this number of parts; null for fewer than five."
        ),
    ]
    min: Annotated[float | None, Field(description="Lower limit; null without one.")]
    max: Annotated[float | None, Field(description="Upper limit; null without one.")]
    cp: Annotated[
        tuple[float, float, float] | None,
        Field(description="Cp with its 95 % interval; null without two fixed limits."),
    ]
    cpk: Annotated[
        tuple[float, float, float] | None, Field(description="Cpk with its 95 % interval; null without a fixed limit.")
    ]


@dataclass(frozen=True, kw_only=True)
class PartTable:
    """Entry of batch.json for one part: result by the limits, values, and deviations in standard deviations."""

    name: Annotated[str, Field(description="Name of the part.")]
    folder: Annotated[str, Field(description="Folder with the results of the part; empty if the row failed.")]
    error: Annotated[str, Field(description="Reason why the row failed; empty if it is done.")]
    result: Annotated[LimitResult | None, Field(description="Result against the limits; null without limits.")]
    misses: Annotated[Mapping[str, str], Field(description="Sentence on each limit that the part misses, by quantity.")]
    doubtful: Annotated[
        Mapping[str, str],
        Field(description="Sentence on each conditional pass and each limit that was not judged, by quantity."),
    ]
    poor_fit: Annotated[str, Field(description="Sentence on a model that misses its tests; empty if the model fits.")]
    deviations: Annotated[
        Mapping[str, float],
        Field(description="Quantities by which the part differs beyond chance, in standard deviations of the others."),
    ]
    differs: Annotated[str, Field(description="Text on these quantities, relative to the median of the other parts.")]
    warnings: Annotated[Sequence[str], Field(description="Warnings of the fit and of the predictions.")]
    labels: Annotated[Mapping[str, str], Field(description="Further texts in the table row of the part, by column.")]
    values: Annotated[
        Sequence[float | None],
        Field(description="Values of the part, in the order of `quantities`; null if not known."),
    ]
    curve: Annotated[Sequence[float] | None, Field(description="Measured stiffness, in the order of `curve_points`.")]


@dataclass(frozen=True, kw_only=True)
class BatchFile:
    """Results of a batch: the content of batch.json."""

    schema: Annotated[Literal["bushfit/batch/2"], Field(description="Name and version of the layout of this file.")] = (
        BATCH_SCHEMA
    )
    title: Annotated[str, Field(description="Title of the batch.")]
    rows: Annotated[int, Field(description="Number of rows in the manifest.")]
    done: Annotated[int, Field(description="Number of rows with results.")]
    kept: Annotated[int | None, Field(description="Number of rows kept from an earlier run; in `--json` only.")] = None
    seconds: Annotated[float | None, Field(description="Time of the run [s]; in `--json` only.")] = None
    failed: Annotated[Sequence[str], Field(description="Names of the rows that failed.")]
    limits: Annotated[Mapping[str, int], Field(description="Number of parts by result against the limits.")]
    missed: Annotated[Sequence[str], Field(description="Names of the parts that miss a limit.")]
    conditional: Annotated[Sequence[str], Field(description="Names of the parts that pass conditionally.")]
    not_judged: Annotated[Sequence[str], Field(description="Names of the parts that were not judged: poor fit.")]
    differ: Annotated[Sequence[str], Field(description="Names of the parts that differ from the others.")]
    headline: Annotated[str, Field(description="Outcome in one sentence.")]
    warnings: Annotated[Sequence[str], Field(description="Warnings on the batch, the important ones first.")]
    detectable: Annotated[
        float | None,
        Field(description="Smallest deviation of an outlying part, in standard deviations; null below five parts."),
    ]
    quantities: Annotated[
        Mapping[str, QuantityTable],
        Field(description="Scatter, limits and capability of each quantity, by column of the table."),
    ]
    curve_points: Annotated[Sequence[str], Field(description="Columns of the measured stiffness curve.")]
    parts: Annotated[Sequence[PartTable], Field(description="All parts, in the order of the manifest.")]
