"""`bushfit reduce`: raw stepped-sine histories -> a sweep."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from bushfit.cli.common import Options, example, shared_options
from bushfit.cli.inspect import FORMAT_KEYS
from bushfit.cli.raw import direction_error, file_options, options_named
from bushfit.cli.show import new_table, warn
from bushfit.errors import MeasurementError
from bushfit.units import alike, number

if TYPE_CHECKING:
    from bushfit.reading.measurement import Loop
    from bushfit.reduction.result import Reduction, Step


@click.command("reduce", epilog=example("bushfit reduce data/cmp_15961_raw/stepped_sine_axial.csv"))
@click.argument("files", metavar="FILE...", nargs=-1, required=True, type=click.Path(path_type=Path))
@file_options("force_sign", *FORMAT_KEYS, sweeps=False)
@click.option(
    "--levels",
    help='Amplitudes that were asked for, such as "0.1, 0.2, 0.5 mm", where the rig missed them by more than 10 %; a '
    "step more than 30 % off all of them is refused [found from the data].",
)
@click.option("--cycles", type=click.IntRange(3, 1000), default=3, show_default=True, help="Fewest steady cycles.")
@shared_options
def command(
    files: tuple[Path, ...],
    stated: Mapping[str, Any],
    levels: str | None,
    cycles: int,
    options: Options,
) -> None:
    """Reduce raw stepped-sine histories (columns time, displacement, force) to a sweep.

    One FILE may hold one step or many, joined by ramps and pauses; several files of one direction make one sweep, and
    what occurs again is a repeat. The steady whole cycles of each step are found, its transient left out, and stiffness
    and loss factor of the fundamental computed by least squares. A step needs five or six cycles: three steady ones
    and what its start and end take. A swept sine is refused; single outliers are left out and counted.

    Shows and writes with each point its noise (the standard error, from the scatter of its cycles and rows), THD (the
    overtones of the force over its fundamental: friction makes some, a loose fixture many), and the amplitude that the
    rig really reached.

    Writes sweep.csv, which a campaign names under [[sweeps]] and `bushfit init` takes, and reduce.png.
    """
    from bushfit.campaign.naming import folder_name
    from bushfit.cli.grids import parse_grid
    from bushfit.reading.csvfile import to_csv
    from bushfit.reduction.steps import reduce
    from bushfit.report.tables import reduced_table

    folder = options.folder(folder_name(files[0].stem))
    options.require_free(folder, ["sweep.csv", *(["reduce.png"] if options.plots else [])])
    histories = _read(files, stated)
    direction = histories[0].direction
    asked = parse_grid(levels, "--levels", direction.motion.displacement_unit) or ()
    reduction = reduce(histories, fewest_cycles=cycles, levels=asked)
    _tell(options, reduction)
    points = reduced_table(reduction)
    output = {"sweep.csv": to_csv(points)}
    if options.plots:
        from bushfit.report.plots import reduction_figure, to_png

        names = histories[0].name if len(histories) == 1 else f"{len(histories)} histories"
        title = f"{names}: {len(reduction.steps)} points, {direction}"
        output["reduce.png"] = to_png(reduction_figure(reduction, histories, title))
    options.write(folder, output)
    snippet = f'[[sweeps]]\nfile = "sweep.csv"\ndirection = "{direction}"\n'
    options.console.print(f"for a campaign in {folder} (elsewhere, with the way there):\n\n{snippet}", markup=False)
    document = {"direction": str(direction), "points": points.to_dict(orient="list")}
    options.tell({**document, "warnings": list(reduction.warnings), "campaign": snippet})


def _read(files: Sequence[Path], stated: Mapping[str, Any]) -> list[Loop]:
    """The histories, of one direction, named by their stems, or by their paths where stems agree."""
    from bushfit.inspection.gathering import Source, stated_of_each
    from bushfit.inspection.opening import read_history

    stems = [file.stem for file in files]
    histories: list[Loop] = []
    sources = stated_of_each([Source(file) for file in files], stated)
    for file, stem, source in zip(files, stems, sources, strict=True):
        with options_named():
            history, direction = read_history(file, source.stated or {})
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


def _tell(options: Options, reduction: Reduction) -> None:
    """A line a level and repeat, with -v a line a point."""
    units = reduction.direction.display
    (unit, length), (stiffness_unit, factor) = units.displacement, units.stiffness

    def line(step: Step) -> tuple[float, ...]:
        return (step.level, step.repeat, *((step.nominal_frequency,) if options.verbose else ()))

    count = len(reduction.steps)
    table = new_table(
        f"{count} point{'s' * (count > 1)} found; of each line the largest noise and distortion",
        f"level [{unit}]", "repeat", "points", "f [Hz]", f"|K| [{stiffness_unit}]", "loss factor", "noise [%]",
        "THD [%]",
    )  # fmt: skip
    for (level, repeat, *_), group in groupby(sorted(reduction.steps, key=line), line):
        steps = list(group)
        table.add_row(
            number(length * level, 4),
            f"{repeat:.0f}",
            f"{len(steps)}",
            _span([number(frequency, 4) for frequency in sorted(step.nominal_frequency for step in steps)]),
            _span(alike(sorted((factor * abs(step.stiffness) for step in steps), reverse=True), 4, least=2)[::-1]),
            _span(alike(sorted((step.loss_factor for step in steps), reverse=True), 3, least=2)[::-1]),
            number(100 * max(step.gain_error for step in steps), 1),
            number(100 * max(step.force_distortion for step in steps), 2),
        )
    options.console.print(table)
    warn(options, reduction.warnings)
    if options.verbose:
        for skip in reduction.skipped:
            text = f"{skip.name}, {skip.start:.4g} to {skip.end:.4g} s makes no point: {skip.why}"
            options.console.print(text, markup=False)


def _span(rising: Sequence[str]) -> str:
    return "-".join(dict.fromkeys((rising[0], rising[-1])))
