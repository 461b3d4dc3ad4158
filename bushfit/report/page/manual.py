"""The manual as one HTML page without outside links, made from its Markdown files."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

from bushfit.report.page import render_page

if TYPE_CHECKING:
    from collections.abc import Sequence

    from markdown_it.token import Token

#: Folder of the Markdown files.
FOLDER = Path(__file__).parents[2] / "manual"
#: Name of the first page, which lists the commands; the others follow in alphabetical order.
_FIRST = "commands"


def page_names() -> list[str]:
    """Names of the pages of the manual in their order: files of the folder without their extension."""
    return sorted((file.stem for file in FOLDER.glob("*.md")), key=lambda name: (name != _FIRST, name))


def manual_page() -> str:
    """Convert the Markdown files of the manual to one HTML page with a table of contents.

    Headings get the identifiers `<page>--<anchor>`, with the anchors that code hosts give them. Links between the pages
    become links within the page; links to other files of the source tree, which an installation does not have, become
    plain text.

    Returns:
        The page as HTML.
    """
    from markdown_it import MarkdownIt
    from markupsafe import Markup

    names, parser = page_names(), MarkdownIt("commonmark", {"html": False}).enable("table")
    chapters = []
    for name in names:
        text = re.sub("<!--.*?-->", "", (FOLDER / f"{name}.md").read_text(encoding="utf-8"))
        tokens = parser.parse(text)
        count, title = Counter[str](), name
        for token, heading in zip(tokens, [None, *tokens], strict=False):
            children = token.children or ()
            if heading and heading.type == "heading_open":
                words = "".join(part.content for part in children if part.type in ("text", "code_inline"))
                anchor = re.sub(r"[^\w\- ]", "", words.lower()).replace(" ", "-")
                heading.attrSet("id", f"{name}--{anchor}" + (f"-{count[anchor]}" if count[anchor] else ""))
                count[anchor] += 1
                title = words if heading.tag == "h1" else title
            _redirect_links(children, name, names)
            if token.type == "table_open":  # on a narrow screen it scrolls, also by keyboard
                token.attrSet("tabindex", "0")
        chapters.append((name, title, Markup(parser.renderer.render(tokens, parser.options, {}))))
    return render_page("manual.html", {"chapters": chapters})


def _redirect_links(tokens: Sequence[Token], name: str, names: Sequence[str]) -> None:
    """Redirect the links of a paragraph into the HTML page, and replace images by their descriptions.

    Args:
        tokens: tokens of the paragraph; links to other pages are redirected, links to other files are hidden.
        name: name of the page that contains the paragraph.
        names: names of all pages.
    """
    hidden = False
    for token in tokens:
        if token.type == "link_open":
            file, _, anchor = str(token.attrGet("href")).partition("#")
            target = Path(file).stem if file else name
            hidden = not file.startswith("https:")
            if hidden and target in names and file in ("", f"{target}.md"):
                token.attrSet("href", f"#{target}--{anchor}" if anchor else f"#{target}")
                hidden = False
        if token.type in ("link_open", "link_close"):
            token.hidden = hidden
        elif token.type == "image":
            token.type = "text"
