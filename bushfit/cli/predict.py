"""`bushfit predict`: model -> stiffness tables and plots."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from bushfit.cli.common import Options, open_model, with_options
from bushfit.cli.grids import asked_for, kelvin, positive, where_predicted
from bushfit.cli.options import FILE, command_called, file_option, flag, option, under
from bushfit.cli.show import tell_table, tell_tests

if TYPE_CHECKING:
    from bushfit.jobs.predict import Predicted

#: Amplitudes of a direction that the terminal shows at most, spread from first to last; the CSV has all.
_MOST_AMPLITUDES = 8


@command_called("predict", 'data/arm_bushing/truth.json --frequencies "10:100:10 Hz" --amplitudes "0.1, 0.5 mm"')
@click.argument("model", metavar="MODEL.json", type=FILE)
@where_predicted("Take its grid, and show its sweeps beside.")
@under(
    "What is predicted besides",
    file_option("--bushing", "Another one, of the same compound: [bushing] of this TOML file."),
    option("--mass", "MASS"),
    option(
        "--base-acceleration", "ACCELERATION", 'Resonance of a mass, such as "1.2 kg", on a base shaken with "0.1 g".'
    ),
    flag("--wide", "Tables with amplitudes across, without bands, too."),
    option(
        "--arms", "[ERROR]", "Maxwell arms for the springpot, within this error [1 %].", is_flag=False, flag_value="1 %"
    ),
)
@with_options("results/<name>", "tables", "pictures")
def command(
    model: Path,
    campaign: Path | None,
    bushing: Path | None,
    directions: tuple[str, ...],
    temperature: str | None,
    mass: str | None,
    base_acceleration: str | None,
    wide: bool,
    arms: str | None,
    options: Options,
    **grids: str | None,
) -> None:
    """Dynamic stiffness and loss factor of a fitted model over frequency and amplitude, with 95 % bands.

    MODEL.json is the model.json of run, fit or diagnose, or dynamic.json. Effects of the rig are left out; a warning
    names what leaves the range that was tested. Writes a table and a plot of each place (axial.csv, axial.png), and
    with --campaign measured.csv.
    """
    from bushfit.campaign.campaign import load_bushing, load_campaign
    from bushfit.jobs.predict import Predict
    from bushfit.model.result import carried
    from bushfit.report.contents import Kinds

    result, notes = open_model(model), list[str]()
    if bushing:
        result, note = carried(result, load_bushing(bushing))
        notes.append(note)
        directions = directions or ("axial", "radial")
    loaded = load_campaign(campaign) if campaign else None
    asked = asked_for(directions, grids)
    if (mass is None) != (base_acceleration is None):
        raise click.UsageError("'--mass' and '--base-acceleration' go together.")
    shaken = positive(mass, "--mass", "kg"), positive(base_acceleration, "--base-acceleration", "m/s^2")
    within = positive(arms, "--arms", "1")
    job = Predict(asked, *shaken, kelvin(temperature), wide, within)
    measured = Kinds(tables=("measured",) if loaded and loaded.sweeps else ())
    folder = options.free_folder((loaded or result).name, job.kinds(result, loaded) + measured)
    outcome = job.run(result, loaded, tuple(notes))
    tell_predictions(options, outcome)
    for found in outcome.resonances:
        frequency, largest = found.peak
        peak = f"resonance at {frequency:.4g} Hz, |T| {largest:.3g}"
        options.say(f"{found.place} under {mass}, base at {base_acceleration}: {peak}")
    for part in outcome.arms:
        options.say(part.sentence)
    tell_tests(options, outcome.tests, outcome.usable)
    options.write(folder, options.formats.files(outcome.contents_beside), outcome.document)


def tell_predictions(options: Options, outcome: Predicted) -> None:
    """The corners of each table, and what a user must know before using it."""
    from bushfit.report.tables import prediction_table, spread
    from bushfit.units import format_aligned, number

    for prediction in outcome.predictions:
        table = prediction_table(prediction)
        amplitudes = table.iloc[:, 1].unique()
        chosen = amplitudes[spread(amplitudes.size, _MOST_AMPLITUDES)]
        place = str(prediction.direction)
        whose = "" if prediction.direction in outcome.result.specimens else f"{outcome.result.name}: "
        low, high = table.iloc[:, 0].min(), table.iloc[:, 0].max()
        rows = []
        for _, row in table[table.iloc[:, 0].isin([low, high]) & table.iloc[:, 1].isin(chosen)].iterrows():
            cells = [number(value, 6) for value in row.iloc[:2]]
            for name, digits in zip(table.columns[2:4], (4, 3), strict=True):
                band = row[f"{name}, low"], row[f"{name}, high"]
                value, *ends = format_aligned([row[name], *band], digits)
                cells.append(f"{value} ({' to '.join(ends)})" if band[0] < band[1] else value)
            rows.append(cells)
        tell_table(options, f"{whose}{place}, corners, with 95 % bands", list(table.columns[:4]), rows, names=2)
    options.warn(outcome.warnings)
