"""Units: texts such as "10 mm" and headers such as "force [kN]" become SI, and SI becomes what people read.

An expected unit is written in SI: "m", "rad", "N*m/rad", "1" for a ratio. Only this module uses pint. Unlike in pint,
an angle is no plain number here: "deg" fits "rad" but not "1", and "rad/s" is not "Hz".
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
#: By expected SI unit: what it measures, and a unit that a user would write for it.
_KINDS: dict[str, tuple[str, str]] = {unit: tuple(words) for unit, words in _WORDS["kinds"].items()}
#: By SI unit: the unit in which people write it, and the factor from SI to it; MPa*s^alpha is the paper's.
_WRITTEN: dict[str, tuple[str, float]] = {unit: tuple(words) for unit, words in _WORDS["written"].items()}
#: By SI unit: the least and the largest size that a quantity of a bushing, of its tests or of its rig may have.
_SIZES: dict[str, tuple[float, float]] = {unit: tuple(ends) for unit, ends in _WORDS["sizes"].items()}
#: The same of every other unit; chosen: far beyond all of them, and powers of it are numbers still.
SIZES = (1e-15, 1e15)
#: Zero of the Celsius scale [K].
CELSIUS = 273.15
#: By the unit of a temperature: kelvin per unit, and kelvin at zero of the unit.
_TEMPERATURES: dict[str, tuple[float, float]] = {
    word: (scale, zero) for words, (scale, zero) in _WORDS["temperatures"].items() for word in words.split()
}
#: Numbers from this size on are written without an exponent: 0.0001, but 9e-5.
_LEAST_PLAIN = 1e-4
#: Numbers below this size are written without an exponent: 9999999, but 1e7.
_LARGEST_PLAIN = 1e7
#: Significant digits that every float keeps.
_MOST_DIGITS = 15
#: A decimal number with a decimal point, and perhaps a power of ten.
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
#: One unit and perhaps its power, such as kN, mm^2, s**-1 or m⁻¹.
_FACTOR = r"(?:[^\W\d_]+|[%‰°1])(?:(?:\^|\*\*)-?[1-9]|⁻?[¹²³])?"
#: The products and quotients of units that are handed on to pint, which would otherwise evaluate any arithmetic.
_UNIT = re.compile(rf"{_FACTOR}(?:(?:\s*[*/·⋅]\s*|\s+){_FACTOR})*")
#: Characters of a unit at most: longer texts are no units, and pint takes its time with them.
_LONGEST_UNIT = 40
#: Of each way to spell a unit the unit: in lower case, with its capitals, and of an acceleration alone.
_SPELLINGS, _EXACT, _OF_ACCELERATION = (
    {word: unit for unit, words in _WORDS[table].items() for word in words.split()}
    for table in ("spellings", "exact", "of_acceleration")
)
#: Everyday units, as pint has them: factor to SI, and SI base. A run that meets no other does not load pint, which
#: takes longer than a fit.
_EVERYDAY: dict[str, tuple[float, str]] = {
    unit: (scale, base) for base, scales in _WORDS["everyday"].items() for unit, scale in scales.items()
}
#: The letters of one unit.
_WORD = re.compile(r"[^\W\d_]+|[º˚]")
#: Between a unit and a power without its sign: mm2.
_POWER = re.compile(r"(?<=[^\W\d_])(?=[23](?!\d))")
#: A point or hyphen that stands for a product: N.m, N-m.
_JOINT = re.compile(r"(?<=[^\W\d_])[.-](?=[^\W\d_])")
#: A header's name, and its unit in brackets.
_BRACKETS = re.compile(r"(?P<name>.*?)\s*[\[(](?P<unit>[^\[\]()]*)[\])]\s*")


def is_number(text: str) -> bool:
    """Whether a text is a plain decimal number, with a decimal point."""
    return _NUMBER.fullmatch(text.strip()) is not None


def split_header(text: str) -> tuple[str, str | None]:
    """Name and unit of a header cell such as "force [N]" or "force (kN)"; the unit is None where there is none."""
    match = _BRACKETS.fullmatch(text.strip())
    return (match["name"], match["unit"].strip()) if match else (text.strip(), None)


def si_factor(text: str, expected: str) -> float:
    """The number that turns values in the unit `text` into SI; of a temperature, differences of values.

    Args:
        text: a unit such as "kN" or "N/mm"; "-" and "" stand for a ratio.
        expected: the SI unit that it has to agree with.

    Raises:
        UnitError: an unknown unit, or a unit of another dimension.
    """
    if expected == "K" and (degree := kelvin_scale(text)):
        return degree[0]
    if expected == "m/s^2":
        text = _OF_ACCELERATION.get(text.strip(), text)
    scale, base = _resolve(text)
    if base != _resolve(expected)[1]:
        hint = 'a pound of force is "lbf"' if {"lb", "lbs"} & set(_WORD.findall(text)) else None
        raise UnitError("the unit does not fit", found=f'"{text}"', expected=describe_unit(expected), hint=hint)
    return scale


def is_unit(text: str) -> bool:
    """Whether `text` is a unit, of whatever dimension."""
    return is_compatible(text, text)


def is_compatible(text: str, expected: str) -> bool:
    """Whether `text` is a known unit of the same dimension as `expected`."""
    try:
        si_factor(text, expected)
    except UnitError:
        return False
    return True


def parse_quantity(value: object, *expected: str) -> float:
    """The SI value of a text such as "10 mm" that agrees with one of the expected SI units, such as "m".

    Raises:
        UnitError: no text, no number, no unit, or a unit of another dimension.
    """
    kind, unit = _kind(expected[0])
    refused = partial(UnitError, expected=f'{kind} with its unit, such as "10 {unit}"')
    text = str(value).strip()
    number = _NUMBER.match(text)
    if not isinstance(value, str | int | float) or isinstance(value, bool) or number is None:
        raise refused("this is no quantity", found=f'"{text}"' if isinstance(value, str) else text)
    own = text[number.end() :].strip()
    if not own:
        hint = None if expected[0] == "1" else f'write "{text} {unit}"'
        raise refused("a number without a unit", found=text, hint=hint)
    if own[0] in ",.":
        parts = re.fullmatch(r"([+-]?\d+),(\d\d?|\d{4,})(\D*)", text)  # three digits may be thousands
        way = f'write "{parts[1]}.{parts[2]}{parts[3]}", with' if parts else "write numbers with"
        raise refused("this is no quantity", found=f'"{text}"', hint=f"{way} a decimal point")
    if not math.isfinite(float(number[0])):
        raise refused("the number is too large", found=f'"{text}"')
    fitting = next((choice for choice in expected if is_compatible(own, choice)), expected[0])
    # to 15 digits: 18 mm are 0.018 m, and not 0.018000000000000002 m
    return check_size(float(f"{float(number[0]) * si_factor(own, fitting):.{_MOST_DIGITS}g}"), fitting)


def check_size(value: float, unit: str) -> float:
    """A value in SI, if it is zero or of a size that a bushing, its tests or its rig may have.

    Raises:
        UnitError: it is smaller or larger than any.
    """
    least, largest = _SIZES.get(unit, SIZES)
    if value == 0.0 or least <= abs(value) <= largest:
        return value
    written = "" if unit == "1" else f" {unit}"
    raise UnitError(
        "no bushing has this",
        found=f"{value:g}{written}",
        expected=f"{_kind(unit)[0]} from {least:g} to {largest:g}{written}",
        hint="check the number and its unit",
    )


def display_unit(unit: str, factor: float, size: float) -> tuple[str, float]:
    """Unit and factor from SI in which people read numbers of that size in SI: MPa for 1.09e6 Pa, kPa for 1.46e4 Pa."""
    unit, factor = _WRITTEN.get(unit, (unit, factor))
    number = abs(size) * factor
    if unit == "mm" and 0.0 < number < 1e-3:
        return "um", 1e3 * factor
    if unit == "s":
        return ("ms", 1e3) if number < 0.1 else (unit, factor)
    least = 0.1 if unit.startswith("Pa") else 10.0  # 0.2 MPa and not 200 kPa, but 9000 N and not 9 kN
    for prefix, power in (("M", 1e6), ("k", 1e3)):
        if unit.startswith(("P", "N")) and number >= least * power:
            return prefix + unit, factor / power
    return unit, factor


def number(value: float, digits: int, sign: str = "") -> str:
    """A number with at most so many digits, up to 15: 32940, 0.3, 1.09e8; an exponent only where zeros would hide it.

    With "+" as `sign`, positive numbers have theirs too.
    """
    rounded = float(f"{value:.{digits}g}")
    if rounded == 0.0 or not math.isfinite(rounded):
        return f"{rounded + 0.0:{sign}g}"  # no -0
    if _LEAST_PLAIN <= abs(rounded) < _LARGEST_PLAIN:
        return f"{rounded:{sign}.{_MOST_DIGITS}g}"
    mantissa, _, power = f"{rounded:.{digits - 1}e}".partition("e")
    return f"{float(mantissa):{sign}.{_MOST_DIGITS}g}e{int(power)}"


def format_aligned(values: Sequence[float], digits: int, least: int = 0) -> list[str]:
    """Numbers that stand together, all with the decimals that the first needs for so many digits: 1.4530, 1.4488.

    Args:
        values: at least one; the first sets the decimals.
        digits: significant ones of the first.
        least: digits that the others have at least; with 0, what is too small to show is 0.
    """
    first = float(f"{values[0]:.{digits}g}")
    if not _LEAST_PLAIN <= abs(first) < _LARGEST_PLAIN:
        return [number(value, digits) for value in values]
    place = digits - 1 - math.floor(math.log10(abs(first)))

    def text(value: float) -> str:
        rounded = round(value, place) + 0.0 if math.isfinite(value) else value  # no -0
        if abs(value) >= _LARGEST_PLAIN or not math.isfinite(value):
            return number(value, digits)
        if value and least and abs(rounded) < 10.0 ** (least - 1 - place):
            return number(value, least)
        return f"{rounded:.{max(place, 0)}f}" if rounded else "0"

    return [text(value) for value in values]


def regular_steps(start: float, stop: float, step: float) -> tuple[float, ...]:
    """Values from start to stop, both of them; none where they do not count upward from above zero, or are beyond
    100 000, by a typing error in the step."""
    if not (0.0 < start <= stop and step > 0.0 and (stop - start) / step < 100_000):
        return ()
    return tuple(start + i * step for i in range(int((stop - start) / step * (1.0 + 1e-9)) + 1))  # with the last one


def format_range(unit: str, *values: float, digits: int = 3) -> str:
    """Positive numbers of one unit as people read them, each once: 1.09 MPa, 5 to 155 Hz, 0.0221 um."""
    unit, factor = display_unit(unit, 1.0, math.sqrt(abs(min(values) * max(values))))
    return f"{' to '.join(dict.fromkeys(number(value * factor, digits) for value in values))} {unit}"


def describe_unit(expected: str) -> str:
    """An expected SI unit in words: "a length, such as mm"."""
    kind, example = _kind(expected)
    return f"{kind}, such as {example}"


def example_unit(expected: str) -> str:
    """A unit that a user would write where the SI unit `expected` is meant."""
    return _kind(expected)[1]


def _kind(expected: str) -> tuple[str, str]:
    return _KINDS.get(expected, ("a quantity", expected))


@lru_cache(maxsize=256)
def _resolve(text: str) -> tuple[float, str]:
    """Factor to SI and SI base of a unit; angles keep their radian.

    Raises:
        UnitError: an unknown unit.
    """
    text = text.strip().rstrip(".")
    unit = "1" if text in ("", "-") else text
    return _EVERYDAY.get(unit) or _by_pint(unit)


def _by_pint(text: str) -> tuple[float, str]:
    """As `_resolve`, by pint, which sees nothing but words, powers, products and quotients."""
    unknown = UnitError(
        "unknown unit", found=f'"{text[:_LONGEST_UNIT]}"', expected="a unit such as mm, N, kN/mm, deg, Hz or %"
    )
    if len(text) <= _LONGEST_UNIT:
        text = _WORD.sub(lambda word: _EXACT.get(word[0]) or _SPELLINGS.get(word[0].lower(), word[0]), text)
        text = _POWER.sub("^", _JOINT.sub("*", text))
    if len(text) > _LONGEST_UNIT or not _UNIT.fullmatch(text):
        raise unknown
    for word in _WORD.findall(text):
        if word in _WORDS["unclear"]:
            raise UnitError("a unit that can be read in two ways", found=f'"{text}"', expected=_WORDS["unclear"][word])
    registry = _registry()
    try:
        unit = registry.parse_units(text.replace("⋅", "*"))
        one, zero = (registry.Quantity(number, unit).to_base_units() for number in (1.0, 0.0))
    except Exception as error:  # pint lets its parser's and Python's own errors through
        raise unknown from error
    if zero.magnitude != 0.0:  # decibel and the like
        raise unknown
    return float(one.magnitude), str(one.units)


@lru_cache(maxsize=1)
def _registry() -> pint.UnitRegistry[Any]:
    import pint

    return pint.UnitRegistry(str(Path(__file__).with_name("units.txt")), cache_folder=None)


def kelvin_scale(unit: str) -> tuple[float, float] | None:
    """Kelvin per unit of temperature such as "°C", and kelvin at its zero; None for any other text."""
    return _TEMPERATURES.get(unit.replace("℃", "°C").replace("°", "deg").replace(" ", "").lower())


def parse_temperature(raw: object) -> float:
    """The temperature [K] that a text such as "22 degC", "295 K" or "72 degF" states.

    Raises:
        UnitError: no text of a number and one of these units, or one below absolute zero.
    """
    found = re.fullmatch(r"\s*([+-]?\d+(?:[.,]\d+)?)\s*(.*?)\s*", raw) if isinstance(raw, str) else None
    scale = kelvin_scale(found[2]) if found else None
    value = scale[0] * float(found[1].replace(",", ".")) + scale[1] if found and scale else -1.0
    if value < 0.0:
        raise UnitError("this is no temperature", found=repr(raw), expected='such as "22 degC" or "295 K"')
    return value
