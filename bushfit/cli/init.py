"""`bushfit init`: test files and a geometry -> a campaign."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from bushfit.cli.common import Options, example, naming_option, shared_options
from bushfit.cli.inspect import KEYS, tell_assumed
from bushfit.cli.raw import direction_error, file_options, options_named
from bushfit.cli.show import warn
from bushfit.errors import BushfitError, CampaignError, MeasurementError, typed

if TYPE_CHECKING:
    from bushfit.geometry import Bushing
    from bushfit.inspection.record import Inspected


@click.command(
    "init",
    epilog=example(
        "bushfit init data/arm_bushing/loop_axial_1.csv data/arm_bushing/sweep_axial.csv "
        '--inner-diameter "28 mm" --outer-diameter "40 mm" --length "45 mm"'
    ),
)
@click.argument("files", metavar="FILE...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--inner-radius", help='Of the rubber, such as "10 mm"; or else')
@click.option("--inner-diameter", help='such as "20 mm".')
@click.option("--outer-radius", help='Of the rubber, such as "18 mm"; or else')
@click.option("--outer-diameter", help='such as "36 mm".')
@click.option("--length", required=True, help='Mean length of the rubber, such as "34 mm".')
@click.option("--name", help="Of the bushing [the folder of the first file].")
@file_options(*KEYS)
@shared_options
def command(
    files: tuple[Path, ...],
    inner_radius: str | None,
    inner_diameter: str | None,
    outer_radius: str | None,
    outer_diameter: str | None,
    length: str,
    name: str | None,
    stated: Mapping[str, Any],
    options: Options,
) -> None:
    """Write a campaign from test files and the geometry of the bushing.

    Loops and sweeps are told apart by their columns, the direction by the file's name or columns. What only you can
    know, such as a unit, the rate of a loop without time, or the direction, is asked for in an error that names the
    option. An option holds for all files of its kind; where files differ otherwise, edit the campaign. Numbers are
    written with a decimal point. Raw stepped-sine histories go through `bushfit reduce` first.

    Writes campaign.toml, which names the files as seen from its folder; -o may also name the file itself, such as
    -o my_bushing.toml.
    """
    from bushfit.inspection.draft import campaign_text
    from bushfit.inspection.opening import inspect, stated_of_each

    name = name or files[0].resolve().parent.name
    table = {
        "name": name,
        "inner_radius": _radius("inner", inner_radius, inner_diameter),
        "outer_radius": _radius("outer", outer_radius, outer_diameter),
        "length": length,
    }
    folder, target = _place(options, name)
    given = {"inner_radius": inner_diameter, "outer_radius": outer_diameter}
    bushing = _bushing(table, folder / target, [key for key, diameter in given.items() if diameter])
    options.require_free(folder, [target])
    with options_named():
        seen = [_usable(inspect(file, own)) for file, own in zip(files, stated_of_each(files, stated), strict=True)]
    _check_once(files)
    text = campaign_text(table, seen, folder)
    inner, outer, long = (1e3 * size for size in (2 * bushing.inner_radius, 2 * bushing.outer_radius, bushing.length))
    options.console.print(
        f"{name}: rubber from {inner:.6g} to {outer:.6g} mm in diameter, {(outer - inner) / 2:.6g} mm thick, "
        f"{long:.6g} mm long",
        markup=False,
    )
    for one in seen:
        _tell(options, one)
    options.write(folder, {target: text.encode()})
    options.console.print(f"next: bushfit run {typed(folder / target)}", markup=False)
    options.tell({"campaign": text, "files": [one.to_document() for one in seen]})


def _radius(side: str, radius: str | None, diameter: str | None) -> str:
    """A radius as the campaign has it, from the one of the two options that was given."""
    from bushfit.units import quantity

    options = f"--{side}-radius", f"--{side}-diameter"
    if radius is not None and diameter is not None:
        raise click.UsageError(f"'{options[0]}' and '{options[1]}' are one size; give one of them.")
    if radius is not None:
        return radius
    if diameter is None:
        raise click.UsageError(f"Missing option '{options[0]}' or '{options[1]}'.")
    with naming_option(options[1]):
        return f"{1e3 * quantity(diameter, 'm') / 2.0:.12g} mm"


def _place(options: Options, name: str) -> tuple[Path, str]:
    """Folder and name of the campaign."""
    from bushfit.campaign.naming import folder_name

    file = options.output
    if file and file.suffix == ".toml":
        return file.parent, file.name
    return options.folder(folder_name(name)), "campaign.toml"


def _bushing(table: Mapping[str, str], file: Path, halved: Sequence[str]) -> Bushing:
    """The bushing of the campaign to be; errors name the options, diameters where these were given and halved."""
    from bushfit.campaign.schema import BushingTable
    from bushfit.geometry import Bushing
    from bushfit.validation import check_tables

    try:
        return Bushing(**vars(check_tables(table, file, BushingTable)))
    except BushfitError as error:
        error.file = None
        if error.place:
            keys = error.place.split(", ")
            names = [key.replace("radius", "diameter") if key in halved else key for key in keys]
            error.place = ", ".join("--" + name.replace("_", "-") for name in names)
            if set(keys) & set(halved):
                error.hint = "a diameter given counts by its half; check that inner and outer are not swapped"
        raise


def _usable(seen: Inspected) -> Inspected:
    """A loop or sweep of a known direction.

    Raises:
        MeasurementError: it is another, with the way on.
    """
    if seen.kind == "history":
        raise MeasurementError(
            "this is a raw stepped-sine history, not a sweep",
            file=seen.file,
            expected="hysteresis loops and sweeps",
            hint=f"bushfit reduce {typed(seen.file)} --direction {seen.direction or '...'} makes a sweep.csv of it; "
            "give that instead",
        )
    if seen.direction is None:
        raise direction_error(seen.file)
    return seen


def _check_once(files: Sequence[Path]) -> None:
    places = [file.resolve() for file in files]
    if twice := [file for file, place in zip(files, places, strict=True) if places.count(place) > 1]:
        raise CampaignError("a file is given twice", found=str(twice[0]), expected="each file once")


def _tell(options: Options, seen: Inspected) -> None:
    """One line of what a file is, what was assumed, and what is odd."""
    facts = seen.looked.facts
    wanted = ("programme", "cycles", "frequency", "frequencies", "amplitude", "amplitudes")
    kept = [f"{key}: {facts[key]}" for key in wanted if key in facts]
    options.console.print(f"{seen.file}: {seen.kind}, {seen.direction}; {'; '.join(kept)}", markup=False)
    warn(options, [f"{seen.file.name}: {sentence}" for sentence in seen.looked.odd])
    tell_assumed(options, seen)
