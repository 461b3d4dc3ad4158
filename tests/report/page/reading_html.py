"""A page as its reader's browser takes it: elements, texts, and what it would load."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field
from html.parser import HTMLParser

#: Elements that have no end.
VOID = {"meta", "link", "br", "hr", "img", "input"}
#: What makes a browser load something.
LOADING = {"src", "srcset", "data", "poster", "background", "action", "formaction", "xlink:href"}


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
    asked += [
        f"<{tag}>" for tag in ("link", "iframe", "object", "embed", "base", "img", "image", "use") if found.counts[tag]
    ]
    styles = re.findall(r"url\(|@import|expression\(", page)
    handlers = [name for _, name, _ in found.attributes if name.startswith("on")]
    addresses = set(re.findall(r"https?://[^\s\"'<]*", page)) - {"http://www.w3.org/2000/svg"}
    return [*asked, *styles, *handlers, *addresses]
