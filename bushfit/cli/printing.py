"""Printed results: parameters, quality of the fit, tests, correlations, and the equation of the model."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

from bushfit.caveat import GENERAL
from bushfit.cli.output import Output
from bushfit.units import format_range, number

if TYPE_CHECKING:
    from bushfit.caveat import Caveat
    from bushfit.model.result import ExpectedError, Misfit, Result
    from bushfit.prediction.validation import Validation

#: Largest number of tests that are shown without -v, those with the largest misfit.
_MOST_TESTS = 8


def permitted_use(warnings: Sequence[Caveat], otherwise: str, places: Collection[str] = ()) -> str:
    """Consequence of the most important warning for the use of the numbers.

    Args:
        warnings: warnings of the numbers.
        otherwise: sentence if there are no warnings.
        places: directions and specimens of the numbers, which the consequence names if the warning is about one.
    """
    if not warnings:
        return otherwise
    first = min(warnings, key=lambda warning: (warning.rank, warning.consequence == GENERAL))
    return f"{first.subject}: {first.consequence}" if first.subject in places else first.consequence


def print_validations(output: Output, validations: Sequence[Validation]) -> None:
    """Print the misfit of the predicted force in each validation record, and the share of points in its 95 % band."""
    from bushfit.report.response import validation_table

    if validations:
        table = validation_table(validations)
        rows = [(*row[:2], *(number(value, 3) for value in row[2:])) for row in table.itertuples(index=False)]
        title = "validation records (never fitted): predicted force compared with measured force"
        title += "; before: without the diagnosis" * (validations[0].nrmse_before is not None)
        output.print_table(title, list(table.columns), rows, text_columns=2)
    for validation in validations:
        source = validation.record.source
        warnings = (*(source.notes if source else ()), *validation.response.warnings)
        output.warn(warning.about(validation.record.name) for warning in warnings)


def print_step(output: Output, title: str, result: Result, source: str) -> None:
    """Print a fit result, and the warnings of its fit if they name a file or step `source`; with -v also its origin."""
    print_result(output, title, result)
    output.warn(warning.about(source) for warning in result.warnings if source)
    print_origin(output, result)


def print_result(output: Output, title: str, result: Result) -> None:
    """Print the parameters of a fit result, NRMSE and reduced chi-square (of each test too), strong correlations.

    Args:
        output: output of the command.
        title: title above the parameters.
        result: fit result.
    """
    from bushfit.report.parameters import correlation_texts

    print_parameters(output, title, result)
    if quality := result.quality:
        gain = quality.loop_gain_error
        of_loops = " (of a loop, the first harmonic; in chi2 below, all rows)" if result.model.unnamed and gain else ""
        loops = f", gain error of a loop {number(100 * gain, 2)} % ([rig] gain_error)" if gain else ""
        output.print(
            f"NRMSE {number(100 * quality.nrmse, 2)} %, reduced chi-square {number(quality.reduced_chi_square, 3)} "
            f"over {quality.points} values{of_loops}, noise {number(100 * quality.noise, 2)} % per point{loops}"
        )
    print_tests(output, result.tests, result.usable)
    if correlations := correlation_texts(result, 0.0) if output.verbose else correlation_texts(result):
        output.print(f"correlation: {correlations}")


def print_tests(output: Output, misfits: Sequence[Misfit], usable: Sequence[ExpectedError]) -> None:
    """Print the misfit of each test, with -v also of each run, and how far single measured points are from the model.

    Args:
        output: output of the command.
        misfits: NRMSE, reduced chi-square, and mean relative difference of |K| (measured minus model) of each test and
            run.
        usable: expected error of |K| and loss factor of each direction or specimen.
    """
    from bushfit.report.tables import DISPLAYS

    tests = [test for test in misfits if output.verbose or test.held is None]
    worst = sorted(tests, key=lambda test: -test.reduced_chi_square)[: len(tests) if output.verbose else _MOST_TESTS]
    if len(tests) > 1:
        title = "test by test: NRMSE [%], reduced chi-square (chi2), mean gap in |K| [%] (measured minus model)"
        columns, rows = ("test", "direction", "points", "NRMSE", "chi2", "gap", ""), []
        for test in (test for test in tests if test in worst):
            name, (unit, factor) = test.test, DISPLAYS.get(test.unit or "", (test.unit or "", 1.0))
            if test.held is not None:  # a run, by its amplitude or frequency
                name = f"  {format_range(unit, factor * (test.value or 0.0))}"
            figures = number(100 * test.nrmse, 2), number(test.reduced_chi_square, 2), f"{100 * test.gain:+z.2f}"
            rows.append((name, test.place, str(test.points), *figures, "" if test.fitted else "not fitted"))
        output.print_table(title, columns, rows, text_columns=2)
    if count := len(tests) - len(worst):
        output.print(f"and {count} more {'test has' if count == 1 else 'tests have'} a smaller misfit; -v lists them")
    for place in usable:
        how = "each predicted by a fit without it" if place.held_out else "all fitted"
        error = f"{number(100 * place.stiffness, 2)} % in stiffness and {number(place.loss_factor, 2)} in loss factor"
        output.print(f"{place.place}: 95 % of {place.points} measured points are within {error} of the model ({how})")


def print_origin(output: Output, result: Result) -> None:
    """Print the equation of a model and its input files; nothing without -v."""
    if output.verbose:
        output.print(result.model.equation())
        for file, sha256 in result.files.items():
            output.print(f"input: {file} sha256 {sha256[:12]}")


def print_parameters(output: Output, title: str, result: Result) -> None:
    """Print the parameters: value, standard error, 95 % interval (by profile likelihood, if any), and unit."""
    from bushfit.report.parameters import parameter_rows

    columns = ("parameter", "value", "std error", "95 % by profile" if result.profile else "95 % interval", "unit")
    rows = []
    for row in parameter_rows(result):
        label = f"{row.name} ({row.state})" if row.state else row.name
        rows.append((label, row.value, row.error, row.interval, row.unit))
    output.print_table(title, columns, rows)
    for name, expression in result.ties.items():
        output.print(f"{name} is tied: {name} = {expression}")
    for name, use in result.priors.items():
        output.print(
            f"prior of {name}, {use.source}: {number(100.0 * use.share, 2)} % of the information; tests and prior "
            f"differ by {number(abs(use.distance), 2)} standard deviations"
        )
