"""compare: several results side by side, the first the reference; or model families on one campaign."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from itertools import combinations
from string import ascii_uppercase
from typing import Any

import numpy as np

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import PredictSettings
from bushfit.diagnosis.evidence import result_of
from bushfit.diagnosis.families import FittedFamily, fit_families
from bushfit.effects import Level
from bushfit.effects.contract import Array
from bushfit.errors import ModelError
from bushfit.fitting.assess import lack_of_fit
from bushfit.fitting.data import Data
from bushfit.geometry import Direction, Place, Specimen
from bushfit.jobs.fits import Fit
from bushfit.jobs.grid import asked_or, common_grid
from bushfit.jobs.predict import columns_of
from bushfit.model.document import BushingTable
from bushfit.model.file import model_document, versions
from bushfit.model.result import Result
from bushfit.prediction.caveats import warnings_of
from bushfit.prediction.comparison import Comparison, compare, holm, with_holm
from bushfit.reading.measurement import Source, Sweep
from bushfit.report.artifacts import comparison_contents
from bushfit.report.compare_document import SCHEMA, ComparedEntry, ComparisonFile, Family, Pair
from bushfit.report.contents import Contents, Kinds
from bushfit.report.page import comparison_page
from bushfit.report.tables import contrast_table
from bushfit.units import format_range, number
from bushfit.validation import to_json_data
from bushfit.version import __version__

#: Results that are compared at most: the colours of a picture, and the columns of a table.
MOST = 8
#: Where nothing is tested alike, the material is compared: its modulus over strain.
_COMPOUND = Specimen("compound", "modulus")
#: What is said of a family where the first has no gap.
_NO_GAP = "the first family meets these tests within their noise: nothing in them asks for another"
#: Odds from which on a family counts where it is said which to use: one in twenty.
_LIKELY = 0.05
#: Share of the modulus within which families say the same: what two bushings of a batch differ by.
_AGREED = 0.05
#: How far beyond the tested range families are followed, as a factor, and points on the way.
_BEYOND, _POINTS = 10.0, 400
#: A record as JSON has it.
_plain: Callable[[Any], Any] = asdict


@dataclass(frozen=True, eq=False)
class Entry:
    """What is compared: a result, what to call it, and the file or folder it came from, with the hash of its content.

    `sweeps` are those of its campaign, for the grid.
    """

    name: str
    source: str
    result: Result
    sweeps: Sequence[Sweep] = ()
    sha256: str | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Compared:
    """The outcome: the entries, and each but the first against it; families where these are what is compared."""

    entries: Sequence[Entry]
    comparisons: Sequence[Comparison]
    families: Sequence[FittedFamily] = ()
    notes: tuple[str, ...] = ()
    command: str = ""

    def __repr__(self) -> str:
        return f"Comparison of {', '.join(entry.name for entry in self.entries)}"

    @property
    def labels(self) -> list[str]:
        """A, B and so on, as tables and sentences call the entries."""
        return list(ascii_uppercase[: len(self.entries)])

    @cached_property
    def words(self) -> list[str]:
        """What differs, a sentence an entry and place."""
        first, *others = self.labels
        pairs = zip(others, self.comparisons, strict=True)
        return [f"{label} against {first}, {line}" for label, found in pairs for line in found.words()]

    @cached_property
    def advice(self) -> list[str]:
        """Of families, which to use; and of each but the first, whether it is nearer to what was held out."""
        pairs = list(zip(self.labels, self.families, strict=False))
        to_use = [_family_to_use(self.families, self.entries)] if self.families else []
        return [*to_use, *(f"{label}, {family.name}: {family.words}" for label, family in pairs[1:])]

    @cached_property
    def warnings(self) -> list[str]:
        """What a user must know, each once, with the labels of those that it holds of."""
        contrasts = [found.contrasts for found in self.comparisons]
        predicted = [[pair.reference for pairs in contrasts for pair in pairs]]
        predicted += [[pair.other for pair in pairs] for pairs in contrasts]
        of_each: dict[str, list[str]] = {}
        for label, entry, found in zip(self.labels, self.entries, predicted, strict=True):
            for line in warnings_of(entry.result, [prediction.warnings for prediction in found]):
                of_each.setdefault(line, []).append(label)
        return [*self.notes, *self._shared(), *(f"{', '.join(who)}: {line}" for line, who in of_each.items())]

    def _shared(self) -> list[str]:
        """That results were fitted to the same files, and what this does."""
        if self.families:
            return [
                "families are fitted to the same tests: intervals of their differences take them as independent and "
                "are too wide as a rule; their odds, and what was held out, compare them"
            ]
        pairs = zip(self.labels[1:], self.comparisons, strict=True)
        return [
            f"{self.labels[0]} and {label} were fitted to the same {', '.join(found.shared)}: intervals of their "
            "difference take them as independent and are too wide as a rule"
            for label, found in pairs
            if found.shared
        ]

    @cached_property
    def document(self) -> ComparisonFile:
        compared = [_entry(*pair) for pair in zip(self.labels, self.entries, strict=True)]
        pairs = [self._pair(*pair) for pair in zip(self.labels[1:], self.comparisons, strict=True)]
        words = ["", *(family.words for family in self.families[1:])]
        families = [_family(*each) for each in zip(self.labels, self.families, words, strict=False)]
        return {
            "schema": SCHEMA,
            "compared": compared,
            "pairs": pairs,
            "families": families or None,
            "words": [*self.advice, *self.words],
            "warnings": self.warnings,
            "command": self.command,
            "versions": {"bushfit": __version__, **versions()},
        }

    def _pair(self, label: str, found: Comparison) -> Pair:
        """The numbers of one entry against the first."""
        return {
            "reference": self.labels[0],
            "other": label,
            "shared_inputs": list(found.shared),
            "joint": {"p": found.joint[0], "parameters": found.joint[1]} if found.joint else None,
            "parameters": [_plain(row) for row in found.parameters],
            "places": {str(each.place): columns_of(contrast_table(found, each)) for each in found.contrasts},
        }

    @property
    def contents(self) -> Contents:
        return comparison_contents(self.document).paged(compare=comparison_page)


def _entry(label: str, entry: Entry) -> ComparedEntry:
    """What an entry is."""
    result, bushing = entry.result, model_document(entry.result.model)["bushing"]
    return {
        "label": label,
        "name": entry.name,
        "source": entry.source,
        "sha256": entry.sha256,
        "bushing": bushing and _plain(BushingTable(**bushing)),
        "effects": list(result.model.effects),
        "reduced_chi_square": result.quality.reduced_chi_square if result.quality else None,
        "nrmse": result.quality.nrmse if result.quality else None,
        "measured": result.measured and _plain(result.measured),
        "inputs": to_json_data(result.inputs, tuple[Source, ...]),
    }


def _family(label: str, family: FittedFamily, words: str) -> Family:
    """How a family meets the tests, and what was held out of them."""
    evidence, held = family.evidence, family.held
    return {
        "label": label,
        "name": family.name,
        "parameters": evidence.parameters,
        "reduced_chi_square": evidence.reduced,
        "bic": evidence.bic,
        "heldout": held.after,
        "first_there": held.before,
        "gain": family.gain,
        "p": family.p,
        "probability": family.probability,
        "parts": [{"part": part.part, "first": part.before, "heldout": part.after} for part in held.parts],
        "skipped": [_plain(skipped) for skipped in held.skipped],
        "words": words,
    }


@dataclass(frozen=True)
class Compare:
    """Every entry against the first: at the places and over the grid asked for, else where all were fitted."""

    asked: PredictSettings = field(default_factory=PredictSettings)
    command: str = ""

    def kinds(self, families: bool = False) -> Kinds:
        """The names of all that is written."""
        tables = ("parameters", *(["families"] if families else []), "differences")
        return Kinds(("compare",), tables, ("compare",), ("compare",))

    def entry(self, opened: Campaign | Result, source: str, sha256: str | None = None) -> Entry:
        """A result, or that of a campaign, which is fitted as `bushfit fit` does."""
        if not isinstance(opened, Campaign):
            return Entry(opened.name, source, opened, sha256=sha256)
        result = Fit(self.asked.directions or ()).run(Data.of(opened)).result
        return Entry(opened.name, source, result, opened.sweeps, opened.sha256)

    def run(
        self, entries: Sequence[Entry], families: Sequence[FittedFamily] = (), notes: Sequence[str] = ()
    ) -> Compared:
        """The comparison of two entries or more.

        Raises:
            ModelError: a place that one of them does not know, or points that none can be predicted at.
        """
        results = [entry.result for entry in entries]
        places = self._places(results)
        grids = [self._grid(results, place, entries[0].sweeps) for place in places]
        found = [
            compare(results[0], result, [(place[0], place[i]) for place in places], grids)
            for i, result in enumerate(results[1:], start=1)
        ]
        return Compared(entries, with_holm(found), families, tuple(notes), self.command)

    def run_families(self, campaign: Campaign, source: str, names: Sequence[str] = ()) -> Compared:
        """Families on one campaign, the model of its [fit] first; all that the library knows unless named.

        Raises:
            FitError: data that cannot support the fit of one.
            ModelError: an unknown effect, or one that the model has already.
        """
        data = Data.of(campaign)
        data_sets = [data_set.with_weight() for data_set in data.chosen(self.asked.directions)]
        model = data.started(data.effects, data_sets, {})
        held = [name for name, setting in campaign.fit.parameters.items() if not setting.vary]
        families, left = fit_families(model, data_sets, names, held, data.bounds)
        tested = iter(holm([family.p for family in families if family.p is not None]))
        families = [family if family.p is None else replace(family, p=next(tested)) for family in families]
        entries = [
            Entry(
                family.name,
                source,
                replace(result_of(family.evidence, data.bounds, model.effects), specimens=campaign.specimens),
                campaign.sweeps,
                campaign.sha256,
            )
            for family in families
        ]
        first = families[0].evidence
        notes = [_NO_GAP] if lack_of_fit(first.model, data_sets, first.parameters) is None else []
        if left:
            odds = number(100.0 * sum(left.values()), 2)
            notes.append(f"{len(left)} more families have odds of {odds} % together: {', '.join(left)}")
        return self.run(entries, families, notes)

    def _places(self, results: Sequence[Result]) -> list[list[Place]]:
        """Where to compare, each place as every result has it."""
        if self.asked.directions:
            return [[result.place(name) for result in results] for name in self.asked.directions]
        known = [_known(result) for result in results]
        common = [name for name in known[0] if all(name in names for names in known)]
        places = [[result.place(name) for result in results] for name in common]
        alike = [place for place in places if all(a.motion is b.motion for a, b in combinations(place, 2))]
        return alike or [[_COMPOUND] * len(results)]

    def _grid(self, results: Sequence[Result], places: Sequence[Place], sweeps: Sequence[Sweep]) -> tuple[Array, Array]:
        """The points asked for, else those that all were fitted at."""
        if len({place.motion for place in places}) > 1:
            found = ", ".join(f"{place}: {place.motion.words[0]}" for place in places)
            raise ModelError("a place that is not one kind of motion in all", found=found, expected="one kind")
        return asked_or(common_grid(results, places, sweeps), self.asked, places[0])


def _family_to_use(families: Sequence[FittedFamily], entries: Sequence[Entry]) -> str:
    """Which family to use, and over what range the likely ones say the same."""
    every = list(zip(ascii_uppercase, families, entries, strict=False))
    label, family, entry = max(every, key=lambda each: each[1].probability)
    others = [each for each in every if each[1].probability >= _LIKELY and each[0] != label]
    said = f"use {label}, {family.name}: odds {number(100.0 * family.probability, 2)} %"
    if not others or entry.result.measured is None:
        return f"{said}, no other has {100.0 * _LIKELY:g} %"
    models = [each.result.model.without(Level.INSTRUMENT) for each in (entry, *(other[2] for other in others))]
    ends = np.array([entry.result.measured.frequency, entry.result.measured.strain])
    ends[1] /= entry.result.model.unit_strain(_COMPOUND)  # as laboratories count it
    middle, reach = np.sqrt(ends.prod(axis=1)), []
    for axis, (low, high) in enumerate(ends):
        points = np.repeat(middle[:, None], _POINTS, axis=1)
        at = points[axis] = np.geomspace(low / _BEYOND, high * _BEYOND, _POINTS)
        moduli = np.abs([model.stiffness(_COMPOUND, *points) for model in models])
        apart = at[moduli.max(axis=0) > (1.0 + _AGREED) * moduli.min(axis=0)]
        below, above = apart[apart < middle[axis]], apart[apart > middle[axis]]
        reach.append((below.max(initial=at[0]), above.min(initial=at[-1])))
    frequencies, strains = format_range("Hz", *reach[0]), format_range("%", *(100.0 * end for end in reach[1]))
    names = ", ".join(other for other, *_ in others)
    return (
        f"{said}; {names}, of {100.0 * _LIKELY:g} % or more, have its modulus within {100.0 * _AGREED:g} % over "
        f"{frequencies} and {strains} shear strain; beyond, these tests do not tell which is right"
    )


def _known(result: Result) -> list[str]:
    """Places where a result was fitted; all that it can be asked about where it does not say."""
    if result.measured and result.measured.directions:
        return list(result.measured.directions)
    directions = [Direction.AXIAL, Direction.RADIAL] if result.model.bushing else []
    return [*map(str, directions), *(specimen.name for specimen in result.specimens)]
