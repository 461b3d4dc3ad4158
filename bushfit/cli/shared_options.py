"""Options that several commands share, and their values in SI."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from bushfit.cli.options import (
    FILE,
    Parameter,
    Size,
    add_parameters,
    direction_option,
    file_option,
    option,
    option_group,
    option_name,
)
from bushfit.errors import UnitError, error_location
from bushfit.units import is_compatible, parse_quantity, regular_steps

if TYPE_CHECKING:
    from bushfit.campaign.campaign import Campaign
    from bushfit.model.result import Result

#: SI units of the grid options, by key.
_UNITS = {"frequencies": "Hz", "amplitudes": "m", "torsion_amplitudes": "rad", "strain_amplitudes": "1"}

#: Option of commands that predict from a model.
TEMPERATURE = option(
    "--temperature",
    "TEMP",
    'Temperature, such as "40 degC", if the model was fitted with --effect temperature [23 degC].',
)


def campaign_options(soft_l1: str = "less weight for points far from the model, none for outliers") -> Parameter:
    """Create the argument CAMPAIGN (`campaigns`) and the options of all commands that fit a campaign.

    Args:
        soft_l1: help text on the loss function soft_l1.
    """
    return lambda function: add_parameters(
        function,
        click.argument("campaigns", metavar="CAMPAIGN", nargs=-1, required=True, type=FILE),
        option_group(
            "Fit",
            option(
                "--loss",
                "LOSS",
                f"linear: least squares; soft_l1: {soft_l1} [from the campaign, else linear].",
                type=click.Choice(["linear", "soft_l1"]),
            ),
            option(
                "--max-nrmse",
                "SHARE",
                "Exit with status 1 if the misfit (NRMSE) exceeds this share of the stiffness, such as 2 %.",
                type=Size("share up to 1, such as 0.02 or 2 %", 1.0),
            ),
        ),
    )


def open_campaign(campaigns: Sequence[Path]) -> Campaign:
    """Load the campaign of a command that takes exactly one.

    Raises:
        UsageError: several campaigns are given.
        CampaignError: the files are test files, or the campaign is invalid.
    """
    from bushfit.campaign.campaign import load_campaign, refuse_tests

    first, *excess = campaigns
    if excess:
        refuse_tests(campaigns)
        extra = "argument" if len(excess) == 1 else "arguments"
        raise click.UsageError(
            f"Got unexpected extra {extra} ({' '.join(map(str, excess))}). bushfit batch takes several campaigns.",
            click.get_current_context(),
        )
    return load_campaign(first)


def exit_above(max_nrmse: float | None, result: Result) -> None:
    """Exit with status 1 if the misfit (NRMSE, 1 = 100 %) of a result exceeds the limit of --max-nrmse."""
    if max_nrmse is not None and result.quality and result.quality.nrmse > max_nrmse:
        click.echo(f"bushfit: NRMSE {result.quality.nrmse:.4g} is above --max-nrmse {max_nrmse:g}", err=True)
        click.get_current_context().exit(1)


def grid_options(default: str) -> Parameter:
    """Create the options for the frequencies and amplitudes of a prediction; `default` is the default in the help."""
    return lambda function: add_parameters(
        function,
        option(
            "--frequencies",
            "GRID",
            f'Frequencies as start:stop:step, "5:155:10 Hz", or as a list, "20, 50 Hz" [{default}].',
        ),
        option("--amplitudes", "GRID", f'Displacement amplitudes, zero-to-peak, such as "0.1, 0.5 mm" [{default}].'),
        option(
            "--torsion-amplitudes",
            "GRID",
            'Rotation amplitudes for --direction torsion, zero-to-peak ["0.5, 1, 2 deg"].',
        ),
        option("--strain-amplitudes", "GRID", 'Strain amplitudes for specimens tested by modulus (DMA) ["1, 2, 5 %"].'),
    )


def prediction_options(campaign: str) -> Parameter:
    """Create --direction, the options of the grid, --temperature, and --campaign with the help text `campaign`."""
    return option_group(
        "Range and conditions",
        direction_option(
            "Predict in this direction (axial, radial, torsion) or for this specimen; may be given again [axial and "
            "radial, and all specimens]."
        ),
        grid_options("from the campaign, else as tested"),
        TEMPERATURE,
        file_option("--campaign", campaign),
    )


def static_rate_option(subject: str) -> Parameter:
    """Create the option --static-rate, the loading rate of static curves; its help text begins with `subject`."""
    return option(
        "--static-rate", "RATE", f'{subject}, such as "10 mm/min" [rate of the slowest loop, else 10 mm/min].'
    )


def displacement_unit(text: str, per: str = "") -> str:
    """SI unit (m, rad, 1) of a displacement such as "2 deg"; with `per` "/s" for a rate such as "10 mm/min"."""
    suffix = re.sub(r"^[-+.\d\s]+(e[-+]?\d+)?\s*", "", text, flags=re.IGNORECASE)
    return next((unit for unit in ("rad", "1") if is_compatible(suffix, unit + per)), "m")


def displacement_rates(text: str | None) -> dict[str, float] | None:
    """Parse the text of --static-rate to {SI unit of the displacement (m, rad, 1): rate in SI}; None without a text."""
    unit = displacement_unit(text or "", "/s")
    rate = parse_positive(text, "--static-rate", f"{unit}/s")
    return None if rate is None else {unit: rate}


def grid_values(directions: Sequence[str], grids: Mapping[str, str | None]) -> dict[str, Any]:
    """Convert grid options to keyword arguments: directions, frequencies and amplitudes [SI]; None for a default."""
    axes = {key: parse_grid(grids[key], option_name(key), unit) for key, unit in _UNITS.items()}
    return {"directions": tuple(directions) or None, **axes}


def parse_positive(text: str | None, option: str, unit: str) -> float | None:
    """Parse the value of an option to a positive number in SI units; None if the option was not given.

    Args:
        text: text of the option.
        option: name of the option, for errors.
        unit: SI unit of the result.

    Raises:
        UnitError: the text is not a value with a unit, or not positive.
    """
    if text is None:
        return None
    with error_location(place=option):
        value = parse_quantity(text, unit)
        if not value > 0.0:
            raise UnitError("this is not positive", found=f'"{text}"', expected="a value above zero")
    return value


def parse_temperature(text: str | None) -> float | None:
    """Parse the text of --temperature, such as "40 degC", to kelvin; None if the option was not given."""
    from bushfit.units import parse_temperature

    with error_location(place="--temperature"):
        return None if text is None else parse_temperature(text)


def parse_grid(text: str | None, option: str, unit: str) -> tuple[float, ...] | None:
    """Parse a list "0.1, 0.2, 0.5 mm" or a range start:stop:step "5:155:10 Hz" to values in SI; None if not given.

    Args:
        text: text of the option.
        option: name of the option, for errors.
        unit: SI unit of the result.

    Raises:
        UnitError: the text has no numbers, no unit, or a unit of another dimension.
    """
    if text is None:
        return None
    expected = 'such as "5:155:10 Hz" (start:stop:step) or "0.1, 0.2, 0.5 mm", with one unit at the end'
    with error_location(place=option):
        if re.search(r"\d,\d", text):
            raise UnitError(
                "a comma between two digits can separate numbers or be a decimal comma",
                found=repr(text),
                expected=expected,
                hint='write decimals with a point, "0.5", and a space after each comma of a list, "1, 5"',
            )
        parts = re.fullmatch(r"\s*([-+0-9.eE,:\s]*[0-9.])\s*([^-+\d\s:,.][^,]*)", text)
        is_span = re.search(r"^[^:]*(:|[0-9.]\s*-)[^:]*$", text)  # "5:155 Hz" or "5-155 Hz"
        if not parts or parts[1].count(":") not in (0, 2) or is_span:
            hint = "write the step, too: start:stop:step" if is_span else None
            raise UnitError("these are not values with a unit", found=repr(text), expected=expected, hint=hint)
        is_range = ":" in parts[1]
        values = tuple(
            parse_quantity(f"{number} {parts[2]}", unit) for number in parts[1].split(":" if is_range else ",")
        )
        hint = "predict --static writes the static curve" if unit == "Hz" and values[0] == 0.0 else None
        if is_range:
            values = tuple(regular_steps(*values))
            if not values:
                raise UnitError("start:stop:step does not count upward", found=text, expected=expected, hint=hint)
        elif min(values) <= 0.0:
            raise UnitError("frequencies and amplitudes are above zero", found=text, expected=expected, hint=hint)
    return values
