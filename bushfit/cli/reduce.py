"""`bushfit reduce`: raw stepped-sine histories, or a resonance test -> a sweep."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from bushfit.cli.file_options import direction_error, options_named, with_stated
from bushfit.cli.options import command_called, option, under
from bushfit.cli.output import Output, with_output
from bushfit.cli.shared_options import parse_grid, positive
from bushfit.errors import BushfitError, MeasurementError
from bushfit.report import plots
from bushfit.report.results import figure_file, table_file
from bushfit.units import format_aligned, number

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from bushfit.geometry import Direction
    from bushfit.reading.measurement import Loop
    from bushfit.reading.table import Table
    from bushfit.reduction.resonance import Resonance
    from bushfit.reduction.result import Reduction, Step

#: Lines an octave in which a resonance test is shown; chosen: a dozen lines for most tests.
_LINES_AN_OCTAVE = 3


@command_called(
    "reduce",
    "data/cmp_15961_raw/stepped_sine_axial.csv",
    'data/measured/epdm_70/shaker_1g_573g.csv --mass "0.5878 kg" --specimen mount',
)
@with_stated(sweeps=False)
@under(
    "Of raw histories",
    option("--levels", "GRID", 'Amplitudes that were asked for, "0.1, 0.2 mm" [found].'),
    option("--cycles", "N", "Fewest steady cycles [3].", type=click.IntRange(3, 1000), default=3),
)
@under(
    "Of a resonance test",
    option("--mass", "MASS", 'On the mount, such as "0.5 kg".'),
    option("--mass-added", "MASS", 'What moves with it, such as "15 g".'),
    option("--specimen", "NAME", "What was tested, if it is no bushing."),
    option("--base-acceleration", "ACCELERATION", 'Such as "0.1 g", if no column says it.'),
)
@with_output("results/<first file>", "tables", "pictures")
def command(
    files: tuple[Path, ...],
    test_options: Mapping[str, Any],
    levels: str | None,
    cycles: int,
    output: Output,
    **shaker: str | None,
) -> None:
    """Reduce raw stepped-sine histories or a resonance test to a sweep.

    Raw histories (time, displacement, force): a FILE may hold many steps of at least five cycles; several files of one
    direction make one sweep. A resonance test (--mass, one FILE): acceleration and phase of the base and of a mass on
    the mount, or their transmissibility. Each point is told with its error.

    Writes sweep.csv, for [[sweeps]] of a campaign or `bushfit init`, and reduce.png.
    """
    folder = output.free_folder(files[0].stem, output.formats.table("sweep"))
    table = _resonance_table(files[0], test_options, shaker)
    found = (
        _histories(files, test_options, levels, cycles)
        if table is None
        else _resonance(files, table, test_options, shaker, levels)
    )
    found.tell(output)
    file = output.formats.table("sweep")
    snippet = f'[[sweeps]]\nfile = "{file}"\n{found.body} = {json.dumps(found.name, ensure_ascii=False)}\n'
    document = {found.body: found.name, "points": found.points.to_dict(orient="list"), **found.document}
    document |= {"warnings": list(found.warnings), "campaign": snippet}
    results = [table_file("sweep", lambda: found.points), figure_file("reduce", found.figure)]
    output.write(folder, results, document, files)
    output.print(f"for a campaign in {folder} (elsewhere, with the way there):\n\n{snippet}")


@dataclass(frozen=True)
class _Reduced:
    """Result of a reduction: the points as a table, how to show and draw them, and what --json has besides.

    What was tested is told by `body` and `name`, as in a campaign: direction = "axial", or specimen = "mount".
    """

    body: Literal["direction", "specimen"]
    name: str
    points: pd.DataFrame
    warnings: Sequence[str]
    tell: Callable[[Output], None]
    figure: Callable[[], Figure]
    document: Mapping[str, Any] = field(default_factory=dict)


def _histories(files: Sequence[Path], test_options: Mapping[str, Any], levels: str | None, cycles: int) -> _Reduced:
    """Raw stepped-sine histories, reduced."""
    from bushfit.reduction.steps import reduce
    from bushfit.report.tables import reduced_table

    histories = _read(files, test_options)
    direction = histories[0].direction
    asked = parse_grid(levels, "--levels", direction.motion.displacement_unit) or ()
    reduction = reduce(histories, fewest_cycles=cycles, levels=asked)

    names = histories[0].name if len(histories) == 1 else f"{len(histories)} histories"
    title = f"{names}: {len(reduction.steps)} points, {direction}"
    return _Reduced(
        "direction",
        str(direction),
        reduced_table(reduction),
        reduction.warnings,
        lambda output: _tell(output, reduction),
        lambda: plots.inspection.reduction_figure(reduction, histories, title),
    )


def _resonance_table(file: Path, test_options: Mapping[str, Any], shaker: Mapping[str, str | None]) -> Table | None:
    """The table of a resonance test; None of a file without any of its columns, unless a mass or the like is stated."""
    from bushfit.inspection.opening import open_table
    from bushfit.reading.headers import RESONANCE_COLUMNS
    from bushfit.reading.resonance import is_resonance

    said = any(value is not None for value in shaker.values())
    try:
        with options_named():
            table = open_table(file, RESONANCE_COLUMNS, test_options)
    except BushfitError:  # which the reading of a history tells as well
        if said:
            raise
        return None
    return table if said or is_resonance(table) else None


def _resonance(
    files: Sequence[Path],
    table: Table,
    test_options: Mapping[str, Any],
    shaker: Mapping[str, str | None],
    levels: str | None,
) -> _Reduced:
    """A resonance test, reduced."""
    from bushfit.geometry import Direction
    from bushfit.inspection.opening import test_direction
    from bushfit.reading.resonance import read_resonance
    from bushfit.reduction.resonance import reduce_resonance
    from bushfit.report.tables import resonance_table

    if len(files) > 1 or levels is not None:
        raise MeasurementError(
            "a resonance test is reduced by itself",
            file=table.file,
            found=f"{len(files)} files" if len(files) > 1 else f"--levels {levels}",
            expected="one file, and no levels: the amplitude follows the resonance",
            hint="call bushfit reduce for each of them, with its own mass",
        )
    direction, specimen = test_direction(table.file, table, test_options), shaker["specimen"] or None
    if direction is None and specimen is None:
        error = direction_error(table.file)
        error.hint = f'{error.hint}; or name the specimen that was tested: --specimen "mount"'
        raise error
    mass = _mass(table, direction, shaker)
    base_acceleration = positive(shaker["base_acceleration"], "--base-acceleration", "m/s^2")
    read_as = direction or Direction.AXIAL  # which translation it is makes no difference to reading
    with options_named():
        reduction = reduce_resonance(read_resonance(table, read_as, base_acceleration), mass)

    title = f"{table.file.stem}, {specimen or direction}: {number(mass, 4)} kg on a shaker"
    frequency, largest = reduction.peak
    return _Reduced(
        "specimen" if specimen else "direction",
        specimen or str(direction),
        resonance_table(reduction),
        reduction.warnings,
        lambda output: _tell_resonance(output, reduction),
        lambda: plots.inspection.resonance_figure(reduction, title),
        {"mass_kg": mass, "resonance_Hz": frequency, "transmissibility_at_resonance": largest},
    )


def _mass(table: Table, direction: Direction | None, shaker: Mapping[str, str | None]) -> float:
    """The mass that moves [kg]."""
    mass = positive(shaker["mass"], "--mass", "kg")
    if direction is not None and direction.is_rotation:
        raise MeasurementError(
            "a mass resists no rotation", file=table.file, found=str(direction), expected="a translation"
        )
    if mass is None:
        raise MeasurementError(
            "this is a resonance test, and nothing says how large the mass is",
            file=table.file,
            place=f"line {table.layout.header_line}",
            found=", ".join(table.headers),
            expected="the mass that moves on the mount",
            hint='state it: --mass "0.5 kg"',
        )
    return mass + (positive(shaker["mass_added"], "--mass-added", "kg") or 0.0)


def _read(files: Sequence[Path], test_options: Mapping[str, Any]) -> list[Loop]:
    """The histories, of one direction, named by their stems, or by their paths where stems agree."""
    from bushfit.inspection.gathering import TestSource, distribute_options
    from bushfit.inspection.opening import read_history

    stems = [file.stem for file in files]
    histories: list[Loop] = []
    sources = distribute_options([TestSource(file) for file in files], test_options)
    for file, stem, source in zip(files, stems, sources, strict=True):
        with options_named():
            history, direction = read_history(file, source.test_options or {})
        if direction is None:
            raise direction_error(file)
        if histories and direction is not histories[0].direction:
            raise MeasurementError(
                "the files are of several directions",
                found=f"{files[0]} ({histories[0].direction}), {file} ({direction})",
                expected="histories of one direction",
                hint="reduce each direction by itself",
            )
        histories.append(replace(history, direction=direction, name=stem if stems.count(stem) == 1 else str(file)))
    return histories


def _tell(output: Output, reduction: Reduction) -> None:
    """A line a level and repeat, with -v a line a point."""
    units = reduction.direction.display
    (unit, length), (stiffness_unit, factor) = units.displacement, units.stiffness

    def line(step: Step) -> tuple[float, ...]:
        return (step.level, step.repeat, *((step.nominal_frequency,) if output.verbose else ()))

    count, rows = len(reduction.steps), []
    for (level, repeat, *_), group in groupby(sorted(reduction.steps, key=line), line):
        steps = list(group)
        cells = (
            number(length * level, 4),
            f"{repeat:.0f}",
            f"{len(steps)}",
            _span([number(frequency, 4) for frequency in sorted(step.nominal_frequency for step in steps)]),
            _span(
                format_aligned(
                    sorted((factor * abs(step.stiffness) for step in steps), reverse=True), 4, minimum_digits=2
                )[::-1]
            ),
            _span(
                format_aligned(sorted((step.loss_factor for step in steps), reverse=True), 3, minimum_digits=2)[::-1]
            ),
            number(100 * max(step.gain_error for step in steps), 1),
            number(100 * max(step.force_distortion for step in steps), 2),
        )
        rows.append(cells)
    title = f"{count} point{'s' * (count > 1)} found; of each line the largest noise and distortion"
    heads = ("repeat", "points", "f [Hz]", f"|K| [{stiffness_unit}]", "loss factor", "noise [%]", "THD [%]")
    output.print_table(title, (f"level [{unit}]", *heads), rows)
    output.warn(reduction.warnings)
    if output.verbose:
        for skip in reduction.skipped:
            output.print(f"{skip.name}, {skip.start:.4g} to {skip.end:.4g} s makes no point: {skip.why}")


def _tell_resonance(output: Output, found: Resonance) -> None:
    """A line a third of an octave, with -v a line a point."""
    import numpy as np

    from bushfit.geometry import TRANSLATION
    from bushfit.reading.measurement import loss_factor

    (unit, length), _, (stiffness_unit, factor) = TRANSLATION.display
    frequency, largest = found.peak
    count, cells = found.frequency.size, []
    lines = range(count) if output.verbose else (_LINES_AN_OCTAVE * np.log2(found.frequency)).round().tolist()
    for _, group in groupby(range(count), lambda place: lines[place]):
        rows = list(group)
        amplitudes, ratios = (
            _span(format_aligned(sorted(values[rows].tolist(), reverse=True), 3, minimum_digits=3)[::-1])
            for values in (length * found.amplitude, np.abs(found.transmissibility))
        )
        figures = (
            number(factor * float(np.median(np.abs(found.stiffness[rows]))), 4),
            number(float(np.median(loss_factor(found.stiffness[rows]))), 3),
            number(100 * float(found.relative_error[rows].max()), 2),
        )
        ends = _span([number(float(end), 4) for end in found.frequency[rows]])
        cells.append((ends, f"{len(rows)}", amplitudes, ratios, *figures))
    title = (
        f"{count} point{'s' * (count > 1)} of {found.test.frequency.size} rows; resonance at {frequency:.1f} Hz, "
        f"|T| {largest:.2f}\nof each line the median of |K| and loss factor, and the largest error"
    )
    heads = ("f [Hz]", "points", f"amplitude [{unit}]", "|T|", f"|K| [{stiffness_unit}]", "loss factor", "error [%]")
    output.print_table(title, heads, cells)
    output.warn(found.warnings)


def _span(rising: Sequence[str]) -> str:
    return "-".join(dict.fromkeys((rising[0], rising[-1])))
