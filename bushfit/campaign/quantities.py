"""Quantities of a campaign file: model parameters, the [compound] of an untested rubber, and [report]."""

import base64
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator

from bushfit.effects import get_parameter, is_parameter, library_parameters
from bushfit.errors import CampaignError, UnitError, error_location
from bushfit.geometry.point import PointText
from bushfit.reading.files import view_bytes
from bushfit.units import check_size, parse_quantity
from bushfit.validation import LARGEST_NUMBER, Name, converter, text, unknown_key

#: The factor s^alpha at the end of the unit of the parameter m.
_S_TO_ALPHA = re.compile(r"[\s*·]*s\s*(\^|\*\*)\s*alpha\s*$")
#: Polymers whose density is known, by the names that rubber engineers use; NR is natural rubber.
Polymer = Literal["natural", "SBR", "EPDM", "NBR", "CR", "IIR"]
#: Range of hardness in which Gent's relation is used [Shore A]; a durometer hardly distinguishes rubbers outside.
_HARDNESS = (20.0, 90.0)
#: Unit of the content of carbon black: parts per hundred parts of rubber.
_PHR = r"phr(?:\s+(?:of\s+)?carbon[\s-]black)?"
#: Maximum carbon black [phr]; no rubber for moving parts contains more.
_MOST_FILLER = 120.0
#: Maximum size of a logo [bytes]; every model file of the campaign contains the logo.
LARGEST_LOGO = 64_000
#: First bytes of a PNG file, bytes in the head of an SVG file, and maximum length of this head [bytes].
_PNG, _SVG, _HEAD = b"\x89PNG\r\n\x1a\n", b"<svg", 4096


def parameter_value(place: str, name: str, raw: Any) -> float:
    """Convert the value of a model parameter to SI. Ratios, and parameters of added effects, may be plain numbers.

    Args:
        place: key of the value in the file, for error messages.
        name: name of the parameter.
        raw: text with a unit, or number.

    Returns:
        Value in SI.

    Raises:
        UnitError: a missing or incompatible unit.
        CampaignError: an unknown parameter.
    """
    with error_location(place=place):
        if not is_parameter(name):
            raise unknown_key(name, library_parameters())
        file_unit = get_parameter(name).unit
        unit = _S_TO_ALPHA.sub("", file_unit)
        is_number = isinstance(raw, int | float) and not isinstance(raw, bool)
        if is_number and (unit == "1" or "." in name) and abs(raw) <= LARGEST_NUMBER:
            return check_size(float(raw), unit)
        return parse_quantity(_S_TO_ALPHA.sub("", raw) if unit != file_unit and isinstance(raw, str) else raw, unit)


def convert_effect(effect: str, entry: Mapping[str, Any]) -> dict[str, float]:
    """Convert the parameter values of an effect, such as {"mass": "0.1 kg"}, to SI, before pydantic checks them."""
    names = {key: f"{effect}.{key}" for key in entry}
    return {key: parameter_value(name, name, entry[key]) for key, name in names.items()}


def convert_values(name: str, entry: Mapping[str, Any], keys: Sequence[str]) -> dict[str, Any]:
    """Convert the values of a parameter in a table, such as {"min": "1 MPa"}, to SI, before pydantic checks them.

    Args:
        name: name of the parameter.
        entry: table of the parameter; its other keys are unchanged.
        keys: keys of the values that are converted, such as "min".
    """
    return {**entry, **{key: parameter_value(f"{name}.{key}", name, entry[key]) for key in keys if key in entry}}


def convert_setting(name: str, entry: Mapping[str, Any]) -> dict[str, Any]:
    """Convert a table of [fit.parameters] to SI.

    A min or a max outside the bounds of the parameter is moved to the bound, such as a min of "0 MPa".

    Args:
        name: name of the parameter.
        entry: table of value, min, max and vary.

    Returns:
        The table with value, min and max in SI.

    Raises:
        CampaignError: min, value and max that are not increasing, or outside the bounds of the parameter.
    """
    keys = ("min", "value", "max")
    setting, parameter = convert_values(name, entry, keys), get_parameter(name)
    ordered, (low, high) = [setting[key] for key in keys if key in setting], parameter.bounds
    ends = np.clip([setting.get("min", low), setting.get("max", high)], low, high)
    if ordered != sorted(ordered) or ends[0] == ends[1]:
        expected = f"min below max within {low:g} to {high:g} {parameter.unit}, and value between them"
        raise CampaignError("no value meets these limits", place=name, found=str(entry), expected=expected)
    return setting | {key: float(end) for key, end in zip(("min", "max"), ends, strict=True) if key in setting}


def _plain_number(quantity: str, unit: str, example: str, largest: float, smallest: float = 0.0) -> BeforeValidator:
    """Validator that converts a text with a unit unknown to pint, such as "60 Shore A", to a number.

    Args:
        quantity: quantity for error messages, such as "a hardness".
        unit: regular expression of the unit.
        example: example of a valid text, for error messages and the JSON Schema.
        largest, smallest: largest and smallest valid number.
    """
    pattern = re.compile(rf"\s*(\d{{1,4}}(?:\.\d{{1,6}})?)\s*(?:{unit})\s*", re.ASCII | re.IGNORECASE)

    def convert(raw: object, _: object) -> float:
        """Return the number in a text such as "60 Shore A", without conversion of the unit."""
        match = pattern.fullmatch(raw) if isinstance(raw, str) else None
        if not match:
            raise UnitError(f"this is not {quantity}", found=str(raw), expected=f'"{example}"')
        if not smallest <= float(match[1]) <= largest:
            limits = f"{smallest:g} to {largest:g} {example.partition(' ')[2]}"
            raise CampaignError(f"{quantity} for which no estimate is known", found=str(raw), expected=limits)
        return float(match[1])

    return converter(convert, text(f'such as "{example}"'))


@dataclass(frozen=True)
class Compound:
    """[compound]: a rubber that was not tested yet, for `bushfit plan`.

    Args:
        hardness: hardness [Shore A].
        filler: carbon black [phr], parts by weight per hundred parts of rubber.
        rubber: polymer of the compound.
    """

    hardness: Annotated[float, _plain_number("a hardness", r"sh(?:ore)?\.?\s*a", "61 Shore A", *_HARDNESS[::-1])]
    filler: Annotated[float, _plain_number("a filler", _PHR, "27 phr", _MOST_FILLER)]
    rubber: Polymer = "natural"


@dataclass(frozen=True)
class EffectsSettings:
    """[effects]: an effect of the user's own.

    Args:
        file: Python file with the effect, relative to the campaign file; it is only run with --trust.
    """

    file: Name


@dataclass(frozen=True)
class ReportSettings:
    """[report]: texts and logo in the head of the report, and the operating points of its result.

    Args:
        customer: customer of the part.
        part_number: part number of the bushing.
        drawing: number and issue of the drawing.
        compound: name of the rubber compound.
        laboratory: laboratory that tested the part.
        date: date of the report.
        logo: PNG or SVG file, relative to the campaign file.
        operating_points: points of the result table, such as "axial 15 Hz 0.5 mm"; empty for the middle of the tests.
    """

    customer: Name | None = None
    part_number: Name | None = None
    drawing: Name | None = None
    compound: Name | None = None
    laboratory: Name | None = None
    date: Name | None = None
    logo: Name | None = None
    operating_points: tuple[PointText, ...] = ()

    @property
    def lines(self) -> dict[str, str]:
        """Texts of the report by key, such as "customer", in order; without the logo and missing texts."""
        texts = vars(self) | {"logo": None, "operating_points": "; ".join(map(str, self.operating_points))}
        return {key: value for key, value in texts.items() if value}


def embed_logo(file: Path) -> str:
    """Encode a logo as a data URI.

    Args:
        file: PNG or SVG file.

    Returns:
        Data URI with the content of the file.

    Raises:
        CampaignError: the file is missing, too large, or neither PNG nor SVG.
    """
    data = view_bytes(file, CampaignError, largest=LARGEST_LOGO, hint="save the logo with fewer pixels, or as SVG")
    if data.startswith(_PNG):
        kind = "png"
    elif _SVG in data[:_HEAD]:
        kind = "svg+xml"
    else:
        raise CampaignError("this is not a picture that a page can show", file=file, expected="PNG or SVG")
    return f"data:image/{kind};base64,{base64.b64encode(data).decode()}"
