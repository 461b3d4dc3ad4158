"""`bushfit report`: one page of a results folder, to show, print and mail."""

from dataclasses import replace
from datetime import date as calendar
from pathlib import Path

import click

from bushfit.cli.options import FILE, command_called, option, option_group
from bushfit.cli.output import Output, with_output


@command_called("report", "data/reports/mystery_mount --date today -o results/page")
@click.argument("folder", metavar="DIR", type=FILE)
@option_group(
    "Content",
    option("--date DATE", 'Date of the report, such as "2026-03-20", or today [from the campaign, else none].'),
)
@with_output("DIR")
def command(folder: Path, date: str | None, output: Output) -> None:
    """Make one report page from DIR, a folder with results of run, diagnose, a fit or a batch.

    Show, print or mail the page: it is a single file that needs no network. The page shows part and tests, verdict,
    expected error, prediction and measurement, parameters with intervals, differences between tests and model, the
    next test, and the origin of the numbers. All numbers come from the JSON and CSV files in DIR. The
    commands run and diagnose also write this page.

    Writes report.html, in place of an earlier one, or for a batch index.html.
    """
    from bushfit.report.page import folder_pages

    target = output.output or folder
    base = "" if output.output is None else f"{folder.resolve().as_uri()}/"
    day = calendar.today().isoformat() if date == "today" else date
    files = folder_pages(folder, base, day)
    sizes = {str(target / f"{file.name}.html"): len(file.content().encode()) for file in files}
    replace(output, force=True).write(target, files, {"pages": sizes})
