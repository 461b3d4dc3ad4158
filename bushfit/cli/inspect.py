"""`bushfit inspect`: what test files hold, how they were understood, and what is odd."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from rich.markup import escape

from bushfit.cli.file_options import options_named, with_stated
from bushfit.cli.options import command_called
from bushfit.cli.output import Output, with_output
from bushfit.errors import BushfitError
from bushfit.progress import track
from bushfit.report import plots
from bushfit.report.results import figure_file

if TYPE_CHECKING:
    from bushfit.inspection.record import Inspected, InspectionDocument

#: Kinds of test file, in words.
_KINDS = {"loop": "a hysteresis loop", "sweep": "a sweep", "history": "a raw stepped-sine history"}
#: Files in one picture: more would be too small to read.
_FILES_A_PICTURE = 5


@command_called("inspect", "data/arm_bushing/loop_axial_1.csv data/arm_bushing/sweep_radial.csv")
@with_stated()
@with_output("results/<first file>", "pictures")
def command(files: tuple[Path, ...], stated: Mapping[str, Any], output: Output) -> None:
    """Look at test files before a campaign names them: loops, sweeps, raw histories.

    FILE may be a folder, or a workbook with several tests. For each test: how every column was understood, in which
    unit; cycles, noise, frequencies, amplitudes; and what is odd: gaps, outliers, drift, cut-off tops, copied rows,
    repeats that disagree. Rows count from 1 below the header. The text for the campaign goes to standard output. If a
    file cannot be used, the others are told, nothing is written, exit status 2. Writes inspect.png, and inspect_2.png
    and so on of more than five files.
    """
    from bushfit.inspection.gathering import gather, with_contradictions
    from bushfit.inspection.record import pasted_text, with_specimens_named

    sources, left_out = gather(files, stated)
    tell_left_out(output, left_out)
    last = math.ceil(len(sources) / _FILES_A_PICTURE)
    pages = ["inspect", *(f"inspect_{page}" for page in range(2, last + 1))]
    folder = output.folder(files[0].stem)
    seen: list[Inspected] = []
    failed: list[BushfitError] = []
    for source in track("tests looked at", sources):
        try:
            with options_named():
                seen.append(source.inspect())
        except BushfitError as error:
            failed.append(error)
        else:
            tell(output, seen[-1])
    for alone, beside in zip(seen, together := with_contradictions(seen), strict=True):
        for sentence in beside.odd[len(alone.odd) :]:
            output.console.print(f"[yellow]odd:[/yellow] {escape(beside.label)}: {escape(sentence)}")
    seen = with_specimens_named(together)
    text = pasted_text(seen)
    if not output.as_json:
        click.echo(text, nl=False)
    if failed:
        for other in failed[:-1]:
            click.echo(f"cannot be used: {other}", err=True)
        raise failed[-1]
    document: InspectionDocument = {
        "files": [one.to_document() for one in seen],
        "left_out": list(left_out),
        "campaign": text,
    }
    if output.formats.pictures:
        figures = [
            figure_file(
                page, partial(plots.inspection.inspection_figure, seen, number * _FILES_A_PICTURE, _FILES_A_PICTURE)
            )
            for number, page in enumerate(pages)
        ]
        output.write(folder, figures, document, files)
    else:
        output.print_json(document)


def tell(output: Output, seen: Inspected) -> None:
    """One file in words: columns, facts, oddities."""
    console = output.console
    written = ", ".join(f"{label} {value}" for label, value in seen.written.items())
    title = f"{seen.file.parent / seen.label}: {_KINDS[seen.kind]}, {seen.direction or 'direction unknown'}"
    rows = []
    for column in seen.columns:
        ends = ("" if end is None else f"{end:.6g}" for end in (column.low, column.high))
        rows.append((column.header, column.role or "(not needed)", column.unit or "", *ends))
    output.print_table(title, ("column", "taken for", "unit", "from", "to"), rows)
    for label, value in {"written with": written, **seen.facts}.items():
        output.print(f"  {label}: {value}")
    if seen.assumed:
        output.print(f"  {seen.assumed}")
    for sentence in seen.odd:
        console.print(f"  [yellow]odd:[/yellow] {escape(sentence)}")
    if not seen.odd:
        console.print("  nothing odd")


def tell_left_out(output: Output, left_out: Sequence[str]) -> None:
    """A line for each file or sheet that holds no test."""
    for sentence in left_out:
        output.print(f"left out: {sentence}")
