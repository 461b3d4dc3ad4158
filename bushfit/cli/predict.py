"""`bushfit predict`: model -> stiffness tables and plots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from bushfit.cli.common import Options, new_table, shared_options, warn

if TYPE_CHECKING:
    from bushfit.measurement import Sweep
    from bushfit.prediction import Prediction
    from bushfit.results import Result
    from bushfit.schema import PredictSettings


@click.command("predict")
@click.argument("model", type=click.Path(path_type=Path))
@click.option(
    "--campaign",
    type=click.Path(path_type=Path),
    help="Lay this campaign's sweeps over the plots, and use its [predict] grid.",
)
@click.option(
    "--direction",
    "directions",
    type=click.Choice(["axial", "radial", "torsion"]),
    multiple=True,
    help="May be given again [axial and radial].",
)
@click.option("--frequencies", help='Such as "5:155:10 Hz" or "20, 50, 100 Hz" [the campaign\'s].')
@click.option("--amplitudes", help='Zero-to-peak, such as "0.1, 0.2, 0.5 mm" [the campaign\'s].')
@click.option("--torsion-amplitudes", help='Zero-to-peak rotation, for --direction torsion ["0.5, 1, 2 deg"].')
@shared_options
def command(
    model: Path,
    campaign: Path | None,
    directions: tuple[str, ...],
    frequencies: str | None,
    amplitudes: str | None,
    torsion_amplitudes: str | None,
    options: Options,
) -> None:
    """Dynamic stiffness and loss factor of MODEL (a JSON file of fit, fit-dynamic or diagnose) over a grid.

    Writes axial.csv and radial.csv (torsion.csv on request) with 95 % bands, and a plot of each. Effects of the rig
    are left out. Without a grid in the options or the campaign it is that of the campaign's sweeps in each direction,
    or the paper's as far as it was measured. A warning names what leaves the measured range of strain or frequency.
    """
    from bushfit.campaign import load_campaign
    from bushfit.cli.artifacts import artifact_names, prediction_files
    from bushfit.cli.grids import parse_grid
    from bushfit.fitting.terms import sweep_terms
    from bushfit.geometry import Direction
    from bushfit.output import folder_name
    from bushfit.results import load_result
    from bushfit.schema import PredictSettings

    result = load_result(model)
    loaded = load_campaign(campaign) if campaign else None
    asked: dict[str, Any] = {
        "frequencies": parse_grid(frequencies, "--frequencies", "Hz"),
        "amplitudes": parse_grid(amplitudes, "--amplitudes", "m"),
        "torsion_amplitudes": parse_grid(torsion_amplitudes, "--torsion-amplitudes", "rad"),
        "directions": tuple(Direction(direction) for direction in directions) or None,
    }
    settings = replace(
        loaded.predict if loaded else PredictSettings(),
        **{key: value for key, value in asked.items() if value is not None},
    )
    name = loaded.slug if loaded else folder_name(result.model.bushing.name)
    folder = options.folder(name)
    predictions = predict_all(result, settings, loaded.sweeps if loaded else ())
    names = artifact_names([str(prediction.direction) for prediction in predictions], plots=options.plots)
    options.require_free(folder, names)
    measured = sweep_terms(loaded.sweeps) if loaded else []
    tell_predictions(options, result, predictions)
    files = prediction_files(result, predictions, measured, plots=options.plots)
    options.write(folder, files)
    options.tell(to_document(predictions))


def predict_all(result: Result, settings: PredictSettings, sweeps: Sequence[Sweep] = ()) -> list[Prediction]:
    """One prediction a direction, on the grid of the settings, else at the points of the sweeps, else the default."""
    from bushfit.geometry import Direction
    from bushfit.prediction import default_grid, predict

    predictions = []
    for direction in settings.directions or (Direction.AXIAL, Direction.RADIAL):
        frequencies, amplitudes = default_grid(result, direction, sweeps)
        asked = settings.torsion_amplitudes if direction is Direction.TORSION else settings.amplitudes
        predictions.append(predict(result, direction, settings.frequencies or frequencies, asked or amplitudes))
    return predictions


def tell_predictions(options: Options, result: Result, predictions: Sequence[Prediction]) -> None:
    """The corners of each table, and what a user must know before using it."""
    from bushfit.prediction import left_out
    from bushfit.sheets import prediction_table

    for prediction in predictions:
        table = prediction_table(prediction)
        shown = new_table(f"{result.model.bushing.name}: {prediction.direction}, corners", *table.columns[:4])
        low, high = table.iloc[:, 0].min(), table.iloc[:, 0].max()
        for row in table[table.iloc[:, 0].isin([low, high])].itertuples(index=False):
            shown.add_row(*(f"{value:.4g}" for value in row[:4]))
        options.console.print(shown)
        warn(options, prediction.warnings)
    rig_only = left_out(result)
    if rig_only:
        warn(options, [rig_only])


def to_document(predictions: Sequence[Prediction]) -> dict[str, object]:
    """Predictions as JSON, by direction and column."""
    from bushfit.sheets import prediction_table

    return {str(p.direction): prediction_table(p).to_dict(orient="list") for p in predictions}
