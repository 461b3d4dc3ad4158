"""A page as its reader's browser takes it: elements, texts, what it would load; and results that somebody spoiled."""

import json
import re
from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass, field
from html import unescape
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np

from bushfit.errors import printable
from bushfit.report.page import folder_pages
from bushfit.report.results import Formats, encode_all

#: A page at most [bytes].
LARGEST = 500_000
#: Elements that have no end.
VOID = {"meta", "link", "br", "wbr", "hr", "img", "input"}
#: What makes a browser load something.
LOADING = {"src", "srcset", "data", "poster", "background", "action", "formaction", "xlink:href"}

#: Names that would do harm where they are not escaped.
HARMFUL = ['"><script>alert(1)</script>', "</style><b>a'b\"c{{ 7*7 }}&lt;<!--']]>", "=1+1\u202eabc"]


@dataclass
class Parsed(HTMLParser):
    """Raises where elements are not closed in turn."""

    counts: Counter[str] = field(default_factory=Counter)
    texts: list[str] = field(default_factory=list)
    attributes: list[tuple[str, str, str]] = field(default_factory=list)
    open_: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__(convert_charrefs=True)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.counts[tag] += 1
        self.attributes += [(tag, name, value or "") for name, value in attrs]
        names = [name for name, _ in attrs]
        assert len(names) == len(set(names)), f"an attribute of <{tag}> twice"
        if tag not in VOID:
            self.open_.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open_.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self.open_, f"</{tag}> of nothing"
        assert self.open_.pop() == tag, f"</{tag}> out of turn"

    def handle_data(self, data: str) -> None:
        if not self.open_ or self.open_[-1] not in ("script", "style"):
            self.texts.append(data)

    @property
    def text(self) -> str:
        """All that is read."""
        return " ".join(" ".join(self.texts).split())


def parsed(page: str) -> Parsed:
    """A page, well-formed."""
    assert page.startswith('<!DOCTYPE html>\n<html lang="en">')
    found = Parsed()
    found.feed(page)
    found.close()
    assert found.open_ == []
    ids = [value for _, name, value in found.attributes if name == "id"]
    assert len(ids) == len(set(ids))
    return found


def loads(page: str) -> list[str]:
    """What a page would load from anywhere, links that are followed by hand aside."""
    found = parsed(page)
    asked = [f"{tag} {name}={value}" for tag, name, value in found.attributes if name in LOADING]
    asked += [f"<{tag}>" for tag in ("link", "iframe", "object", "embed", "base", "img", "image") if found.counts[tag]]
    styles = re.findall(r"url\((?!#)|@import|expression\(", page)
    handlers = [name for _, name, _ in found.attributes if name.startswith("on")]
    addresses = set(re.findall(r"https?://[^\s\"'<]*", page)) - {"http://www.w3.org/2000/svg"}
    return [*asked, *styles, *handlers, *addresses]


def assert_harmless(page: str, plain: Parsed, name: str) -> None:
    """Whatever stands in a text, the page has the same elements and attributes as a plain one, and says it to the
    letter."""
    found = parsed(page)
    same = ("script", "style", "svg", "section", "table", "h2", "b", "a", "meta", "body", "button")
    assert {tag: found.counts[tag] for tag in same} == {tag: plain.counts[tag] for tag in same}
    assert {key for _, key, _ in found.attributes} == {key for _, key, _ in plain.attributes}
    assert " ".join(printable(name).split()) in found.text
    assert loads(page) == [] or "//" in name


def drawn(page: str, title: str) -> list[np.ndarray]:
    """The points of each panel of a figure by its title, in the units of its axes, (2, n) each."""
    (svg,) = re.findall(rf"<h3>{re.escape(title)}</h3>.*?(<svg.*?</svg>)", page, re.DOTALL)
    spots = np.array(re.findall(r'<use x="([-\d.]+)" y="([-\d.]+)"', svg), dtype=float).T
    panels = []
    for left, top, right, bottom, x_low, x_high, y_low, y_high, x_log, y_log, *_ in json.loads(
        unescape(re.findall(r'data-axes="([^"]*)"', svg)[0])
    ):
        inside = (spots[0] > left + 0.2) & (spots[0] < right) & (spots[1] > top) & (spots[1] < bottom - 0.2)
        shares = (spots[0][inside] - left) / (right - left), (bottom - spots[1][inside]) / (bottom - top)
        ends = (x_low, x_high, x_log), (y_low, y_high, y_log)
        panels.append(
            np.array(
                [
                    low * (high / low) ** share if log else low + (high - low) * share
                    for share, (low, high, log) in zip(shares, ends, strict=True)
                ]
            )
        )
    return panels


def spoiled(value: Any, name: str, keys: Collection[str], key: str = "") -> Any:
    """A document with this name in place of the texts of these keys, which come from a user, and in those of places."""
    if isinstance(value, dict) and key == "places":
        return {f"{name}{n}": columns for n, columns in enumerate(value.values())}
    if isinstance(value, dict):
        return {each: spoiled(inside, name, keys, each) for each, inside in value.items()}
    if isinstance(value, list):
        return [spoiled(each, name, keys, "" if isinstance(each, dict) else key) for each in value]
    return name if isinstance(value, str) and key in keys else value


def change(file: Path, **keys: object) -> None:
    file.write_text(json.dumps(json.loads(file.read_text(encoding="utf-8")) | keys), encoding="utf-8")


def page_of(folder: Path) -> str:
    return (folder / "report.html").read_text(encoding="utf-8")


def made_of(folder: Path) -> str:
    """The report that is made of what stands in a folder."""
    return encode_all(folder_pages(folder), Formats())["report.html"].decode()
