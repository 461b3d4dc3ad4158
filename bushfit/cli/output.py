"""Output of a command: messages and tables on the terminal, and files in the results folder."""

from __future__ import annotations

import gc
import os
import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from operator import attrgetter
from pathlib import Path
from time import monotonic
from typing import Any, Literal, get_args

import click
from rich import box
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderableType
from rich.markup import escape
from rich.segment import Segment
from rich.table import Table

from bushfit.caveat import GENERAL, Caveat
from bushfit.cli.options import Folder, Parameter, flag, option, option_group
from bushfit.errors import OutputError, printable, quote_path
from bushfit.progress import report_progress_to
from bushfit.reading.tablefile import Form, folder_name
from bushfit.report.results import Formats, Picture, ResultFile, check_free, to_json, write_results

#: Kinds of result files whose format can be chosen by an option, and these options.
Written = Literal["tables", "pictures", "pages"]
_FORMAT_OPTIONS: dict[Written, Parameter] = {
    "tables": option(
        "--table-format FORM",
        "Format of tables: csv, decimal-comma (German Excel) or xlsx [csv].",
        type=click.Choice(get_args(Form)),
        default="csv",
        envvar="BUSHFIT_TABLE_FORMAT",
        show_envvar=True,  # in the error of a wrong value
    ),
    "pictures": option(
        "--plot-format FORM",
        "Format of plots: png, svg or pdf [png].",
        type=click.Choice(get_args(Picture)),
        multiple=True,
        default=["png"],
        envvar="BUSHFIT_PLOT_FORMAT",
        show_envvar=True,  # in the error of a wrong value
    ),
    "pages": flag("--no-report", "Do not write the HTML report."),
}
#: Seconds after which a command shows its progress.
_PATIENCE = 2.0
#: Width of tables if their stream is no terminal, in characters.
_WIDTH = 100
#: Largest number of warnings that are printed without -v.
_MOST_WARNINGS = 3
#: Characters between two columns of a table.
_GAP = 3


class _Console(Console):
    """Console that escapes control characters in texts from files.

    Args:
        stderr: True for standard error, False for standard output.
        quiet: True to print nothing.
    """

    def __init__(self, *, stderr: bool, quiet: bool) -> None:
        super().__init__(stderr=stderr, quiet=quiet, highlight=False, soft_wrap=True, emoji=False)
        if not self.is_terminal and "COLUMNS" not in os.environ:  # which rich reads
            self.width = _WIDTH

    def print(self, *objects: Any, **options: Any) -> None:
        """Print objects of rich; an error of writing, such as a full disk, is reported only when the command ends."""
        with suppress(OutputError):
            super().print(*objects, **options)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Render an object of rich as pieces of text, with control characters as escape sequences."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else segment._replace(text=printable(segment.text, lines=True))


@dataclass(frozen=True)
class Output:
    """Terminal messages and result files of one call of a command, controlled by the options that all commands share.

    Args:
        default: default results folder, with a placeholder such as <name> for the name of the result.
        formats: file formats of tables and figures, and the kinds of result file to write.
        to_stderr: True to print texts and tables on standard error, because standard output is for JSON or TOML.
        output: results folder from --output; None for the default.
        verbose, quiet: True to print more, or errors only.
        as_json: True to print the result as JSON on standard output.
        force: True to replace files of an earlier result.
    """

    default: str
    formats: Formats
    to_stderr: bool
    output: Path | None
    verbose: bool
    quiet: bool
    as_json: bool
    force: bool
    _warnings: dict[Caveat, None] = field(default_factory=dict)
    _headlines: list[str] = field(default_factory=list)

    @property
    def console(self) -> Console:
        """Console for results; silent with --quiet."""
        return _Console(stderr=self.to_stderr, quiet=self.quiet)

    @property
    def messages(self) -> Console:
        """Console for progress and warnings, on standard error; silent with --quiet."""
        return _Console(stderr=True, quiet=self.quiet)

    def folder(self, name: str, *files: str) -> Path:
        """Folder for results: --output, or the default; checked for conflicts before anything is printed.

        Args:
            name: name of the result, which replaces the placeholder in the default folder.
            files: names of the main result files, with extensions, which must not exist yet (unless --force).

        Raises:
            OutputError: the folder cannot be written, or contains one of the files.
        """
        folder = self.output or Path(re.sub("<.*>", lambda _: folder_name(name), self.default))
        check_free(folder, files, overwrite=self.force)
        return folder

    def command(self, arguments: str, name: str) -> str:
        """Command line of bushfit to print as the next step: its results below --output, and --force if needed.

        Args:
            arguments: name of the command, its arguments and options.
            name: name of the result, which names the default folder.
        """
        folder = (self.output or Path("results", folder_name(name))) / arguments.split()[0]
        place = f" -o {quote_path(folder)}" if self.output else ""
        return f"bushfit {arguments}{place}{' --force' * folder.exists()}"

    def print(self, text: str) -> None:
        """Print a line of the result without interpreting markup."""
        self.console.print(text, markup=False)

    def print_headline(self, name: str, verdict: str, action: str = "", colour: str = "default") -> None:
        """Print the first two lines of a result: name and verdict, then the next step (`action`)."""
        self._headlines.append(verdict)
        self.console.print(f"[bold]{escape(name)}:[/bold] [{colour}]{escape(verdict)}[/]")
        if action:
            self.print(f"  {action}")

    def warn(self, warnings: Iterable[Caveat]) -> None:
        """Collect warnings, to print them once below the results of a command."""
        self._warnings.update(dict.fromkeys(warnings))

    def print_warnings(self) -> None:
        """Print the most important collected warnings, one of each kind; with -v all."""
        warnings = sorted(self._warnings, key=attrgetter("rank"))
        if not self.verbose:
            warnings = [one for one in warnings if not any(one.text in verdict for verdict in self._headlines)]
        distinct = dict[str, Caveat]()
        for warning in warnings:
            distinct.setdefault(warning.kind, warning)
        printed, messages = warnings if self.verbose else [*distinct.values()][:_MOST_WARNINGS], self.messages
        for warning in printed:
            messages.print(f"[yellow]warning:[/yellow] {escape(warning.text)}")
            if warning.consequence != GENERAL:
                messages.print(f"  {warning.consequence}", markup=False)
        if remaining := len(warnings) - len(printed):
            messages.print(f"{remaining} more warning{'s' * (remaining > 1)}: see -v or the result files")
        self._warnings.clear()

    def print_table(
        self, title: str, columns: Sequence[str], rows: Iterable[Sequence[str]], *, text_columns: int = 1
    ) -> None:
        """Print a table, or if it is wider than the terminal a list of cells for each of its rows.

        Args:
            title: title above the table.
            columns: headers.
            rows: cells of each row.
            text_columns: number of leading columns with texts, which are wrapped; the other columns contain numbers,
                which are never cut or wrapped.
        """
        rows, console = [list(map(printable, row)) for row in rows], self.console
        widths = _column_widths(columns, rows, text_columns, console.width)
        if not widths:
            console.print(title, style="bold", markup=False)
            for row in rows:
                console.print(", ".join(filter(None, row[:text_columns])), markup=False)
                for column, cell in zip(columns[text_columns:], row[text_columns:], strict=True):
                    if cell:
                        console.print(f"  {column}: {cell}" if column else f"  {cell}", markup=False)
            return
        table = Table(title=escape(title), title_justify="left", box=box.SIMPLE_HEAD, title_style="bold")
        for index, (column, width) in enumerate(zip(columns, widths, strict=True)):
            table.add_column(escape(column), justify="right" if index >= text_columns else "left", width=width)
        for row in rows:
            table.add_row(*map(escape, row))
        console.print(table)

    def print_json(self, document: Mapping[str, Any]) -> None:
        """Print a document on standard output if --json is given."""
        if self.as_json:
            sys.stdout.write(to_json(document).decode())
            sys.stdout.flush()

    def write(
        self,
        folder: Path,
        files: Iterable[ResultFile],
        document: Mapping[str, Any] | None = None,
        inputs: Iterable[Path] = (),
    ) -> None:
        """Write result files, then print the document if --json is given, and the names of the files.

        Args:
            folder: results folder.
            files: result files.
            document: JSON data to print if --json is given; None for no JSON.
            inputs: files that the command has read and must not replace.
        """
        self.print_warnings()
        gc.freeze()  # figures make many objects: garbage collection then skips all earlier ones
        written = write_results(folder, files, self.formats, overwrite=self.force, inputs=inputs)
        if document is not None:
            self.print_json(document)
        self.print(f"wrote {', '.join(written)} to {folder}")


def with_output(
    folder: str, *written: Written, target: str = "Write the results to this folder", to_stderr: bool = False
) -> Parameter:
    """Create the options shared by all commands, whose functions receive them as one argument `output`.

    Args:
        folder: default results folder, with a placeholder such as <campaign name> for the name of the result.
        written: kinds of result file whose formats can be chosen.
        target: beginning of the help of --output.
        to_stderr: True for a command that prints TOML on standard output, and thus texts on standard error.
    """

    def start(context: click.Context, values: dict[str, Any]) -> Output:
        """Make the output of a command, which shows its progress and, at its end, prints the collected warnings."""
        formats = Formats(
            pictures=not values.pop("no_plots"),
            pages=not values.pop("no_report", False),
            table_form=values.pop("table_format", Formats.table_form),
            picture_forms=tuple(dict.fromkeys(values.pop("plot_format", Formats.picture_forms))),
        )
        output = Output(folder, formats, to_stderr or values["as_json"], **values)
        context.with_resource(_progress(output.messages))
        context.call_on_close(output.print_warnings)
        return output

    return option_group(
        "Output",
        option("-o --output DIR", f"{target} [{folder}].", type=Folder(path_type=Path)),
        flag("--force", "Replace earlier results in this folder."),
        *(_FORMAT_OPTIONS[kind] for kind in written),
        flag("--no-plots", "Do not write plots.", hidden="pictures" not in written),
        flag("--json as_json", "Print the result as JSON on standard output."),
        flag("-v --verbose"),
        flag("-q --quiet", "-v prints more details, -q only errors."),
        flag("--trust", hidden=True, expose_value=False, callback=_trust),
        record=("output", start),
    )


def _trust(_: click.Context, __: click.Parameter, is_given: bool) -> None:
    """Callback of --trust: permit the Python file of an effect to run in this process and its child processes."""
    if is_given:
        from bushfit.model.laws import TRUST

        os.environ[TRUST] = "1"


def _column_widths(columns: Sequence[str], rows: Sequence[Sequence[str]], text_columns: int, width: int) -> list[int]:
    """Column widths [characters] at which a table fits a width; empty if it does not fit.

    Headers and the cells of the text columns are wrapped between words; numbers are never wrapped.

    Args:
        columns: headers.
        rows: cells of each row.
        text_columns: number of leading columns with texts.
        width: available width [characters].
    """
    widths, narrowest = [], []
    for index, (header, *cells) in enumerate(zip(columns, *rows, strict=True)):
        unbroken = [part for cell in cells for part in cell.split()] if index < text_columns else cells
        widths.append(max(map(cell_len, (header, *cells))))
        narrowest.append(max(map(cell_len, ("", *unbroken, *header.split()))))
    excess = sum(widths) + _GAP * len(widths) + 1 - width
    for index in sorted(range(len(widths)), key=lambda index: narrowest[index] - widths[index]):
        cut = max(0, min(excess, widths[index] - narrowest[index]))
        widths[index], excess = widths[index] - cut, excess - cut
    return widths if excess <= 0 else []


@contextmanager
def _progress(console: Console) -> Iterator[None]:
    """Context that shows progress bars after two seconds; only on a terminal, and not with --quiet."""
    if console.quiet or not (console.is_interactive and console.file.isatty()):
        yield
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

    columns = BarColumn(20), MofNCompleteColumn(), TimeRemainingColumn(), TextColumn("[red]{task.fields[remark]}")
    bar = Progress(TextColumn("{task.description}"), *columns, console=console, transient=True, redirect_stdout=False)
    tasks, start = dict[str, TaskID](), monotonic()

    def update(description: str, done: int | None, total: int, remark: str) -> None:
        """Show how much of a task is done, in a progress bar with a remark; `done` is None at the end of the task."""
        if done is None:
            bar.remove_task(tasks.pop(description))
        else:
            if description not in tasks:
                tasks[description] = bar.add_task(description, total=total, remark="")
            bar.update(tasks[description], completed=done, remark=remark)
        if tasks and monotonic() > start + _PATIENCE:
            bar.start()
        elif not tasks:
            bar.stop()

    try:
        with report_progress_to(update):
            yield
    finally:
        bar.stop()
