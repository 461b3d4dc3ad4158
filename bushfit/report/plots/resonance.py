"""A resonance test and the sweep it was reduced to."""

import numpy as np
from matplotlib.figure import Figure

from bushfit.geometry import TRANSLATION
from bushfit.reading.measurement import loss_factor
from bushfit.reduction.resonance import LARGEST_ERROR, Resonance
from bushfit.report.plots import style
from bushfit.units import for_people


def resonance_figure(found: Resonance, title: str) -> Figure:
    """Transmissibility and amplitude reached, stiffness and loss factor with errors, each over the frequency."""
    figure = style.new_figure(title, 2 * style.ROW)
    (ratio, amplitude), (stiffness, loss) = figure.subplots(2, 2, sharex=True)
    (unit, length), _, stiffness_units = TRANSLATION.display
    stiffness_unit, factor = for_people(*stiffness_units, float(np.abs(found.stiffness).max()))
    color = style.styles(1, "amplitude")[0].color
    upper = (
        (ratio, np.abs(found.transmissibility), "transmissibility |T| [-]"),
        (amplitude, length * found.amplitude, f"amplitude reached [{unit}]"),
    )
    for axes, values, label in upper:
        axes.plot(found.frequency, values, "o", color=color, **style.DOT)
        style.label_axes(axes, "", label)
        style.logarithmic(axes, values, "y")
    ratio.plot(found.test.frequency, np.abs(found.test.transmissibility), color=style.GREY, lw=0.7, zorder=1)
    frequency, largest = found.peak
    ratio.annotate(f"{frequency:.1f} Hz", (frequency, largest), (4, 0), textcoords="offset points", **style.WORDS)
    magnitude, factors = factor * np.abs(found.stiffness), loss_factor(found.stiffness)
    lower = (
        (stiffness, magnitude, magnitude, f"stiffness |K| [{stiffness_unit}]"),
        (loss, factors, 1.0 + factors**2, "loss factor [-]"),
    )
    for axes, values, scale, label in lower:
        error = 2.0 * found.relative_error * scale
        axes.plot(found.frequency, values, "o", color=color, **style.DOT)
        low, high = axes.get_ylim()
        axes.vlines(found.frequency, values - error, values + error, color=color, lw=0.7, alpha=0.6)
        axes.set_ylim(low, high)
        style.label_axes(axes, "frequency [Hz]", label)
    style.log_if_wide(loss, found.test.frequency)
    least = f"Where the error of K is beyond {100 * LARGEST_ERROR:g} % there is no point."
    style.explain(
        figure,
        "Grey line: mass over base acceleration as measured. Points: means of neighbouring rows.",
        "Bars: twice the standard error, large where the mass moves almost as the base does; they may leave the panel.",
        least * bool(found.left_out.size),
    )
    return figure
