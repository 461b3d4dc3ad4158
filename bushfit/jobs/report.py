"""report: the page of a folder of results, or of a batch."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bushfit.report.contents import Contents


def report(folder: Path, base: str = "") -> Contents:
    """What stands in a folder, with its page: `report` of a result, `index` of a batch.

    Args:
        folder: as `bushfit run`, `diagnose`, a fit or `batch` wrote it.
        base: of a batch, what its links begin with, where the page is to stand elsewhere.

    Raises:
        ModelError: a folder of neither, or a file in it that is not as bushfit writes it.
    """
    from bushfit.report.page.index import is_batch, read_batch
    from bushfit.report.page.readback import read_results

    return read_batch(folder, base) if is_batch(folder) else read_results(folder)
