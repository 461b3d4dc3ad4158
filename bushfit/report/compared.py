"""A comparison as its readers want it, made of its document: tables, cells for terminal and page, lines to draw."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from bushfit.effects.contract import Array
from bushfit.errors import ModelError
from bushfit.model.file import require_schema
from bushfit.prediction.comparison import ParameterContrast
from bushfit.report.compare_document import SCHEMA, ComparisonFile
from bushfit.report.tables import numbers, required
from bushfit.units import display_unit, format_range, number, split_header
from bushfit.validation import validate_tables

#: Digits of a parameter's value, and decimals of a difference at most.
_DIGITS = 4
_MOST_DECIMALS = 6
#: Width of an interval from which on its numbers have an exponent: it is open.
_OPEN = 1e7
#: A probability below this is told as being below it.
_LEAST_CHANCE = 1e-3
#: Columns that say of a difference whether it is more than chance.
_SURE = re.compile(", sure$")
#: Least span of an axis of relative differences [%], and of differences of the loss factor: less would show rounding.
LEAST_PERCENT = 1.0
LEAST_LOSS = 0.005


class Line(NamedTuple):
    """One result over x at one value that is held: values with the ends of their 95 % bands, each (n,).

    `level` is 0 of the smallest value that is held, 1 of the largest.
    """

    label: str
    level: int
    x: Array
    value: Array
    low: Array
    high: Array


class Panel(NamedTuple):
    """Lines under one header; of differences, the least span of their axis, else 0."""

    header: str
    lines: list[Line]
    least: float


class Sides(NamedTuple):
    """A place as all results have it: stiffness and loss factor, then how far these are off the first's.

    Along x lies what the header `along` names; `levels` are what is held, in words: its smallest value, its largest.
    """

    place: str
    along: str
    levels: list[str]
    panels: list[Panel]


@dataclass(frozen=True, eq=False)
class SideBySide:
    """A comparison by its checked document."""

    document: ComparisonFile

    @classmethod
    def of(cls, document: Mapping[str, Any], file: Path | None = None) -> SideBySide:
        """A document that may have been read from a file.

        Raises:
            ModelError: another schema, or a key that is missing or of the wrong kind.
        """
        require_schema(document, file, "a comparison", SCHEMA, hint="bushfit compare writes it anew")
        checked = validate_tables(document, file, ComparisonFile, kind=ModelError)
        first, *others = [entry["label"] for entry in checked["compared"]] or [""]
        pairs, families = checked["pairs"], checked["families"]
        asked = [(first, other) for other in dict.fromkeys(others) if other != first]
        found = [(pair["reference"], pair["other"]) for pair in pairs]
        places = {tuple(pair["places"]) for pair in pairs}
        if not asked or len(asked) < len(others) or found != asked or len(places) > 1 or () in places:
            what = "each result but the first against the first, at the same places"
            raise ModelError("results that do not go together", file=file, place="pairs", expected=what)
        if families and [family["label"] for family in families] != [first, *others]:
            raise ModelError("families that do not go together", file=file, place="families", expected="all compared")
        return cls(checked)

    @cached_property
    def names(self) -> dict[str, str]:
        """What each result is called, by its label; by its source where names are the same."""
        compared = self.document["compared"]
        alike = len({entry["name"] for entry in compared}) < len(compared)
        return {entry["label"]: entry["source"] if alike else entry["name"] for entry in compared}

    def tables(self) -> dict[str, pd.DataFrame]:
        """`parameters`, `differences` and, of families, `families`."""
        pairs = self.document["pairs"]
        parameters = [
            {
                "parameter": row.name,
                "unit": row.unit,
                "reference": pair["reference"],
                "other": pair["other"],
                "reference value": row.reference,
                "other value": row.other,
                "difference": row.difference,
                "difference, low": row.interval and row.interval[0],
                "difference, high": row.interval and row.interval[1],
                "difference is": "relative" if row.relative else "absolute",
                "p": row.p,
                "p by Holm": row.holm,
                "not tested": row.note,
            }
            for pair in pairs
            for row in pair["parameters"]
        ]
        families = {"families": pd.DataFrame([*self._families()])} if self.document["families"] else {}
        at = [self.at(place) for place in self.places]
        differences = pd.concat([each[pair["other"]] for pair in pairs for each in at], ignore_index=True)
        return {"parameters": pd.DataFrame(parameters), **families, "differences": differences}

    def _families(self) -> Iterator[dict[str, Any]]:
        """A family a row: how it meets the tests, and what was held out of them."""
        families = self.document["families"] or []
        for family in families:
            gain = family["gain"] or (None, None, None)
            yield {
                "label": family["label"],
                "family": family["name"],
                "parameters": family["parameters"],
                "reduced chi-square": family["reduced_chi_square"],
                "BIC less the first's": family["bic"] - families[0]["bic"],
                "held out [noise]": family["heldout"],
                "the first there [noise]": family["first_there"],
                "parts held out": len(family["parts"]),
                **dict(zip((f"fall of the mean square{end}" for end in ("", ", low", ", high")), gain, strict=True)),
                "p by Holm": family["p"],
                "probability": family.get("probability"),
                "words": family["words"],
            }

    def family_cells(self) -> Iterator[list[str]]:
        """The families in rows of cells, as `FAMILY_HEADS` names them."""
        families = self.document["families"] or ()
        for family, entry in zip(families, self.document["compared"], strict=False):
            parts, share = len(family["parts"]), family.get("probability")
            yield [
                f"{family['label']}: {family['name'].replace('+', ' + ')}",
                str(family["parameters"]),
                "" if entry["nrmse"] is None else f"{number(100.0 * entry['nrmse'], 2)} %",
                number(family["reduced_chi_square"], 3),
                "" if share is None else f"{number(100.0 * share, 2)} %" if share >= _LEAST_CHANCE else "< 0.1 %",
                *("" if each is None else number(each, 3) for each in (family["heldout"], family["first_there"])),
                f"{parts} of {parts + len(family['skipped'])}",
            ]

    @property
    def places(self) -> list[str]:
        """Where the results are compared."""
        return [*self.document["pairs"][0]["places"]]

    def at(self, place: str) -> dict[str, pd.DataFrame]:
        """The columns of differences.csv at a place, by the label of each but the first.

        Raises:
            ModelError: a place of only some, or columns that do not go together.
        """
        found = {}
        for pair in self.document["pairs"]:
            columns = pair["places"].get(place, {})
            texts = [name for name, cells in columns.items() if isinstance(next(iter(cells), None), str)]
            sizes = {len(cells) for cells in columns.values()}
            if len(sizes) != 1 or 0 in sizes or not all(map(_SURE.search, texts)):
                raise ModelError(
                    "columns that do not go together",
                    place=f"pairs, {pair['other']}, places, {place}",
                    expected="as many numbers in each, and yes or no of what is sure",
                )
            table = pd.DataFrame({name: pd.Series(column, dtype=object) for name, column in columns.items()})
            table = table.astype(dict.fromkeys(table.columns.difference(texts), float))
            table.insert(0, "other", pair["other"])
            table.insert(1, "place", place)
            found[pair["other"]] = table
        return found

    def sides(self, place: str) -> Sides:
        """The lines of a place, over frequency, or over amplitude where there is one frequency."""
        tables = self.at(place)
        heads = Heads.of(next(iter(tables.values())))
        grid = numbers(next(iter(tables.values())), "frequency [Hz]", heads.amplitude)
        swept = np.unique(grid[0]).size > 1
        along, held = (("frequency [Hz]", heads.amplitude), (heads.amplitude, "frequency [Hz]"))[not swept]
        levels = np.unique(np.unique(grid[int(swept)])[[0, -1]])
        first, *others = self.names
        own = [(first, tables[others[0]], "reference"), *((label, tables[label], "other") for label in others)]

        def lines(what: str, scale: float, of: list[tuple[str, pd.DataFrame, str]]) -> Iterator[Line]:
            for label, table, who in of:
                header = f"{who} {what}".strip()
                columns = numbers(table, along, held, header, f"{header}, low", f"{header}, high")
                for level, value in enumerate(levels):
                    x, _, *ends = columns[:, columns[1] == value]
                    yield Line(label, level, x, *(scale * end for end in ends))

        largest = max(float(np.nanmax(line.value, initial=0.0)) for line in lines(heads.stiffness, 1.0, own))
        name, unit = split_header(heads.stiffness)
        shown, scale = display_unit(unit or "", 1.0, largest)
        off = [(label, table, "") for label, table, who in own if who == "other"]
        panels = [
            Panel(f"{name} [{shown}]", [*lines(heads.stiffness, scale, own)], 0.0),
            Panel("loss factor [-]", [*lines("loss factor [-]", 1.0, own)], 0.0),
            Panel(f"{name} less {first}'s [%]", [*lines(heads.relative, 100.0, off)], LEAST_PERCENT),
            Panel(f"loss factor less {first}'s [-]", [*lines(heads.loss, 1.0, off)], LEAST_LOSS),
        ]
        return Sides(
            place, along, [format_range(split_header(held)[1] or "", float(level)) for level in levels], panels
        )


class Heads(NamedTuple):
    """Headers of the differences at a place: amplitude, stiffness, and the differences of stiffness and loss factor."""

    amplitude: str
    stiffness: str
    relative: str
    loss: str

    @classmethod
    def of(cls, table: pd.DataFrame) -> Heads:
        """Those of a table, found by what stands before and after them.

        Raises:
            ModelError: one is not there.
        """
        names = [str(name) for name in table]
        amplitude = next((name for name in names if split_header(name)[0].endswith("amplitude")), "amplitude [mm]")
        stiffness = next((name for name in names if name.startswith("reference ")), "reference stiffness [N/mm]")
        stiffness = stiffness.removeprefix("reference ")
        found = cls(
            amplitude,
            stiffness,
            f"relative difference of {split_header(stiffness)[0]} [-]",
            "difference of loss factor [-]",
        )
        sides = [f"{who} {what}" for who in ("reference", "other") for what in (stiffness, "loss factor [-]")]
        bands = [f"{what}{end}" for what in (*sides, *found[2:]) for end in ("", ", low", ", high")]
        required(table, "frequency [Hz]", amplitude, *bands, *(f"{what}, sure" for what in found[2:]))
        return found


#: Heads of `family_cells`, and of `parameter_cells` without the labels of the two results.
FAMILY_HEADS = ("family", "parameters", "NRMSE", "χ²", "probability", "held out", "first, held out", "parts")


def parameter_cells(row: ParameterContrast) -> list[str]:
    """Name, both values, difference with its 95 % interval, probability and unit, as people read them."""
    unit, factor = display_unit(row.unit, 1.0, row.reference)
    values = [number(value * factor, _DIGITS) for value in (row.reference, row.other)]
    if row.difference is None or row.interval is None or row.holm is None:
        return [row.name, *values, "", row.note, "", unit]
    scale, percent = (100.0, " %") if row.relative else (factor, "")
    low, high = (scale * end for end in row.interval)
    shown, *ends = (signed(value * scale, high - low) for value in (row.difference, *row.interval))
    return [row.name, *values, shown + percent, " to ".join(ends), chance(row.holm), unit]


def signed(value: float, width: float) -> str:
    """A difference with the decimals that two digits of its interval need."""
    if width >= _OPEN:
        return number(value, 2, "+")
    decimals = max(1 - math.floor(math.log10(width)), 0) if width > 0.0 else _DIGITS
    decimals = min(decimals, _MOST_DECIMALS)
    return f"{round(value, decimals) + 0.0:+.{decimals}f}"


def chance(p: float) -> str:
    """A probability as people read it."""
    return f"< {_LEAST_CHANCE:g}" if p < _LEAST_CHANCE else number(p, 2)
