"""The style of all figures: the same figure is the same file, any name a title, and no text lies on another."""

from __future__ import annotations

import matplotlib
import numpy as np
import pytest
from figures import Looped, Swept, predicted
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from bushfit.geometry import Direction
from bushfit.model.model import Model
from bushfit.report.plots.fits import loops_figure, sweeps_figure
from bushfit.report.plots.prediction import prediction_figure
from bushfit.report.plots.style import dress, to_image


def test_same_figure_same_bytes_and_no_trace_of_when_or_with_what(paper_model: Model, swept: Swept) -> None:
    prediction, curves = predicted(paper_model, Direction.AXIAL)
    settings = dict(matplotlib.rcParams)
    pictures = {
        to_image(prediction_figure(prediction, [swept(paper_model)], "CMP 15 961", curves=curves)) for _ in range(2)
    }
    assert len(pictures) == 1
    assert pictures.pop()[:8] == b"\x89PNG\r\n\x1a\n"
    assert dict(matplotlib.rcParams) == settings
    picture = to_image(prediction_figure(prediction, [], "x"))
    assert not any(chunk in picture for chunk in (b"tEXt", b"iTXt", b"zTXt", b"tIME", b"Matplotlib"))


@pytest.mark.parametrize("title", ["price in $ and 50 %, a_b^c\\", "衬套 61 Shore A", "x" * 300, ""])
def test_any_name_can_be_a_title(paper_model: Model, title: str) -> None:
    prediction, _ = predicted(paper_model, Direction.AXIAL)
    assert to_image(prediction_figure(prediction, [], title))


def test_no_text_lies_on_another(paper_model: Model, swept: Swept, looped: Looped) -> None:
    prediction, curves = predicted(paper_model, Direction.AXIAL, amplitudes=np.geomspace(1e-5, 1e-3, 6))
    for figure in (
        prediction_figure(prediction, [swept(paper_model)], "CMP 15 961", curves=curves),
        sweeps_figure(paper_model, [swept(paper_model), swept(paper_model, Direction.RADIAL)], "CMP 15 961"),
        loops_figure(paper_model, [looped(paper_model, 1e-3), looped(paper_model, 5e-4)], "CMP 15 961"),
    ):
        figure.draw_without_rendering()
        boxes = [axes.get_tightbbox() for axes in figure.axes]
        assert not any(
            overlap(one, other) for number, one in enumerate(boxes) for other in boxes[:number] if one and other
        )
        canvas = figure.bbox
        assert all(box is not None and box.x0 >= 0 and box.x1 <= canvas.x1 + 1 for box in boxes)


def overlap(one: Bbox, other: Bbox) -> bool:
    common = Bbox.intersection(one, other)
    return common is not None and common.width > 1.0 and common.height > 1.0


def test_the_name_of_a_panel_is_in_lines_no_higher_than_the_panel() -> None:
    axes = Figure().add_subplot()
    for label, lines in (
        ("axial stiffness |K| [N/mm]", ["axial stiffness |K| [N/mm]"]),
        ("torsion stiffness |K| [N m/deg]", ["torsion stiffness |K|", "[N\u00a0m/deg]"]),
        ("DMA, second specimen modulus [MPa]", ["DMA, second specimen", "modulus [MPa]"]),
    ):
        dress(axes, "", label)
        assert axes.get_ylabel().splitlines() == lines
