"""`bushfit compare`: several results side by side, or model families on one campaign."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from bushfit.caveat import join_names
from bushfit.cli.options import FILE, command_called, direction_option, option, option_group
from bushfit.cli.output import Output, with_output
from bushfit.cli.shared_options import grid_options
from bushfit.errors import error_location, quote_path
from bushfit.progress import track

if TYPE_CHECKING:
    from bushfit.commands.compare import ComparisonOutput

#: Value of the option --families if no names follow.
_ALL = "all"


@command_called(
    "compare", "configs/cmp_15961.toml configs/arm_bushing.toml", "configs/arm_bushing.toml --families sliders,kraus"
)
@click.argument("sources", metavar="A [B]...", nargs=-1, required=True, type=FILE)
@option_group(
    "Range of the comparison",
    direction_option("compare", "all that were fitted in every result"),
    grid_options("as measured"),
    option("--preload LOAD", 'Preload such as "500 N" or "1.5 mm", within the tests of each result [none].'),
    option(
        "--families [NAME,...]",
        "Fit the paper's model and these models to campaign A. NAME is an effect, or several joined by +, such as "
        "kraus+inertia [each law of frequency with each law of amplitude].",
        is_flag=False,
        flag_value=_ALL,
    ),
)
@with_output("results/<names>/compare", "tables", "pictures", "pages")
def command(sources: tuple[Path, ...], families: str | None, output: Output, **settings: Any) -> None:
    """Compare results with A, the reference: differences in parameters, stiffness and loss factor.

    A and B are models (JSON), folders of results, or campaigns, which are fitted first. Each difference has a 95 %
    interval. With --families, the command instead fits several models to one campaign, and compares how well each
    model fits the tests and how well it predicts tests that were left out of its fit.

    Writes compare.json, parameters.csv, differences.csv, compare.png and compare.html. With --families, it also writes
    families.csv.
    """
    from bushfit.campaign.campaign import Campaign, load_campaign
    from bushfit.commands.compare import MOST, ComparedResult, compare, compared_result
    from bushfit.commands.loading import load_source, model_file, model_source
    from bushfit.commands.provenance import command_line, option_words
    from bushfit.effects import get_effect

    if families is None and not 2 <= len(sources) <= MOST:
        raise click.UsageError(f"2 to {MOST} results are needed, or one campaign with '--families' after it.")
    if families is not None and len(sources) > 1:
        raise click.UsageError("'--families' takes one campaign.")
    texts = {key: getattr(value, "text", value) for key, value in settings.items()}  # a grid as it was typed
    words = option_words(families=families, direction=texts.pop("directions"), **texts)
    entries: list[Campaign | ComparedResult] = []
    settings["command"] = command_line("compare", *map(str, sources), *words)
    if families is not None:
        names = () if families == _ALL else tuple(name.replace(" ", "") for name in families.split(","))
        with error_location(place="--families"):
            for name in names:
                all(map(get_effect, name.split("+")))
        settings["families"] = names
        entries.append(load_campaign(sources[0]))
    else:
        for source in track("results fitted", sources):
            loaded = load_source(source)
            digest = None if isinstance(loaded, Campaign) else model_source(model_file(source)).sha256
            entries.append(compared_result(loaded, str(source), digest, settings["directions"]))
    name = join_names(entry.name for entry in entries)
    folder = output.folder(name, "compare.json")
    compared = compare(*entries, **settings)
    _print_comparison(output, name, compared)
    inputs = [source if source.suffix == ".toml" else model_file(source) for source in sources]
    output.write(folder, compared.files, compared.document, inputs)


def _print_comparison(output: Output, name: str, compared: ComparisonOutput) -> None:
    """Print which results differ by more than chance, the next step, the sources of the results, and tables."""
    from bushfit.report.compared import FAMILY_HEADS, family_cells, format_p_value, parameter_cells

    content, families = compared.content, compared.content.families
    first, *labels = content.names
    notes = [note.text for note in compared.notes]
    if families:
        verdict, *advice = compared.advice
        best = max(families, key=lambda family: family.probability)
        effects = "" if best is families[0] else "".join(f" --effect {name}" for name in best.name.split("+"))
        source = content.compared[0]
        action = f"next: {output.command(f'fit {quote_path(source.source)}{effects}', source.name)}"
        sentences = [*advice, *notes, *(compared.words if output.verbose else ())]
    else:
        called = {entry.label: f"{entry.label} ({entry.name})" for entry in content.compared}
        different = [
            f"{called[label]} differs from {called[first]} in {join_names(names)}"
            for label, comparison in zip(labels, compared.comparisons, strict=True)
            if (names := comparison.significant_differences)
        ]
        verdict = f"{'; '.join(different)}, by more than chance"
        action = "do not exchange the results; differences.csv lists stiffness and loss factor at each point"
        if not different:
            verdict = f"no stiffness, loss factor or parameter differs from that of {first} by more than chance"
            action = "the compounds agree within the intervals below"
        sentences = [*notes, *compared.words]
    output.print_headline(name, verdict, action)
    for sentence in sentences:
        output.print(sentence)
    for entry in content.compared:
        output.print(f"{entry.label}: {entry.name} ({entry.source})")
    detailed = compared.comparisons if output.verbose or not families else ()
    for label, comparison in zip(labels, detailed, strict=False):
        title = f"parameters of {label} against {first}; p: probability of such a difference by chance (Holm)"
        columns = ("parameter", first, label, "difference", "95 % interval", "p", "unit")
        output.print_table(title, columns, map(parameter_cells, comparison.parameters))
        if joint := comparison.joint:
            output.print(f"all {joint.parameters} together, with correlations: p {format_p_value(joint.p)}")
    if families:
        title = "families; held out: root mean square in units of noise (1: noise alone)"
        output.print_table(title, FAMILY_HEADS, family_cells(content))
    output.warn(warning for warning in compared.warnings if warning not in compared.notes)
