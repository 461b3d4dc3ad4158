"""`bushfit simulate`: model -> a simulated campaign of raw tests."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from bushfit.caveat import Caveat
from bushfit.cli.options import FILE, command_called, option, option_group
from bushfit.cli.output import Output, with_output
from bushfit.cli.shared_options import quantity
from bushfit.errors import ModelError, error_location
from bushfit.units import is_number, parse_quantity

if TYPE_CHECKING:
    from bushfit.model.model import Model


@command_called("simulate", "configs/simulate_arm_bushing.toml --seed 7")
@click.argument("source", metavar="CAMPAIGN|MODEL.json", type=FILE)
@option_group(
    "Tests and effects",
    option("--effect effects EFFECT", 'Add an effect to the model, such as "inertia.mass=0.1 kg".', multiple=True),
    option("--repeats N", "Number of repeats of each sweep [1].", type=click.IntRange(1, 1000)),
    option("--seed N", "Seed of the random numbers [0].", type=click.IntRange(0)),
)
@option_group(
    "Noise and errors of the rig [from the campaign, else none]",
    *(
        option(f"--{usage}", words, type=quantity(unit, "0 up to 100 %, or below 1 rad", lambda x: 0.0 <= x < 1.0))
        for usage, unit, words in (
            ("noise SHARE", "1", 'Random error of each sweep point, relative to the stiffness |K|: "0.5 %".'),
            ("force-noise SHARE", "1", 'Noise of the force in loops, relative to half its range: "0.3 %".'),
            ("displacement-noise SHARE", "1", 'Displacement noise in loops, relative to the amplitude: "0.02 %".'),
            ("gain-error SHARE", "1", 'Random gain error of each run (one repeat of one amplitude): "0.4 %".'),
            ("phase-error ANGLE", "rad", 'Random phase error of each run: "0.2 deg".'),
        )
    ),
)
@with_output("results/<name>/simulate", "tables")
def command(source: Path, effects: tuple[str, ...], output: Output, **settings: Any) -> None:
    """Simulate the tests of a model on a virtual rig and write them as a campaign.

    With CAMPAIGN, its [simulate] table states the model and the tests. With MODEL.json, this model is simulated in the
    paper's test programme. Use simulate to check whether `bushfit diagnose` would find an effect that you add with
    --effect. The equations are solved step by step in time, independently of the formulas that the fits use. Radial
    tests follow the paper's formula. `bushfit init` writes campaigns with shape = "calibrated": to use init on the
    simulated files, first set it in [bushing] of CAMPAIGN, too.

    Writes campaign.toml, its test files, and truth.json (the model that was simulated).
    """
    from bushfit.campaign.campaign import load_campaign
    from bushfit.commands.loading import load_model
    from bushfit.commands.simulate import simulate_campaign, simulated_tests

    is_model = source.suffix.lower() == ".json" or source.is_dir()
    truth, tests, fitted = simulated_tests(load_model(source) if is_model else load_campaign(source))
    changes = {name: value for name, value in settings.items() if value is not None}
    for text in effects:
        truth = _with_effect(truth, text)
    with error_location(source):
        result, document, files = simulate_campaign(truth, replace(tests, **changes), fitted, output.formats.table_form)
    if truth.unnamed:
        sentence = "the smooth correction is left out, because it applies only to steady states, not in time"
        output.warn([Caveat("correction_not_simulated", sentence)])
    folder = output.folder(result.name, *(file.name for file in files))
    output.print(result.model.equation())
    output.write(folder, files, document, [source])


def _with_effect(model: Model, text: str) -> Model:
    """Add an effect to a model by a text such as "inertia.mass=0.1 kg"; return the new model."""
    from bushfit.effects import effect_name_of, get_effect, is_parameter, qualified_name

    name, found, value = text.replace(" ", "").partition("=")
    is_known = "." in name and is_parameter(name)
    effect = get_effect(effect_name_of(name) if is_known else name.partition(".")[0])
    if not (found and is_known):
        raise ModelError(
            "not an effect with a value",
            place="--effect",
            found=repr(text),
            expected='such as "inertia.mass=0.1 kg"; parameters of '
            + f"{effect.name}: {', '.join(parameter.name for parameter in effect.parameters)}",
        )
    unit = next(parameter.unit for parameter in effect.parameters if qualified_name(effect, parameter) == name)
    with error_location(place="--effect"):
        is_plain = is_number(value) and unit == "1"
        values = {name: float(value) if is_plain else parse_quantity(text.partition("=")[2].strip(), unit)}
    return model.with_values(values) if effect.name in model.effects else model.with_effect(effect.name, values)
