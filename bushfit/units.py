"""Conversion of texts such as "10 mm" and headers such as "force [kN]" to SI, and of SI values to display units.

Expected units are SI units: "m", "rad", "N*m/rad", "1" for a ratio. Only this module uses pint. Unlike in pint, an
angle is not a plain number: "deg" is compatible with "rad" but not with "1", and "rad/s" is not compatible with "Hz".
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Sequence
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bushfit.errors import UnitError

if TYPE_CHECKING:
    import pint

#: The words of units.toml, by table.
_WORDS: dict[str, dict[str, Any]] = tomllib.loads(Path(__file__).with_name("units.toml").read_text(encoding="utf-8"))
#: Quantity and an example of a common unit, by SI unit.
_KINDS: dict[str, tuple[str, str]] = {unit: tuple(words) for unit, words in _WORDS["kinds"].items()}
#: Display unit and factor from SI, by SI unit; MPa*s^alpha is the unit of the paper.
_WRITTEN: dict[str, tuple[str, float]] = {unit: tuple(words) for unit, words in _WORDS["written"].items()}
#: Least and largest plausible magnitude for a bushing, its tests or its rig, by SI unit.
_SIZES: dict[str, tuple[float, float]] = {unit: tuple(ends) for unit, ends in _WORDS["sizes"].items()}
#: Least and largest magnitude of all other units; powers of these are still finite.
SIZES = (1e-15, 1e15)
#: Zero of the Celsius scale [K].
CELSIUS = 273.15
#: Kelvin per unit and kelvin at zero, by unit of temperature.
_TEMPERATURES: dict[str, tuple[float, float]] = {
    word: (scale, zero) for words, (scale, zero) in _WORDS["temperatures"].items() for word in words.split()
}
#: Least magnitude that is written without an exponent: 0.0001, but 9e-5.
_LEAST_PLAIN = 1e-4
#: Magnitude from which numbers are written with an exponent: 9999999, but 1e7.
_LARGEST_PLAIN = 1e7
#: Significant digits that a float preserves.
_MOST_DIGITS = 15
#: A decimal number with a decimal point, and perhaps a power of ten.
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
#: One unit and perhaps its power, such as kN, mm^2, s**-1 or m⁻¹.
_FACTOR = r"(?:[^\W\d_]+|[%‰°1])(?:(?:\^|\*\*)-?[1-9]|⁻?[¹²³])?"
#: Products and quotients of units; nothing else is passed to pint, which would evaluate any arithmetic.
_UNIT = re.compile(rf"{_FACTOR}(?:(?:\s*[*/·⋅]\s*|\s+){_FACTOR})*")
#: Multiple in front of a unit: 10^5 N/m, 1e-3 N, 1/100 mm, x 1000 N.
_MULTIPLE = re.compile(
    r"(?:[x×*]\s*)?(?:(?:10(?:\^|\*\*)|1?[eE])(?P<power>[+-]?\d{1,2})|1/(?P<part>10+)|(?<=[x×* ])(?P<factor>\d+\.?\d*))"
    r"(?![\d.])\s*[*·]?(?P<unit>.*)"
)
SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
#: Full-width signs of Chinese and Japanese texts as plain ones.
FULL_WIDTH = {code: code - 0xFEE0 for code in range(0xFF01, 0xFF5F)}
#: First character of a sign in UTF-8 that was decoded as Windows-1252: "Âµm", "Â°", "Ns/mmÂ²".
_MOJIBAKE = re.compile("Â(?=[µ°·²³])")
#: Remark behind a unit of energy: J/cycle, mJ per cycle, N mm/Zyklus.
_PER_CYCLE = re.compile(
    r"(?<=[Jm³3])\s*(?:/|\b(?:per|je|pro|par|por)\b)\s*(?:cyc(?:le)?|zyklus|schwingung|lastwechsel|lw|ciclo|cykl|サイクル|循环|周期)$",
    re.IGNORECASE,
)
#: Maximum length of a unit [characters]; pint is slow with longer texts.
_LONGEST_UNIT = 40
#: Unit by spelling: in lower case, with capitals, and spellings of an acceleration and of a length.
_SPELLINGS, _EXACT, _OF_ACCELERATION, _OF_LENGTH = (
    {word: unit for unit, words in _WORDS[table].items() for word in words.split()}
    for table in ("spellings", "exact", "of_acceleration", "of_length")
)
#: Common units: factor to SI and SI base unit. With these alone pint is not imported, which takes longer than a fit.
_EVERYDAY: dict[str, tuple[float, str]] = {
    unit: (scale, base) for base, scales in _WORDS["everyday"].items() for unit, scale in scales.items()
}
#: Definitions of the units that pint reads.
_DEFINITIONS = Path(__file__).with_name("units.txt")
#: The letters of one unit.
_WORD = re.compile(r"[^\W\d_]+|[º˚]")
#: Unit of mass that stands for the weight of this mass in a force or stiffness: kg, lbs.
_MASS = re.compile(r"(?<![^\W_])(kg|lb)s?(?![^\W\d_])")
#: Newton before a length with a power: the N of Nmm-1.
_NEWTON = re.compile(r"(?<![^\W_])(k?N)(?=(?:mm|cm|m)(?:\^|\*\*)?-)")
#: Position between a unit and a power without a sign: mm2, mm-1.
_POWER = re.compile(r"(?<=[^\W\d_])(?=(?:[23]|-[123])(?!\d))")
#: A point or hyphen as the sign of a product: N.m, N-m.
_JOINT = re.compile(r"(?<=[^\W\d_])[.-](?=[^\W\d_])")
#: Characters of a header with a unit at most.
_LONGEST_HEADER = 500
#: A header's name, and its unit in brackets.
_BRACKETS = re.compile(r"(?P<name>.*?)\s*[\[(](?P<unit>[^\[\]()]*)[\])]\s*")


def is_number(text: str) -> bool:
    """Return True if the text is a decimal number with a decimal point."""
    return _NUMBER.fullmatch(text.strip()) is not None


def split_header(text: str) -> tuple[str, str | None]:
    """Split a header cell such as "force [N]" into name and unit; the unit is None if the cell has no brackets."""
    text = text.strip()
    match = _BRACKETS.fullmatch(text) if text.endswith(("]", ")")) and len(text) <= _LONGEST_HEADER else None
    return (match["name"], match["unit"].strip()) if match else (text, None)


def si_factor(text: str, expected: str) -> float:
    """Factor that converts values in a unit to SI; for temperatures, the factor of temperature differences.

    Args:
        text: unit such as "kN" or "N/mm"; "-" and "" mean a ratio.
        expected: SI unit of the same dimension. A unit of mass is also a unit of force, and N_mm also N/mm.

    Returns:
        SI value of one unit.

    Raises:
        UnitError: an unknown unit, or a unit of another dimension.
    """
    if expected == "K" and (degree := kelvin_scale(text)):
        return degree[0]
    text = {"m/s^2": _OF_ACCELERATION, "m": _OF_LENGTH}.get(expected, {}).get(text.strip(), text)
    scale, base = _resolve(text)
    expected_base = _resolve(expected)[1]
    if base != expected_base and "_" in text:  # a name cannot contain a slash
        scale, base = _resolve("/".join(text.rsplit("_", 1)))
    if base != expected_base and "N" in expected:
        scale, base = _resolve(_MASS.sub(r"\1f", text))
    if base != expected_base:
        fitting = ", such as ".join(common_unit(expected))
        raise UnitError("the unit does not fit", found=f'"{text}"', expected=fitting)
    return scale


def is_unit(text: str) -> bool:
    """Return True if the text is a unit of any dimension."""
    return is_compatible(text, text)


@lru_cache(maxsize=4096)
def is_compatible(text: str, expected: str) -> bool:
    """Return True if the text is a known unit of the same dimension as the expected SI unit."""
    try:
        si_factor(text, expected)
    except UnitError:
        return False
    return True


def parse_quantity(value: object, *expected: str) -> float:
    """SI value of a text such as "10 mm".

    Args:
        value: text with a number and a unit.
        expected: SI units, such as "m"; the unit must be compatible with one of them.

    Returns:
        Value in the compatible SI unit, rounded to 15 significant digits.

    Raises:
        UnitError: no text, no number, no unit, or a unit of another dimension.
    """
    kind, unit = common_unit(expected[0])
    refuse = partial(UnitError, expected=f'{kind} with its unit, such as "10 {unit}"')
    text = str(value).strip()
    number = _NUMBER.match(text)
    if not isinstance(value, str | int | float) or isinstance(value, bool) or number is None:
        written = f'"{text}"' if isinstance(value, str) else text.lower() if isinstance(value, bool) else text
        raise refuse("this is not a quantity", found=written)
    suffix = text[number.end() :].strip()
    if not suffix:
        hint = None if expected[0] == "1" else f'write "{text} {unit}"'
        raise refuse("a number without a unit", found=text, hint=hint)
    if suffix[0] in ",.":
        parts = re.fullmatch(r"([+-]?\d+),(\d\d?|\d{4,})(\D*)", text)  # three digits may be thousands
        advice = f'write "{parts[1]}.{parts[2]}{parts[3]}", with' if parts else "write numbers with"
        raise refuse("this is not a quantity", found=f'"{text}"', hint=f"{advice} a decimal point")
    if not math.isfinite(float(number[0])):
        raise refuse("the number is too large", found=f'"{text}"')
    fitting = next((choice for choice in expected if is_compatible(suffix, choice)), expected[0])
    # 18 mm are 0.018 m, not 0.018000000000000002 m
    return check_size(float(f"{float(number[0]) * si_factor(suffix, fitting):.{_MOST_DIGITS}g}"), fitting)


def check_size(value: float, unit: str) -> float:
    """Return an SI value unchanged, or refuse it if no bushing, test or rig has a quantity of this magnitude.

    Args:
        value: SI value.
        unit: its SI unit.

    Raises:
        UnitError: the value is not zero, and below the smallest or above the largest plausible magnitude of its unit.
    """
    smallest, largest = _SIZES.get(unit, SIZES)
    if value == 0.0 or smallest <= abs(value) <= largest:
        return value
    written = "" if unit == "1" else f" {unit}"
    raise UnitError(
        "implausible for a bushing or its tests",
        found=f"{value:g}{written}",
        expected=f"{common_unit(unit)[0]} from {smallest:g} to {largest:g}{written}",
        hint="check the number and its unit",
    )


def display_unit(unit: str, factor: float, size: float) -> tuple[str, float]:
    """Choose a display unit by the magnitude of a value: MPa for 1.09e6 Pa, kPa for 1.46e4 Pa.

    Args:
        unit: SI unit, or another unit together with its factor from SI.
        factor: factor that converts SI values to `unit`.
        size: magnitude of the value [SI].

    Returns:
        Display unit, and factor from SI to the display unit.
    """
    unit, factor = _WRITTEN.get(unit, (unit, factor))
    number = abs(size) * factor
    if unit == "mm" and 0.0 < number < 1e-3:
        return "um", 1e3 * factor
    if unit == "s":
        return ("ms", 1e3) if number < 0.1 else (unit, factor)
    threshold = 0.1 if unit.startswith("Pa") else 10.0  # 0.2 MPa and not 200 kPa, but 9000 N and not 9 kN
    for prefix, power in (("M", 1e6), ("k", 1e3)):
        if unit.startswith(("P", "N")) and number >= threshold * power:
            return prefix + unit, factor / power
    return unit, factor


def number(value: float, digits: int, sign: str = "") -> str:
    """Format a number: 32940, 0.3, 1.09e8.

    Args:
        value: any number.
        digits: significant digits, up to 15; trailing zeros are omitted.
        sign: "+" to show the sign of positive numbers.

    Returns:
        Text, with an exponent below 0.0001 and from 1e7 on.
    """
    rounded = float(f"{value:.{digits}g}")
    if rounded == 0.0 or not math.isfinite(rounded):
        return f"{rounded:{sign}zg}"
    if _LEAST_PLAIN <= abs(rounded) < _LARGEST_PLAIN:
        return f"{rounded:{sign}.{_MOST_DIGITS}g}"
    mantissa, _, power = f"{rounded:.{digits - 1}e}".partition("e")
    return f"{float(mantissa):{sign}.{_MOST_DIGITS}g}e{int(power)}"


def format_aligned(values: Sequence[float], digits: int, minimum_digits: int = 0) -> list[str]:
    """Format numbers with equal decimals, as many as the first number needs: 1.4530, 1.4488.

    Args:
        values: one or more numbers; the first determines the decimals.
        digits: number of significant digits of the first value.
        minimum_digits: minimum number of significant digits of the others; with 0, values too small to show become "0".

    Returns:
        One text per value.
    """
    first = float(f"{values[0]:.{digits}g}")
    if not _LEAST_PLAIN <= abs(first) < _LARGEST_PLAIN:
        return [number(value, digits) for value in values]
    decimals = digits - 1 - math.floor(math.log10(abs(first)))

    def text(value: float) -> str:
        """Format one number with the common decimals."""
        rounded = round(value, decimals) + 0.0 if math.isfinite(value) else value  # no -0
        if abs(value) >= _LARGEST_PLAIN or not math.isfinite(value):
            return number(value, digits)
        if value and minimum_digits and abs(rounded) < 10.0 ** (minimum_digits - 1 - decimals):
            return number(value, minimum_digits)
        return f"{rounded:.{max(decimals, 0)}f}" if rounded else "0"

    return [text(value) for value in values]


def regular_steps(start: float, stop: float, step: float) -> tuple[float, ...]:
    """Values from start to at most stop at a regular distance.

    Args:
        start: first value.
        stop: last value.
        step: distance between values, in the unit of start and stop.

    Returns:
        The values; empty if start, stop or step is not positive, if stop is below start, or for 100 000 steps or more.
    """
    if not (0.0 < start <= stop and step > 0.0 and (stop - start) / step < 100_000):
        return ()
    return tuple(
        start + i * step for i in range(int((stop - start) / step * (1.0 + 1e-9)) + 1)
    )  # the last step despite rounding


def format_range(unit: str, *values: float, digits: int = 3) -> str:
    """Format a value or the ends of a range with its display unit: 1.09 MPa, 5 to 155 Hz.

    Args:
        unit: SI unit.
        values: one or more positive SI values; equal texts are shown once.
        digits: number of significant digits.
    """
    unit, factor = display_unit(unit, 1.0, math.sqrt(abs(min(values) * max(values))))
    return f"{' to '.join(dict.fromkeys(number(value * factor, digits) for value in values))} {unit}"


def common_unit(unit: str) -> tuple[str, str]:
    """Quantity of an SI unit, and a unit in which it is usually written: "a length" and "mm" for "m"."""
    return _KINDS.get(unit, ("a quantity", unit))


@lru_cache(maxsize=256)
def _resolve(text: str) -> tuple[float, str]:
    """Factor to SI, and SI base unit, of a unit; the base unit of an angle is the radian."""
    text = _PER_CYCLE.sub("", _MOJIBAKE.sub("", text.translate(FULL_WIDTH)).replace("Î¼", "µ").strip().rstrip("."))
    text = re.sub("(?<=10)[⁻⁰¹²³⁴-⁹]+", lambda power: "^" + power[0].translate(SUPERSCRIPTS), text)
    if match := _MULTIPLE.fullmatch(text):
        scale, base = _resolve(match["unit"])
        return scale * float(match["factor"] or f"1e{match['power'] or 1 - len(match['part'])}"), base
    unit = "1" if text in ("", "-") else text
    return _EVERYDAY.get(unit) or _by_pint(unit)


def _spell(word: re.Match[str]) -> str:
    """Return the usual spelling of one unit; a word of five letters or more has no capitals in pint."""
    lower = word[0].lower()
    return _EXACT.get(word[0]) or _SPELLINGS.get(lower, lower if word[0].istitle() and len(lower) > 4 else word[0])


def _by_pint(text: str) -> tuple[float, str]:
    """Factor to SI, and SI base unit, of a unit that pint has to parse: words, powers, products and quotients."""
    unknown = UnitError("unknown unit", found=f'"{text[:_LONGEST_UNIT]}"', expected="such as mm, N, kN/mm, deg, Hz, %")
    if len(text) <= _LONGEST_UNIT:
        text = _WORD.sub(_spell, text)
        text = _POWER.sub("^", _JOINT.sub("*", _NEWTON.sub(r"\1*", text.replace("_", " "))))
    if len(text) > _LONGEST_UNIT or not _UNIT.fullmatch(text):
        raise unknown
    for word in _WORD.findall(text):
        if word in _WORDS["unclear"]:
            raise UnitError("a unit that can be read in two ways", found=f'"{text}"', expected=_WORDS["unclear"][word])
    if not all({word.rstrip("¹²³"), word.rstrip("¹²³s")} & _defined_words() for word in _WORD.findall(text)):
        raise unknown
    registry = _registry()
    try:
        unit = registry.parse_units(text.replace("⋅", "*"))
        one, zero = (registry.Quantity(number, unit).to_base_units() for number in (1.0, 0.0))
    except Exception as error:  # pint raises errors of its parser and of Python
        raise unknown from error
    if zero.magnitude != 0.0:  # decibel and the like
        raise unknown
    return float(one.magnitude), str(one.units)


@lru_cache(maxsize=1)
def _defined_words() -> set[str]:
    """Names of the units in units.txt, with and without a prefix; other words are no units, and need no pint."""
    lines = _DEFINITIONS.read_text(encoding="utf-8").splitlines()
    names = {"per", "dimensionless", *(name.strip() for line in lines for name in line.split("="))}
    prefixes = ["", *(name.removesuffix("-") for name in names if name.endswith("-"))]
    return {prefix + name for prefix in prefixes for name in names}


@lru_cache(maxsize=1)
def _registry() -> pint.UnitRegistry[Any]:
    """Units of pint as units.txt defines them; imported at the first use, because pint is slow to import."""
    import pint

    return pint.UnitRegistry(str(_DEFINITIONS), cache_folder=None)


def kelvin_scale(unit: str) -> tuple[float, float] | None:
    """Kelvin per unit, and kelvin at zero, of a temperature unit such as "°C"; None for other texts."""
    return _TEMPERATURES.get(unit.replace("℃", "°C").replace("°", "deg").replace(" ", "").replace("_", "").lower())


def parse_temperature(raw: object) -> float:
    """Temperature [K] of a text such as "22 degC", "295 K" or "72 degF".

    Raises:
        UnitError: no number with a unit of temperature, or a temperature below absolute zero.
    """
    match = re.fullmatch(r"\s*([+-]?\d+(?:[.,]\d+)?)\s*(.*?)\s*", raw) if isinstance(raw, str) else None
    scale = kelvin_scale(match[2]) if match else None
    value = scale[0] * float(match[1].replace(",", ".")) + scale[1] if match and scale else -1.0
    if value < 0.0:
        raise UnitError("this is not a temperature", found=repr(raw), expected='such as "22 degC" or "295 K"')
    return value
