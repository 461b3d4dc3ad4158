"""The picture of Maxwell arms: the model, its arms, and an error that stays within what was asked for."""

from __future__ import annotations

import numpy as np
from figures import labels, lines

from bushfit.model.arms import model_arms
from bushfit.model.model import Model
from bushfit.report.plots.arms import arms_figure


def test_arms_are_drawn_over_what_they_stand_for(paper_model: Model) -> None:
    model = paper_model.with_effect("second_springpot", {"second_springpot.m": 2e3})
    arms = model_arms(model, (5.0, 155.0), 0.01)
    figure = arms_figure(model, arms, "CMP 15 961")
    assert labels(figure) == ["frequency [Hz]", "modulus [MPa]", "frequency [Hz]", "error of the modulus [%]"]
    moduli, errors = figure.axes
    assert (len(lines(moduli)), len(lines(errors))) == (8, 2)
    for part, line in zip(arms, lines(errors), strict=True):
        assert 0.95 * part.error < line.get_ydata().max() / 100.0 <= part.error * 1.01
        assert line.get_xdata().min() >= 5.0
    omega = 2.0 * np.pi * lines(moduli)[1].get_xdata()
    np.testing.assert_allclose(lines(moduli)[1].get_ydata(), 1e-6 * arms[0].at(omega).real)
    assert "in place of the springpot" in " ".join(figure.get_supxlabel().split())
