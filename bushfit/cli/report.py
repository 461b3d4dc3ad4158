"""`bushfit report`: a folder of results -> one page to show, to print and to mail."""

from pathlib import Path

import click

from bushfit.cli.common import Options, with_options
from bushfit.cli.options import FILE, command_called


@command_called("report", "data/reports/mystery_mount -o results/page")
@click.argument("folder", metavar="DIR", type=FILE)
@with_options("DIR")
def command(folder: Path, options: Options) -> None:
    """Make one page of DIR, the results of run, diagnose, a fit, or of a batch: to show, to print, to mail.

    The page is a single file that needs no network: what was tested, the verdict and within what the model is usable,
    the parameters with intervals, prediction beside measurement, loops, what was missing, the next test, and where the
    numbers come from. It is made of the JSON and CSV files of DIR, and shows what they hold; run and diagnose write it
    by themselves.

    Writes report.html, or for a batch index.html.
    """
    from bushfit.report.contents import pages_of
    from bushfit.report.folder import check_free
    from bushfit.report.page import folder_contents

    target = options.output or folder
    base = "" if options.output is None else f"{folder.resolve().as_uri()}/"
    contents = folder_contents(folder, base)
    check_free(target, [f"{name}.html" for name in contents.pages], force=options.force)
    pages = pages_of(contents)
    options.write(target, pages, {"pages": {str(target / name): len(page) for name, page in pages.items()}})
