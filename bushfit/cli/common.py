"""What the commands share: options, where results go, how far long work is, and the order of work on a campaign."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from functools import wraps
from pathlib import Path
from threading import Timer
from time import monotonic
from typing import TYPE_CHECKING, Any

import click
from rich.console import Console, ConsoleOptions, RenderableType
from rich.markup import escape
from rich.segment import Segment

from bushfit.cli.options import FILE, FORMS, Folder, Function, Parameter, Size, Written, flag, in_order, option, under
from bushfit.errors import ModelError, printable, quote_path
from bushfit.progress import report_progress_to
from bushfit.reading.tablefile import folder_name
from bushfit.report.contents import Formats, Kinds
from bushfit.report.folder import check_free, to_json, write_files

if TYPE_CHECKING:
    from rich.console import Console

    from bushfit.campaign.campaign import Campaign
    from bushfit.campaign.schema import Loss
    from bushfit.jobs import Found, Job
    from bushfit.model.result import Result
    from bushfit.reading.tablefile import Form
    from bushfit.report.contents import Picture

#: Seconds after which long work shows how far it is.
_PATIENCE = 2.0
#: Width of tables where standard error is no terminal, in characters.
_WIDTH = 100


def _told(done: int, total: int, seconds: float) -> str:
    """How many are done, of how many, how fast, and the seconds that are left."""
    if not done:
        return f"0 of {total}"
    pace = f"{done / seconds:.3g} a second" if done >= seconds else f"{seconds / done:.2g} s each"
    return f"{done} of {total}, {pace}, {seconds / done * (total - done):.0f} s left"


@contextmanager
def shown_on(console: Console) -> Iterator[None]:
    """A line for each kind of work within, from two seconds on; on a terminal alone, and not with --quiet."""
    if console.quiet or not (console.is_interactive and console.file.isatty()):
        yield
        return
    from rich.progress import BarColumn, Progress, TextColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(20),
        TextColumn("{task.fields[told]} [red]{task.fields[remark]}"),
    )
    bar = Progress(*columns, console=console, transient=True, redirect_stdout=False)
    lines, patient = dict[str, tuple[float, Any]](), True

    def listen(what: str, done: int | None, total: int, remark: str) -> None:
        if done is None:
            bar.remove_task(lines.pop(what)[1])
        else:
            if what not in lines:
                lines[what] = monotonic(), bar.add_task(what, total=total, told="", remark="")
            begun, line = lines[what]
            bar.update(line, completed=done, told=_told(done, total, monotonic() - begun), remark=remark)
        show()

    def show() -> None:
        """What is printed between two kinds of work stands on a line of its own."""
        if lines and not patient:
            bar.start()
        elif bar.live.is_started:
            bar.stop()

    def run_out() -> None:
        nonlocal patient
        patient = False
        show()

    timer = Timer(_PATIENCE, run_out)
    timer.start()
    try:
        with report_progress_to(listen):
            yield
    finally:
        timer.cancel()
        timer.join()
        bar.stop()


class _Console(Console):
    """A console to which no text that it is given can speak by itself: only its own colours and bars are commands."""

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        for segment in super().render(renderable, options):
            yield segment if segment.control else segment._replace(text=printable(segment.text, lines=True))


@dataclass(frozen=True)
class Options:
    """Options that every command takes; those of forms only where it writes what has them."""

    output: Path | None = None
    verbose: bool = False
    quiet: bool = False
    as_json: bool = False
    force: bool = False
    no_plots: bool = False
    no_report: bool = False
    table_format: Form = Formats.table_form
    plot_format: Sequence[Picture] = Formats.picture_forms

    @property
    def formats(self) -> Formats:
        """What is written of a result, and in which forms."""
        pictures = tuple(dict.fromkeys(self.plot_format))
        return Formats(True, not self.no_plots, not self.no_report, self.table_format, pictures)

    def folder(self, name: str, form: str = "{}") -> Path:
        """Where results go: --output, or results/<name>, in which `form` says what stands around it."""
        return self.output or Path("results") / form.format(folder_name(name))

    def free_folder(self, name: str, kinds: Kinds, *files: str, form: str = "{}") -> Path:
        """The folder of results of some kinds, and further files; refused before the work where they stand there."""
        folder = self.folder(name, form)
        check_free(folder, [*self.formats.names(kinds), *files], force=self.force)
        return folder

    @property
    def console(self) -> Console:
        """People read standard error; nothing at all with --quiet."""
        console = _Console(stderr=True, quiet=self.quiet, highlight=False, soft_wrap=True)
        return console if console.is_terminal else _Console(stderr=True, quiet=self.quiet, soft_wrap=True, width=_WIDTH)

    def say(self, text: str) -> None:
        """A line as it is, its brackets no markup."""
        self.console.print(text, markup=False)

    def warn(self, lines: Iterable[str]) -> None:
        """A line for each warning that this command has not given yet."""
        given = click.get_current_context().meta.setdefault(__name__, set())
        for line in (line for line in lines if line not in given):
            given.add(line)
            self.console.print(f"[yellow]warning:[/yellow] {escape(line)}")

    def write(self, folder: Path, files: Mapping[str, bytes], document: Mapping[str, Any] | None = None) -> None:
        """Write the results, all or none, and say where; --json prints the document once they are safe on the disk.

        With --force, what the same command wrote there before and does not write now is removed.
        """
        write_files(
            folder,
            files,
            force=self.force,
            by=click.get_current_context().info_name,
            before=lambda: self.print_json(document) if document is not None else None,
        )
        self.say(f"wrote {', '.join(files)} to {folder}")

    def print_json(self, document: Mapping[str, Any]) -> None:
        """The result on standard output, where --json asks for it."""
        if self.as_json:
            sys.stdout.write(to_json(document).decode())
            sys.stdout.flush()


def with_options(folder: str, *written: Written) -> Parameter:
    """Decorator of a command: the options that all have become one `options`.

    Args:
        folder: where results go without --output, as the help says it.
        written: what the command writes that has forms.
    """

    def decorate(function: Function) -> Function:
        @wraps(function)
        def wrapped(**given: Any) -> Any:
            options = Options(**{each.name: given.pop(each.name) for each in fields(Options) if each.name in given})
            with shown_on(options.console):
                return function(options=options, **given)

        return in_order(
            wrapped,
            under(
                "Output",
                option("-o --output", "DIR", f"For the results [{folder}].", type=Folder(path_type=Path)),
                flag("--force", "Replace results that stand there."),
                *(FORMS[kind] for kind in written),
                flag("--no-plots", "Write no plots.", hidden="pictures" not in written),
                flag("--json as_json", "Print the result as JSON on standard output."),
                flag("-v --verbose"),
                flag("-q --quiet", "Say more, or nothing but errors."),
            ),
        )

    return decorate


@dataclass(frozen=True)
class Task:
    """Work on one campaign as its command line asks for it."""

    campaign: Path
    loss: Loss | None
    max_nrmse: float | None
    options: Options

    def perform(
        self,
        job: Job[Found],
        tell: Callable[[Options, str, Found], None],
        last_line: Callable[[Path, Found], str] | None = None,
    ) -> None:
        """What every command on a campaign does: read, refuse to overwrite, work, tell, write, hold to a limit.

        `tell` is given the campaign's name; `last_line`, said below the files written, their folder.
        """
        from bushfit.campaign.campaign import load_campaign
        from bushfit.fitting.data import Data

        options, loaded = self.options, load_campaign(self.campaign)
        if self.loss:
            loaded = replace(loaded, fit=replace(loaded.fit, loss=self.loss))
        folder = options.free_folder(loaded.name, job.kinds(loaded))
        data = Data.of(loaded)
        options.warn(data.notes)
        outcome = job.run(data)
        tell(options, loaded.name, outcome)
        options.write(folder, options.formats.files(outcome.contents), outcome.document)
        if last_line:
            options.say(last_line(folder, outcome))
        quality = outcome.result.quality
        if self.max_nrmse is not None and quality and quality.nrmse > self.max_nrmse:
            click.echo(f"bushfit: NRMSE {quality.nrmse:.4g} is above --max-nrmse {self.max_nrmse:g}", err=True)
            click.get_current_context().exit(1)


def with_task(*written: Written, soft_l1: str = "points far off pull less, outliers not at all") -> Parameter:
    """Decorator of a command on one campaign, with tables and plots: CAMPAIGN and its options become one `task`.

    Args:
        written: beside tables and pictures, as of `with_options`.
        soft_l1: what this loss does, as the help says it.
    """

    def decorate(function: Function) -> Function:
        @with_options("results/<campaign name>", "tables", "pictures", *written)
        @wraps(function)
        def wrapped(
            campaigns: Sequence[Path], loss: Loss | None, max_nrmse: float | None, options: Options, **others: Any
        ) -> Any:
            return function(task=Task(_one_campaign(campaigns), loss, max_nrmse, options), **others)

        return in_order(
            wrapped,
            click.argument("campaigns", metavar="CAMPAIGN", nargs=-1, required=True, type=FILE),
            under(
                "How it is fitted",
                option(
                    "--loss",
                    "LOSS",
                    f"linear: least squares [the campaign's, else this]; soft_l1: {soft_l1}.",
                    type=click.Choice(["linear", "soft_l1"]),
                ),
                option(
                    "--max-nrmse",
                    "SHARE",
                    "Exit status 1 above this misfit (NRMSE), such as 2 %.",
                    type=Size("share up to 1, such as 0.02 or 2 %", 1.0),
                ),
            ),
        )

    return decorate


def _one_campaign(campaigns: Sequence[Path]) -> Path:
    """The one campaign of a command line; several test files in its place are told what makes one of them."""
    from bushfit.campaign.campaign import refuse_tests

    first, *others = campaigns
    if others:
        refuse_tests(campaigns)
        extra = "argument" if len(others) == 1 else "arguments"
        raise click.UsageError(
            f"Got unexpected extra {extra} ({' '.join(map(str, others))}). bushfit batch takes several campaigns.",
            click.get_current_context(),
        )
    return first


def open_model(file: Path) -> Result:
    """The result in a model file.

    Raises:
        ModelError: a campaign or a test file, or whatever else is no model.
    """
    from bushfit.campaign.campaign import TEST_FILES
    from bushfit.model.file import load_result

    ending = file.suffix.lower()
    if file.is_dir() or (file.is_file() and ending in (".toml", *TEST_FILES)):
        found = "a folder" if file.is_dir() else "a campaign" if ending == ".toml" else "a test file"
        way = (
            f"bushfit run {quote_path(file)}"
            if ending == ".toml"
            else f"bushfit init {quote_path(file)} ..., then bushfit run"
        )
        inside = file / "model.json"
        raise ModelError(
            "a fitted model is needed",
            file=file,
            found=found,
            expected="a .json file, as bushfit run, the fits and diagnose write it",
            hint=f"name the file: {quote_path(inside)}" if inside.is_file() else f"{way} makes one",
        )
    return load_result(file)


def open_source(source: Path) -> Campaign | Result:
    """What a command line names: a campaign, or the result in a model file or in a folder of results."""
    from bushfit.campaign.campaign import load_campaign

    if source.suffix.lower() == ".toml" and not source.is_dir():
        return load_campaign(source)
    return open_model(inside if (inside := source / "model.json").is_file() else source)
