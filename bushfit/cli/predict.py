"""`bushfit predict`: model -> stiffness tables and plots."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from bushfit.cli.common import CAMPAIGN_FOLDER, Options, open_model, with_options
from bushfit.cli.grids import TEMPERATURE, asked_for, grid_options, kelvin, positive
from bushfit.cli.options import FILE, PLOT_FORMAT, TABLE_FORMAT, command_called, place_option
from bushfit.cli.show import new_table, tell_tests

if TYPE_CHECKING:
    from bushfit.jobs.predict import Predicted

#: Amplitudes of a direction that the terminal shows at most, spread from first to last; the CSV has all.
_MOST_AMPLITUDES = 8


@command_called("predict", 'data/arm_bushing/truth.json --frequencies "10:100:10 Hz" --amplitudes "0.1, 0.5 mm"')
@click.argument("model", type=FILE)
@click.option(
    "--campaign", type=FILE, help="Lay its sweeps over the plots and beside the prediction, and use its [predict] grid."
)
@click.option(
    "--bushing",
    type=FILE,
    metavar="FILE",
    help="Predict another bushing of the same compound: the [bushing] table of this TOML file.",
)
@place_option(
    "axial, radial or torsion, or a specimen's name; may be given again [axial and radial of a bushing, and all "
    "specimens]."
)
@grid_options("the campaign's")
@TEMPERATURE
@click.option("--mass", help='Predict its resonance on each place, too: such as "1.2 kg", with --base-acceleration.')
@click.option("--base-acceleration", help='Amplitude of the base under the mass, such as "0.1 g" or "1 m/s^2".')
@click.option("--wide", is_flag=True, help="Also <place>_wide.csv: frequency down, amplitude across, no bands.")
@click.option(
    "--arms",
    is_flag=False,
    flag_value="1 %",
    metavar="[ERROR]",
    help="Also arms.csv, arms.png: Maxwell arms for the springpot, within this error [1 %].",
)
@with_options(CAMPAIGN_FOLDER, TABLE_FORMAT, PLOT_FORMAT)
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
    """Dynamic stiffness and loss factor of MODEL (the model.json of run, fit or diagnose, or dynamic.json) over a grid.

    Writes axial.csv and radial.csv (torsion.csv on request), and a table of each specimen, with 95 % bands, and a plot
    of each; with --campaign measured.csv, its sweeps beside the model. Effects of the rig are left out; of what may be
    the bushing's or the rig's both readings are written. Without a grid in the options or the campaign it is that of
    the campaign's sweeps at each place, or the paper's as far as it was measured. A warning names what leaves the
    fitted directions, strains or frequencies.

    --mass shakes the base under a mass: its transmissibility, in <place>_resonance.csv.

    --bushing carries the compound to another shape: effects of its material are kept, those of bushing and rig are not.
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
    from bushfit.units import alike, number

    for prediction in outcome.predictions:
        table = prediction_table(prediction)
        amplitudes = table.iloc[:, 1].unique()
        chosen = amplitudes[spread(amplitudes.size, _MOST_AMPLITUDES)]
        place = str(prediction.direction)
        whose = "" if prediction.direction in outcome.result.specimens else f"{outcome.result.name}: "
        shown = new_table(f"{whose}{place}, corners", *table.columns[:4])
        low, high = table.iloc[:, 0].min(), table.iloc[:, 0].max()
        for row in table[table.iloc[:, 0].isin([low, high]) & table.iloc[:, 1].isin(chosen)].itertuples(index=False):
            shown.add_row(*(number(value, 6) for value in row[:2]), *(alike([value], 4)[0] for value in row[2:4]))
        options.console.print(shown)
    options.warn(outcome.warnings)
