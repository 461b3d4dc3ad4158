"""`bushfit compare`: several results side by side, or model families on one campaign."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from bushfit.cli.common import Options, open_source, with_options
from bushfit.cli.grids import asked_for, grid_options
from bushfit.cli.options import FILE, command_called, effect_lists, option, place_option, under
from bushfit.cli.show import tell_table
from bushfit.errors import error_location
from bushfit.progress import track

if TYPE_CHECKING:
    from bushfit.campaign.campaign import Campaign
    from bushfit.jobs.compare import Compared
    from bushfit.model.result import Result

#: What --families means without names.
_ALL = "all"


@command_called(
    "compare", "configs/cmp_15961.toml configs/arm_bushing.toml", "configs/arm_bushing.toml --families sliders,kraus"
)
@click.argument("sources", metavar="A [B]...", nargs=-1, required=True, type=FILE)
@under(
    "What is compared",
    place_option(
        "axial, radial, torsion or a specimen; of campaigns only these tests are fitted; may be given again [where all "
        "were fitted]."
    ),
    grid_options("as measured"),
    option(
        "--families",
        "[NAME,...]",
        (
            "Model families on the one campaign A: the paper's, and those named, effects joined by + [each law of "
            "rate with each of amplitude]."
        ),
        is_flag=False,
        flag_value=_ALL,
        shell_complete=effect_lists,
    ),
)
@with_options("results/<names>", "tables", "pictures", "pages")
def command(
    sources: tuple[Path, ...], families: str | None, directions: tuple[str, ...], options: Options, **grids: str | None
) -> None:
    """Compare A, the reference, with others: what differs, by how much, and whether by more than chance.

    Each is a model (JSON), a folder of results (its model.json), or a campaign, which is fitted on the spot as by
    `bushfit fit`: parameters, and stiffness and loss factor over frequency. --families fits several models to one
    campaign: how well each meets the tests, and which predicts best what it was not fitted to.

    Writes compare.json, parameters.csv, differences.csv, compare.png, compare.html; with --families families.csv.
    """
    from bushfit.campaign.campaign import load_campaign
    from bushfit.effects import effect_named
    from bushfit.jobs.compare import MOST, Compare
    from bushfit.jobs.fits import command_line, options_typed

    if families is None and not 2 <= len(sources) <= MOST:
        raise click.UsageError(f"2 to {MOST} results are compared; one campaign alone with '--families' after it.")
    if families is not None and len(sources) > 1:
        raise click.UsageError("'--families' is of one campaign.")
    words = options_typed(families=families, direction=directions, **grids)
    job = Compare(asked_for(directions, grids), command_line("compare", *map(str, sources), *words))
    if families is not None:
        names = () if families == _ALL else tuple(name.replace(" ", "") for name in families.split(","))
        with error_location(place="--families"):
            for name in names:
                all(map(effect_named, name.split("+")))
        campaign = load_campaign(sources[0])
        folder = options.free_folder(campaign.name, job.kinds(families=True), form="{} families")
        outcome = job.run_families(campaign, str(sources[0]), names)
    else:
        opened = [_opened(source) for source in sources]
        folder = options.free_folder(" and ".join(each.name for each, *_ in opened), job.kinds())
        outcome = job.run([job.entry(*each) for each in track("results fitted", opened)])
    _tell(options, outcome)
    options.write(folder, options.formats.files(outcome.contents), outcome.document)


def _opened(source: Path) -> tuple[Campaign | Result, str, str | None]:
    """What a command line names, as typed, with its hash: a campaign, or the result in a model file or in a folder."""
    from bushfit.campaign.campaign import Campaign
    from bushfit.jobs.export import source_of

    opened = open_source(source)
    if isinstance(opened, Campaign):
        return opened, str(source), None
    return opened, str(source), source_of(source / "model.json" if source.is_dir() else source).sha256


def _tell(options: Options, outcome: Compared) -> None:
    """Who is who, and what differs: of families, how they meet the tests; parameters and stiffness with -v."""
    from bushfit.report.compared import FAMILY_HEADS, SideBySide

    for label, entry in zip(outcome.labels, outcome.entries, strict=True):
        options.say(f"{label}: {entry.name} ({entry.source})")
    if options.verbose or not outcome.families:
        _tell_parameters(options, outcome)
    if outcome.families:
        title = "families; held out: root mean square in units of noise, 1 where noise is all"
        tell_table(options, title, FAMILY_HEADS, SideBySide.of(outcome.document).family_cells())
    for line in (*outcome.advice, *(outcome.words if options.verbose or not outcome.families else ())):
        options.say(line)
    options.warn(outcome.warnings)


def _tell_parameters(options: Options, outcome: Compared) -> None:
    """The parameters of each beside those of the first."""
    from bushfit.report.compared import chance, parameter_cells

    first, *others = outcome.labels
    for label, found in zip(others, outcome.comparisons, strict=True):
        title = f"parameters of {label} against {first}; p: chance of such a difference, by Holm over all of them"
        columns = ("parameter", first, label, "difference", "95 % interval", "p", "unit")
        tell_table(options, title, columns, map(parameter_cells, found.parameters))
        if found.joint:
            p, count = found.joint
            options.say(f"all {count} together, correlations counted: p {chance(p)}")
