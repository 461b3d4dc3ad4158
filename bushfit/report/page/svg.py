"""Figures of matplotlib as SVG inside a page."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple
from xml.etree import ElementTree

from markupsafe import Markup

from bushfit.report import plots

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SVG, _HREF = "http://www.w3.org/2000/svg", "{http://www.w3.org/1999/xlink}href"
_NUMBER = re.compile(r"-?\d+\.\d{2,}")
_FONT = re.compile(r"(?P<weight>bold )?(?P<size>[\d.]+px) .*")
#: Length of the path of a marker at most: it is small and needs two decimals.
_SMALL_SHAPE = 500
#: Fonts as wide as the one that matplotlib lays out with.
_FAMILY = "DejaVu Sans, Verdana, sans-serif"


class Picture(NamedTuple):
    """A figure in a page.

    Args:
        title: of the figure.
        caption: explanation below the figure.
        svg: drawing without title and caption.
    """

    title: str
    caption: str
    svg: Markup


def picture(figure: Figure, name: str) -> Picture:
    """A figure as SVG for a page: without title and caption, which the page shows as text.

    Pages are shown where a content policy forbids style attributes and style sheets (Jenkins, mail), so that colours
    and fonts are attributes of their own. Numbers have one decimal, a tenth of a point.

    Args:
        figure: to draw; title and caption are removed from it.
        name: that no other picture of the page has; identifiers begin with it.

    Returns:
        Title, caption and drawing for the template.
    """
    title, caption = figure.get_suptitle().replace("\n", " "), figure.get_supxlabel().replace("\n", " ")
    figure.suptitle("")
    figure.supxlabel("")
    ElementTree.register_namespace("", _SVG)
    root = ElementTree.parse(io.BytesIO(plots.style.to_image(figure, "svg", outlines=False))).getroot()
    for parent in list(root.iter()):
        for child in list(parent):
            if child.tag in (f"{{{_SVG}}}metadata", f"{{{_SVG}}}style"):
                parent.remove(child)
    targets = dict.fromkeys(target for element in root.iter() for _, target in _references(element))
    names = {target: f"{name}{count}" for count, target in enumerate(targets)}
    for element in root.iter():
        _rewrite(element, names)
    _hoist(root)
    _unwrap(root)
    axes = json.dumps(list(_axes(figure)), separators=(",", ":"))
    attributes = {"viewBox": root.attrib["viewBox"], "role": "img", "aria-label": f"{title}. {caption}".strip(". ")}
    root.attrib.clear()
    root.attrib.update({**attributes, "stroke-linejoin": "round", "font-family": _FAMILY, "data-axes": axes})
    text = ElementTree.tostring(root, encoding="unicode").replace("\n", "").replace(" />", "/>")
    return Picture(title, caption, Markup(re.sub(r">\s+<", "><", text)))


def _axes(figure: Figure) -> Iterator[list[Any]]:
    """Panels with lines, for reading values under the pointer.

    Yields:
        Left, top, right and bottom in the drawing [point]; left, right, lower and upper limit; whether x and y are
        logarithmic; labels.
    """
    width, height = 72.0 * figure.get_size_inches()
    for axes in figure.axes:
        if axes.lines and axes.get_visible() and axes.get_xlabel():
            box = axes.get_window_extent().transformed(figure.transFigure.inverted())
            corners = box.x0 * width, (1.0 - box.y1) * height, box.x1 * width, (1.0 - box.y0) * height
            limits = (float(f"{limit:.6g}") for limit in (*axes.get_xlim(), *axes.get_ylim()))
            logarithmic = [scale == "log" for scale in (axes.get_xscale(), axes.get_yscale())]
            labels = [" ".join(label.split()) for label in (axes.get_xlabel(), axes.get_ylabel())]
            yield [*(round(float(corner), 1) for corner in corners), *limits, *logarithmic, *labels]


def _references(element: ElementTree.Element) -> Iterator[tuple[str, str]]:
    """Attributes of an element that refer to an identifier, and the identifiers."""
    for key in (_HREF, "clip-path"):
        match = re.search(r"#([\w-]+)", element.get(key, ""))
        if match:
            yield key, match[1]


def _rewrite(element: ElementTree.Element, names: Mapping[str, str]) -> None:
    """Turn the style of an element into attributes, shorten its numbers, and give identifiers names of the page."""
    for declaration in filter(None, element.attrib.pop("style", "").split(";")):
        key, _, value = (part.strip() for part in declaration.partition(":"))
        if key == "font" and (font := _FONT.fullmatch(value)):
            element.attrib |= {"font-size": font["size"].removesuffix("px")}
            element.attrib |= {"font-weight": "bold"} if font["weight"] else {}
        elif key != "font-family":
            element.set(key, value.removesuffix("px"))
    for key, target in list(_references(element)):
        del element.attrib[key]
        reference = {_HREF: ("href", f"#{names[target]}"), "clip-path": ("clip-path", f"url(#{names[target]})")}[key]
        element.set(*reference)
    identifier = element.attrib.pop("id", None)
    decimals = 1
    if identifier and identifier in names:
        element.set("id", names[identifier])
        decimals = 2 if len(element.get("d", "")) < _SMALL_SHAPE else 1
    for key in ("x", "y", "width", "height", "transform", "d"):
        if key in element.attrib:
            value = _NUMBER.sub(lambda number: _rounded(number[0], decimals), element.attrib[key])
            element.set(key, re.sub(r"\s*([A-Za-z])\s*", r"\1", value).strip() if key == "d" else value)
    if element.get("transform", "").startswith("rotate(-0 "):
        del element.attrib["transform"]


def _rounded(number: str, decimals: int) -> str:
    return f"{float(number):.{decimals}f}".rstrip("0").rstrip(".")


def _hoist(root: ElementTree.Element) -> None:
    """Give groups the attributes that all of their children share, and drop from markers what their shape states."""
    shapes = {f"#{element.get('id')}": element for element in root.iter() if element.get("id")}
    for marker in root.iter(f"{{{_SVG}}}use"):
        for key in {*marker.attrib} & {*shapes[marker.get("href", "")].attrib}:
            del marker.attrib[key]
    for group in root.iter(f"{{{_SVG}}}g"):
        children = list(group)
        if len(children) < 2 or len({child.tag for child in children}) > 1:
            continue
        for key, value in list(children[0].attrib.items()):
            if key not in ("x", "y", "d", "href", "id") and all(child.get(key) == value for child in children):
                group.set(key, value)
                for child in children:
                    del child.attrib[key]


def _unwrap(parent: ElementTree.Element) -> None:
    """Put the children of groups without attributes in the place of these groups."""
    children = []
    for child in list(parent):
        _unwrap(child)
        children += list(child) if child.tag == f"{{{_SVG}}}g" and not child.attrib else [child]
    parent[:] = children
