"""Options that several commands share, and their values in SI."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import click

from bushfit.cli.options import FILE, Parameter, combined, direction_option, file_option, option, option_group
from bushfit.errors import UnitError
from bushfit.units import is_compatible, parse_quantity, parse_temperature, regular_steps

if TYPE_CHECKING:
    from bushfit.campaign.campaign import Campaign
    from bushfit.model.result import Result

#: Option of commands that predict from a model.
TEMPERATURE = option(
    "--temperature TEMP",
    'Temperature, such as "40 degC", if the model was fitted with --effect temperature [23 degC].',
    type=parse_temperature,
)


def number_up_to(maximum: float, name: str) -> Callable[[str], float]:
    """Make the parser of an option for a positive number up to a maximum, also in percent; `name` is for errors."""

    def parse(text: str) -> float:
        with suppress(ValueError):
            if 0.0 < (number := float(text.removesuffix("%")) * (0.01 if "%" in text else 1.0)) <= maximum:
                return number
        raise click.BadParameter(f"{text} is not a {name}")

    return parse


_LOSS = "linear: least squares; soft_l1: little or no weight for points far from the model [from the campaign]."
_LIMIT = "Exit with status 1 if the misfit (NRMSE) exceeds this share of the stiffness, such as 2 %."
#: Argument CAMPAIGN (`campaigns`) and options of all commands that fit a campaign.
campaign_options = combined(
    click.argument("campaigns", metavar="CAMPAIGN", nargs=-1, required=True, type=FILE),
    option_group(
        "Fit",
        option("--loss LOSS", _LOSS, type=click.Choice(["linear", "soft_l1"])),
        option("--max-nrmse SHARE", _LIMIT, type=number_up_to(1.0, "share up to 1, such as 0.02 or 2 %")),
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


def grid_options(default: str, *, static: bool = False) -> Parameter:
    """Create the options for the frequencies and amplitudes of a prediction.

    Args:
        default: default in the help.
        static: True if "0 Hz", an empty grid, selects the static curve.

    Returns:
        Decorator that adds --frequencies, --amplitudes, --torsion-amplitudes and --strain-amplitudes to a command.
    """
    words = {
        ("frequencies", "Hz"): f'Frequencies: start:stop:step, "5:155:10 Hz", or a list, "20, 50 Hz" [{default}].',
        ("amplitudes", "m"): f'Displacement amplitudes, zero-to-peak, such as "0.1, 0.5 mm" [{default}].',
        ("torsion-amplitudes", "rad"): 'Rotation amplitudes for --direction torsion, zero-to-peak ["0.5, 1, 2 deg"].',
        ("strain-amplitudes", "1"): 'Strain amplitudes for specimens tested by modulus (DMA) ["1, 2, 5 %"].',
    }
    return combined(
        *(
            option(f"--{name} GRID", text, type=grid(unit, static=static and unit == "Hz"))
            for (name, unit), text in words.items()
        )
    )


def prediction_options(campaign: str, *, static: bool = False) -> Parameter:
    """Create the options for the range and conditions of a prediction.

    Args:
        campaign: help text of --campaign.
        static: True if frequencies of "0 Hz" select the static curve.

    Returns:
        Decorator that adds --direction, --frequencies, the options of amplitudes, --temperature and --campaign to a
        command.
    """
    return option_group(
        "Range and conditions",
        direction_option("predict", "axial and radial, and all specimens"),
        grid_options("from the campaign, else as tested, else as in the paper", static=static),
        TEMPERATURE,
        file_option("--campaign", campaign),
    )


def static_rate_option(subject: str) -> Parameter:
    """Create the option --static-rate, the loading rate of static curves; its help text begins with `subject`."""
    words = f'{subject}, such as "10 mm/min" [rate of the slowest loop, else 10 mm/min].'
    return option("--static-rate static_rates RATE", words, type=parse_rate)


def displacement_unit(text: str, per: str = "") -> str:
    """SI unit of a displacement: "m", "rad" ("2 deg") or "1" (strain); with `per` "/s", of a rate ("10 mm/min")."""
    suffix = re.sub(r"^[-+.\d\s]+(e[-+]?\d+)?\s*", "", text, flags=re.IGNORECASE)
    return next((unit for unit in ("rad", "1") if is_compatible(suffix, unit + per)), "m")


def parse_rate(text: str) -> dict[str, float]:
    """Parse a rate such as "10 mm/min" to {SI unit of the displacement (m, rad, 1): rate in SI}."""
    unit = displacement_unit(text, "/s")
    return {unit: quantity(f"{unit}/s")(text)}


def quantity(
    unit: str, expected: str = "a value above zero", is_valid: Callable[[float], bool] = lambda value: value > 0.0
) -> Callable[[str], float]:
    """Make the parser of an option such as "0.5 kg", which is the type of the option.

    Args:
        unit: SI unit of the value.
        expected: permitted values, for the error.
        is_valid: function that returns True for a permitted value in SI.

    Returns:
        Function that returns the SI value of a text, and raises a UnitError for other texts and values.
    """

    def parse(text: str) -> float:
        value = parse_quantity(text, unit)
        if not is_valid(value):
            raise UnitError("impossible size", found=f'"{text}"', expected=expected)
        return value

    return parse


class Grid(tuple[float, ...]):
    """Frequencies or amplitudes of an option in SI, with the `text` that the user typed."""

    text: str


def grid(unit: str, *, static: bool = False) -> Callable[[str], Grid]:
    """Make the parser of an option with a list "0.1, 0.2, 0.5 mm" or a range start:stop:step "5:155:10 Hz".

    Args:
        unit: SI unit of the values.
        static: True if a single 0 is permitted; it gives an empty grid.

    Returns:
        Function that returns the SI values of a text, and raises a UnitError if it has no numbers or no such unit.
    """

    def parse(text: str) -> Grid:
        expected = 'such as "5:155:10 Hz" (start:stop:step) or "0.1, 0.2, 0.5 mm", with one unit at the end'
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
            hint = "add the step: start:stop:step" if is_span else None
            raise UnitError("these are not values with a unit", found=repr(text), expected=expected, hint=hint)
        is_range = ":" in parts[1]
        numbers = [parse_quantity(f"{number} {parts[2]}", unit) for number in parts[1].split(":" if is_range else ",")]
        hint = "predict --static writes the static curve" if unit == "Hz" and numbers[0] == 0.0 else None
        is_zero = static and numbers == [0.0]
        values = Grid(regular_steps(*numbers) if is_range else () if is_zero else numbers)
        values.text = text
        if not (values or is_zero):
            raise UnitError("start:stop:step contains no value", found=text, expected=expected, hint=hint)
        if min(values, default=1.0) <= 0.0:
            raise UnitError("frequencies and amplitudes must be above zero", found=text, expected=expected, hint=hint)
        return values

    return parse
