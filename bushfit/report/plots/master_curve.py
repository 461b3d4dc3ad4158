"""Figures of sweeps at several temperatures shifted to 23 degC, of their shift factors, and of Maxwell arms."""

from collections.abc import Sequence

import numpy as np

from bushfit.fitting.master_curve import SHIFT, ShiftedSweep, law
from bushfit.model.arms import Arms, part_modulus
from bushfit.model.covariance import Z95
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.reading.measurement import loss_factor
from bushfit.report.plots import style
from bushfit.report.tables import words
from bushfit.units import CELSIUS, display_unit, number

#: Number of points of a line.
_FINE = 200
#: Largest ratio of amplitudes that are treated as one level.
_NEAR = 1.3
#: Factor by which the frequency axis exceeds the band of the Maxwell arms, to show their behaviour outside.
_BEYOND = 4.0


@style.in_own_style
def master_curve_figure(model: Model, shifted_sweeps: Sequence[ShiftedSweep], title: str) -> style.Chart:
    """Figure of the master curve: stiffness and loss factor over reduced frequency at 23 degC, measured and modelled.

    Args:
        model: fitted model with an effect of temperature.
        shifted_sweeps: sweeps shifted to 23 degC.
        title: title of the figure.

    Returns:
        Figure with two panels per direction or specimen, at the amplitude with most points.
    """
    places = list(dict.fromkeys(shifted.sweep.direction for shifted in shifted_sweeps))
    degrees = sorted({_degree(shifted) for shifted in shifted_sweeps})
    figure = style.Chart(title, style.ROW * len(places))
    grid, levels = figure.subplots(len(places), 2, squeeze=False), []
    for place, (stiffness, loss) in zip(places, grid, strict=True):
        of_place = [shifted for shifted in shifted_sweeps if shifted.sweep.direction is place]
        reached = np.sort(np.concatenate([shifted.sweep.amplitude for shifted in of_place]))
        near = np.searchsorted(reached, _NEAR * reached) - np.arange(reached.size)
        level = float(np.median(reached[near.argmax() :][: near.max()]))  # the level with most points
        length_unit, length = place.display.displacement
        levels.append(f"{place} {number(level * length, 3)} {length_unit}")
        unit, factor = display_unit(
            *place.display.stiffness, max(np.abs(shifted.reduced_stiffness).max() for shifted in of_place)
        )
        reach = np.concatenate([shifted.reduced_frequency for shifted in of_place])
        frequency = np.geomspace(reach.min(), reach.max(), _FINE)
        line = model.stiffness(place, frequency, level)
        for axes, part in ((stiffness, lambda k, by=factor: by * np.abs(k)), (loss, loss_factor)):
            for shifted in of_place:
                look = style.styles(len(degrees), "temperature")[degrees.index(_degree(shifted))]
                near_level = np.abs(np.log(shifted.sweep.amplitude / level)) < np.log(_NEAR)
                points = shifted.reduced_frequency[near_level], part(shifted.reduced_stiffness[near_level])
                axes.plot(*points, "o", color=look.color, **style.DOT)
            axes.plot(frequency, part(line), color=style.INK, lw=1.1, zorder=3)
            style.logarithmic(axes, reach)
        style.label_axes(stiffness, "reduced frequency f a_T [Hz]", f"{place}\n|{words(place)[2]}| [{unit}]")
        style.label_axes(loss, "reduced frequency f a_T [Hz]", "loss factor [-]")
        style.name_levels(loss, [f"{degree:g}" for degree in degrees], "temperature")
    return figure.explain(
        f"Line: model at 23 °C, {', '.join(levels)}. Points: measured at the temperatures in the legend [°C], shifted",
        "to 23 °C by the model.",
    )


@style.in_own_style
def shift_factors_figure(result: Result, shifted_sweeps: Sequence[ShiftedSweep], title: str) -> style.Chart:
    """Figure of the temperature shift factors: the fitted law, each sweep by itself, and their differences.

    Args:
        result: fitted result, which gives the law and its standard error.
        shifted_sweeps: sweeps shifted to 23 degC.
        title: title of the figure.

    Returns:
        Figure with two panels.
    """
    figure = style.Chart(title, style.ROW)
    factors, differences = figure.subplots(1, 2)
    kelvin = np.array([shifted.temperature for shifted in shifted_sweeps])
    fine = np.linspace(kelvin.min(), kelvin.max(), _FINE)
    line, error = (values / np.log(10.0) for values in law(result, fine))
    single, unsure = np.array([shifted.best_shift for shifted in shifted_sweeps]).T / np.log(10.0)
    at_law = np.array([shifted.shift[0] for shifted in shifted_sweeps]) / np.log(10.0)
    color = style.styles(1, "amplitude")[0].color
    for axes, base, points in ((factors, line, single), (differences, 0.0 * line, single - at_law)):
        axes.fill_between(fine - CELSIUS, base - Z95 * error, base + Z95 * error, color=style.SHADE, lw=0)
        axes.plot(fine - CELSIUS, base, color=style.INK, lw=1.1)
        axes.errorbar(kelvin - CELSIUS, points, Z95 * unsure, fmt="o", color=color, lw=0.8, **style.POINT)
    style.label_axes(factors, "temperature [degC]", "log10 a_T [-]")
    style.label_axes(differences, "temperature [degC]", "log10 a_T, sweep minus law [-]")
    return figure.explain(
        f"Line: law, with a shift of {number(result.model.values[SHIFT], 3)} 1/K at 23 °C; grey: its 95 % band.",
        "Points: shift factor of each sweep alone, with 95 % intervals.",
    )


def _degree(shifted: ShiftedSweep) -> float:
    """Mean temperature of a sweep, rounded to 1 degC."""
    return float(np.round(shifted.temperature - CELSIUS))


@style.in_own_style
def arms_figure(model: Model, arms: Sequence[Arms], title: str) -> style.Chart:
    """Figure of the moduli of effects and of the Maxwell arms that replace them, with the relative error of the arms.

    Args:
        model: model whose effects the arms replace.
        arms: Maxwell arms of each replaced effect, with the frequency band of their fit.
        title: title of the figure.

    Returns:
        Figure with two panels.
    """
    figure = style.Chart(title, style.ROW)
    moduli, errors = figure.subplots(1, 2)
    low, high = arms[0].band
    omega = 2.0 * np.pi * np.geomspace(low / _BEYOND, high * _BEYOND, 400)
    frequency = omega / (2.0 * np.pi)
    inside = (frequency >= low) & (frequency <= high)
    wholes = [part_modulus(model, part.size, omega, part.conditions) for part in arms]
    unit, factor = display_unit("Pa", 1.0, max(float(np.abs(whole).max()) for whole in wholes))
    looks = style.styles(len(arms), "loop")
    for part, whole, look in zip(arms, wholes, looks, strict=True):
        arm_modulus = part.complex_modulus(omega)
        for share, dashes in ((np.real, style.DASHES[0]), (np.imag, style.DASHES[1])):
            moduli.plot(frequency, factor * share(whole), color=style.GREY, lw=2.6, alpha=0.45, ls=dashes)
            moduli.plot(frequency, factor * share(arm_modulus), color=look.color, lw=1.1, ls=dashes)
        percent_error = 100.0 * np.abs(arm_modulus / whole - 1.0)[inside]
        errors.plot(frequency[inside], percent_error, color=look.color, lw=1.1)
    style.label_axes(moduli, "frequency [Hz]", f"modulus [{unit}]", frequency)
    style.label_axes(errors, "frequency [Hz]", "error of the modulus [%]", frequency)
    moduli.axvspan(low, high, color=style.SHADE, lw=0, zorder=0)
    errors.set_ylim(bottom=0.0)
    return figure.explain(
        "Wide grey lines: model; coloured: Maxwell arms; solid: storage, dashed: loss. Shaded: band of the fit.",
        *(f"{part.sentence}." for part in arms),
    )
