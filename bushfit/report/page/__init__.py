"""Pages of a result (report.html), a comparison (compare.html) and a batch (index.html), one file each."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bushfit.errors import printable
from bushfit.units import number

if TYPE_CHECKING:
    import jinja2

    from bushfit.report.results import ResultFile

#: Folder of the templates, and of the style sheet and the script that every page contains.
_TEMPLATES = Path(__file__).parent / "templates"


def report_page(files: Sequence[ResultFile]) -> str:
    """Make the report of a result as an HTML page.

    Args:
        files: documents (model, fit without the effects of a diagnosis, diagnosis), tables (sweeps, loops, gap, and
            predictions of directions and specimens) and figures.

    Raises:
        ModelError: no model among the documents, or a document or table that is not as bushfit writes it.
    """
    from bushfit.report.page.record import report_record
    from bushfit.report.page.report import report_context

    return rendered("report.html", report_context(report_record(files)))


def comparison_page(files: Sequence[ResultFile]) -> str:
    """Make the HTML page of a comparison from its document, compare.json, and its figure.

    Raises:
        ModelError: a document that is not as bushfit writes it.
    """
    from bushfit.report.page.comparison import comparison_context

    return rendered("compare.html", comparison_context(files))


def rendered(template: str, context: dict[str, Any]) -> str:
    """Render a complete HTML page, with a content security policy that allows only its own style sheet and script.

    Args:
        template: file name of the template.
        context: values of the variables of the template, by name.

    Returns:
        The page as HTML.
    """
    from markupsafe import Markup

    style, script = (Markup((_TEMPLATES / name).read_text(encoding="utf-8")) for name in ("style.css", "script.js"))
    digests = [base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in (style, script)]
    sources = "style-src 'sha256-{}'; script-src 'sha256-{}'; img-src data:".format(*digests)
    allowed = f"default-src 'none'; {sources}; base-uri 'none'; form-action 'none'"
    page = filled(template, {"style": style, "script": script, "allowed": allowed, **context})
    return printable(page, lines=True) + "\n"


def filled(template: str, context: dict[str, Any]) -> str:
    """Render a template, by its file name, with the values of its variables; texts are escaped for HTML."""
    return _environment().get_template(template).render(context)


@cache
def _environment() -> jinja2.Environment:
    """Template environment with the filters `number` (significant digits), `formula` and `px` (pixels)."""
    import jinja2

    from bushfit.report.page.formulas import formula

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    pixels = {"px": lambda length: f"{length:.1f}".removesuffix(".0")}
    environment.filters |= {"number": number, "formula": formula, **pixels}
    return environment


def folder_pages(folder: Path, base: str = "") -> list[ResultFile]:
    """HTML pages for a results folder: report.html for a result, compare.html for a comparison, index.html for a batch.

    Args:
        folder: results folder written by `bushfit run`, `diagnose`, a fit, `compare` or `batch`.
        base: prefix of the links of a batch page that is written to another folder.

    Returns:
        Result files for the pages; their content is made when they are written.

    Raises:
        ModelError: a folder without results, or a file in it that is not as bushfit writes it.
    """
    from bushfit.report.page.comparison import read_comparison
    from bushfit.report.page.index import index_page, read_batch
    from bushfit.report.page.record import has_model, read_results
    from bushfit.report.results import ResultFile

    if (folder / "batch.json").exists():
        return [ResultFile("index", "page", partial(partial(index_page, folder=folder, base=base), read_batch(folder)))]
    compared = (folder / "compare.json").exists()
    pages = [ResultFile("compare", "page", partial(comparison_page, read_comparison(folder)))] if compared else []
    if has_model(folder) or not compared:
        pages.append(ResultFile("report", "page", partial(report_page, read_results(folder))))
    return pages
