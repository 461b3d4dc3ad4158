"""Maxwell arms over what they stand for, and how far they are off."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from bushfit.model.arms import Arms, part_modulus
from bushfit.model.model import Model
from bushfit.report.plots import style
from bushfit.units import for_people

#: Factor by which the picture goes beyond the band, to show how arms end.
_BEYOND = 4.0


def arms_figure(model: Model, arms: Sequence[Arms], title: str) -> Figure:
    """Storage and loss modulus of each part and of its arms, and the relative error within the band."""
    figure = style.new_figure(title, style.ROW)
    moduli, errors = figure.subplots(1, 2)
    low, high = arms[0].band
    omega = 2.0 * np.pi * np.geomspace(low / _BEYOND, high * _BEYOND, 400)
    frequency = omega / (2.0 * np.pi)
    inside = (frequency >= low) & (frequency <= high)
    wholes = [part_modulus(model, part.size, omega, part.under) for part in arms]
    unit, factor = for_people("Pa", 1.0, max(float(np.abs(whole).max()) for whole in wholes))
    looks = style.styles(len(arms), "loop")
    for part, whole, look in zip(arms, wholes, looks, strict=True):
        made = part.at(omega)
        for share, dashes in ((np.real, "-"), (np.imag, (0, (5, 1.5)))):
            moduli.plot(frequency, factor * share(whole), color=style.GREY, lw=2.6, alpha=0.45, ls=dashes)
            moduli.plot(frequency, factor * share(made), color=look.color, lw=1.1, ls=dashes)
        off = 100.0 * np.abs(made / whole - 1.0)[inside]
        errors.plot(frequency[inside], off, color=look.color, lw=1.1)
    style.label_axes(moduli, "frequency [Hz]", f"modulus [{unit}]")
    style.label_axes(errors, "frequency [Hz]", "error of the modulus [%]")
    for axes in (moduli, errors):
        style.log_if_wide(axes, frequency)
    moduli.axvspan(low, high, color="#ebebeb", lw=0, zorder=0)
    errors.set_ylim(bottom=0.0)
    style.explain(
        figure,
        "Wide grey: the model; coloured: its arms; solid storage, dashed loss. Shaded: where the arms were fitted.",
        *(f"{part.sentence}." for part in arms),
    )
    return figure
