"""Tables of the differences between results, computed or read from compare.json, and formatted cells."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from bushfit.effects.contract import Array
from bushfit.errors import ModelError
from bushfit.model.file import require_schema
from bushfit.prediction.comparison import Comparison
from bushfit.prediction.parameter_comparison import ParameterContrast, relative_difference
from bushfit.report.compare_document import SCHEMA, ComparisonFile, FamilyEntry
from bushfit.report.tables import response_headers, table_columns
from bushfit.units import display_unit, number, split_header
from bushfit.validation import validate_tables

#: Significant digits of the value of a parameter; largest number of decimals of a difference.
_DIGITS, _MOST_DECIMALS = 4, 6
#: Width of an interval from which the numbers are written with an exponent: the interval is practically unbounded.
_OPEN = 1e7
#: Smallest probability that is written as a number; smaller ones are written as "< 0.001".
_LEAST_PROBABILITY = 1e-3
#: Column header of the loss factor.
LOSS = "loss factor [-]"
#: Column headers of the held-out gain of a family with its 95 % interval in families.csv.
_GAIN_HEADERS = [f"decrease of the mean square{end}" for end in ("", ", low", ", high")]
#: Column headers of the rows of `family_cells`.
FAMILY_HEADS = ("family", "parameters", "NRMSE", "χ²", "probability", "held out", "first, held out", "parts")


def contrast_columns(comparison: Comparison) -> dict[str, dict[str, list[Any]]]:
    """Columns of stiffness and loss factor of two results at the same operating points, with the differences.

    Args:
        comparison: comparison of the two results, which widens the 95 % bands so that they are valid at all points
            together.

    Returns:
        Columns by header, of each direction or specimen by its name; an entry per operating point, None if it is not
        known: frequency [Hz] and amplitude; stiffness (or modulus) and loss factor of both results; and their
        differences, other minus reference, relative for the stiffness. Each has columns for the ends of its 95 % band
        ("..., low" and "..., high"), a difference also "yes" or "no" in the column "..., significant".
    """
    places = {}
    for contrast in comparison.contrasts:
        (_, length), _, (_, factor) = contrast.place.display
        columns: list[Any] = [contrast.reference.frequency, contrast.reference.amplitude * length]
        for side in (contrast.reference, contrast.other):
            columns += [*(factor * side.stiffness.ends), *side.loss_factor.ends]
        for band, convert in ((contrast.stiffness, relative_difference), (contrast.loss_factor, np.asarray)):
            columns += [*convert(band.ends), np.where(comparison.significant(band), "yes", "no")]
        headers = contrast_headers(*response_headers(contrast.place)[:2])
        places[str(contrast.place)] = table_columns(pd.DataFrame(dict(zip(headers, columns, strict=True))))
    return places


def contrast_headers(amplitude: str, stiffness: str) -> list[str]:
    """Headers of `contrast_columns`, from headers such as "amplitude [mm]" and "stiffness [N/mm]"."""
    ends = ("", ", low", ", high")
    sides = [f"{side} {name}" for side in ("reference", "other") for name in (stiffness, LOSS)]
    differences = (f"relative difference of {split_header(stiffness)[0]} [-]", f"difference of {LOSS}")
    headers = ["frequency [Hz]", amplitude, *(f"{name}{end}" for name in sides for end in ends)]
    return [*headers, *(f"{name}{end}" for name in differences for end in (*ends, ", significant"))]


@dataclass(frozen=True, eq=False)
class PlaceDifferences:
    """Differences of one result from the reference at one direction or specimen, as compare.json lists them.

    Args:
        label: letter of the result.
        place: name of the direction or specimen.
        table: a row per operating point: label and place, frequency and amplitude; values of both results; relative
            difference of |K| [1] and difference of the loss factor (result minus reference), with their 95 % bands;
            "yes" or "no" for a significant difference.
        amplitude: header of the amplitude.
        stiffness: header of the stiffness or modulus; in the table it follows "reference " or "other ".
    """

    label: str
    place: str
    table: pd.DataFrame
    amplitude: str
    stiffness: str

    @property
    def changes(self) -> tuple[str, str]:
        """Headers of the relative difference of the stiffness or modulus, and of the difference of the loss factor."""
        return f"relative difference of {split_header(self.stiffness)[0]} [-]", f"difference of {LOSS}"

    def band(self, header: str) -> Array:
        """Value, low and high end of the 95 % band of the column `header`, (3, n), in the unit of the header."""
        ends = [f"{header}{end}" for end in ("", ", low", ", high")]
        return self.table[ends].to_numpy(dtype=float).T


def read_comparison(document: Mapping[str, Any], file: Path | None = None) -> ComparisonFile:
    """Validate the content of a `compare.json`.

    Args:
        document: content of compare.json.
        file: file that the document was read from, for error messages.

    Returns:
        The comparison.

    Raises:
        ModelError: another schema, a missing or wrong key, or results that do not belong together.
    """
    require_schema(document, file, "a comparison", SCHEMA, hint="bushfit compare writes it again")
    comparison = validate_tables(document, file, ComparisonFile, kind=ModelError)
    first, *others = labels = [entry.label for entry in comparison.compared] or [""]
    pairs = [(pair.reference, pair.other) for pair in comparison.pairs]
    places = {tuple(pair.places) for pair in comparison.pairs}
    families = [family.label for family in comparison.families or ()]
    is_complete = others and len(set(labels)) == len(labels) and pairs == [(first, label) for label in others]
    if not is_complete or len(places) != 1 or places == {()} or families not in ([], labels):
        rule = "each further result compared with the first, in the same directions and specimens"
        raise ModelError("the results do not fit together", file=file, place="pairs", expected=rule)
    return comparison


def place_differences(comparison: ComparisonFile) -> dict[str, list[PlaceDifferences]]:
    """Differences in stiffness and loss factor from the reference; the quantity may be a stiffness or a modulus.

    Returns:
        Differences of each other result, by direction or specimen.

    Raises:
        ModelError: a column of a pair is missing or empty, or columns have different lengths.
    """
    by_place = defaultdict[str, list[PlaceDifferences]](list)
    for label, places in [(pair.other, pair.places) for pair in comparison.pairs]:
        for place, columns in places.items():
            _, amplitude, stiffness, *_ = [*columns, *contrast_headers("", "")]
            stiffness = stiffness.removeprefix("reference ")
            if [*columns] != contrast_headers(amplitude, stiffness) or len({0, *map(len, columns.values())}) != 2:
                raise ModelError(
                    "columns are missing, empty or of unequal length",
                    place=f"pairs, {label}, places, {place}",
                    expected="the columns that bushfit compare writes, equally long",
                )
            types = {header: float for header in columns if not header.endswith(", significant")}
            table = pd.DataFrame({"other": label, "direction": place, **columns}).astype(types)
            by_place[place].append(PlaceDifferences(label, place, table, amplitude, stiffness))
    return by_place


def parameter_differences_table(comparison: ComparisonFile) -> pd.DataFrame:
    """Table of the differences of parameters, parameters.csv.

    Returns:
        A row per parameter and pair of results: values, difference with its 95 % interval, and probability by chance.
    """
    rows = [
        {
            "parameter": row.name,
            "unit": row.unit,
            "reference": pair.reference,
            "other": pair.other,
            "reference value": row.reference,
            "other value": row.other,
            "difference": row.difference,
            "difference, low": row.interval and row.interval[0],
            "difference, high": row.interval and row.interval[1],
            "difference type": "relative" if row.relative else "absolute",
            "p": row.p,
            "p (Holm)": row.holm,
            "note": row.note,
        }
        for pair in comparison.pairs
        for row in pair.parameters
    ]
    return pd.DataFrame(rows)


def differences_table(comparison: ComparisonFile) -> pd.DataFrame:
    """Table of the differences of stiffness and loss factor, differences.csv: a row per pair and operating point.

    Returns:
        Letter of the other result, direction or specimen, and the columns of `contrast_columns`: frequency, amplitude,
        values of both results and their differences, with 95 % bands.
    """
    by_result = zip(*place_differences(comparison).values(), strict=True)
    return pd.concat([one.table for of_result in by_result for one in of_result], ignore_index=True)


def families_table(families: Sequence[FamilyEntry]) -> pd.DataFrame:
    """Table of the compared model families, families.csv.

    Returns:
        A row per family: name, parameters, reduced chi-square, BIC, held-out error, gain, p-value and probability.
    """
    rows = [
        {
            "label": family.label,
            "family": family.name,
            "parameters": family.parameters,
            "reduced chi-square": family.reduced_chi_square,
            "BIC minus that of the first": family.bic - families[0].bic,
            "held out [noise]": family.heldout,
            "held out, first family [noise]": family.first_there,
            "held-out parts": len(family.parts),
            **dict(zip(_GAIN_HEADERS, family.gain or (None, None, None), strict=True)),
            "p (Holm)": family.p,
            "probability": family.probability,
            "held-out result": family.words,
        }
        for family in families
    ]
    return pd.DataFrame(rows)


def family_cells(comparison: ComparisonFile) -> Iterator[list[str]]:
    """Rows of the table of model families (sets of effects, fitted to the same tests), as formatted texts.

    Returns:
        An iterator over the families. Eight texts each: letter and name, number of parameters, NRMSE, reduced
        chi-square, probability, rms residual [noise] of the held-out parts with this and with the first family, and
        number of held-out parts, such as "3 of 4".
    """
    for family, entry in zip(comparison.families or (), comparison.compared, strict=False):
        parts = len(family.parts)
        yield [
            f"{family.label}: {family.name.replace('+', ' + ')}",
            str(family.parameters),
            "" if entry.nrmse is None else f"{number(100.0 * entry.nrmse, 2)} %",
            number(family.reduced_chi_square, 3),
            f"{number(100.0 * family.probability, 2)} %" if family.probability >= 1e-3 else "< 0.1 %",
            *("" if size is None else number(size, 3) for size in (family.heldout, family.first_there)),
            f"{parts} of {parts + len(family.skipped)}",
        ]


def parameter_cells(row: ParameterContrast) -> list[str]:
    """Format the comparison of one parameter as the cells of a table row.

    Returns:
        Seven texts: name, value of the reference, value of the other result, difference, 95 % interval of the
        difference (or the reason why it was not tested), probability by chance, and display unit of the values.
    """
    unit, factor = display_unit(row.unit, 1.0, row.reference)
    values = [number(value * factor, _DIGITS) for value in (row.reference, row.other)]
    if row.difference is None or row.interval is None or row.holm is None:
        return [row.name, *values, "", row.note, "", unit]
    scale, percent = (100.0, " %") if row.relative else (factor, "")
    low, high = (scale * end for end in row.interval)
    difference, *ends = (format_difference(value * scale, high - low) for value in (row.difference, *row.interval))
    return [row.name, *values, difference + percent, " to ".join(ends), format_p_value(row.holm), unit]


def format_difference(value: float, width: float) -> str:
    """Format a difference with its sign, to two significant digits of its interval.

    Args:
        value: difference, in any unit.
        width: width of its 95 % interval, in the same unit; infinite if unknown.
    """
    if width >= _OPEN:
        return number(value, 2, "+")
    decimals = max(1 - math.floor(math.log10(width)), 0) if width > 0.0 else _DIGITS
    decimals = min(decimals, _MOST_DECIMALS)
    return f"{value:+z.{decimals}f}"


def format_p_value(p: float) -> str:
    """Format a probability with two significant digits, or as "< 0.001"."""
    return f"< {_LEAST_PROBABILITY:g}" if p < _LEAST_PROBABILITY else number(p, 2)
