"""`bushfit inspect`: contents of test files, meaning of their columns, and oddities."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from rich.markup import escape

from bushfit.caveat import Caveat
from bushfit.cli.file_options import metadata_options, options_named
from bushfit.cli.options import command_called
from bushfit.cli.output import Output, with_output
from bushfit.errors import BushfitError, NoTestError
from bushfit.progress import track
from bushfit.report import plots
from bushfit.report.results import ResultFile

if TYPE_CHECKING:
    from bushfit.inspection.record import Inspection, InspectionDocument

#: Kinds of test file, in words.
_KINDS = {"loop": "a hysteresis loop", "sweep": "a sweep", "history": "a raw stepped-sine history"}
#: Files in one picture: more would be too small to read.
_FILES_A_PICTURE = 5


@command_called("inspect", "data/arm_bushing/loop_axial_1.csv data/arm_bushing/sweep_radial.csv")
@metadata_options()
@with_output("results/<first file>", "pictures", to_stderr=True)
def command(files: tuple[Path, ...], test_options: Mapping[str, Any], output: Output) -> None:
    """Show how bushfit reads test files, before a campaign exists: loops, sweeps, raw histories.

    FILE is a test file, a workbook or a folder. For each test, the command lists every column with its meaning and
    unit; cycles, noise, frequencies and amplitudes; and anything unusual, such as missing rows, outliers, drift or
    repeats that disagree. Rows are numbered from 1, starting below the header. The command prints the lines that a
    campaign needs for these tests. If a file cannot be read, the exit status is 2, and nothing is written. Writes
    inspect.png, in place of an earlier one; for more than five files also inspect_2.png and so on.
    """
    from bushfit.inspection.gathering import gather, with_contradictions
    from bushfit.inspection.record import pasted_text, with_specimens_named

    sources, left_out = gather(files, test_options)
    last = math.ceil(len(sources) / _FILES_A_PICTURE)
    pages = ["inspect", *(f"inspect_{page}" for page in range(2, last + 1))]
    folder = output.folder(files[0].stem)
    inspections: list[Inspection] = []
    errors: list[BushfitError] = []
    for source in track("tests looked at", sources):
        try:
            with options_named():
                inspections.append(source.inspect())
        except NoTestError as error:
            if source.is_named:
                errors.append(error)
            else:
                left_out.append(Caveat("left_out", f"{error.problem} ({error.found})").about(source))
        except BushfitError as error:
            errors.append(error)
        else:
            print_inspection(output, inspections[-1])
    for reason in left_out:
        output.print(f"left out: {reason}")
    compared = with_contradictions(inspections)
    for alone, inspection in zip(inspections, compared, strict=True):
        for warning in inspection.odd[len(alone.odd) :]:
            output.console.print(f"[yellow]unusual:[/yellow] {escape(inspection.label)}: {escape(warning.text)}")
    inspections = with_specimens_named(compared)
    text = pasted_text(inspections)
    if not output.as_json:
        click.echo(text, nl=False)
    if errors:
        for earlier in errors[:-1]:
            click.echo(f"cannot be used: {earlier}", err=True)
        raise errors[-1]
    document: InspectionDocument = {
        "files": [inspection.to_document() for inspection in inspections],
        "left_out": [reason.text for reason in left_out],
        "campaign": text,
    }
    if output.formats.pictures:
        draw = plots.inspection.inspection_figure
        figures = [
            ResultFile(page, "figure", partial(draw, inspections, number * _FILES_A_PICTURE, _FILES_A_PICTURE))
            for number, page in enumerate(pages)
        ]
        replace(output, force=True).write(folder, figures, document, files)
    else:
        output.print_json(document)


def print_inspection(output: Output, inspection: Inspection) -> None:
    """Print the columns of a test file, its frequencies, amplitudes and noise, and anything unusual in it."""
    console = output.console
    written = ", ".join(f"{label} {value}" for label, value in inspection.written.items())
    place = inspection.direction or "direction unknown"
    title = f"{inspection.file.parent / inspection.label}: {_KINDS[inspection.kind]}, {place}"
    rows = []
    for column in inspection.columns:
        ends = ("" if end is None else f"{end:.6g}" for end in (column.low, column.high))
        rows.append((column.header, column.role or "(not needed)", column.unit or "", *ends))
    output.print_table(title, ("column", "taken for", "unit", "from", "to"), rows)
    for label, value in {"file format": written, **inspection.facts}.items():
        output.print(f"  {label}: {value}")
    if inspection.assumed:
        output.print(f"  {inspection.assumed}")
    for warning in inspection.odd:
        console.print(f"  [yellow]unusual:[/yellow] {escape(warning.text)}")
    if not inspection.odd:
        console.print("  nothing else is unusual" if inspection.assumed else "  nothing unusual")
