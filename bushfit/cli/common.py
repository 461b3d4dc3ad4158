"""What the commands share: options, where results go, and how they are told."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

import click

from bushfit.report.folder import check_free, to_json, write_files
from bushfit.units import alike, for_people, number

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from bushfit.campaign.campaign import Campaign
    from bushfit.campaign.schema import Loss
    from bushfit.jobs import Found, Job
    from bushfit.jobs.fits import Fitted
    from bushfit.model.result import Result

F = TypeVar("F", bound=Callable[..., Any])

#: Width of tables where standard error is no terminal.
_WIDTH = 100

campaign_argument = click.argument("campaign", type=click.Path(path_type=Path))


class _Folder(click.Path):
    """A folder for results; an empty text, as of a variable that is not set, is none."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        return (
            super().convert(value, param, ctx) if value else self.fail("this is no folder: an empty text", param, ctx)
        )


class _Share(click.FloatRange):
    """A share above zero; nan is none."""

    name = "share, such as 0.02"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        share = super().convert(value, param, ctx)
        return share if math.isfinite(share) else self.fail(f"{value} is no share such as 0.02", param, ctx)


@dataclass(frozen=True)
class Options:
    """Options that every command takes."""

    output: Path | None
    verbose: bool
    quiet: bool
    as_json: bool
    plots: bool
    force: bool

    @property
    def formats(self) -> tuple[str, ...]:
        """What to write besides JSON."""
        return ("csv", "png") if self.plots else ("csv",)

    def folder(self, name: str) -> Path:
        """Where results go: --output, or results/<name>."""
        return self.output or Path("results") / name

    @property
    def console(self) -> Console:
        """People read standard error; nothing at all with --quiet."""
        from rich.console import Console

        console = Console(stderr=True, quiet=self.quiet, highlight=False, soft_wrap=True)
        return console if console.is_terminal else Console(stderr=True, quiet=self.quiet, soft_wrap=True, width=_WIDTH)

    def write(self, folder: Path, files: Mapping[str, bytes]) -> None:
        """Write the results, all or none, and say where."""
        write_files(folder, files, force=self.force)
        self.console.print(f"wrote {', '.join(files)} to {folder}", markup=False)

    def require_free(self, folder: Path, names: Sequence[str]) -> None:
        """Refuse before the work rather than after it."""
        check_free(folder, list(names), force=self.force)

    def tell(self, document: Mapping[str, Any]) -> None:
        """The result on standard output, where --json asks for it."""
        if self.as_json:
            click.echo(to_json(document).decode(), nl=False)


def _shared_options(where: str, function: F) -> F:
    @click.option("-o", "--output", type=_Folder(path_type=Path), help=f"Folder for the results [{where}].")
    @click.option("-v", "--verbose", is_flag=True, help="Say more: all correlations, the equation, the files read.")
    @click.option("-q", "--quiet", is_flag=True, help="Say nothing but errors.")
    @click.option("--json", "as_json", is_flag=True, help="Print the result as JSON on standard output.")
    @click.option("--no-plots", is_flag=True, help="Write no PNG files.")
    @click.option("--force", is_flag=True, help="Replace results that stand.")
    @wraps(function)
    def wrapped(*args: Any, **kwargs: Any) -> Any:
        plots = not kwargs.pop("no_plots")
        names = ("output", "verbose", "quiet", "as_json", "force")
        options = Options(plots=plots, **{name: kwargs.pop(name) for name in names})
        return function(*args, options=options, **kwargs)

    return wrapped  # type: ignore[return-value]


def shared_options(function: F) -> F:
    """-o, -v, -q, --json, --no-plots, --force, gathered into one `options` argument."""
    return _shared_options("results/<campaign or file>", function)


def options_without_folder(function: F) -> F:
    """The same of a command that writes nothing where no folder is given."""
    return _shared_options("nothing is written", function)


max_nrmse_option = click.option(
    "--max-nrmse",
    type=_Share(min=0.0, min_open=True),
    help="Exit with status 1 if the NRMSE is above this share (0.02 is 2 %).",
)


def _loss_option(soft_l1: str) -> Callable[[Any], Any]:
    words = f"linear: least squares [the campaign's, else this]. soft_l1: {soft_l1}."
    return click.option("--loss", type=click.Choice(["linear", "soft_l1"]), help=words)


loss_option = _loss_option("points far off pull less, wild ones not at all")
diagnose_loss_option = _loss_option("the same with wild points left out")


def open_campaign(file: Path, loss: str | None) -> Campaign:
    """A campaign as it is, or with another loss."""
    from bushfit.campaign.campaign import load_campaign

    loaded = load_campaign(file)
    return replace(loaded, fit=replace(loaded.fit, loss=cast("Loss", loss))) if loss else loaded


def perform(
    options: Options,
    campaign: Path,
    job: Job[Found],
    tell: Callable[[Options, str, Found], None],
    max_nrmse: float | None,
    loss: str | None,
) -> None:
    """What every command on a campaign does: read, refuse to overwrite, work, tell, write, hold to a limit."""
    from bushfit.fitting.data import Data

    loaded = open_campaign(campaign, loss)
    folder = options.folder(loaded.slug)
    options.require_free(folder, job.names(loaded, options.formats))
    outcome = job.run(Data.of(loaded))
    tell(options, loaded.name, outcome)
    options.write(folder, outcome.files(options.formats))
    options.tell(outcome.document)
    enforce_nrmse(outcome.result, max_nrmse)


def enforce_nrmse(result: Result, limit: float | None) -> None:
    """Exit with status 1 where the fit misses the user's limit."""
    if limit is None or result.quality is None or result.quality.nrmse <= limit:
        return
    click.echo(f"bushfit: NRMSE {result.quality.nrmse:.4g} is above --max-nrmse {limit:g}", err=True)
    click.get_current_context().exit(1)


def tell_fit(options: Options, name: str, outcome: Fitted) -> None:
    """Each step of a fit."""
    for title, result in outcome.reports:
        report(options, f"{name}: {title}", result)


def report(options: Options, title: str, result: Result) -> None:
    """Table 1 of a result, its quality, and its warnings."""
    console = options.console
    console.print(parameter_table(title, result))
    if result.quality:
        quality = result.quality
        console.print(
            f"NRMSE {number(100 * quality.nrmse, 2)} %, reduced chi-square {number(quality.reduced_chi_square, 3)} "
            f"over {quality.points} points, noise {number(100 * quality.noise, 2)} % a point"
        )
    tells = result.covariance.correlations()
    shown = tells if options.verbose else [pair for pair in tells if abs(pair[2]) > 0.9]
    if shown:
        console.print("correlation: " + ", ".join(f"{one}/{other} {value:+.2f}" for one, other, value in shown))
    warn(options, result.warnings)
    if options.verbose:
        console.print(result.model.equation(), markup=False)
        for source in result.inputs:
            console.print(f"input: {source.file} sha256 {source.sha256[:12]}", markup=False)


def warn(options: Options, lines: Sequence[str]) -> None:
    from rich.markup import escape

    for line in lines:
        options.console.print(f"[yellow]warning:[/yellow] {escape(line)}")


def new_table(title: str, *columns: str) -> Table:
    """A table in the house's style: the first column names, the others are numbers."""
    from rich import box
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=escape(title), title_justify="left", box=box.SIMPLE_HEAD, title_style="bold")
    for place, column in enumerate(columns):
        table.add_column(escape(column), justify="right" if place else "left", no_wrap=True)
    return table


def parameter_table(title: str, result: Result) -> Table:
    """The paper's Table 1 with uncertainty: value, standard error, 95 % interval (by profile, if any), unit."""
    kind = "95 % by profile" if result.profile else "95 % interval"
    table = new_table(title, "parameter", "value", "std error", kind, "unit")
    for name, parameter in result.model.parameters.items():
        value, stderr = result.model.values[name], result.covariance.stderr(name)
        interval = result.profile.get(name) or result.interval(name)
        digits, (unit, factor) = _digits(value, stderr), for_people(parameter.unit, 1.0, value)
        known = [end * factor for end in interval or () if end is not None]
        shown, *texts = alike([value * factor, *known], digits, least=2)
        ends = ["open" if end is None else texts.pop(0) for end in interval or ()]
        error = "" if stderr is None else alike([stderr * factor], 2)[0]
        table.add_row(_labelled(name, result), shown, error, " to ".join(ends), unit)
    return table


def _labelled(name: str, result: Result) -> str:
    if name in result.at_bound:
        return f"{name} (at {result.at_bound[name]})"
    return name if name in result.fitted else f"{name} (held)"


def _digits(value: float, stderr: float | None) -> int:
    """Digits that carry meaning: two of the standard error."""
    if not stderr or not value:
        return 4
    return int(min(max(math.floor(math.log10(abs(value))) - math.floor(math.log10(stderr)) + 2, 2), 6))
