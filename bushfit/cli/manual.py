"""`bushfit manual`: the manual as one page in the browser, without a network."""

from __future__ import annotations

from pathlib import Path

import click

from bushfit.cli.options import command_called
from bushfit.cli.output import Output, with_output


@command_called("manual", "diagnosis -o results/manual")
@click.argument("page", required=False)
@with_output("a temporary folder, opened in the browser")
def command(page: str | None, output: Output) -> None:
    """Open the manual in the browser, at PAGE if it is given, such as `diagnosis`.

    The manual is one file that needs no network. With -o, the command writes the file to a folder and opens no browser.

    Writes manual.html.
    """
    import tempfile
    import webbrowser

    from bushfit.errors import unknown_name
    from bushfit.report.page.manual import manual_page, page_names
    from bushfit.report.results import ResultFile

    names = page_names()
    if page not in (None, *names):
        raise unknown_name("no such page", str(page), names, place="PAGE")
    folder = output.output or Path(tempfile.mkdtemp(prefix="bushfit-manual-"))
    file = (folder / "manual.html").resolve()
    output.write(folder, [ResultFile("manual", "page", manual_page)], {"file": str(file), "pages": names})
    if output.output is None:
        webbrowser.open(f"{file.as_uri()}#{page}" if page else file.as_uri())
