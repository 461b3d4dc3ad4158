"""Figure of sweeps at several temperatures, shifted to 23 degC."""

from collections.abc import Sequence

import numpy as np

from bushfit.fitting.master_curve import ShiftedSweep
from bushfit.model.model import Model
from bushfit.report.plots import style
from bushfit.report.plots.pairs import ResponsePair
from bushfit.units import CELSIUS

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
    for place, panels in zip(places, grid, strict=True):
        of_place = [shifted for shifted in shifted_sweeps if shifted.sweep.direction is place]
        reached = np.sort(np.concatenate([shifted.sweep.amplitude for shifted in of_place]))
        near = np.searchsorted(reached, _NEAR * reached) - np.arange(reached.size)
        level = float(np.median(reached[near.argmax() :][: near.max()]))  # the level with most points
        levels.append(f"{place} {place.display.displacement.text(level)}")
        reach = np.concatenate([shifted.reduced_frequency for shifted in of_place])
        largest = max(float(np.abs(shifted.reduced_stiffness).max()) for shifted in of_place)
        pair = ResponsePair(panels, place, largest, "reduced frequency f a_T [Hz]")
        for shifted in of_place:
            near_level = np.abs(np.log(shifted.sweep.amplitude / level)) < np.log(_NEAR)
            points = shifted.reduced_frequency[near_level], shifted.reduced_stiffness[near_level]
            pair.plot(*points, "o", color=looks[rounded[shifted.sweep.name]].color, **style.DOT)
        frequency = np.geomspace(reach.min(), reach.max(), _FINE)
        pair.plot(frequency, model.stiffness(place, frequency, level), color=style.INK, lw=1.1, zorder=3)
        for axes in panels:
            style.make_logarithmic(axes, reach)
        style.color_bar(panels[-1], [f"{degree:g} °C" for degree in degrees], "temperature")
    return figure.explain(f"Line: model at 23 °C, {', '.join(levels)}. Points: tests, shifted to 23 °C by the model.")
