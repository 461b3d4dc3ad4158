"""Labels of a test: amplitude, direction and conditions in the name of its file or sheet, and above its table."""

import re
import unicodedata
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from functools import reduce
from operator import or_
from pathlib import Path
from typing import Any, NamedTuple

from bushfit import units
from bushfit.errors import UnitError
from bushfit.geometry import Direction
from bushfit.reading.headers import (
    COUNTED,
    PEAK_TO_PEAK_NAMES,
    STRAINING_COLUMNS,
    SWEEP_COLUMNS,
    WORDS,
    AmplitudeConvention,
    Vocabulary,
    folded,
    plain,
    split_convention,
)
from bushfit.reading.lines import Line
from bushfit.reading.roles import X_UNIT_NAMES

#: Usual spelling of the units in names, by their spelling in lower case.
_UNITS = {spelling: unit for unit, spellings in WORDS["units_in_names"].items() for spelling in spellings}
_UNIT_WORDS = "|".join(sorted(_UNITS, key=len, reverse=True))
#: Quantity in a name, with its sign and the word before it: "0.5mm", "A0,5 mm", "0p5mm", "10Hz", "2deg"; but neither
#: "20Hz" in "5-20Hz" nor "10mm_min".
_QUANTITY = re.compile(
    r"(?<![^\W_])(?<!\d[.,-])(?<!\de-)(?:(?P<word>[^\W\d_]+)(?P<gap>[\s_=:]*))?(?P<sign>\+/?-|±|-|\+)?\s*"
    r"(?P<number>\d+(?:[.,p]\d+)?)[ _-]?"
    rf"(?P<unit>{_UNIT_WORDS})(?=[^A-Za-z]|pp|pkpk|ss|spsp|$)"
    r"(?![\s/_-]*(?:(?:per|pro|p)[\s_-]*)?(?:min|s|sec)(?![A-Za-z]|-s))",
    re.IGNORECASE,
)
#: Underscore or missing zero instead of a decimal point: "0_1mm", "_.1mm".
_LEADING_ZERO = re.compile(rf"(?:(?<![\d.,])0_|(?<![^\W_])\.)(?=\d+[ _-]?(?:{_UNIT_WORDS})(?![A-Za-z]))", re.IGNORECASE)
#: Whole number before an underscore, which may be the decimal point of the next number: "1_5mm", "A_1_5 mm".
_PERHAPS_DECIMAL = re.compile(r"(?:^|[^A-Za-z0-9]|(?<![A-Za-z])[AFTaft])\d{1,3}_$")
#: Words that can precede a number, by the kind of quantity that they announce: amplitude, preload, size and so on.
_WORDS = {kind: frozenset(words) for kind, words in WORDS["beside"].items()}
#: Date: 2024-05-03, 2024_05_03, 20240503 or 03.05.2024.
_DATE = re.compile(
    r"(?<!\d)(?:20\d\d([-_.]?)(?:0[1-9]|1[0-2])\1(?:0[1-9]|[12]\d|3[01])"
    r"|(?:0?[1-9]|[12]\d|3[01])\.(?:0?[1-9]|1[0-2])\.20\d\d)(?!\d)"
)
#: Number of a specimen, after a word or as "P01": "SN12", "Nr. 7", "Probe_3", "#4"; but not the size in "Probe 3mm",
#: nor the hardness of natural rubber in "NR55".
_SPECIMEN_NUMBER = re.compile(
    rf"(?:(?:(?<![^\W_])(?:s[/_]?n|serial|nr(?![_\W]?\d\d[_\W]?sh|-?\d)|no|"
    rf"(?:{'|'.join(WORDS['beside']['specimen'])})(?:[\W_]?nr)?)|#)"
    rf"[\s_.:#-]*(?!\d+[.,]?\d*[\s_]?(?:{_UNIT_WORDS})(?![A-Za-z]))|(?<![^\W_])"
    r"(?=P\d{2,4}(?![^\W_])))(P?\d[A-Za-z0-9]*)(?![^\W_]|[.,]\d)",
    re.IGNORECASE,
)
#: Duration of a treatment, whose temperature is not that of the test: "168 h", "24 Std", "7 days".
_DURATION = re.compile(
    r"(?<![\w.,])\d+(?:[.,]\d+)?[\s_]?(?:h|hrs?|hours?|std|stunden|days?|tage|weeks?|heures?|jours?)(?![^\W_])",
    re.IGNORECASE,
)
#: Range of test temperatures [degC]; chosen: a number with a C outside this range is part of a part number.
_TEMPERATURES = (-100.0, 300.0)
#: Key of a campaign by each of its usual names above a table.
_STATED_ABOVE = {**WORDS["above"], "direction": WORDS["rows"]["direction"], "preload": SWEEP_COLUMNS["preload"]}
_KEY_OF = {plain(name): key for key, names in _STATED_ABOVE.items() for name in names}
#: Names of the step between rows, whose unit is that of the x axis.
_STEPS = frozenset(map(plain, WORDS["rows_of"]["steps"]))
#: SI unit of the two keys for the time between rows.
_SAMPLING = {"sampling_rate": "Hz", "sampling_interval": "s"}
#: Usual names of amplitude and frequency above a table.
_AMPLITUDES = [*SWEEP_COLUMNS["amplitude"], *STRAINING_COLUMNS["amplitude"]]
_VOCABULARY = Vocabulary({"frequency": SWEEP_COLUMNS["frequency"], "amplitude": _AMPLITUDES})
#: Separator between a name and its value above a table.
_AFTER_KEY = re.compile(r"\t|;|:\s|:$|\s=\s|=|,(?!\d)|(?<=[^\W\d]),|(?<=[)\]]),")
#: Blank between a name and its value at the end of a line: "Sample rate 512 Hz".
_BEFORE_VALUE = re.compile(r"\s+(?=\d[\d.,]*(?:\s*[^\W\d]\S*)?$)")
#: Name and value with unit in a line: "1 V = 200 N", "Crosshead speed: 10 mm/min".
_NAMED_QUANTITY = re.compile(
    r"(?P<name>[^\t;,:=]*?)\s*[=:]\s*(?P<number>[+-]?\d+(?:[.,]\d+)?)\s*(?P<unit>[^\s\d,;]+(?:\s*/\s*[^\s\d,;]+)?)"
)
#: Separator of several statements in a line: "Temp: 23 C, Preload: 500 N".
_PARTS_OF_LINE = re.compile(r"[,;|]\s+|\s/\s|\t")
#: Decimal comma of a number at the start of a value; the comma of 1,500 may separate thousands.
_COMMA = re.compile(r"^([+-]?0|[+-]?\d+(?=,(?!\d{3}(?!\d)))),(?=\d+(?!\d|[.,]\d))")
#: Unit of a sampling rate in samples: "kS/s", "samples/s", "SPS".
_SAMPLES = re.compile(r"^(k|M)?(?:sps|(?:s|sa|samples?|pts|points|scans?)\s?/\s?s(?:ec)?)$", re.IGNORECASE)
#: Number with a decimal mark or exponent, and its unit, if any.
_NUMBER_AND_UNIT = re.compile(r"(?P<number>\d[\d.,']*(?:[eE][+-]?\d+)?)\s*(?P<unit>\D.*?)\s*")
#: Characters of the longest line of running text; chosen: a line or two of a page.
_LONGEST_TEXT = 200
#: Characters of the longest value above a table; chosen: a longer one is a text.
_LONGEST_VALUE = 60

#: Direction by the start of a word, without accents.
_WORD_STARTS = {start: Direction(name) for name, starts in WORDS["direction"].items() for start in starts}
#: Direction by its abbreviation in names; in headers rad is a unit.
_SHORT = {"ax": Direction.AXIAL, "rad": Direction.RADIAL, "tors": Direction.TORSION, "tor": Direction.TORSION}
_LETTERS = re.compile(r"[^\W\d_]+")
#: Starts of words, and phrases, in remarks that may change what a test means.
_REMARKS, _REMARK_PHRASES = tuple(WORDS["remarks"]["starts"]), re.compile("|".join(WORDS["remarks"]["phrases"]))
#: Texts that name a coupon of rubber rather than a bushing.
_COUPON = re.compile("|".join(WORDS["coupon"]["words"]))
#: Word that is not a unit after a number.
_WORD = re.compile(r"(?<![a-z\d.,])(?:[a-z]+)")


class StatedQuantity(NamedTuple):
    """Quantity with a unit in a name or in a line above a table.

    Args:
        text: number and unit, such as "0.05 mm".
        unit: unit alone, such as "mm".
        is_marked: True if a word or sign identifies the quantity as the amplitude or frequency of the test.
        convention: convention of an amplitude; None if it is not stated.
    """

    text: str
    unit: str
    is_marked: bool = False
    convention: AmplitudeConvention | None = None


@dataclass(frozen=True)
class Labels:
    """Information on a test from the name of its file or sheet and from the lines above its table.

    Args:
        quantities: quantities that may be the amplitude or frequency of the test.
        direction: direction of the bushing; None if it is not named.
        temperature, preload, date, operator, specimen_number: values for these keys of a campaign, as texts such as
            "23 degC" and "500 N".
        part_number: number of the part, which replaces `specimen_number` above a table if that is not stated.
        sampling: sampling rate or interval of a record, such as "500 Hz" or "2 ms".
        convention: convention of the amplitudes in the table, "zero-to-peak" or "peak-to-peak".
        force: force in a name without a word for its meaning; the preload if the names of several tests differ in it.
    """

    quantities: tuple[StatedQuantity, ...] = ()
    direction: Direction | None = None
    temperature: str | None = None
    preload: str | None = None
    date: str | None = None
    operator: str | None = None
    specimen_number: str | None = None
    part_number: str | None = None
    sampling: str | None = None
    convention: AmplitudeConvention | None = None
    force: str | None = None

    def of_dimension(self, unit: str) -> list[StatedQuantity]:
        """Return the distinct quantities with the dimension of an SI unit; if any is marked, only marked quantities."""
        fitting = [quantity for quantity in dict.fromkeys(self.quantities) if units.is_compatible(quantity.unit, unit)]
        return [quantity for quantity in fitting if quantity.is_marked] or fitting

    def __or__(self, labels: "Labels") -> "Labels":
        """Combine two sets of labels; values on the left take precedence."""
        dimensions = [unit for unit in ("m", "rad", "1", "Hz") if self.of_dimension(unit)]
        added = (
            quantity
            for quantity in labels.quantities
            if not any(units.is_compatible(quantity.unit, unit) for unit in dimensions)
        )
        values = {field.name: getattr(self, field.name) or getattr(labels, field.name) for field in fields(self)}
        return Labels(**{**values, "quantities": (*self.quantities, *added)})


#: Labels without any information.
NO_LABELS = Labels()


def labels_in_names(*names: str) -> Labels:
    """Extract the labels of a test from names, such as those of its sheet and file; earlier names take precedence.

    Numbers without a unit, such as dates and part numbers, are not read as amplitudes.
    """
    normalized = (unicodedata.normalize("NFC", name) for name in names)
    return reduce(or_, map(_labels_in_name, normalized), NO_LABELS)


def _labels_in_name(name: str) -> Labels:
    """Information on a test (quantities, direction, conditions) in the name of a file, sheet or block."""
    date, rest = _DATE.search(name), _LEADING_ZERO.sub("0.", _DATE.sub(" ", name))
    number = _SPECIMEN_NUMBER.search(rest)
    quantities: list[StatedQuantity] = []
    values: dict[str, Any] = {"date": date and date[0], "specimen_number": number and number[1]}
    for match in _QUANTITY.finditer(rest):
        if match["number"].isdecimal() and _PERHAPS_DECIMAL.search(rest[: match.start("number")]):
            continue
        if re.fullmatch(r"[1-9]\d{0,2},\d{3}", match["number"]):
            continue  # "1,500N" may be 1500 N or 1.5 N
        word, sign = plain(match["word"] or ""), match["sign"]
        is_joined = bool(match["word"]) and not match["gap"] and not sign
        unit, digits = _UNITS[match["unit"].lower()], re.sub("[,p]", ".", match["number"].lower())
        announced = word in _WORDS["preload"] | _WORDS["temperature"] | _WORDS["force"]
        # a dash after another word is no sign
        is_negative = sign == "-" and (announced or not match["word"] or bool(match["gap"]))
        text, value = f"{'-' * is_negative}{float(digits):g} {unit}", float(digits) * (-1.0 if is_negative else 1.0)
        is_peak = sign in ("+-", "+/-", "±")
        if word in _WORDS["preload"] or (unit in ("N", "kN") and word in _WORDS["force"]):
            values.setdefault("preload", text)
        elif unit == "degC":
            is_sure = len(match["unit"]) > 1 or (match["unit"] == "C" and re.match(r"[1-9]\d|\d\D", match["number"]))
            is_plain = bool(is_sure) and not is_joined and not _DURATION.search(rest.replace("_", " "))
            if (is_plain or word in _WORDS["temperature"]) and _TEMPERATURES[0] < value < _TEMPERATURES[1]:
                values.setdefault("temperature", text)
        elif unit in ("N", "kN"):
            values |= {} if is_joined else {"force": text}
        elif value <= 0.0:
            continue
        elif unit in ("Hz", "mHz"):
            if word in _WORDS["frequency"] or not is_joined:
                quantities.append(StatedQuantity(text, unit, word in _WORDS["frequency"]))
        elif re.match(r"0\d", match["number"]):
            continue  # "05mm" may be 5 mm or 0.5 mm
        elif word in _WORDS["amplitude"] or not (word in _WORDS["size"] or is_joined):
            convention = "zero-to-peak" if is_peak else split_convention(rest[match.end("unit") :])[1]
            quantities.append(StatedQuantity(text, unit, is_peak or word in _WORDS["amplitude"], convention))
    return Labels(tuple(quantities), named_direction([name], short=True), **values)


def labels_above(lines: Iterable[Line]) -> Labels:
    """Extract the labels of a test from lines above its table, such as "Temperature: 23 degC".

    Unknown names and quantities without a unit are ignored.

    Args:
        lines: lines above the table.

    Returns:
        Labels that all lines together state.
    """
    lines = list(lines)
    conventions = {found for line in lines if (found := _convention_in_line(line))}
    convention = conventions.pop() if len(conventions) == 1 else None
    rows = map(name_and_values, lines)
    x_units = (row[1] for row in rows if len(row) > 1 and plain(row[0]) in X_UNIT_NAMES)
    x_unit = next(filter(units.is_unit, x_units), "s")
    parts = [Line(line.number, part) for line in lines for part in (line.content, *_PARTS_OF_LINE.split(line.text))]
    labels = reduce(or_, (_label_in_line(line, x_unit) for line in parts), Labels(convention=convention))
    return labels | Labels(specimen_number=labels.part_number)


def labels_and_text_above(lines: Sequence[Line]) -> Labels:
    """Labels of a test in lines above its table, and its temperature if running text above the table states one."""
    labels = [_labels_in_name(line.text) for line in lines if len(line.text) <= _LONGEST_TEXT]
    temperatures = {one.temperature for one in labels} - {None}
    return labels_above(lines) | Labels(temperature=temperatures.pop() if len(temperatures) == 1 else None)


def _convention_in_line(line: Line) -> AmplitudeConvention | None:
    """Convention of amplitudes in a line such as "all amplitudes pk-pk"; None for any other line."""
    words = set(map(plain, _LETTERS.findall(line.text)))
    if words & _WORDS["force"] or not any(word.startswith(tuple(_WORDS["motion"])) for word in words):
        return None
    doubled = any(name in plain(line.text) for name in PEAK_TO_PEAK_NAMES if len(name) > 3 or not name.isascii())
    return "peak-to-peak" if doubled else split_convention(line.text)[1]


def is_remark(text: str) -> bool:
    """True if a text may change the meaning of a test but fits no key of a campaign, such as "2 in parallel"."""
    starts = any(plain(word).startswith(_REMARKS) for word in _LETTERS.findall(text))
    return starts or _REMARK_PHRASES.search(folded(text)) is not None


def names_coupon(text: str) -> bool:
    """True if a text names a coupon or its standard, such as "Specimen: quad shear" or "ISO 1827"."""
    return _COUPON.search(folded(text)) is not None


def name_and_values(line: Line) -> list[str]:
    """Split a line of text or row of a sheet into a name and its values.

    Returns:
        Texts of the name and of each value; one text if the line has no value.
    """
    if isinstance(line.content, str):
        cells = _AFTER_KEY.split(line.content.lstrip("#%/; "))
    else:
        cells = [cell if isinstance(cell, str) else f"{cell:.12g}" for cell in line.content]
        cells = [*_AFTER_KEY.split(cells[0], maxsplit=1), *cells[1:]]
    cells = [cell.strip(' "') for cell in cells if cell.strip(' "')]
    if len(cells) == 1 and (end := _BEFORE_VALUE.search(split_convention(cells[0])[0])):
        convention = split_convention(cells[0])[1]
        cells = [end.string[: end.start()], end.string[end.end() :] + COUNTED[convention]]
    return cells


def _label_in_line(line: Line, x_unit: str) -> Labels:
    """Label in a line that has a name and a value; no labels in any other line.

    Args:
        line: line of text or row of a sheet.
        x_unit: unit of the step between rows, such as dx, if the line states none.
    """
    cells = name_and_values(line)
    if len(cells) < 2 or len(cells[0]) > _LONGEST_VALUE:
        return NO_LABELS
    (name, unit), heading = units.split_header(cells[0]), _VOCABULARY.heading(cells[0])
    unit = unit or (heading.unit if heading else None)
    values: dict[str, Any] = {}
    key, forms = _KEY_OF.get(plain(name)), (cells[1], " ".join(cells[1:3]), f"{cells[1]} {unit or ''}")
    if key in ("date", "operator", "specimen_number", "part_number"):
        is_header = plain(cells[1]) in _KEY_OF or units.split_header(cells[1])[1] is not None
        is_value = len(cells[1]) <= _LONGEST_VALUE and not (is_header or names_coupon(cells[1]))
        values = {key: cells[1]} if is_value else {}
        return Labels(**values)
    if key == "direction":
        return Labels(direction=named_direction([cells[1]], short=True))
    if key in _SAMPLING:
        usual = "Hz" if key == "sampling_rate" else x_unit if plain(name) in _STEPS else ""
        for form in (*forms[:2], f"{cells[1]} {unit or usual}"):
            match = _NUMBER_AND_UNIT.fullmatch(form)
            if match and units.is_compatible(rate_unit := _SAMPLES.sub(r"\1Hz", match["unit"]), _SAMPLING[key]):
                return Labels(sampling=f"{match['number']} {rate_unit}")
    expected = {"temperature": ["K"], "preload": ["m", "N"]}.get(key or "", [])
    for text in (_COMMA.sub(r"\1.", form) for form in forms):
        if any(_is_quantity(text, unit) for unit in expected):
            values = {str(key): text}
            return Labels(**values)
        number, convention = split_convention(text)
        if heading and not key and number[:1].isdigit():
            fitting = [si for si in ("Hz", "m", "rad", "1") if _is_quantity(number, si)]
            if fitting and (fitting[0] == "Hz") == (heading.role == "frequency"):
                return Labels((StatedQuantity(number, number.split()[-1], True, heading.convention or convention),))
    return NO_LABELS


def named_quantities(line: Line) -> dict[str, tuple[str, str]]:
    """Number and unit of each quantity behind "=" or ":" in a line above a table, by its name."""
    matches = _NAMED_QUANTITY.finditer(line.text)
    return {match["name"].strip(' "#'): (match["number"].replace(",", "."), match["unit"]) for match in matches}


def _is_quantity(text: str, unit: str) -> bool:
    """Return True if a text is a quantity with the dimension of an SI unit."""
    try:
        units.parse_temperature(text) if unit == "K" else units.parse_quantity(text, unit)
    except UnitError:
        return False
    return True


def named_direction(texts: Iterable[str], *, short: bool = False) -> Direction | None:
    """Return the direction of the bushing that headers or names contain; None if they name none or several.

    With `short`, the abbreviations "ax", "rad" and "tors" are recognised too, as in file names.
    """
    text = folded(" ".join(texts))
    directions = {direction for start, direction in _WORD_STARTS.items() if re.search(rf"(?<![a-z]){start}", text)}
    if short and not directions:
        directions = {_SHORT[word] for word in _WORD.findall(text) if word in _SHORT}
    return directions.pop() if len(directions) == 1 else None


def direction_of_file(file: Path, headers: Iterable[str], *, turns: bool, sheet: str | None = None) -> Direction | None:
    """Direction that a sheet name, or else the file name, or else the headers contain; None if none of them does.

    Args:
        file: path of the test file.
        headers: column headers of the table.
        turns: True if the displacement is an angle; the direction is then torsion unless another rotation is named.
        sheet: name of the sheet; None if there is none.
    """
    direction = labels_in_names(sheet or "", file.stem).direction or named_direction(headers)
    return Direction.TORSION if turns and not (direction and direction.is_rotation) else direction
