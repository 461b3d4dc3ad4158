"""The pages of a result, `report.html`, of a comparison, `compare.html`, and of a batch, `index.html`: one file each,
complete without a network."""

from __future__ import annotations

import base64
import hashlib
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bushfit.errors import printable

if TYPE_CHECKING:
    import jinja2

    from bushfit.report.contents import Documents, Tables

#: Where the templates are, with the style sheet and the script that go into every page.
_TEMPLATES = Path(__file__).parent / "templates"


def report_page(documents: Documents, tables: Tables) -> str:
    """The report of a result as HTML: the same text for the same documents and tables, to the digits of their files.

    Raises:
        ModelError: no model among the documents, or a spoiled one.
    """
    from bushfit.report.page.readback import canonical, checked
    from bushfit.report.page.story import story

    same = {name: canonical(table) for name, table in tables.items()}
    return rendered("report.html", story(checked(documents), same))


def comparison_page(documents: Documents, _: Tables) -> str:
    """The page of a comparison as HTML, made of its document alone.

    Raises:
        ModelError: a spoiled document.
    """
    from bushfit.report.compared import SideBySide
    from bushfit.report.page.comparison import account

    return rendered("compare.html", account(SideBySide.of(documents["compare"])))


def rendered(template: str, context: dict[str, Any]) -> str:
    """A template with its context; no style or script but the page's own may run, and nothing may be loaded."""
    from markupsafe import Markup

    style, script = (Markup((_TEMPLATES / name).read_text(encoding="utf-8")) for name in ("style.css", "script.js"))
    allowed = (
        f"default-src 'none'; style-src {_hash(style)}; script-src {_hash(script)}; base-uri 'none'; form-action 'none'"
    )
    page = _environment().get_template(template).render(style=style, script=script, allowed=allowed, **context)
    return printable(page, lines=True) + "\n"


def _hash(text: str) -> str:
    """A text as a content policy names it."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


@cache
def _environment() -> jinja2.Environment:
    """Templates in which all that comes from elsewhere is escaped."""
    import jinja2

    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
