"""`bushfit predict`: model -> stiffness tables and plots."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from bushfit.cli.common import Options, direction_option, example, open_model, shared_options
from bushfit.cli.show import new_table, warn

if TYPE_CHECKING:
    from bushfit.geometry import Direction
    from bushfit.jobs.predict import Predicted

#: Amplitudes of a direction that the terminal shows at most, spread from first to last; the CSV has all.
_MOST_AMPLITUDES = 8


@click.command(
    "predict",
    epilog=example(
        'bushfit predict data/arm_bushing/truth.json --frequencies "10:100:10 Hz" --amplitudes "0.1, 0.5 mm"'
    ),
)
@click.argument("model", type=click.Path(path_type=Path))
@click.option(
    "--campaign",
    type=click.Path(path_type=Path),
    help="Lay this campaign's sweeps over the plots, and use its [predict] grid.",
)
@direction_option(
    "directions",
    multiple=True,
    help="{directions}; may be given again [axial and radial].",
)
@click.option("--frequencies", help='Such as "5:155:10 Hz" or "20, 50, 100 Hz" [the campaign\'s].')
@click.option("--amplitudes", help='Zero-to-peak, such as "0.1, 0.2, 0.5 mm" [the campaign\'s].')
@click.option("--torsion-amplitudes", help='Zero-to-peak rotation, for --direction torsion ["0.5, 1, 2 deg"].')
@shared_options
def command(
    model: Path,
    campaign: Path | None,
    directions: tuple[Direction, ...],
    frequencies: str | None,
    amplitudes: str | None,
    torsion_amplitudes: str | None,
    options: Options,
) -> None:
    """Dynamic stiffness and loss factor of MODEL (the model.json of run, fit or diagnose, or dynamic.json) over a grid.

    Writes axial.csv and radial.csv (torsion.csv on request) with 95 % bands, and a plot of each. Effects of the rig
    are left out. Without a grid in the options or the campaign it is that of the campaign's sweeps in each direction,
    or the paper's as far as it was measured. A warning names what leaves the fitted directions, strains or frequencies.
    """
    from bushfit.campaign.campaign import load_campaign
    from bushfit.campaign.naming import folder_name
    from bushfit.campaign.schema import PredictSettings
    from bushfit.cli.grids import parse_grid
    from bushfit.jobs.predict import Predict

    result = open_model(model)
    loaded = load_campaign(campaign) if campaign else None
    job = Predict(
        PredictSettings(
            parse_grid(frequencies, "--frequencies", "Hz"),
            parse_grid(amplitudes, "--amplitudes", "m"),
            parse_grid(torsion_amplitudes, "--torsion-amplitudes", "rad"),
            directions or None,
        )
    )
    folder = options.folder(loaded.slug if loaded else folder_name(result.name))
    options.require_free(folder, job.names(loaded, options.formats))
    outcome = job.run(result, loaded)
    tell_predictions(options, outcome)
    warn(options, [f"of the fit: {line}" for line in result.warnings])
    options.write(folder, outcome.files(options.formats))
    options.tell(outcome.document)


def tell_predictions(options: Options, outcome: Predicted) -> None:
    """The corners of each table, and what a user must know before using it."""
    from bushfit.report.tables import prediction_table, spread
    from bushfit.units import alike, number

    for prediction in outcome.predictions:
        table = prediction_table(prediction)
        amplitudes = table.iloc[:, 1].unique()
        chosen = amplitudes[spread(amplitudes.size, _MOST_AMPLITUDES)]
        shown = new_table(f"{outcome.result.name}: {prediction.direction}, corners", *table.columns[:4])
        low, high = table.iloc[:, 0].min(), table.iloc[:, 0].max()
        for row in table[table.iloc[:, 0].isin([low, high]) & table.iloc[:, 1].isin(chosen)].itertuples(index=False):
            shown.add_row(*(number(value, 6) for value in row[:2]), *(alike([value], 4)[0] for value in row[2:4]))
        options.console.print(shown)
    warn(options, outcome.warnings)
