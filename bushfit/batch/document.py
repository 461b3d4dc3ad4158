"""JSON file of one part of a batch, `row.json`; `report.batch_document` defines the file of the whole batch."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from bushfit.diagnosis import document
from bushfit.model.result import End

#: Value of the key `schema`, which names the layout of the file; a row with another layout is evaluated again.
ROW_SCHEMA: Literal["bushfit/row/3"] = "bushfit/row/3"


@dataclass(frozen=True, slots=True)
class Estimate:
    """Value of a quantity with its 95 % interval and standard error; None if the tests do not determine them.

    Args:
        value: value of the quantity.
        low: lower end of the 95 % interval.
        high: upper end of the 95 % interval.
        stderr: standard error.
        unit: SI unit of all four numbers.
    """

    value: float
    low: float | None = None
    high: float | None = None
    stderr: float | None = None
    unit: str = "1"


@dataclass(frozen=True, kw_only=True, slots=True)
class RowFile:
    """Results of one part, with hashes that show a later run whether the results are still valid.

    Args:
        schema: name and version of the layout of this file.
        status: a failed row has an error and no results.
        error: reason why the row failed; empty if it is done.
        seconds: computing time of the row [s].
        key: hash of the settings of the row and of the version of bushfit.
        inputs: SHA-256 of each input file.
        files: SHA-256 of each result file.
        campaign_name: name of the campaign.
        verdict: verdict of diagnose; null if diagnose was not run.
        effects: effects that diagnose named.
        alternatives: effects that these tests cannot distinguish from the named effects.
        warnings: warnings of the fit and of the predictions.
        warning_kinds: kind of each warning, as in bushfit/caveat.toml.
        quantities: parameters, NRMSE, reduced chi-square, stiffness and loss factor at the points, by name.
        measured: stiffness and loss factor as measured at the points, where known.
        at_bound: parameters whose fitted value is at a bound, with the bound: min or max.
        curve: |K| [SI] along the middle run of the first sweep, by operating point.
    """

    schema: Literal["bushfit/row/3"] = ROW_SCHEMA
    status: Literal["done", "failed"]
    error: str = ""
    seconds: float = 0.0
    key: str = ""
    inputs: Mapping[str, str] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)
    campaign_name: str = ""
    verdict: document.Verdict | None = None
    effects: Sequence[str] = ()
    alternatives: Sequence[str] = ()
    warnings: Sequence[str] = ()
    warning_kinds: Sequence[str] = ()
    quantities: Mapping[str, Estimate] = field(default_factory=dict)
    measured: Mapping[str, Estimate] = field(default_factory=dict)
    at_bound: Mapping[str, End] = field(default_factory=dict)
    curve: Mapping[str, float] = field(default_factory=dict)
