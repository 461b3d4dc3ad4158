"""Conversion of charts to compact SVG for HTML pages."""

from __future__ import annotations

import io
import json
import re
from functools import partial
from typing import TYPE_CHECKING, NamedTuple
from xml.etree import ElementTree

from markupsafe import Markup

from bushfit.report import plots

if TYPE_CHECKING:
    from bushfit.report.plots.style import Chart

_SVG, _HREF = "{http://www.w3.org/2000/svg}", "{http://www.w3.org/1999/xlink}href"
_NUMBER = re.compile(r"-?\d+\.\d{2,}")
_FONT = re.compile(r"(?P<weight>bold )?(?P<size>[\d.]+px) .*")
#: Length of the path data [characters] below which a shape is a marker, which is small and needs two decimals.
_SMALL_SHAPE = 500
#: Font families as wide as the font that matplotlib uses for the layout.
_FAMILY = "DejaVu Sans, Verdana, sans-serif"


class Picture(NamedTuple):
    """Drawing of a chart in an HTML page, with its texts.

    Args:
        title: heading above the chart.
        caption: explanation below the chart.
        svg: SVG element with the panels, without heading and explanation.
    """

    title: str
    caption: str
    svg: Markup


def picture(chart: Chart, name: str, title: str) -> Picture:
    """Convert a chart to SVG for a page: only its panels, since the page shows heading and explanation as text.

    Some viewers of the page (Jenkins, mail) forbid style attributes and style sheets. Colours and fonts are therefore
    separate SVG attributes. Numbers have one decimal, a tenth of a point.

    Args:
        chart: chart to draw.
        name: unique name in the page, used as the prefix of SVG identifiers.
        title: heading of the chart in the page.

    Returns:
        Title, caption and drawing for the template.
    """
    chart.arrange(texts=False)
    image = plots.style.to_image(chart, "svg", outlines=False)
    width, height = 72.0 * chart.get_size_inches()
    # for the script of the page, which shows the values under the pointer: of each visible panel with lines left, top,
    # right and bottom in the drawing [point]; limits of x and y; True or False for logarithmic x and y; labels
    panels = []
    for axes in chart.axes:
        if axes.lines and axes.get_visible() and axes.get_xlabel():
            box = axes.get_position()
            corners = box.x0 * width, (1.0 - box.y1) * height, box.x1 * width, (1.0 - box.y0) * height
            limits = (float(f"{limit:.6g}") for limit in (*axes.get_xlim(), *axes.get_ylim()))
            logarithmic = [scale == "log" for scale in (axes.get_xscale(), axes.get_yscale())]
            labels = [" ".join(label.split()) for label in (axes.get_xlabel(), axes.get_ylabel())]
            panels.append([*(round(float(corner), 1) for corner in corners), *limits, *logarithmic, *labels])
    chart.arrange(texts=True)
    ElementTree.register_namespace("", _SVG.strip("{}"))
    root = ElementTree.parse(io.BytesIO(image)).getroot()
    _rewrite(root, name)
    root.attrib.clear()
    root.attrib |= {
        "viewBox": f"0 0 {width:.1f} {height:.1f}",
        "role": "img",
        "aria-label": f"{title}. {chart.caption}".strip(". "),
        "stroke-linejoin": "round",
        "font-family": _FAMILY,
        "data-axes": json.dumps(panels, separators=(",", ":")),
    }
    svg = ElementTree.tostring(root, encoding="unicode").replace("\n", "").replace(" />", "/>")
    return Picture(title, chart.caption, Markup(re.sub(r">\s+<", "><", svg)))


def _rewrite(root: ElementTree.Element, prefix: str) -> None:
    """Simplify an SVG: no metadata or style sheets, styles as attributes, short numbers, identifiers with a prefix.

    Attributes that all children of a group share are moved to the group, and attributes that a marker repeats dropped.
    """
    for parent in list(root.iter()):
        for child in list(parent):
            if child.tag in (f"{_SVG}metadata", f"{_SVG}style"):
                parent.remove(child)
    names: dict[str, str] = {}
    for element in root.iter():
        for declaration in filter(None, element.attrib.pop("style", "").split(";")):
            key, _, value = (part.strip() for part in declaration.partition(":"))
            if key == "font" and (font := _FONT.fullmatch(value)):
                element.attrib |= {"font-size": font["size"].removesuffix("px")}
                element.attrib |= {"font-weight": "bold"} if font["weight"] else {}
            elif key != "font-family":
                element.set(key, value.removesuffix("px"))
        for key, new_key, form in ((_HREF, "href", "#{}"), ("clip-path", "clip-path", "url(#{})")):
            if reference := re.search(r"#([\w-]+)", element.attrib.pop(key, "")):
                element.set(new_key, form.format(names.setdefault(reference[1], f"{prefix}{len(names)}")))
    for element in root.iter():
        identifier, decimals = element.attrib.pop("id", ""), 1
        if identifier in names:
            element.set("id", names[identifier])
            decimals = 2 if len(element.get("d", "")) < _SMALL_SHAPE else 1
        for key in {"x", "y", "width", "height", "transform", "d"}.intersection(element.keys()):
            numbers = partial(lambda count, digits: f"{float(digits[0]):.{count}f}".rstrip("0").rstrip("."), decimals)
            value = _NUMBER.sub(numbers, element.attrib[key])
            element.set(key, re.sub(r"\s*([A-Za-z])\s*", r"\1", value).strip() if key == "d" else value)
        if element.get("transform", "").startswith("rotate(-0 "):
            del element.attrib["transform"]
    shapes = {f"#{element.get('id')}": element for element in root.iter() if element.get("id")}
    for marker in root.iter(f"{_SVG}use"):
        for key in {*marker.attrib} & {*shapes[marker.get("href", "")].attrib}:
            del marker.attrib[key]
    for group in root.iter(f"{_SVG}g"):
        children = list(group)
        if len(children) < 2 or len({child.tag for child in children}) > 1:
            continue
        for key, value in list(children[0].attrib.items()):
            if key not in ("x", "y", "d", "href", "id") and all(child.get(key) == value for child in children):
                group.set(key, value)
                for child in children:
                    del child.attrib[key]
