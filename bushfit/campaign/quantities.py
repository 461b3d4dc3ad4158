"""Model parameters of a campaign file by name: texts such as "1.1 MPa" become SI."""

import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from bushfit.effects import is_parameter, parameter_named, parameter_names
from bushfit.errors import CampaignError, naming
from bushfit.units import quantity, sized
from bushfit.validation import LARGEST_NUMBER, unknown_key

#: The second to the power of alpha, at the end of the unit of m.
_S_TO_ALPHA = re.compile(r"[\s*·]*s\s*(\^|\*\*)\s*alpha\s*$")


def parameter_value(place: str, name: str, raw: Any) -> float:
    """The SI value of a model parameter by its name in files; an error names the place.

    Ratios, and parameters of added effects, may be plain numbers.
    """
    with naming(place=place):
        if not is_parameter(name):
            raise unknown_key(name, parameter_names())
        stated = parameter_named(name).unit
        unit = _S_TO_ALPHA.sub("", stated)
        is_number = isinstance(raw, int | float) and not isinstance(raw, bool)
        if is_number and (unit == "1" or "." in name) and abs(raw) <= LARGEST_NUMBER:
            return sized(float(raw), unit)
        return quantity(_S_TO_ALPHA.sub("", raw) if unit != stated and isinstance(raw, str) else raw, unit)


def parameter_values(raw: dict[str, Any]) -> dict[str, float]:
    """Values by parameter, in SI."""
    return {name: parameter_value(name, name, value) for name, value in raw.items()}


def effect_values(raw: dict[str, Any]) -> dict[str, Any]:
    """Values by effect and parameter, in SI."""

    def values(effect: str, own: dict[str, Any]) -> dict[str, float]:
        return {key: parameter_value(f"{effect}.{key}", f"{effect}.{key}", value) for key, value in own.items()}

    return _each_table(raw, values)


def with_sizes(raw: dict[str, Any], keys: Sequence[str]) -> dict[str, Any]:
    """Tables by parameter with the values of some keys in SI; what is no table is left alone."""

    def sized_table(name: str, own: dict[str, Any]) -> dict[str, Any]:
        return own | {key: parameter_value(f"{name}.{key}", name, own[key]) for key in keys if key in own}

    return _each_table(raw, sized_table)


def _each_table(raw: dict[str, Any], convert: Callable[[str, dict[str, Any]], Any]) -> dict[str, Any]:
    """Tables by name, each converted; what is no table is left to pydantic."""
    return {name: convert(name, own) if isinstance(own, dict) else own for name, own in raw.items()}


def parameter_settings(raw: dict[str, Any]) -> dict[str, Any]:
    """Tables of value, min, max and vary by parameter, with the first three in SI.

    A min or a max beyond what the parameter can have is moved there: "0 MPa" as the least modulus is meant well.
    """
    keys = ("min", "value", "max")
    settings = with_sizes(raw, keys)
    for name, table in settings.items():
        if isinstance(table, dict):
            ordered = [table[key] for key in keys if key in table]
            parameter = parameter_named(name)
            low, high = parameter.bounds
            ends = np.clip([table.get("min", low), table.get("max", high)], low, high)
            if ordered != sorted(ordered) or ends[0] == ends[1]:
                expected = f"min below max within {low:g} to {high:g} {parameter.unit}, and value between them"
                raise CampaignError("these limits hold no value", place=name, found=str(raw[name]), expected=expected)
            table |= {key: float(end) for key, end in zip(("min", "max"), ends, strict=True) if key in table}
    return settings
