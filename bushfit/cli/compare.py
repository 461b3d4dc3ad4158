"""`bushfit compare`: several results side by side, or model families on one campaign."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from bushfit.cli.common import Options, example, open_model, option_of, place_option, shared_options
from bushfit.cli.show import new_table, warn
from bushfit.errors import ModelError, naming
from bushfit.units import for_people, number

if TYPE_CHECKING:
    from bushfit.campaign.campaign import Campaign
    from bushfit.comparison import ParameterContrast
    from bushfit.diagnosis.families import FittedFamily
    from bushfit.jobs.compare import Compared, Entry
    from bushfit.model.result import Result

#: Options of the grid, and the SI unit of each.
_GRIDS = {"frequencies": "Hz", "amplitudes": "m", "torsion_amplitudes": "rad", "strain_amplitudes": "1"}
#: What --families means without names.
_ALL = "all"
#: Warnings that the terminal shows at most without -v.
_MOST_WARNINGS = 8
#: Digits of a parameter's value, and decimals of a difference at most.
_DIGITS = 4
_MOST_DECIMALS = 6
#: A probability below this is told as being below it.
_LEAST_CHANCE = 1e-3


@click.command(
    "compare",
    epilog=example(
        "bushfit compare configs/cmp_15961.toml configs/arm_bushing.toml",
        "bushfit compare configs/arm_bushing.toml --families sliders,kraus",
    ),
)
@click.argument("sources", metavar="A [B]...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--families",
    metavar="[NAME,...]",
    is_flag=False,
    flag_value=_ALL,
    help="Compare model families on the one campaign A: the paper's, and those named, effects joined by + [all that "
    "stand in place of a branch].",
)
@place_option(
    "directions",
    multiple=True,
    help="axial, radial or torsion, or a specimen's name: where to compare, and which tests of campaigns to fit; may "
    "be given again [all where each was fitted].",
)
@click.option("--frequencies", help='Such as "5:155:10 Hz" [as far as all were measured].')
@click.option("--amplitudes", help='Zero-to-peak, such as "0.1, 0.2, 0.5 mm" [as far as all were measured].')
@click.option("--torsion-amplitudes", help='Zero-to-peak rotation, such as "0.5, 1, 2 deg".')
@click.option("--strain-amplitudes", help='Zero-to-peak strain where a modulus is compared, such as "1, 2, 5 %".')
@shared_options
def command(
    sources: tuple[Path, ...],
    families: str | None,
    directions: tuple[str, ...],
    options: Options,
    **grids: str | None,
) -> None:
    """Compare A, the reference, with others: what differs, by how much, and whether by more than chance.

    Each is a model (JSON), a folder of results (its model.json), or a campaign, which is fitted on the spot as by
    `bushfit fit`. Parameters stand side by side with the interval of each difference, stiffness and loss factor over
    frequency with bands; words say what differs, or how large a difference may be that is not seen.

    --families fits several models to one campaign and holds out alike what tests them: a table of how well each meets
    the tests, and which predicts better what it was not fitted to.

    Writes compare.json, parameters.csv, differences.csv (a row a result, place, frequency and amplitude), compare.png,
    and with --families families.csv.
    """
    from bushfit.campaign.campaign import load_campaign
    from bushfit.campaign.naming import folder_name
    from bushfit.campaign.schema import PredictSettings
    from bushfit.cli.grids import parse_grid
    from bushfit.effects import effect_named
    from bushfit.jobs.compare import MOST, Compare

    if families is None and not 2 <= len(sources) <= MOST:
        raise click.UsageError(f"2 to {MOST} results are compared; one campaign alone with '--families' after it.")
    if families is not None and len(sources) > 1:
        raise click.UsageError("'--families' is of one campaign.")
    asked = {name: parse_grid(grids[name], option_of(name), unit) for name, unit in _GRIDS.items()}
    job = Compare(PredictSettings(directions=directions or None, **asked))
    if families is not None:
        names = () if families == _ALL else tuple(name.replace(" ", "") for name in families.split(","))
        with naming(place="--families"):
            for name in names:
                all(map(effect_named, name.split("+")))
        campaign = load_campaign(sources[0])
        folder = options.folder(f"{campaign.slug} families")
        options.require_free(folder, options.formats.names(job.kinds(families=True)))
        outcome = job.run_families(campaign, str(sources[0]), names)
    else:
        opened = [(_opened(source), str(source)) for source in sources]
        folder = options.folder(folder_name(" and ".join(each.name for each, _ in opened)))
        options.require_free(folder, options.formats.names(job.kinds()))
        outcome = job.run([job.entry(*each) for each in opened])
    _tell(options, outcome)
    options.write(folder, options.formats.files(outcome.contents), outcome.document)


def _opened(source: Path) -> Campaign | Result:
    """What a command line names: a campaign, or the result in a model file or in a folder of results."""
    from bushfit.campaign.campaign import load_campaign

    if source.suffix.lower() == ".toml" and not source.is_dir():
        return load_campaign(source)
    file = source / "model.json" if source.is_dir() else source
    if source.is_dir() and not file.is_file():
        raise ModelError(
            "there is no model in this folder",
            file=source,
            expected="model.json, as bushfit run, fit and diagnose write it",
            hint="name a model file itself, or a campaign",
        )
    return open_model(file)


def _tell(options: Options, outcome: Compared) -> None:
    """Who is who, and what differs: of families, how they meet the tests; parameters and stiffness with -v."""
    for label, entry in zip(outcome.labels, outcome.entries, strict=True):
        options.say(f"{label}: {entry.name} ({entry.source})")
    if options.verbose or not outcome.families:
        _tell_parameters(options, outcome)
    if outcome.families:
        title = "families; held out: root mean square in units of noise, 1 where noise is all"
        table = new_table(title, "family", "parameters", "NRMSE", "chi2", "BIC", "held out", "first there", "parts")
        for label, entry, family in zip(outcome.labels, outcome.entries, outcome.families, strict=True):
            table.add_row(f"{label}: {family.name}", *_figures(entry, family, outcome.families[0]))
        options.console.print(table)
    for line in (*outcome.judged, *(outcome.words if options.verbose or not outcome.families else ())):
        options.say(line)
    shown = outcome.warnings if options.verbose else outcome.warnings[:_MOST_WARNINGS]
    warn(options, shown)
    if left := len(outcome.warnings) - len(shown):
        options.say(f"and {left} more warnings; -v shows them, compare.json has all")


def _tell_parameters(options: Options, outcome: Compared) -> None:
    """The parameters of each beside those of the first."""
    first, *others = outcome.labels
    for label, found in zip(others, outcome.comparisons, strict=True):
        title = f"parameters of {label} against {first}; p: chance of such a difference, by Holm over all of them"
        table = new_table(title, "parameter", first, label, "difference", "95 % interval", "p", "unit")
        for row in found.parameters:
            table.add_row(*_cells(row))
        options.console.print(table)
        if found.joint:
            p, count = found.joint
            options.say(f"all {count} together, correlations counted: p {_chance(p)}")


def _cells(row: ParameterContrast) -> list[str]:
    """The cells of a parameter: values, difference with its interval, and probability, as people read them."""
    unit, factor = for_people(row.unit, 1.0, row.reference)
    values = [number(value * factor, _DIGITS) for value in (row.reference, row.other)]
    if row.difference is None or row.interval is None or row.holm is None:
        return [row.name, *values, "", row.note, "", unit]
    scale, percent = (100.0, " %") if row.relative else (factor, "")
    low, high = (scale * end for end in row.interval)
    shown, *ends = (_signed(value * scale, high - low) for value in (row.difference, *row.interval))
    return [row.name, *values, shown + percent, " to ".join(ends), _chance(row.holm), unit]


def _signed(value: float, width: float) -> str:
    """A difference with the decimals that two digits of its interval need."""
    decimals = max(1 - math.floor(math.log10(width)), 0) if width > 0.0 else _DIGITS
    decimals = min(decimals, _MOST_DECIMALS)
    return f"{round(value, decimals) + 0.0:+.{decimals}f}"


def _chance(p: float) -> str:
    """A probability as people read it."""
    return f"< {_LEAST_CHANCE:g}" if p < _LEAST_CHANCE else number(p, 2)


def _figures(entry: Entry, family: FittedFamily, first: FittedFamily) -> list[str]:
    """The cells of a family."""
    evidence, held = family.evidence, family.held
    nrmse = entry.result.quality and f"{number(100.0 * entry.result.quality.nrmse, 2)} %"
    errors = ["" if error is None else number(error, 3) for error in (held.after, held.before)]
    parts = f"{len(held.parts)} of {len(held.parts) + len(held.skipped)}"
    bic = number(evidence.bic - first.evidence.bic, 4, "+")
    return [str(evidence.parameters), nrmse or "", number(evidence.reduced, 3), bic, *errors, parts]
