"""Figure of sweeps at several temperatures, shifted to 23 degC."""

from collections.abc import Sequence

import numpy as np

from bushfit.fitting.master_curve import ShiftedSweep
from bushfit.model.model import Model
from bushfit.reading.measurement import loss_factor
from bushfit.report.plots import style
from bushfit.report.tables import quantity_words
from bushfit.units import CELSIUS, display_unit, number

#: Number of points of a line.
_FINE = 200
#: Largest ratio of amplitudes that are treated as one level.
_NEAR = 1.3


@style.fixed_settings()
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
    rounded = {shifted.sweep.name: float(np.round(shifted.temperature - CELSIUS)) for shifted in shifted_sweeps}
    degrees = sorted({*rounded.values()})
    looks = dict(zip(degrees, style.styles(len(degrees), "temperature"), strict=True))
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
                near_level = np.abs(np.log(shifted.sweep.amplitude / level)) < np.log(_NEAR)
                points = shifted.reduced_frequency[near_level], part(shifted.reduced_stiffness[near_level])
                axes.plot(*points, "o", color=looks[rounded[shifted.sweep.name]].color, **style.DOT)
            axes.plot(frequency, part(line), color=style.INK, lw=1.1, zorder=3)
            style.logarithmic(axes, reach)
        style.label_axes(stiffness, "reduced frequency f a_T [Hz]", f"{place}\n|{quantity_words(place)[2]}| [{unit}]")
        style.label_axes(loss, "reduced frequency f a_T [Hz]", "loss factor [-]")
        style.name_levels(loss, [f"{degree:g}" for degree in degrees], "temperature")
    return figure.explain(
        f"Line: model at 23 °C, {', '.join(levels)}. Points: measured at the temperatures in the legend [°C], shifted",
        "to 23 °C by the model.",
    )
