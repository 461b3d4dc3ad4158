"""Tables, figures, parameters and files of the output of a command."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from bushfit.commands.loading import HasResult, as_result
from bushfit.commands.provenance import input_files
from bushfit.errors import BushfitError, did_you_mean
from bushfit.report.results import Formats, Kind, ResultFile, write_results

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from bushfit.model.result import Result


class CommandOutput(Protocol):
    """Protocol of a command's output that contains result files."""

    @property
    def files(self) -> Sequence[ResultFile]:
        """Result files (tables, figures, documents) of the command, whose content is made when it is needed."""


def table(output: CommandOutput, name: str) -> pd.DataFrame:
    """Table of an output, by its file name without ending: "axial" of a prediction, "sweeps" of a fit."""
    return _content(output, name, "table")


def picture(output: CommandOutput, name: str) -> Figure:
    """Figure of an output as a matplotlib figure, by its file name without ending, such as "sweeps"."""
    return _content(output, name, "figure")


def parameters(model: Result | HasResult) -> pd.DataFrame:
    """Parameters of a result, or of an output with a result, in SI.

    Returns:
        Table with a row for each parameter: value, std error, low and high end of the 95 % interval, unit, and fitted
        (True or False).
    """
    from bushfit.report.spreadsheets import parameters_table

    rows = parameters_table(as_result(model)).set_index("parameter").rename_axis(None)
    rows = rows.rename(columns={"95 %, low": "low", "95 %, high": "high"})
    rows["fitted"] = rows["fitted"] == "yes"
    columns = ["value", "std error", "low", "high"]
    return rows[[*columns, "unit", "fitted"]].astype(dict.fromkeys(columns, float))


def save(
    output: CommandOutput, folder: str | Path, *, tables: bool = True, pictures: bool = True, force: bool = False
) -> Path:
    """Write the result files of an output into a folder, as the command would.

    Args:
        output: output of a command.
        folder: results folder.
        tables: True to write tables.
        pictures: True to write figures.
        force: True to replace files of an earlier result.

    Returns:
        The folder.

    Raises:
        OutputError: the folder cannot be written, or holds a file that must not be replaced.
    """
    data = getattr(output, "data", None)
    inputs = input_files(data.campaign) if data else []
    write_results(Path(folder), output.files, Formats(tables, pictures), overwrite=force, inputs=inputs)
    return Path(folder)


def _content(output: CommandOutput, name: str, kind: Kind) -> Any:
    """Make the content of the result file with the given name (without ending) and kind."""
    files = {file.name: file for file in output.files if file.kind == kind}
    if name not in files:
        word = {"figure": "picture"}.get(kind, kind)
        expected = "one of " + ", ".join(files) if files else f"an output with a {word}"
        raise BushfitError(f"there is no such {word}", found=name, expected=expected, hint=did_you_mean(name, files))
    return files[name].content()
