"""What the name of a file or sheet, and the lines above its table, say of its test: amplitude, direction and so on."""

import re
import unicodedata
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from functools import reduce
from pathlib import Path
from typing import Any, NamedTuple

from bushfit import units
from bushfit.errors import UnitError
from bushfit.geometry import Direction
from bushfit.reading.headers import SWEEP_COLUMNS, WORDS, AmplitudeConvention, Vocabulary, plain, split_convention
from bushfit.reading.layout import Line

#: Units as names have them, in lower case, with the usual spelling of those that have another one elsewhere.
_UNITS = {
    **{"mm": "mm", "um": "µm", "µm": "µm", "μm": "µm", "deg": "deg", "grad": "deg", "rad": "rad"},
    **{"%": "%", "pct": "%", "mhz": "mHz", "hz": "Hz", "n": "N", "kn": "kN"},
    **{"degc": "degC", "gradc": "degC", "grdc": "degC", "°c": "degC", "c": "degC"},
}
#: A quantity in a name, "0.5mm", "A0,5 mm", "0p5mm", "10Hz", "2deg", with the word before it and its sign; not the
#: "20Hz" of "5-20Hz" nor "10mm_min".
_QUANTITY = re.compile(
    r"(?<![^\W_])(?<!\d[.,-])(?:(?P<word>[^\W\d_]+)(?P<gap>[\s_=:]*))?(?P<sign>\+/?-|±|-|\+)?\s*"
    r"(?P<number>\d+(?:[.,p]\d+)?)[ _-]?"
    rf"(?P<unit>{'|'.join(sorted(_UNITS, key=len, reverse=True))})(?=[^A-Za-z]|pp|pkpk|ss|spsp|$)"
    r"(?![\s/_-]*(?:(?:per|pro|p)[\s_-]*)?(?:min|s|sec)(?![A-Za-z]|-s))",
    re.IGNORECASE,
)
#: Words, glued to a number or before it, that say what it is: an amplitude, a preload, a size and so on.
_WORDS = {meant: frozenset(words) for meant, words in WORDS["beside"].items()}
#: A date: 2024-05-03, 2024_05_03, 20240503 or 03.05.2024.
_DATE = re.compile(
    r"(?<!\d)(?:20\d\d([-_.]?)(?:0[1-9]|1[0-2])\1(?:0[1-9]|[12]\d|3[01])"
    r"|(?:0?[1-9]|[12]\d|3[01])\.(?:0?[1-9]|1[0-2])\.20\d\d)(?!\d)"
)
#: A number of a specimen: "SN12", "Nr. 7", "Probe_3", "#4".
_SPECIMEN_NUMBER = re.compile(
    r"(?:(?<![^\W_])(?:s[/_]?n|serial|nr|no|probe|specimen|sample|muster|prüfling|pruefling|éprouvette|probeta)|#)"
    r"[\s_.:#-]*(\d[A-Za-z0-9]*)(?![^\W_]|[.,]\d)",
    re.IGNORECASE,
)
#: What the temperature of a test may be [degC], so that a part's number with a C is none; chosen.
_TEMPERATURES = (-100.0, 300.0)
#: What the lines above a table may state, by the names that it goes by; amplitude and frequency are headers.
_KEY_OF = {plain(name): key for key, names in WORDS["above"].items() for name in names}
#: The names that an amplitude and a frequency go by there.
_VOCABULARY = Vocabulary({role: SWEEP_COLUMNS[role] for role in ("frequency", "amplitude")}, {})
#: What parts a key from its value above a table.
_AFTER_KEY = re.compile(r"\t|;|:\s|:$|\s=\s|=|,(?!\d)")
#: A decimal comma of the number that begins a value.
_COMMA = re.compile(r"^([+-]?\d+),(?=\d+(?!\d|[.,]\d))")
#: Characters of the longest value above a table that is taken; chosen: a longer one is a text.
_LONGEST_VALUE = 60

#: For the starts of words, without accents, the direction they name.
_WORD_STARTS = {start: Direction(named) for named, starts in WORDS["direction"].items() for start in starts}
#: Short for a direction in names; in headers rad is a unit.
_SHORT = {"ax": Direction.AXIAL, "rad": Direction.RADIAL, "tors": Direction.TORSION, "tor": Direction.TORSION}
#: A word, without the letters of a unit behind a number.
_WORD = re.compile(r"(?<![a-z\d.,])(?:[a-z]+)")


class Quantity(NamedTuple):
    """A quantity such as "0.05 mm" as a name has it; `is_marked` where a word or sign says that it is the amplitude."""

    text: str
    unit: str
    is_marked: bool = False
    convention: AmplitudeConvention | None = None


@dataclass(frozen=True)
class Labels:
    """What is said of a test outside its table: `quantities` that may be its amplitude or frequency, and keys."""

    quantities: tuple[Quantity, ...] = ()
    direction: Direction | None = None
    temperature: str | None = None
    preload: str | None = None
    date: str | None = None
    operator: str | None = None
    specimen_number: str | None = None

    def of(self, expected: str) -> list[Quantity]:
        """The quantities of the dimension of a unit, each once; those that are marked alone, if any is."""
        found = [each for each in dict.fromkeys(self.quantities) if units.is_compatible(each.unit, expected)]
        return [each for each in found if each.is_marked] or found

    def __or__(self, other: "Labels") -> "Labels":
        """What both say; what this one says goes first."""
        own = {unit for unit in ("m", "rad", "1", "Hz") if self.of(unit)}
        more = tuple(each for each in other.quantities if not any(units.is_compatible(each.unit, unit) for unit in own))
        either = {field.name: getattr(self, field.name) or getattr(other, field.name) for field in fields(self)}
        return Labels(**{**either, "quantities": self.quantities + more})


#: Where nothing is said.
NO_LABELS = Labels()


def labels_in_names(*names: str) -> Labels:
    """What names say of a test, such as those of its sheet and its file; what an earlier one says goes first.

    Only a number with its unit counts: dates and numbers of parts are no amplitudes.
    """
    return reduce(lambda labels, name: labels | _labels_in_name(unicodedata.normalize("NFC", name)), names, Labels())


def _labels_in_name(name: str) -> Labels:
    date, rest = _DATE.search(name), _DATE.sub(" ", name)
    number = _SPECIMEN_NUMBER.search(rest)
    quantities: list[Quantity] = []
    stated: dict[str, Any] = {"date": date and date[0], "specimen_number": number and number[1]}
    for match in _QUANTITY.finditer(rest):
        word, is_glued = plain(match["word"] or ""), bool(match["word"]) and not match["gap"] and not match["sign"]
        unit, digits = _UNITS[match["unit"].lower()], re.sub("[,p]", ".", match["number"].lower())
        # a dash after a word parts it from the number, unless the word says what the number is
        known = (
            word in _WORDS["preload"] | _WORDS["temperature"] | _WORDS["force"]
            or not match["word"]
            or bool(match["gap"])
        )
        text = f"{'-' if match['sign'] == '-' and known else ''}{float(digits):g} {unit}"
        if word in _WORDS["preload"] or (unit in ("N", "kN") and word in _WORDS["force"]):
            stated.setdefault("preload", text)
        elif unit == "degC":
            is_plain = match["unit"].lower() != "c" or len(match["number"]) > 1
            low, high = _TEMPERATURES
            is_said = word in _WORDS["temperature"] or (is_plain and not is_glued)
            if is_said and low < float(text.split()[0]) < high:
                stated.setdefault("temperature", text)
        elif unit not in ("N", "kN") and float(text.split()[0]) > 0.0:
            quantities += _amplitude_or_frequency(word, match, rest, text, unit, is_glued=is_glued)
    return Labels(tuple(quantities), named_direction([name], short=True), **stated)


def _amplitude_or_frequency(
    word: str, match: re.Match[str], name: str, text: str, unit: str, *, is_glued: bool
) -> list[Quantity]:
    """The quantity of a match, unless a word beside it says that it is another one."""
    if unit in ("Hz", "mHz"):
        is_frequency = word in _WORDS["frequency"]
        return [Quantity(text, unit, is_frequency)] if is_frequency or not is_glued else []
    padded = re.match(r"0\d", match["number"])  # "05mm" may be 5 mm or 0.5 mm
    if padded or word in _WORDS["size"] or (is_glued and word not in _WORDS["amplitude"]):
        return []
    is_peak = match["sign"] in ("+-", "+/-", "±")
    convention = "zero-to-peak" if is_peak else split_convention(name[match.end("unit") :])[1]
    return [Quantity(text, unit, is_peak or word in _WORDS["amplitude"], convention)]


def labels_above(lines: Iterable[Line]) -> Labels:
    """What lines such as those above a table state of its test: each a name and a value, as "Temperature: 23 degC".

    What is not understood is left out; so is a quantity without a unit.
    """
    return reduce(lambda labels, line: labels | _label_above(line), lines, Labels())


def _label_above(line: Line) -> Labels:
    cells = _cells(line)
    if len(cells) < 2 or len(cells[0]) > _LONGEST_VALUE:
        return Labels()
    name, unit = units.split_header(cells[0])
    values = [_COMMA.sub(r"\1.", value) for value in (cells[1], " ".join(cells[1:3]), f"{cells[1]} {unit or ''}")]
    key = _KEY_OF.get(plain(name))
    if key in ("date", "operator", "specimen_number"):
        is_value = len(cells[1]) <= _LONGEST_VALUE and plain(cells[1]) not in _KEY_OF  # else a row of headers
        stated: dict[str, Any] = {key: cells[1]} if is_value else {}
        return Labels(**stated)
    for value in values:
        if key == "temperature" and _is_quantity(value, "K"):
            return Labels(temperature=value)
        if key == "preload" and (_is_quantity(value, "m") or _is_quantity(value, "N")):
            return Labels(preload=value)
        heading = _VOCABULARY.heading(cells[0])
        if heading and heading.role in ("frequency", "amplitude") and not key:
            found = [unit for unit in ("Hz", "m", "rad", "1") if _is_quantity(value, unit) and value[0].isdigit()]
            if found and (found[0] == "Hz") == (heading.role == "frequency"):
                return Labels((Quantity(value, value.split()[-1], True, heading.convention),))
    return Labels()


def _cells(line: Line) -> Sequence[str]:
    """The filled cells of a line of a sheet, or key and value of a line of text."""
    if isinstance(line.content, str):
        cells = _AFTER_KEY.split(line.content.lstrip("#%/; "))
    else:
        cells = [cell if isinstance(cell, str) else f"{cell:.12g}" for cell in line.content]
        cells = [*_AFTER_KEY.split(cells[0], maxsplit=1), *cells[1:]]
    return [cell.strip(' "') for cell in cells if cell.strip(' "')]


def _is_quantity(text: str, expected: str) -> bool:
    """Whether a text is a quantity of the dimension of an SI unit."""
    try:
        units.parse_temperature(text) if expected == "K" else units.parse_quantity(text, expected)
    except UnitError:
        return False
    return True


def named_direction(texts: Iterable[str], *, short: bool = False) -> Direction | None:
    """The one direction that texts, such as headers, name; None where they name none or several.

    With `short`, "ax", "rad" and "tors" count as well, as in names of files.
    """
    plain = unicodedata.normalize("NFKD", " ".join(texts)).encode("ascii", "ignore").decode().casefold()
    found = {named for start, named in _WORD_STARTS.items() if re.search(rf"(?<![a-z]){start}", plain)}
    if short and not found:
        found = {_SHORT[word] for word in _WORD.findall(plain) if word in _SHORT}
    return found.pop() if len(found) == 1 else None


def direction_of_file(file: Path, headers: Iterable[str], *, turns: bool, sheet: str | None = None) -> Direction | None:
    """The direction that the file of a test names; None where it does not say.

    The name of its sheet goes before the file's, and that before the headers. Where the displacement `turns`, in units
    of angle, it is torsion unless another rotation is named.
    """
    named = named_direction([sheet or ""], short=True) or named_direction([file.stem], short=True)
    named = named or named_direction(headers)
    return Direction.TORSION if turns and not (named and named.is_rotation) else named
