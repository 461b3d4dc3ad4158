"""`bushfit reduce`: raw stepped-sine histories, or a resonance test -> a sweep."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from bushfit.caveat import to_entries
from bushfit.cli.file_options import direction_error, metadata_options, options_named
from bushfit.cli.options import command_called, option, option_group
from bushfit.cli.output import Output, with_output
from bushfit.cli.shared_options import grid, quantity
from bushfit.errors import BushfitError, MeasurementError, error_location, quote_path
from bushfit.report import plots
from bushfit.report.results import ResultFile
from bushfit.units import format_aligned, number

if TYPE_CHECKING:
    import pandas as pd

    from bushfit.reading.measurement import Loop
    from bushfit.reading.table import Table
    from bushfit.reduction.resonance import Resonance
    from bushfit.reduction.result import Reduction

#: Number of printed lines per octave of a resonance test; chosen: a dozen lines for most tests.
_LINES_AN_OCTAVE = 3


@command_called(
    "reduce",
    "data/cmp_15961_raw/stepped_sine_axial.csv",
    'data/measured/epdm_70/shaker_1g_573g.csv --mass "0.5878 kg" --specimen mount',
)
@metadata_options("histories")
@option_group(
    "Raw histories",
    option("--levels GRID", 'Nominal amplitudes of the steps, zero-to-peak, such as "0.1, 0.2 mm" [detected].'),
    option("--cycles N", "Use only steps with at least N steady cycles [3].", type=click.IntRange(3, 1000), default=3),
)
@option_group(
    "Resonance test",
    option("--mass MASS", 'Mass that the mount carries on the shaker, such as "0.5 kg".', type=quantity("kg")),
    option(
        "--mass-added MASS",
        'Further mass that moves with this mass, such as "15 g" of accelerometer and cable; added to --mass.',
        type=quantity("kg"),
    ),
    option("--specimen NAME", "Name of the tested specimen, if the test is not of a bushing."),
    option(
        "--base-acceleration ACCELERATION",
        'Acceleration amplitude of the base, such as "0.1 g", if no column states it.',
        type=quantity("m/s^2"),
    ),
)
@with_output("results/<first file>", "tables", "pictures")
def command(files: tuple[Path, ...], levels: str | None, cycles: int, output: Output, **shaker: Any) -> None:
    """Reduce raw stepped-sine histories or a resonance test to a sweep.

    A raw history contains time, displacement and force, with many steps of at least five cycles. Several files of one
    direction make one sweep. A resonance test is one FILE with --mass: the accelerations and phases of a shaken base
    and of a mass on the mount, or their ratio (transmissibility). Each point gets a standard error.

    Writes reduce.png and sweep.csv, which init and campaigns read as a sweep.
    """
    from bushfit.reduction.steps import reduce
    from bushfit.report.reduced import reduced_table, resonance_table

    test_options: Mapping[str, Any] = shaker.pop("test_options")
    folder = output.folder(files[0].stem, output.formats.table("sweep"))
    table = _resonance_table(files[0], test_options, shaker)
    document: dict[str, Any] = {}
    if table is not None:
        resonance, body, name = _reduce_resonance(files, table, test_options, shaker, levels)
        frequency, largest = resonance.peak
        document = {"mass_kg": resonance.mass, "resonance_Hz": frequency, "transmissibility_at_resonance": largest}
        points, warnings = resonance_table(resonance), resonance.warnings
        title = f"{table.file.stem}, {name}: {number(resonance.mass, 4)} kg on a shaker"
        figure = partial(plots.inspection.resonance_figure, resonance, title)
        _print_resonance(output, resonance, points)
    else:
        histories = _read_histories(files, test_options)
        body, direction = "direction", histories[0].direction
        name = str(direction)
        with error_location(place="--levels"):
            nominal_levels = grid(direction.motion.displacement_unit)(levels) if levels else ()
        reduction = reduce(histories, fewest_cycles=cycles, levels=nominal_levels)
        points, warnings = reduced_table(reduction), reduction.warnings
        records = histories[0].name if len(histories) == 1 else f"{len(histories)} histories"
        title = f"{records}: {len(reduction.steps)} points, {direction}"
        figure = partial(plots.inspection.reduction_figure, reduction, histories, title)
        _print_steps(output, reduction, points)
    output.warn(warnings)
    if body == "direction":
        points = points.assign(direction=name)  # so that init knows it whatever the file is called
    file = output.formats.table("sweep")
    snippet = f'[[sweeps]]\nfile = "{file}"\n{body} = {json.dumps(name, ensure_ascii=False)}\n'
    document = {body: name, "points": points.to_dict(orient="list"), **document, **to_entries(warnings)}
    document["campaign"] = snippet
    results = [ResultFile("sweep", "table", points), ResultFile("reduce", "figure", figure)]
    output.write(folder, results, document, files)
    following = f"bushfit init {quote_path(folder / file)} --amplitude zero-to-peak"
    output.print(f"next, write a new campaign: {following}\nor write into a campaign in {folder}:\n\n{snippet}")


def _resonance_table(file: Path, test_options: Mapping[str, Any], shaker: Mapping[str, Any]) -> Table | None:
    """Open a test file as a resonance test; None for other files, unless an option such as the mass states this kind.

    Args:
        file: test file.
        test_options: what the user states on the test, by campaign key such as "direction".
        shaker: options of a resonance test by key: masses [kg], base acceleration [m/s^2], specimen; None if not given.
    """
    from bushfit.inspection.recognition import open_table
    from bushfit.reading.headers import RESONANCE_COLUMNS
    from bushfit.reading.resonance import is_resonance

    is_stated = any(value is not None for value in shaker.values())
    try:
        with options_named():
            table = open_table(file, RESONANCE_COLUMNS, test_options)
    except BushfitError:  # the reading of a history raises it as well
        if is_stated:
            raise
        return None
    return table if is_stated or is_resonance(table) else None


def _reduce_resonance(
    files: Sequence[Path], table: Table, test_options: Mapping[str, Any], shaker: Mapping[str, Any], levels: str | None
) -> tuple[Resonance, str, str]:
    """Reduce a resonance test to a sweep.

    Args:
        files: the test file; more than one is an error.
        table: table of the file.
        test_options: what the user states on the test, by campaign key such as "direction".
        shaker: options of a resonance test by key: masses [kg], base acceleration [m/s^2], specimen; None if not given.
        levels: text of the option --levels, which is an error here; None if it is not given.

    Returns:
        The reduced test, and its campaign key ("direction" or "specimen") with the value of this key.
    """
    from bushfit.geometry import Direction
    from bushfit.reading.finding import direction_of_table
    from bushfit.reading.resonance import read_resonance
    from bushfit.reduction.resonance import reduce_resonance

    if len(files) > 1 or levels is not None:
        raise MeasurementError(
            "several files or levels cannot be reduced for a resonance test",
            file=table.file,
            found=f"{len(files)} files" if len(files) > 1 else f"--levels {levels}",
            expected="one file without --levels, because the amplitude follows the resonance",
            hint="call bushfit reduce for each file, with the mass of that test",
        )
    direction, specimen = direction_of_table(table, test_options.get("direction")), shaker["specimen"] or None
    if direction is None and specimen is None:
        error = direction_error(table.file)
        error.hint = f'{error.hint}; or name the specimen that was tested: --specimen "mount"'
        raise error
    if direction is not None and direction.is_rotation:
        raise MeasurementError(
            "a mass needs a translation", file=table.file, found=str(direction), expected="a translation"
        )
    if (mass := shaker["mass"]) is None:
        raise MeasurementError(
            "the mass of this resonance test is not stated",
            file=table.file,
            place=f"line {table.layout.header_line}",
            found=", ".join(table.headers),
            expected="the mass that moves on the mount",
            hint='state it: --mass "0.5 kg"',
        )
    mass += shaker["mass_added"] or 0.0
    read_as = direction or Direction.AXIAL  # which translation it is makes no difference to reading
    with options_named():
        resonance = reduce_resonance(read_resonance(table, read_as, shaker["base_acceleration"]), mass)
    return (resonance, "specimen", specimen) if specimen else (resonance, "direction", str(direction))


def _read_histories(files: Sequence[Path], test_options: Mapping[str, Any]) -> list[Loop]:
    """Read stepped-sine histories of one direction; each is named by its file without extension, or by its path."""
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
                "the files contain several directions",
                found=f"{files[0]} ({histories[0].direction}), {file} ({direction})",
                expected="histories of one direction",
                hint="call bushfit reduce for each direction separately",
            )
        histories.append(replace(history, direction=direction, name=stem if stems.count(stem) == 1 else str(file)))
    return histories


def _print_steps(output: Output, reduction: Reduction, points: pd.DataFrame) -> None:
    """Print the reduced points, one line per amplitude level and repeat; with -v also the stretches without a point.

    Args:
        output: output of the command.
        reduction: operating points, with the stretches of the histories without one.
        points: table of the operating points.
    """
    from bushfit.report.tables import response_headers

    level, stiffness, _ = response_headers(reduction.direction)
    rows = []
    for _, line in points.groupby([level, "repeat"]):
        frequencies, loss_factors = _format_hertz(line["frequency [Hz]"]), _format_span(line["loss factor [-]"], 3)
        noise = (line[stiffness.replace(" [", " std error [")] / line[stiffness]).max()
        errors = number(100 * noise, 1), number(100 * line["force distortion [-]"].max(), 2)
        step = number(line[level].iloc[0], 4), f"{line['repeat'].iloc[0]}"
        magnitudes = _format_span(line[stiffness], 4)
        rows.append((*step, f"{len(line)}", frequencies, magnitudes, loss_factors, *errors))
    title = f"{len(points)} point{'s' * (len(points) > 1)} found; noise and THD: the largest of each line"
    heads = ("repeat", "points", "f [Hz]", stiffness.replace("stiffness", "|K|"), "loss factor", "noise [%]", "THD [%]")
    output.print_table(title, (level.replace("amplitude", "level"), *heads), rows)
    for skip in reduction.skipped if output.verbose else ():
        output.print(f"{skip.name}, {skip.start:.4g} to {skip.end:.4g} s gives no point: {skip.why}")


def _print_resonance(output: Output, resonance: Resonance, points: pd.DataFrame) -> None:
    """Print a reduced resonance test, `points` by frequency, one line per third of an octave."""
    import numpy as np

    from bushfit.geometry import Direction
    from bushfit.report.tables import response_headers

    amplitude, stiffness, _ = response_headers(Direction.AXIAL)
    rows = []
    for _, line in points.groupby((_LINES_AN_OCTAVE * np.log2(points["frequency [Hz]"])).round()):
        spans = _format_span(line[amplitude], 3), _format_span(line["transmissibility [-]"], 3)
        medians = number(line[stiffness].median(), 4), number(line["loss factor [-]"].median(), 3)
        error = number(100 * line["relative error [-]"].max(), 2)
        rows.append((_format_hertz(line["frequency [Hz]"]), f"{len(line)}", *spans, *medians, error))
    frequency, largest = resonance.peak
    count = f"{len(points)} point{'s' * (len(points) > 1)} of {resonance.test.frequency.size} rows"
    title = f"{count}; resonance at {frequency:.1f} Hz, |T| {largest:.2f}"
    title += "\n|K| and loss factor: median of each line; error: the largest"
    heads = ("f [Hz]", "points", amplitude, "|T|", stiffness.replace("stiffness", "|K|"), "loss factor", "error [%]")
    output.print_table(title, heads, rows)


def _format_hertz(frequencies: Any) -> str:
    """Format the lowest and the highest of some frequencies [Hz], such as "5-155"."""
    return "-".join(dict.fromkeys(f"{end:.4g}" for end in (min(frequencies), max(frequencies))))


def _format_span(values: Any, digits: int) -> str:
    """Format the smallest and the largest of some numbers with common decimals, such as "537.2-693.0"."""
    high, low = format_aligned([float(max(values)), float(min(values))], digits, minimum_digits=2)
    return "-".join(dict.fromkeys((low, high)))
