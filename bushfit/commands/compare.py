"""compare: several results compared with the first, or model families on one campaign."""

from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass
from functools import partial
from string import ascii_uppercase
from typing import Any, Unpack

from bushfit.campaign.campaign import Campaign
from bushfit.caveat import Caveat
from bushfit.commands.families import COMPOUND, family_to_use, fit_campaign_families
from bushfit.commands.fit import fit
from bushfit.commands.loading import HasResult, as_result
from bushfit.commands.predict import requested_preloads
from bushfit.diagnosis.families import FittedFamily
from bushfit.errors import BushfitError, ModelError
from bushfit.geometry import Place, default_places, get_places
from bushfit.model.document import BushingTable
from bushfit.model.file import versions
from bushfit.model.result import Result
from bushfit.prediction.caveats import warnings_of
from bushfit.prediction.comparison import Comparison, with_holm
from bushfit.prediction.comparison import compare as compare_two
from bushfit.prediction.grid import GridOptions, common_grid, grid_settings, requested_grid
from bushfit.reading.measurement import Sweep
from bushfit.report import plots
from bushfit.report.compare_document import (
    SCHEMA,
    ComparedEntry,
    ComparedPair,
    ComparisonFile,
    FamilyEntry,
    HeldOutPart,
)
from bushfit.report.compared import contrast_columns, differences_table, families_table, parameter_differences_table
from bushfit.report.page.comparison import comparison_page
from bushfit.report.results import ResultFile
from bushfit.validation import to_json_data
from bushfit.version import __version__

#: Maximum number of results, limited by the colours of a figure and the columns of a table.
MOST = 8


@dataclass(frozen=True, eq=False)
class ComparedResult:
    """Result that takes part in a comparison: fitted model, its name, and the sweeps of its campaign.

    Args:
        name: name of the result in tables.
        source: file or folder that the user named.
        result: fitted model with its uncertainty.
        sweeps: sweeps of its campaign, which determine the grid.
        sha256: SHA-256 of the model file or campaign.
    """

    name: str
    source: str
    result: Result
    sweeps: Sequence[Sweep] = ()
    sha256: str | None = None


#: Types of objects that can be compared.
Comparable = Result | HasResult | Campaign | ComparedResult


@dataclass(frozen=True, eq=False, repr=False)
class ComparisonOutput:
    """Output of the command compare: compared results or model families, sentences, and result files.

    Args:
        comparisons: comparison of each further result with the reference.
        advice: sentences on the family to use and on each family's error on held-out data; empty for other results.
        words: sentences on the differences, one for each result and direction.
        notes: warnings on the families.
        warnings: all warnings without repetition, each with the letters of the results that it concerns.
        content: content of compare.json.
        document: the same as JSON data.
        files: document, tables, figure and page.
    """

    comparisons: Sequence[Comparison]
    advice: Sequence[str]
    words: Sequence[str]
    notes: Sequence[Caveat]
    warnings: Sequence[Caveat]
    content: ComparisonFile
    document: Mapping[str, Any]
    files: Sequence[ResultFile]

    def __repr__(self) -> str:
        return f"Comparison of {', '.join(entry.name for entry in self.content.compared)}"


def compare(
    reference: Comparable,
    *others: Comparable,
    families: Sequence[str] | None = None,
    preload: str | None = None,
    command: str = "",
    **grid: Unpack[GridOptions],
) -> ComparisonOutput:
    """Compare parameters and predicted stiffness of results with a reference, and test the differences for chance.

    Args:
        reference: result, output with a result, or campaign, which is fitted as by `fit`; also a `ComparedResult`.
        others: results, outputs or campaigns that are compared with the reference.
        families: model families to fit to a single campaign, such as "sliders" or "kraus+inertia"; () for all.
        preload: preload with its unit, such as "500 N", within the tested range of each result; default none.
        command: command line for the document.
        grid: directions (default those in which all results were fitted), frequencies [Hz] and amplitudes [m] (default
            those measured for all results), torsion_amplitudes [rad] and strain_amplitudes.

    Returns:
        Differences of parameters and of predicted stiffness from the reference, with tables, figure and page.

    Raises:
        BushfitError: too few or too many results, or directions and points that one of them cannot predict.
    """
    settings, directions = grid_settings(grid), grid.get("directions") or ()
    fitted, notes = list[FittedFamily](), list[Caveat]()
    if families is not None and isinstance(reference, Campaign) and not others:
        fitted, results, notes = fit_campaign_families(reference, families, directions or None)
        path, sweeps, sha256 = str(reference.path), reference.sweeps, reference.sha256
        family_results = zip(fitted, results, strict=True)
        entries = [ComparedResult(family.name, path, result, sweeps, sha256) for family, result in family_results]
    elif families is None and 1 <= len(others) < MOST:
        entries = [compared_result(source, directions=directions) for source in (reference, *others)]
    else:
        raise BushfitError(
            "this cannot be compared",
            found=f"{1 + len(others)} results{' and families' if families is not None else ''}",
            expected=f"2 to {MOST} results, or one campaign and families",
        )
    results, labels = [entry.result for entry in entries], list(ascii_uppercase[: len(entries)])
    columns, grids = _common_places(results, settings.directions), []
    for places in columns:
        if len({place.motion for place in places}) > 1:
            found = ", ".join(f"{place}: {place.motion.words[0]}" for place in places)
            raise ModelError("the results have different kinds of motion", found=found, expected="one kind of motion")
        grids.append(requested_grid(common_grid(results, places, entries[0].sweeps), settings, places[0]))
    preloads = [requested_preloads(results[0], places[0], [preload])[0] if preload else None for places in columns]
    comparisons = with_holm(
        [
            compare_two(results[0], result, [(places[0], places[index]) for places in columns], grids, preloads)
            for index, result in enumerate(results[1:], start=1)
        ]
    )
    others_compared = list(zip(labels[1:], comparisons, strict=True))
    words = [f"{label} against A, {line}" for label, comparison in others_compared for line in comparison.sentences()]
    advice = [family_to_use(fitted, results)] if fitted else []
    further = zip(labels[1:], fitted[1:], strict=False)
    advice += [f"{label}, {family.name}: {family.sentence}" for label, family in further]
    warnings = [*notes, *_warnings(labels, entries, comparisons, are_families=bool(fitted))]
    content = ComparisonFile(
        SCHEMA,
        [_entry(label, entry) for label, entry in zip(labels, entries, strict=True)],
        [
            ComparedPair("A", label, one.shared, one.joint, one.parameters, contrast_columns(one))
            for label, one in others_compared
        ],
        [_family(*row) for row in zip(labels, fitted, results, strict=False)] or None,
        [*advice, *words],
        [warning.text for warning in warnings],
        command,
        {"bushfit": __version__, **versions()},
        [warning.kind for warning in warnings],
    )
    document = to_json_data(content, ComparisonFile)
    figure = ResultFile("compare", "figure", lambda: plots.comparison.comparison_figure(content))
    files = [
        ResultFile("compare", "json", document),
        figure,
        ResultFile("parameters", "table", partial(parameter_differences_table, content)),
        *([ResultFile("families", "table", partial(families_table, content.families))] if content.families else []),
        ResultFile("differences", "table", partial(differences_table, content)),
        ResultFile("compare", "page", partial(comparison_page, content, figure)),
    ]
    return ComparisonOutput(comparisons, advice, words, notes, warnings, content, document, files)


def compared_result(
    source: Comparable, name: str | None = None, sha256: str | None = None, directions: Sequence[str] = ()
) -> ComparedResult:
    """Make an entry of a comparison from a model or output, or from a campaign, which is fitted as by `fit`.

    Args:
        source: result, output with a result, or campaign; a compared result is returned unchanged.
        name: file or folder that the source was read from.
        sha256: SHA-256 of the model file.
        directions: directions of a campaign whose tests are fitted.

    Returns:
        The fitted result with its name, and the sweeps of a campaign.
    """
    if isinstance(source, ComparedResult):
        return source
    if isinstance(source, Campaign):
        result = fit(source, directions=directions).result
        return ComparedResult(source.name, name or str(source.path), result, source.sweeps, source.sha256)
    result = as_result(source)
    return ComparedResult(result.name, name or result.name, result, sha256=sha256)


def _warnings(
    labels: Sequence[str], entries: Sequence[ComparedResult], comparisons: Sequence[Comparison], *, are_families: bool
) -> list[Caveat]:
    """Warnings on results that share tests, then the warnings of each result with the letters of the results.

    Args:
        labels: letters of the results.
        entries: compared results, the reference first.
        comparisons: comparison of each further result with the reference.
        are_families: True if the results are model families, which share their tests by design.

    Returns:
        Warnings; a warning that several results have is listed once, and starts with their letters.
    """
    shared = "intervals of their {} assume independent tests and are usually too wide"
    if are_families:
        sentences = [
            f"families are fitted to the same tests: {shared.format('differences')}; compare families by their "
            "probability and held-out error"
        ]
    else:
        sentences = [
            f"A and {label} were fitted to the same {', '.join(comparison.shared)}: {shared.format('difference')}"
            for label, comparison in zip(labels[1:], comparisons, strict=True)
            if comparison.shared
        ]
    predictions = [[pair.reference for comparison in comparisons for pair in comparison.contrasts]]
    predictions += [[pair.other for pair in comparison.contrasts] for comparison in comparisons]
    labels_of: dict[Caveat, list[str]] = {}
    for label, entry, predicted in zip(labels, entries, predictions, strict=True):
        for warning in warnings_of(entry.result, [prediction.warnings for prediction in predicted]):
            labels_of.setdefault(warning, []).append(label)
    warnings = [Caveat("shared_tests", sentence) for sentence in sentences]
    return [*warnings, *(warning.about(", ".join(having)) for warning, having in labels_of.items())]


def _common_places(results: Sequence[Result], names: Sequence[str] | None) -> list[list[Place]]:
    """Find the directions or specimens to compare: those with the given names, or all that the results have in common.

    Returns:
        For each common direction or specimen, a list of its equivalents in all results. If the results have none in
        common, only the rubber compound.
    """
    if names:
        columns = list[list[Place]]()
        for name in names:
            places_of = [get_places(name, result.specimens) for result in results]
            labels = dict.fromkeys(", ".join(map(str, places)) for places in places_of)
            if len(labels) > 1 and {len(places) for places in places_of} != {1}:
                expected = "one direction of one body in each result"
                raise ModelError(f"{name} is not the same in all results", found="; ".join(labels), expected=expected)
            columns += map(list, zip(*places_of, strict=True))
        return columns
    tested = []
    for result in results:
        default = [str(place) for place in default_places(result.model.bushing, result.specimens)]
        tested.append(list(result.measured.directions if result.measured else ()) or default)
    common = [name for name in tested[0] if all(name in places for places in tested)]
    places = [[result.place(name) for result in results] for name in common]
    matching = [bodies for bodies in places if all(body.motion is bodies[0].motion for body in bodies)]
    return matching or [[COMPOUND] * len(results)]


def _entry(label: str, entry: ComparedResult) -> ComparedEntry:
    """Make the entry of a compared result in compare.json; the label, a letter, stands for it in tables."""
    result, bushing = entry.result, entry.result.model.bushing
    return ComparedEntry(
        label,
        entry.name,
        entry.source,
        entry.sha256,
        BushingTable(*astuple(bushing)) if bushing else None,
        list(result.model.effects),
        result.quality.reduced_chi_square if result.quality else None,
        result.quality.nrmse if result.quality else None,
        result.measured,
        result.inputs,
    )


def _family(label: str, family: FittedFamily, result: Result) -> FamilyEntry:
    """Make the entry of a model family, by its letter (`label`), in compare.json, with its held-out residual."""
    fit, held_out = family.fit, family.holdout
    return FamilyEntry(
        label,
        family.name,
        len(fit.names),
        result.quality.reduced_chi_square if result.quality else fit.reduced_chi_square,
        family.bic,
        held_out.after,
        held_out.before,
        family.gain,
        family.p,
        family.probability,
        [HeldOutPart(part.part, part.before, part.after) for part in held_out.parts],
        held_out.skipped,
        family.sentence if label != "A" else "",
    )
