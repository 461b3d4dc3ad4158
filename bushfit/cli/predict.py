"""`bushfit predict`: stiffness tables and figures of a model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from bushfit.cli.options import FILE, command_called, flag, option, option_group
from bushfit.cli.output import Output, with_output
from bushfit.cli.printing import permitted_use, print_tests
from bushfit.cli.shared_options import displacement_unit, prediction_options, quantity, static_rate_option

if TYPE_CHECKING:
    from bushfit.commands.predicted import PredictionOutput
    from bushfit.geometry import Bushing
    from bushfit.model.result import Result
    from bushfit.prediction.static_curve import StaticCurve
    from bushfit.prediction.superposed import LargeMotion

#: Maximum number of amplitudes per direction that the terminal shows; the CSV has all.
_MOST_AMPLITUDES = 8


def parse_motion(text: str) -> LargeMotion:
    """Parse --over: a slow sine ("2 Hz 3 mm") or offset ("3 mm") under the predicted vibration."""
    from bushfit.prediction.superposed import LargeMotion
    from bushfit.units import parse_quantity

    frequency, hertz, size = (part.strip(" ,;") for part in text.rpartition("Hz"))
    unit = displacement_unit(size)
    if not hertz:
        return LargeMotion(parse_quantity(size, unit), unit)
    return LargeMotion(quantity(unit)(size), unit, quantity("Hz")(f"{frequency} Hz"))


@command_called("predict", 'data/arm_bushing/truth.json --frequencies "10:100:10 Hz" --amplitudes "0.1, 0.5 mm"')
@click.argument("model", metavar="MODEL", type=FILE)
@prediction_options("Use the frequencies and amplitudes of this campaign, and show its measured sweeps.", static=True)
@option_group(
    "Further predictions",
    option(
        "--preload preloads LOAD",
        'Predict at this preload, "500 N" or "1.5 mm", between the tested preloads [none].',
        multiple=True,
    ),
    option(
        "--bushing NAME",
        "Predict this bushing: one of several fitted bushings by name, or another bushing of the same compound by a "
        "TOML file with its [bushing] table.",
    ),
    option("--mass MASS", type=quantity("kg")),
    option(
        "--base-acceleration ACCELERATION",
        'Also predict the resonance of this mass, such as "1.2 kg", on the bushing. The base of the bushing '
        'vibrates with this acceleration, such as "0.1 g".',
        type=quantity("m/s^2"),
    ),
    flag("--static", "Also write the static curve: force over displacement in a slow motion, and its slope."),
    static_rate_option("Rate of the static curve"),
    option(
        "--over MOTION",
        'Predict a small vibration on a slow large motion, such as "0.5 Hz 1 mm", or on an offset, such as "1 mm".',
        type=parse_motion,
    ),
    flag("--wide", "Also write tables with one column per amplitude, without bands."),
    option(
        "--arms [ERROR]",
        "Also write Maxwell arms (a Prony series) that represent the springpot within this error [1 %].",
        is_flag=False,
        flag_value="1 %",
        type=quantity("1"),
    ),
)
@with_output("results/<model name>/predict", "tables", "pictures")
def command(model: Path, campaign: Path | None, bushing: str | None, output: Output, **settings: Any) -> None:
    """Predict dynamic stiffness and loss factor over frequency and amplitude, with 95 % bands.

    MODEL is the model.json of run, fit or diagnose, its folder, or dynamic.json. Effects that belong to the test rig
    are left out. A warning reports predictions outside the tested range. Writes a table and a plot for each direction
    or specimen (axial.csv, axial.png), and with --campaign measured.csv.
    """
    from bushfit.campaign.campaign import load_campaign
    from bushfit.commands.loading import load_model, model_file
    from bushfit.commands.predict import predict
    from bushfit.commands.provenance import input_files
    from bushfit.units import si_factor

    result, loaded = load_model(model), load_campaign(campaign) if campaign else None
    if (settings["mass"] is None) != (settings["base_acceleration"] is None):
        raise click.UsageError("'--mass' and '--base-acceleration' are needed together.")
    if settings["frequencies"] == ():  # "0 Hz"
        settings |= {"frequencies": None, "static": True}
    target = None if bushing is None else _bushing_of(result, bushing)
    predicted = predict(result, loaded, bushing=target, **settings)
    tables = (output.formats.table(file.name) for file in predicted.files if file.kind == "table")
    folder = output.folder(predicted.result.name, *tables)
    _print_summary(output, predicted)
    print_predictions(output, predicted)
    for resonance in predicted.resonances:
        frequency, largest = resonance.peak
        peak = f"resonance at {frequency:.4g} Hz, |T| {largest:.3g}"
        acceleration = resonance.base_acceleration / si_factor("g", "m/s^2")
        shaken = f"{resonance.mass:.5g} kg, base acceleration {acceleration:.4g} g"
        output.print(f"{resonance.label} with a mass of {shaken}: {peak}")
    for curve in predicted.static:
        _print_static(output, curve)
    for part in predicted.arms:
        output.print(part.sentence)
    print_tests(output, predicted.tests, predicted.usable)
    inputs = input_files(loaded, model_file(model), Path(bushing) if bushing and target != bushing else None)
    output.write(folder, predicted.files, predicted.document, inputs)


def _bushing_of(result: Result, text: str) -> Bushing | str:
    """Return the text of --bushing if it is the name of a fitted bushing, else the bushing in the named TOML file."""
    from bushfit.campaign.campaign import load_bushing
    from bushfit.errors import ModelError

    names = [bushing.name for bushing in result.bushings]
    if text in names:
        return text
    if names and not Path(text).suffix:
        expected = f"{', '.join(names)}, or a TOML file with a [bushing]"
        raise ModelError("no such bushing in the model", place="--bushing", found=text, expected=expected)
    return load_bushing(Path(text))


def _print_summary(output: Output, predicted: PredictionOutput) -> None:
    """Print the permitted use of the prediction, and the range of stiffness and loss factor for each direction."""
    from bushfit.units import format_range

    places = list(dict.fromkeys(str(prediction.direction) for prediction in predicted.predictions))
    bands = "with 95 % bands" if predicted.result.measured else "without bands, because the model was not fitted"
    verdict = f"{', '.join(places)} predicted {bands}"
    if warnings := predicted.warnings:
        verdict += f", with {len(warnings)} warning{'s' * (len(warnings) > 1)}"
    action = permitted_use(warnings, "The prediction may be used: there are no warnings.", places)
    output.print_headline(predicted.result.name, verdict, action)
    for prediction in predicted.predictions:
        force, loss = prediction.direction.display.stiffness, prediction.loss_factor.value
        stiffness = force.factor * prediction.stiffness.value
        output.print(
            f"{prediction.label}: {prediction.direction.motion.words[2]} "
            f"{format_range(force.name, stiffness.min(), stiffness.max())}, loss factor "
            f"{format_range('', loss.min(), loss.max()).strip()}, {format_range('Hz', *prediction.frequency[[0, -1]])}"
        )


def _print_static(output: Output, curve: StaticCurve) -> None:
    """Print the range and rate of a static curve, its stiffness over the range with its 95 % interval, and at zero."""
    from bushfit.units import number

    length, _, (name, factor) = curve.direction.display
    reach = length.text(curve.displacement[-1])
    middle = curve.displacement.size // 2
    values = (curve.secant.value[0], curve.secant.low[0], curve.secant.high[0], curve.slope.value[middle])
    secant, low, high, slope = (number(factor * value, 4) for value in values)
    interval = f" (95 %: {low} to {high})" if low != high else ""
    output.print(
        f"{curve.label}: static {curve.direction.motion.words[2]} {secant} {name} from -{reach} to {reach} at "
        f"{curve.rate_text}{interval}; slope of the static curve at zero displacement {slope} {name}"
    )


def print_predictions(output: Output, predicted: PredictionOutput) -> None:
    """Print the rows of each prediction table at the lowest and highest frequency, and collect its warnings."""
    from bushfit.report.tables import prediction_table, spread_indices
    from bushfit.units import format_aligned, number

    for prediction in predicted.predictions:
        table = prediction_table(prediction)
        amplitudes = table.iloc[:, 1].unique()
        chosen = amplitudes[spread_indices(amplitudes.size, _MOST_AMPLITUDES)]
        owner = "" if prediction.direction in predicted.result.specimens else f"{predicted.result.name}: "
        ends = table.iloc[:, 0].min(), table.iloc[:, 0].max()
        rows = []
        for _, row in table[table.iloc[:, 0].isin(ends) & table.iloc[:, 1].isin(chosen)].iterrows():
            cells = [number(value, 6) for value in row.iloc[:2]]
            for name, digits in zip(table.columns[2:4], (4, 3), strict=True):
                band = row[f"{name}, low"], row[f"{name}, high"]
                value, *limits = format_aligned([row[name], *band], digits)
                cells.append(f"{value} ({' to '.join(limits)})" if band[0] < band[1] else value)
            rows.append(cells)
        bands = ", with 95 % bands" * bool(predicted.result.measured)
        bands += ", which include each possible cause" * bool(predicted.result.possible_causes)
        title = f"{owner}{prediction.label}, first and last frequency{bands}"
        output.print_table(title, list(table.columns[:4]), rows, text_columns=0)
    output.warn(predicted.warnings)
