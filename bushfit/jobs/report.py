"""report: the page of a folder of results, of a comparison, or of a batch."""

from pathlib import Path

from bushfit.report.contents import Contents


def report(folder: Path, base: str = "") -> Contents:
    """What stands in a folder, with its page: `report` of a result, `compare` of a comparison, `index` of a batch.

    Args:
        folder: as `bushfit run`, `diagnose`, a fit, `compare` or `batch` wrote it.
        base: of a batch, what its links begin with, where the page is to stand elsewhere.

    Raises:
        ModelError: a folder of none of them, or a file in it that is not as bushfit writes it.
    """
    from bushfit.report.page import comparison_page, report_page
    from bushfit.report.page.comparison import read_comparison
    from bushfit.report.page.index import is_batch, read_batch
    from bushfit.report.page.readback import has_model, read_results

    if is_batch(folder):
        return read_batch(folder, base)
    compared = (folder / "compare.json").exists()
    found = read_comparison(folder).paged(compare=comparison_page) if compared else Contents()
    if has_model(folder) or not compared:
        found |= read_results(folder).paged(report=report_page)
    return found
