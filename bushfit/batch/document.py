"""What a batch writes as JSON, key by key: row.json of a bushing, and the summary that `--json` prints.

Their JSON Schemas are made of these types, and the type checker holds to them what is written.
"""

from typing import Annotated, Literal, NotRequired

from typing_extensions import Doc, TypedDict

from bushfit.diagnosis.document import Verdict
from bushfit.model.result import End
from bushfit.report.process import Process


class Found(TypedDict, total=False):
    """What was found of one bushing of a batch."""

    campaign_name: Annotated[str, Doc("of the campaign.")]
    inputs: Annotated[dict[str, str], Doc("SHA-256 of the campaign, its tests and a model, by file.")]
    verdict: Annotated[Verdict, Doc("of diagnose, where it was asked.")]
    effects: Annotated[list[str], Doc("that diagnose named.")]
    alternatives: Annotated[list[str], Doc("what the tests cannot tell the effects from.")]
    warnings: Annotated[list[str], Doc("what a user must know before using the numbers.")]
    parameters: Annotated[
        dict[str, list[float | str | None]],
        Doc(
            "by name: value, least and largest of the 95 % interval, standard error, and the SI unit that all four "
            "are in; null what is not known."
        ),
    ]
    at_bound: Annotated[
        dict[str, End],
        Doc("parameters that came to rest on the least or largest value that they may have."),
    ]
    nrmse: Annotated[
        float | None,
        Doc("root mean square difference of model and tests, relative; null where nothing was fitted."),
    ]
    reduced_chi_square: Annotated[
        float | None,
        Doc("mean square residual in units of noise; null where nothing was fitted."),
    ]
    points: Annotated[
        dict[str, dict[str, list[float | None]]],
        Doc(
            'by operating point, then "stiffness" [N/m, or N m/rad, or Pa] and "loss factor" [1]: value, least and '
            "largest of the 95 % band."
        ),
    ]
    date: Annotated[str | None, Doc("of the first test for which the campaign states one.")]
    curve: Annotated[
        dict[str, float],
        Doc("|K| [N/m, N m/rad or Pa] by operating point, as the first sweep measured it at the level in its middle."),
    ]


class Record(Found):
    """What was found of one bushing of a batch, and the hashes by which a later run can tell whether it still holds."""

    schema: Annotated[Literal["bushfit/row/2"], Doc("of this file.")]
    status: Annotated[Literal["done", "failed"], Doc("done, or failed; of a failed row nothing was found.")]
    seconds: Annotated[float, Doc("that the row took [s].")]
    error: NotRequired[Annotated[str, Doc("why the row failed, in words.")]]
    key: NotRequired[Annotated[str, Doc("hash of what was asked, and of the version that answers.")]]
    files: NotRequired[Annotated[dict[str, str], Doc("SHA-256 of the result files beside this one, by name.")]]
    kept: NotRequired[Annotated[bool, Doc("whether the record was taken over from an earlier run; in memory only.")]]


class Failure(TypedDict):
    """A bushing that came to nothing."""

    name: Annotated[str, Doc("of the bushing.")]
    error: Annotated[str, Doc("why, in words.")]


class Scatter(TypedDict):
    """The middle and the scatter of a quantity over the batch."""

    median: Annotated[float, Doc("in the unit.")]
    sigma: Annotated[float, Doc("robust standard deviation, in the unit.")]
    unit: Annotated[str, Doc("of both.")]


class Control(TypedDict):
    """The middle and the scatter of a column of the table, and what is allowed."""

    median: Annotated[float, Doc("in the unit of the column.")]
    sigma: Annotated[float, Doc("robust standard deviation, in the unit of the column.")]
    allowed: Annotated[
        list[float | None],
        Doc("least and largest, in the unit of the column; null where there is no limit."),
    ]
    process: Annotated[Process, Doc("what the order of test tells of it.")]


class Differing(TypedDict):
    """A bushing that differs from the others of its batch by more than chance."""

    name: Annotated[str, Doc("of the bushing.")]
    row: Annotated[int, Doc("of the table, from 1.")]
    by: Annotated[
        dict[str, float],
        Doc("robust z, by quantity: parameters before what follows from them, each the clearest first."),
    ]
    p: Annotated[float, Doc("probability by chance of the clearest, all bushings and quantities counted (Holm).")]
    words: Annotated[str, Doc("the same in words.")]


class Counts(TypedDict):
    """What came of a batch, row by row."""

    schema: Annotated[Literal["bushfit/batch/1"], Doc("of this document.")]
    rows: Annotated[int, Doc("how many there are.")]
    done: Annotated[int, Doc("how many of them are done.")]
    failed: Annotated[list[Failure], Doc("the others, and why.")]
    limits: Annotated[dict[str, int], Doc("bushings by how they meet the limits.")]
    missed: Annotated[list[str], Doc("names of the bushings that miss a limit.")]
    conditional: Annotated[
        list[str],
        Doc("names of those that pass on condition: the value is within, its interval reaches over the limit."),
    ]
    warnings: Annotated[list[str], Doc("what could not be judged, and other things to know.")]
    differ: Annotated[list[Differing], Doc("bushings that differ from the others by more than chance.")]


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
