"""Figures of tests with many amplitudes: nothing leaves the page, and levels have a legend or a colour bar."""

from typing import Any
from unittest import mock

import numpy as np
import pytest
from commandline import typing
from matplotlib.colors import to_hex, to_rgba
from matplotlib.figure import Figure
from paper import BUSHING, PARAMETERS
from tries import some

from bushfit.report.plots.style import _SCALES, fixed_settings, styles

CAMPAIGN = f"""
{BUSHING.replace('"B"', '"A name that tells all that is known of the bushing and of its tests"')}
{PARAMETERS}
[simulate]
noise = "1 %"
[[simulate.sweeps]]
direction = "axial"
frequencies = {{ start = "5 Hz", stop = "155 Hz", step = "10 Hz" }}
"""
#: A picture that is higher does not fit on three pages of A4 [inch].
HIGHEST = 33.0


@fixed_settings()
def assert_whole(figure: Figure) -> None:
    """Nothing leaves the figure, and no panel is too small."""
    figure.draw_without_rendering()
    boxes = [axes.get_tightbbox() for axes in figure.axes]
    boxes += [legend.get_window_extent() for axes in figure.axes if (legend := axes.get_legend())]
    for box in filter(None, boxes):
        assert min(box.x0, box.y0) >= -1
        assert max(box.x1 - figure.bbox.x1, box.y1 - figure.bbox.y1) <= 1
    width, height = figure.get_size_inches()
    assert height < HIGHEST
    for place in (axes.get_position() for axes in figure.axes if axes.axison):
        assert (place.height * height > 0.5, place.width * width > 1.2) == (True, True)


@pytest.mark.parametrize("count", some([8, 40], {40}))
def test_levels_are_named_by_a_legend_or_a_colour_bar(tmp_path, count):
    figures: list[Figure] = []

    def keep(figure: Figure, *_: Any, **options: Any) -> bytes:
        figures.append(figure)
        return b""

    amplitudes = [f"{amplitude:.4g} mm" for amplitude in np.geomspace(0.02, 1.0, count)]
    (tmp_path / "plan.toml").write_text(f"{CAMPAIGN}amplitudes = {amplitudes}\n")
    run, file = typing(tmp_path), "s/sweep_axial.csv"
    run("simulate", "plan.toml", "-o", "s")
    with mock.patch("bushfit.report.plots.style.to_image", keep):
        run("inspect", file, "-o", "i")
        run("fit", "s/campaign.toml", "-o", "f")
        run("predict", "f", "--campaign", "s/campaign.toml", "--direction", "axial", "-o", "p")
        run("diagnose", "s/campaign.toml", "--max-effects", "0", "--no-report", "-o", "d")
    assert len(figures) == 4
    for figure in figures:
        assert_whole(figure)
    sweep = figures[1].axes
    if count > 8:
        (bar,) = sweep[1].child_axes
        names = [tick.get_text() for tick in bar.get_yticklabels()]
        assert (len(names), names[0], names[-1], bar.get_title()) == (8, "0.02 mm", "1 mm", "amplitude")
        drawn = next(line for line in sweep[0].get_lines() if line.get_linestyle() == "None").get_color()
        np.testing.assert_allclose(bar._colorbar.mappable.to_rgba(0), to_rgba(drawn), err_msg="of the smallest")
    else:
        legend = sweep[1].get_legend()
        assert legend
        assert len(legend.get_texts()) == count


def test_curves_have_the_stored_colours_lines_and_markers(file_regression):
    """For a few curves, as many as a legend names, and more."""
    looks = {(palette, count): styles(count, palette) for palette in _SCALES for count in (2, 8, 9)}
    lines = [
        f"{key}: {[(to_hex(look.color), look.dashes, look.marker) for look in look_of]}"
        for key, look_of in looks.items()
    ]
    file_regression.check("\n".join(lines) + "\n", encoding="utf-8")
