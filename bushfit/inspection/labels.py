"""Labels of a test in names and in the lines above its table: values for keys of a campaign, and contradictions."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from bushfit.caveat import Caveat
from bushfit.geometry import Place
from bushfit.reading.headers import HINTS, ZERO_TO_PEAK, AmplitudeConvention, plain
from bushfit.reading.levels import ONE_TEST, read_condition
from bushfit.reading.names import Labels, StatedQuantity, labels_in_names
from bushfit.reading.roles import UNIT_NAMES
from bushfit.reading.si_columns import columns_key
from bushfit.reading.table import Table
from bushfit.reading.times import sampling_rate_above
from bushfit.units import common_unit, is_compatible, is_unit, parse_quantity, parse_temperature, si_factor

#: Conditions of a test that a campaign states, with their names in sentences.
_CONDITIONS = {key: key for key in ("temperature", "preload", "date", "operator")} | {"specimen_number": "specimen"}
#: Role of the quantity that a sweep keeps constant, by the campaign key that states its value.
_CONSTANT_ROLES = {"at_amplitude": "amplitude", "at_frequency": "frequency"}

#: Word or unit in a line of text; and a unit after the word "in", as in "Force in kN".
_WORD, _IN_UNIT = re.compile(r"[^\s,;:|=()\[\]{}]+"), re.compile(r"\w in \w", re.IGNORECASE)
#: Relative difference up to which a measured value agrees with a label; chosen: rigs miss levels by it.
_AGREEMENT = 0.03


def count_temperatures(table: Table) -> int:
    """Number of temperatures in the columns of a table: 0 without such a column."""
    condition = read_condition(table, "temperature", table.motion)
    return len(condition.levels(np.arange(condition.values.size))) if condition else 0


def labels_of_file(file: Path, sheet: str, test_options: Mapping[str, Any]) -> Labels:
    """Quantities and conditions in the names of a file and its sheet, such as "25 Hz"; the sheet takes precedence.

    Args:
        file: test file.
        sheet: name of the sheet, or "".
        test_options: what the user states on the test, by campaign key; the value of "amplitude" is the convention
            of amplitudes, "zero-to-peak" or "peak-to-peak".

    Returns:
        The quantities and conditions, as `Labels`.
    """
    labels = labels_in_names(sheet, file.stem)
    convention = test_options.get("amplitude")
    if convention is None:
        return labels
    quantities = [one if "Hz" in one.unit else one._replace(convention=convention) for one in labels.quantities]
    return replace(labels, quantities=tuple(quantities))


def keys_from_labels(
    table: Table, place: Place, test_options: Mapping[str, Any], by_name: Labels, of_book: Labels, *, is_sweep: bool
) -> tuple[dict[str, Any], dict[str, str], bool]:
    """Find values for the campaign keys of a test, such as temperature, in the texts around its columns (labels).

    An option takes precedence, then a column, the names, the lines above the table, and the other sheets.

    Args:
        table: table of the test.
        place: direction or specimen; it determines the unit of an amplitude.
        test_options: what the user states on the test, by campaign key such as "direction".
        by_name: labels in the names of file and sheet.
        of_book: labels in the other sheets of the workbook.
        is_sweep: True for a sweep, whose frequency and amplitude have to be known.

    Returns:
        The values by campaign key; for each origin (such as "from the name"), a sentence that lists the values from it;
        and False if a label states an amplitude but not whether the amplitude is zero-to-peak or peak-to-peak.

    Raises:
        MeasurementError: a sweep without an amplitude or a frequency, or two temperatures.
    """
    written = "from the lines above the table" if table.layout.header_line else "from the properties in the file"
    sources = {"from the name": by_name, written: table.labels_above, "from the other sheets": of_book}
    in_text = (quantity for line in table.lines_above for quantity in labels_in_names(line.text).quantities)
    is_amplitude = (quantity for quantity in in_text if quantity.convention or quantity.is_marked)
    counted = Labels(tuple(one for one in is_amplitude if "Hz" not in one.unit))  # "amplitude 0.4 mm", "0.4 mm pk-pk"
    keys: dict[str, Any] = {}
    facts: dict[str, list[str]] = {}
    has_convention = True
    for key, role in _CONSTANT_ROLES.items() if is_sweep else ():
        if role not in table.roles and key not in test_options:
            origin, quantity = _constant_quantity(table, place, key, {**sources, "from the text above": counted})
            conventions = (text.convention for text in counted.quantities if text.text == quantity.text)
            convention = test_options.get("amplitude") or quantity.convention or next(conventions, None)
            keys[key] = sentence = quantity.text
            if role == "amplitude" and convention in ("peak-to-peak", "rms"):
                keys[key] = _zero_to_peak(quantity.text, convention)
                factor = "half of" if convention == "peak-to-peak" else "the square root of two times the rms of"
                sentence = f"{keys[key]}, {factor} {quantity.text}"
            facts.setdefault(origin, []).append(f"{role} {sentence}")
            has_convention &= role != "amplitude" or convention is not None
    amplitude = table.roles.get("amplitude")
    for origin, labels in sources.items() if is_sweep and amplitude and "amplitude" not in test_options else ():
        if amplitude and labels.convention and not amplitude.convention:
            keys["amplitude"] = labels.convention
            facts.setdefault(origin, []).append(f"amplitudes {labels.convention}")
            break
    for key, name in _CONDITIONS.items():
        texts = {origin: text for origin, labels in sources.items() if (text := getattr(labels, key))}
        origin, text = next(iter(texts.items()), ("", ""))
        is_static = key != "preload" or origin == written or "force_amplitude" not in table.roles
        if text and key not in test_options and is_static and (key != "temperature" or key not in table.roles):
            if key == "temperature" and np.ptp([parse_temperature(one) for one in texts.values()]) > ONE_TEST:
                found = " and ".join(f"{one} {where}" for where, one in texts.items())
                hint = " or ".join(f'temperature = "{one}"' for one in texts.values())
                problem, hint = "two temperatures are stated for this test", f"state the right one: {hint}"
                raise table.header_error(problem, found=found, expected="one temperature", hint=hint)
            keys[key] = text
            facts.setdefault(origin, []).append(f"{name} {text}")
    return keys, {origin: ", ".join(sentences) for origin, sentences in facts.items()}, has_convention


def _zero_to_peak(amplitude: str, convention: AmplitudeConvention | None) -> str:
    """Convert the text of an amplitude, such as "0.4 mm", to zero-to-peak; without a convention it is unchanged."""
    size, _, unit = amplitude.partition(" ")
    return f"{float(size) * ZERO_TO_PEAK[convention or 'zero-to-peak']:.6g} {unit}"


def _constant_quantity(
    table: Table, place: Place, key: str, sources: Mapping[str, Labels]
) -> tuple[str, StatedQuantity]:
    """Find the constant amplitude or frequency of a sweep in the texts around its columns (labels).

    Args:
        table: table of the sweep.
        place: direction or specimen, which determines the unit of an amplitude.
        key: campaign key of the quantity: "at_amplitude" or "at_frequency".
        sources: labels by their origin, such as "from the name".

    Returns:
        Origin of the label, and the stated quantity.

    Raises:
        MeasurementError: no label states one such quantity.
    """
    role = _CONSTANT_ROLES[key]
    expected = place.motion.displacement_unit if role == "amplitude" else "Hz"
    quantities = {origin: texts for origin, labels in sources.items() if (texts := labels.of_dimension(expected))}
    origin, found = next(iter(quantities.items()), ("", []))
    if len(found) == 1:
        return origin, found[0]
    listed = [f"{quantity.text} {quantity.convention or ''}".rstrip() for quantity in found]
    sizes = [_zero_to_peak(quantity.text, quantity.convention) for quantity in found]
    state = " or ".join(f'{key} = "{size}"' for size in sizes or [f"... {common_unit(expected)[1]}"])
    state = f"state {state} in the campaign"
    if "block" in table.headers:
        state = f"{HINTS['level_of_blocks']} {key}"
    counting = ', with amplitude = "peak-to-peak" if it counts so' if role == "amplitude" else ""
    raise table.header_error(
        f"the {role} of this test is not stated",
        found=f"{origin}: {' and '.join(listed)}" if found else None,
        expected=f"a column for the {role}, or one number with its unit in the name of the file",
        hint=f"{state}, or name the column: {columns_key(table, role, expected)}{counting}",
    )


def wrong_labels(
    labels: Mapping[str, Labels],
    direction: Place,
    amplitudes: Sequence[float],
    frequencies: Sequence[float],
    sampling: float = 0.0,
) -> Iterator[Caveat]:
    """Warn where a name or a line above the table states an amplitude or a frequency that the file does not contain.

    Args:
        labels: stated quantities by their origin, "name" (of file and sheet) or "text above the table".
        direction: direction or specimen.
        amplitudes: zero-to-peak amplitudes in the file [m, rad or strain].
        frequencies: frequencies in the file [Hz].
        sampling: sampling rate of a record [Hz], which its name may state; 0 for a sweep.

    Returns:
        One warning for each wrong label.
    """
    unit, factor = direction.display.displacement
    quantities = (
        ("amplitude", direction.motion.displacement_unit, amplitudes, factor, f"{unit} zero-to-peak"),
        ("frequency", "Hz", frequencies, 1.0, "Hz"),
    )
    for origin, (name, expected, values, to_display, written) in product(labels, quantities):
        labelled = labels[origin].of_dimension(expected)
        factors = [ZERO_TO_PEAK[label.convention or "zero-to-peak"] for label in labelled]
        sizes = [factor * parse_quantity(label.text, expected) for label, factor in zip(labelled, factors, strict=True)]
        expected_values = [*values, sampling] if sampling and expected == "Hz" else values
        ratios = np.divide.outer(np.array(sizes), np.asarray(expected_values))
        if not labelled or np.any(np.abs(ratios - 1.0) <= _AGREEMENT):
            continue
        is_double = name == "amplitude" and np.any(np.abs(ratios - 2.0) <= 2.0 * _AGREEMENT)
        stated = dict.fromkeys(f"{label.text} {label.convention or ''}".rstrip() for label in labelled)
        in_file = list(dict.fromkeys(f"{to_display * value:.4g}" for value in values))
        in_file = in_file if len(in_file) <= 4 else [f"{in_file[0]} to {in_file[-1]}"]
        doubt = f": the {origin} may be peak-to-peak" if is_double else ""
        sentence = f"the {origin} states {' or '.join(stated)}, the {name} is {', '.join(in_file)} {written}{doubt}"
        yield Caveat("wrong_label", sentence)


def contradicting_lines(table: Table, time_step: float | None) -> Iterator[Caveat]:
    """Warn where a line above the table states another unit than a header, or another rate than the record has.

    Args:
        table: table of the test.
        time_step: recorded time from row to row [s]; None for a sweep, or if the file has no time.

    Yields:
        A warning for each contradiction.
    """
    for line in table.lines_above:
        words = [word for word in _WORD.findall(line.text) if word != "in"]
        units = [word for word in words if is_unit(word)]
        is_list_of_units = any(plain(word) in UNIT_NAMES for word in words) or _IN_UNIT.search(line.text)
        for column in table.roles.values() if is_list_of_units and not re.search(r"\d", line.text) else ():
            unit = column.unit or ""
            scales = [si_factor(word, unit) for word in units if unit and is_compatible(word, unit)]
            if scales and si_factor(unit, unit) not in scales:
                sentence = f'line {line.number} states "{line.text}", the unit of "{column.header}" is {unit}'
                yield Caveat("wrong_label", sentence)
    rate = sampling_rate_above(table)[0]
    if rate and time_step and abs(rate * time_step - 1.0) > _AGREEMENT:
        recorded = 1.0 / time_step
        sentence = f"the text above the table states {rate:.4g} rows a second, the recorded time {recorded:.4g}"
        yield Caveat("wrong_label", sentence)
