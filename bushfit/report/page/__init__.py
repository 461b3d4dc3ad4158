"""Pages of a result (report.html), a comparison (compare.html) and a batch (index.html), one file each."""

from __future__ import annotations

import base64
import hashlib
from functools import partial
from pathlib import Path
from typing import Any

from bushfit.errors import ModelError, printable
from bushfit.model.file import read_document, require_schema
from bushfit.report.results import ResultFile
from bushfit.templates import template_environment
from bushfit.units import format_range, number
from bushfit.validation import validate_tables

#: Folder of the templates, and of the style sheet and the script that every page contains.
TEMPLATES = Path(__file__).parent / "templates"


def render_page(template: str, context: dict[str, Any]) -> str:
    """Render a complete HTML page, with a content security policy that allows only its own style sheet and script.

    Args:
        template: file name of the template.
        context: values of the variables of the template, by name.

    Returns:
        The page as HTML.
    """
    from markupsafe import Markup

    from bushfit.report.page.formulas import formula

    style, script = (Markup((TEMPLATES / name).read_text(encoding="utf-8")) for name in ("style.css", "script.js"))
    digests = [base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in (style, script)]
    sources = "style-src 'sha256-{}'; script-src 'sha256-{}'; img-src data:".format(*digests)
    allowed = f"default-src 'none'; {sources}; base-uri 'none'; form-action 'none'"
    constants = {"style": style, "script": script, "allowed": allowed}
    environment = template_environment(TEMPLATES, is_markup=True)
    environment.filters |= {"number": number, "formula": formula}
    environment.globals["format_range"] = format_range
    return printable(environment.get_template(template).render({**constants, **context}), lines=True)


def folder_pages(folder: Path, base: str = "", date: str | None = None) -> list[ResultFile]:
    """HTML pages for a results folder: report.html for a result, compare.html for a comparison, index.html for a batch.

    Args:
        folder: results folder written by `bushfit run`, `diagnose`, a fit, `compare` or `batch`.
        base: prefix of the links of a batch page that is written to another folder.
        date: date in the head of report.html; None for the date that the campaign states.

    Returns:
        Result files for the pages; their content is made when they are written.

    Raises:
        ModelError: a folder without results, or a file in it that is not as bushfit writes it.
    """
    from bushfit.report.batch_document import BATCH_SCHEMA, BatchFile
    from bushfit.report.compared import read_comparison
    from bushfit.report.page.comparison import comparison_page
    from bushfit.report.page.index import index_page
    from bushfit.report.page.record import MODELS

    if (file := folder / "batch.json").exists():
        document = read_document(file)
        require_schema(document, file, "a batch", BATCH_SCHEMA, hint="run the batch again with --resume")
        batch = validate_tables(document, file, BatchFile, kind=ModelError)
        return [ResultFile("index", "page", partial(index_page, batch, folder, base))]
    pages = []
    if (file := folder / "compare.json").exists():
        comparison = read_comparison(read_document(file), file)
        pages.append(ResultFile("compare", "page", partial(comparison_page, comparison)))
    if not pages or any((folder / f"{name}.json").exists() for name in MODELS):
        pages.append(ResultFile("report", "page", partial(saved_page, folder, date)))
    return pages


def saved_page(folder: Path, date: str | None) -> str:
    """Make the report of a results folder as an HTML page.

    Args:
        folder: results folder.
        date: date of the report; None for the date that the campaign states.

    Returns:
        The page as HTML.

    Raises:
        ModelError: a folder without results, or a file in it that is not as bushfit writes it.
    """
    from bushfit.report.page.record import read_results
    from bushfit.report.page.report import report_page

    try:
        return report_page(read_results(folder), date, folder)
    except KeyError as error:
        hint = "write the results again, or remove the file: the page then omits the table"
        raise ModelError("a column of a table is missing", expected=str(error.args[0]), hint=hint) from error
