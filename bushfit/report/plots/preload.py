"""Figure of predictions over the preload."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from bushfit.model.result import Result
from bushfit.prediction.stiffness import Prediction, predict
from bushfit.reading.preload import Preload
from bushfit.report.plots import style
from bushfit.report.plots.pairs import ResponsePair
from bushfit.report.tables import spread_indices
from bushfit.units import format_range

#: Number of preloads of a line of the model.
_FINE = 25
#: Largest number of amplitudes drawn: more bands would overlap.
_MOST_LEVELS = 6


@style.fixed_settings()
def preload_figure(result: Result, predictions: Sequence[Prediction], title: str) -> style.Chart:
    """Figure of stiffness magnitude and loss factor over the preload, at the middle frequency of a prediction.

    Args:
        result: fitted model.
        predictions: predictions of one direction or specimen at several preloads, on the same grid.
        title: title of the figure.

    Returns:
        Figure with a line and a 95 % band for at most six amplitudes, and points at measured preloads.
    """
    place, conditions = predictions[0].direction, [prediction.conditions for prediction in predictions]
    preloads = [condition.preload for condition in conditions if condition.preload]
    frequencies, amplitudes = np.unique(predictions[0].frequency), np.unique(predictions[0].amplitude)
    frequency = frequencies[frequencies.size // 2]
    amplitudes = amplitudes[spread_indices(amplitudes.size, _MOST_LEVELS)]
    ends = min(preloads).value, max(preloads).value
    loads = [Preload(value, preloads[0].unit) for value in np.linspace(*ends, _FINE).tolist()]
    temperature: Any = conditions[0].temperature
    fine = [predict(result, place, [frequency], amplitudes, temperature=temperature, preload=load) for load in loads]
    figure = style.Chart(title, style.ROW)
    panels, unit = figure.subplots(1, 2), preloads[0].in_display_unit(place)[1]
    largest = max(float(prediction.stiffness.value.max()) for prediction in fine)
    pair = ResponsePair(panels, place, largest, f"preload [{unit}]")
    over_load = np.array([load.in_display_unit(place)[0] for load in loads])
    stiffness, loss = (
        np.array([getattr(prediction, name).ends for prediction in fine]) for name in ("stiffness", "loss_factor")
    )
    for index, look in enumerate(style.styles(amplitudes.size, "amplitude")):
        pair.draw_bands(over_load, [stiffness[:, :, index].T, loss[:, :, index].T], look)
        for prediction, preload in zip(predictions, preloads, strict=True):
            if prediction.measured is not None:  # nan, which is not drawn, without a measurement
                mask = (prediction.frequency == frequency) & (prediction.amplitude == amplitudes[index])
                x = np.array([preload.in_display_unit(place)[0]])
                pair.plot(x, prediction.measured[mask], color=look.color, marker=look.marker)
    style.name_levels(panels[-1], list(map(place.display.displacement.text, amplitudes)), "amplitude")
    sentence = f"Lines: model at {format_range('Hz', frequency)}; shaded: its 95 % band."
    measured = any(prediction.measured is not None for prediction in predictions)
    return figure.explain(sentence, *["Points: measured."] * measured)
