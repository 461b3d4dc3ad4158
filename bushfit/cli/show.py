"""What people read on the terminal: tables of parameters, quality, correlations and warnings."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from rich import box
from rich.markup import escape
from rich.table import Table

from bushfit.cli.common import Options
from bushfit.units import format_range, number

if TYPE_CHECKING:
    from bushfit.jobs.fits import Fitted
    from bushfit.model.result import Misfit, Result, Usable

#: Correlation between two parameters from which on it is shown without -v: they trade off against each other.
_CLOSE = 0.9
#: Tests that the terminal shows at most without -v, those that are met worst.
_MOST_TESTS = 8


def tell_fit(options: Options, name: str, outcome: Fitted) -> None:
    """Each step of a fit, and before all what it leaves open."""
    if left := outcome.result.left_open:
        options.console.print(f"[bold]{escape(name)}:[/bold] [yellow]{escape(left)}[/]")
    for title, result in outcome.reports:
        report(options, f"{name}: {title}", result)


def report(options: Options, title: str, result: Result) -> None:
    """The parameters of a result, its quality, and its warnings."""
    from bushfit.prediction.caveats import warnings_of

    tell_result(options, title, result)
    options.warn(warnings_of(result))
    tell_sources(options, result)


def tell_result(options: Options, title: str, result: Result) -> None:
    """The parameters of a result and its quality."""
    console = options.console
    tell_parameters(options, title, result)
    if result.quality:
        quality = result.quality
        gain = quality.loop_gain_error
        loops = f", gain of a loop within {number(100 * gain, 2)} % ([rig] gain_error)" if gain else ""
        console.print(
            f"NRMSE {number(100 * quality.nrmse, 2)} %, reduced chi-square {number(quality.reduced_chi_square, 3)} "
            f"over {quality.points} points, noise {number(100 * quality.noise, 2)} % a point{loops}",
            markup=False,
        )
    tell_tests(options, result.tests, result.usable)
    shown = [pair for pair in result.covariance.correlations() if options.verbose or abs(pair[2]) > _CLOSE]
    if shown:
        console.print("correlation: " + ", ".join(f"{one}/{other} {value:+.2f}" for one, other, value in shown))


def tell_tests(options: Options, tested: Sequence[Misfit], usable: Sequence[Usable]) -> None:
    """How well each test is met, with -v each run of it, and within what the model is usable."""
    tests = [test for test in tested if options.verbose or test.held is None]
    worst = sorted(tests, key=lambda test: -test.reduced_chi_square)[: len(tests) if options.verbose else _MOST_TESTS]
    if len(tests) > 1:
        title = "test by test: NRMSE and gain off [%] (+: the model is stiffer), chi2 the reduced chi-square"
        columns, rows = ("test", "place", "points", "NRMSE", "chi2", "gain", ""), []
        for test in (test for test in tests if test in worst):
            name = test.test if test.held is None else f"  {_held(test)}"
            gain = f"{round(100 * test.gain, 2) + 0.0:+.2f}"  # no -0
            figures = (number(100 * test.nrmse, 2), number(test.reduced_chi_square, 2), gain)
            rows.append((name, test.place, str(test.points), *figures, "" if test.fitted else "not fitted"))
        tell_table(options, title, columns, rows, names=2)
    if left := len(tests) - len(worst):
        options.say(
            f"and {left} more {'test, which is' if left == 1 else 'tests, which are'} met better; -v shows them"
        )
    for place in usable:
        how = "each predicted from other runs" if place.held_out else "as fitted"
        words = f"{number(100 * place.stiffness, 2)} % of stiffness and {number(place.loss_factor, 2)} of loss factor"
        options.say(f"{place.place}: usable within {words} (95 % of {place.points} points, {how})")


def _held(test: Misfit) -> str:
    """What a run held, as people read it."""
    from bushfit.report.tables import DISPLAYS

    unit, factor = DISPLAYS.get(test.unit or "", (test.unit or "", 1.0))
    return format_range(unit, factor * (test.value or 0.0))


def tell_sources(options: Options, result: Result) -> None:
    """With -v the equation of a model and the files behind it."""
    if options.verbose:
        options.say(result.model.equation())
        for source in result.inputs:
            options.say(f"input: {source.file} sha256 {source.sha256[:12]}")


def tell_table(
    options: Options, title: str, columns: Sequence[str], rows: Iterable[Sequence[str]], *, names: int = 1
) -> None:
    """A table of rows: so many columns hold names, which wrap, the others numbers."""
    table = Table(title=escape(title), title_justify="left", box=box.SIMPLE_HEAD, title_style="bold")
    for place, column in enumerate(columns):
        number = place >= names
        table.add_column(escape(column), justify="right" if number else "left", no_wrap=number, overflow="fold")
    for row in rows:
        table.add_row(*row)
    options.console.print(table)


def tell_parameters(options: Options, title: str, result: Result) -> None:
    """The paper's Table 1 with uncertainty: value, standard error, 95 % interval (by profile, if any), unit."""
    from bushfit.report.parameters import interval_kind, parameter_rows

    columns = ("parameter", "value", "std error", interval_kind(result), "unit")
    rows = ((row.label, row.value, row.error, row.interval, row.unit) for row in parameter_rows(result))
    tell_table(options, title, columns, rows)
