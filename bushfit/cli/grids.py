"""Grids on the command line: "5:155:10 Hz" or "0.1, 0.2, 0.5 mm"."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from bushfit.cli.options import Parameter, file_option, in_order, option, option_of, place_option, under
from bushfit.errors import UnitError, error_location
from bushfit.units import parse_quantity, regular_steps

if TYPE_CHECKING:
    from bushfit.campaign.schema import PredictSettings

#: SI units of the options of a grid, by their keys.
_UNITS = {"frequencies": "Hz", "amplitudes": "m", "torsion_amplitudes": "rad", "strain_amplitudes": "1"}


def grid_options(usual: str) -> Parameter:
    """Where stiffness is predicted, by the keys of [predict]; `usual` says what the grid is without them."""
    return lambda function: in_order(
        function,
        option("--frequencies", "GRID", f'"5:155:10 Hz" or "20, 50 Hz" [{usual}].'),
        option("--amplitudes", "GRID", f'Zero-to-peak, "0.1, 0.5 mm" [{usual}].'),
        option("--torsion-amplitudes", "GRID", 'For --direction torsion ["0.5, 1, 2 deg"].'),
        option("--strain-amplitudes", "GRID", 'For specimens that give a modulus ["1, 2, 5 %"].'),
    )


def where_predicted(campaign: str) -> Parameter:
    """Where and at which temperature a model is predicted; `campaign` says what is taken of one."""
    return under(
        "Where it is predicted",
        place_option("axial, radial, torsion or a specimen; may be given again [axial and radial, and all specimens]."),
        grid_options("the campaign's"),
        option("--temperature", "TEMP", 'Such as "40 degC", if the model knows it [23 degC].'),
        file_option("--campaign", campaign),
    )


def asked_for(directions: Sequence[str], grids: Mapping[str, str | None]) -> PredictSettings:
    """Places, and the values of the options of a grid in SI; None where they were not given."""
    from bushfit.campaign.schema import PredictSettings

    axes = {key: parse_grid(grids[key], option_of(key), unit) for key, unit in _UNITS.items()}
    return PredictSettings(directions=tuple(directions) or None, **axes)


def positive(text: str | None, option: str, unit: str) -> float | None:
    """The value of an option in SI, above zero; None where it was not given.

    Raises:
        UnitError: no value with a unit, or one that is not positive.
    """
    if text is None:
        return None
    with error_location(place=option):
        value = parse_quantity(text, unit)
        if not value > 0.0:
            raise UnitError("this is not positive", found=f'"{text}"', expected="a value above zero")
    return value


def kelvin(text: str | None) -> float | None:
    """The value of --temperature [K]; None where it was not given."""
    from bushfit.units import parse_temperature

    with error_location(place="--temperature"):
        return None if text is None else parse_temperature(text)


def parse_grid(text: str | None, option: str, unit: str) -> tuple[float, ...] | None:
    """Values of an option in SI, or None where it was not given.

    Raises:
        UnitError: no numbers, no unit, or a unit of another dimension.
    """
    if text is None:
        return None
    expected = 'such as "5:155:10 Hz" (start:stop:step) or "0.1, 0.2, 0.5 mm", with one unit at the end'
    with error_location(place=option):
        if re.search(r"\d,\d", text):
            raise UnitError(
                "a comma between two digits may part numbers or be a decimal comma",
                found=repr(text),
                expected=expected,
                hint='write decimals with a point, "0.5", and numbers of a list apart, "1, 5"',
            )
        parts = re.fullmatch(r"\s*([-+0-9.eE,:\s]*[0-9.])\s*([^-+\d\s:,.][^,]*)", text)
        if not parts or parts[1].count(":") not in (0, 2):
            hint = "write the step, too: start:stop:step" if text.count(":") == 1 else None
            raise UnitError("these are no values with a unit", found=repr(text), expected=expected, hint=hint)
        counted = ":" in parts[1]
        values = tuple(
            parse_quantity(f"{number} {parts[2]}", unit) for number in parts[1].split(":" if counted else ",")
        )
        if not counted and min(values) <= 0.0:
            raise UnitError("frequencies and amplitudes are above zero", found=text, expected=expected)
        if not counted:
            return values
        if not (counted_up := regular_steps(*values)):
            raise UnitError("start:stop:step does not count upward", found=text, expected=expected)
        return counted_up
