"""What a figure of raw files shows, and where its texts collide or leave it."""

from __future__ import annotations

from itertools import combinations

from matplotlib.figure import Figure


def labels(figure: Figure) -> set[str]:
    return {
        " ".join(label.split()) for axes in figure.axes for label in (axes.get_xlabel(), axes.get_ylabel()) if label
    }


def colliding(figure: Figure) -> list[tuple[str, str]]:
    """Labels of y axes that run into each other or into a panel's title."""
    figure.draw_without_rendering()
    texts = [axes.yaxis.label for axes in figure.axes] + [axes._left_title for axes in figure.axes]
    boxes = [(text.get_text(), text.get_window_extent()) for text in texts if text.get_text()]
    return [(name, other) for (name, box), (other, beside) in combinations(boxes, 2) if box.overlaps(beside)]


def outside(figure: Figure) -> list[str]:
    """Texts that leave the canvas."""
    figure.draw_without_rendering()
    texts = [text for axes in figure.axes for text in (axes.xaxis.label, axes.yaxis.label, axes.title)]
    boxes = [(text.get_text(), text.get_window_extent()) for text in texts if text.get_text()]
    boxes += [("legend", box.get_window_extent()) for axes in figure.axes if (box := axes.get_legend())]
    canvas = figure.bbox
    return [
        name for name, box in boxes
        if box.x0 < -1 or box.x1 > canvas.x1 + 1 or box.y0 < -1 or box.y1 > canvas.y1 + 1
    ]  # fmt: skip
