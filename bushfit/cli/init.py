"""`bushfit init`: test files and a geometry -> a campaign."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from bushfit.cli.common import Options, shared_options, warn
from bushfit.cli.inspect import KEYS
from bushfit.cli.raw import direction_error, file_options, options_named
from bushfit.errors import CampaignError, MeasurementError

if TYPE_CHECKING:
    from bushfit.inspection.record import Inspected


@click.command("init")
@click.argument("files", metavar="FILE...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--inner-radius", required=True, help='Of the rubber, such as "10 mm".')
@click.option("--outer-radius", required=True, help='Of the rubber, such as "18 mm".')
@click.option("--length", required=True, help='Mean length of the rubber, such as "34 mm".')
@click.option("--name", help="Of the bushing [the folder of the first file].")
@file_options(*KEYS)
@shared_options
def command(
    files: tuple[Path, ...],
    inner_radius: str,
    outer_radius: str,
    length: str,
    name: str | None,
    stated: Mapping[str, Any],
    options: Options,
) -> None:
    """Write a campaign from test files and the geometry of the bushing.

    Loops and sweeps are told apart by their columns, the direction by the file's name or columns. What only you can
    know, such as a unit, the rate of a loop without time, or the direction, is asked for in an error that names the
    option. Raw stepped-sine histories go through `bushfit reduce` first.

    Writes campaign.toml; -o may also name the file itself, such as -o my_bushing.toml.
    """
    from bushfit.inspection.draft import campaign_text
    from bushfit.inspection.opening import inspect

    name = name or files[0].resolve().parent.name
    bushing = {"name": name, "inner_radius": inner_radius, "outer_radius": outer_radius, "length": length}
    folder, target = _target(options, bushing)
    options.require_free(folder, [target])
    with options_named():
        seen = [_usable(inspect(file, stated)) for file in files]
    _check_once(files)
    text = campaign_text(bushing, seen, folder)
    for one in seen:
        _tell(options, one)
    options.write(folder, {target: text.encode()})
    options.console.print(f"next: bushfit fit {folder / target}", markup=False)
    options.tell({"campaign": text, "files": [one.to_document() for one in seen]})


def _target(options: Options, bushing: Mapping[str, str]) -> tuple[Path, str]:
    """Folder and name of the campaign, its geometry checked."""
    from bushfit.errors import BushfitError
    from bushfit.geometry import Bushing
    from bushfit.output import folder_name
    from bushfit.schema import BushingTable
    from bushfit.toml import check_tables

    file = options.output if options.output and options.output.suffix == ".toml" else None
    folder = file.parent if file else options.folder(folder_name(bushing["name"]))
    target = file.name if file else "campaign.toml"
    try:
        Bushing(**vars(check_tables(bushing, folder / target, BushingTable)))
    except BushfitError as error:
        error.file = None
        if error.place:
            error.place = ", ".join("--" + key.replace("_", "-") for key in error.place.split(", "))
        raise
    return folder, target


def _usable(seen: Inspected) -> Inspected:
    """A loop or sweep of a known direction.

    Raises:
        MeasurementError: it is another, with the way on.
    """
    if seen.kind == "history":
        stated = seen.direction or "..."
        raise MeasurementError(
            "this is a raw stepped-sine history, not a sweep",
            file=seen.file,
            expected="hysteresis loops and sweeps",
            hint=f"bushfit reduce {seen.file} --direction {stated} makes a sweep.csv of it; give that instead",
        )
    if seen.direction is None:
        raise direction_error(seen.file)
    return seen


def _check_once(files: Sequence[Path]) -> None:
    places = [file.resolve() for file in files]
    for file, place in zip(files, places, strict=True):
        if places.count(place) > 1:
            raise CampaignError("a file is given twice", found=str(file), expected="each file once")


def _tell(options: Options, seen: Inspected) -> None:
    """One line of what a file is, what was assumed, and what is odd."""
    facts = seen.looked.facts
    kept = [facts[key] for key in ("cycles", "frequency", "frequencies", "amplitude", "amplitudes") if key in facts]
    options.console.print(f"{seen.file}: {seen.kind}, {seen.direction}; {'; '.join(kept)}", markup=False)
    warn(options, [f"{seen.file.name}: {sentence}" for sentence in seen.looked.odd])
    if seen.kind == "sweep" and "amplitude" not in seen.entry and not seen.counted:
        options.console.print(
            "  its header does not say how amplitudes are counted: taken zero-to-peak, else --amplitude peak-to-peak",
            markup=False,
        )
