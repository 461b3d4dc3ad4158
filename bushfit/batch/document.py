"""What a batch writes as JSON, key by key: row.json of a bushing, and the summary that `--json` prints.

Their JSON Schemas are made of these types, and the type checker holds to them what is written.
"""

from typing import Literal, NotRequired

from typing_extensions import TypedDict

from bushfit.diagnosis.document import Verdict
from bushfit.model.result import End
from bushfit.report.process import Process


class Found(TypedDict, total=False):
    """What was found of one bushing of a batch.

    Args:
        campaign_name: of the campaign.
        inputs: SHA-256 of the campaign, its tests and a model, by file.
        verdict: of diagnose, where it was asked.
        effects: that diagnose named.
        alternatives: what the tests cannot tell the effects from.
        warnings: what a user must know before using the numbers.
        parameters: by name: value, least and largest of the 95 % interval, standard error, and the SI unit that all
            four are in; null what is not known.
        at_bound: parameters that came to rest on the least or largest value that they may have.
        nrmse: root mean square difference of model and tests, relative; null where nothing was fitted.
        reduced_chi_square: mean square residual in units of noise; null where nothing was fitted.
        points: by operating point, then "stiffness" [N/m, or N m/rad, or Pa] and "loss factor" [1]: value, least and
            largest of the 95 % band.
        date: of the first test for which the campaign states one.
        curve: |K| [N/m, N m/rad or Pa] by operating point, as the first sweep measured it at the level in its middle.
    """

    campaign_name: str
    inputs: dict[str, str]
    verdict: Verdict
    effects: list[str]
    alternatives: list[str]
    warnings: list[str]
    parameters: dict[str, list[float | str | None]]
    at_bound: dict[str, End]
    nrmse: float | None
    reduced_chi_square: float | None
    points: dict[str, dict[str, list[float | None]]]
    date: str | None
    curve: dict[str, float]


class Record(Found):
    """What was found of one bushing of a batch, and the hashes by which a later run can tell whether it still holds.

    Args:
        schema: of this file.
        status: done, or failed; of a failed row nothing was found.
        seconds: that the row took [s].
        error: why the row failed, in words.
        key: hash of what was asked, and of the version that answers.
        files: SHA-256 of the result files beside this one, by name.
        kept: whether the record was taken over from an earlier run; in memory only.
    """

    schema: Literal["bushfit/row/2"]
    status: Literal["done", "failed"]
    seconds: float
    error: NotRequired[str]
    key: NotRequired[str]
    files: NotRequired[dict[str, str]]
    kept: NotRequired[bool]


class Failure(TypedDict):
    """A bushing that came to nothing.

    Args:
        name: of the bushing.
        error: why, in words.
    """

    name: str
    error: str


class Scatter(TypedDict):
    """The middle and the scatter of a quantity over the batch.

    Args:
        median: in the unit.
        sigma: robust standard deviation, in the unit.
        unit: of both.
    """

    median: float
    sigma: float
    unit: str


class Control(TypedDict):
    """The middle and the scatter of a column of the table, and what is allowed.

    Args:
        median: in the unit of the column.
        sigma: robust standard deviation, in the unit of the column.
        allowed: least and largest, in the unit of the column; null where there is no limit.
        process: what the order of test tells of it.
    """

    median: float
    sigma: float
    allowed: list[float | None]
    process: Process


class Differing(TypedDict):
    """A bushing that differs from the others of its batch by more than chance.

    Args:
        name: of the bushing.
        row: of the table, from 1.
        by: robust z, by quantity: parameters before what follows from them, each the clearest first.
        p: probability by chance of the clearest, all bushings and quantities counted (Holm).
        words: the same in words.
    """

    name: str
    row: int
    by: dict[str, float]
    p: float
    words: str


class Counts(TypedDict):
    """What came of a batch, row by row.

    Args:
        schema: of this document.
        rows: how many there are.
        done: how many of them are done.
        failed: the others, and why.
        limits: bushings by how they meet the limits.
        missed: names of the bushings that miss a limit.
        conditional: names of those that pass on condition: the value is within, its interval reaches over the limit.
        warnings: what could not be judged, and other things to know.
        differ: bushings that differ from the others by more than chance.
    """

    schema: Literal["bushfit/batch/1"]
    rows: int
    done: int
    failed: list[Failure]
    limits: dict[str, int]
    missed: list[str]
    conditional: list[str]
    warnings: list[str]
    differ: list[Differing]


class BatchFile(Counts):
    """What came of a batch, beside its table.

    Args:
        title: of the batch.
        quantities: by column of the table.
        order: what the order of test is taken from.
        least_told: standard deviations by which a bushing has to differ to be told; null where none can be.
    """

    title: str
    quantities: dict[str, Control]
    order: str
    least_told: float | None


class BatchSummary(Counts):
    """What came of a batch in this run.

    Args:
        kept: how many rows were taken over from an earlier run.
        scatter: by quantity.
        seconds: that the batch took [s].
    """

    kept: int
    scatter: dict[str, Scatter]
    seconds: float
