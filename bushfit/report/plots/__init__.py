"""Figures of results, one description for PNG, SVG, PDF and the pages.

Figures are made from the tables of a result, so that a results folder gives the same figures as the run itself.
matplotlib is slow to import and only imported in this folder: a module is imported when it is first used, as in
`plots.gap.gap_figure`. Levels differ in colour (of scales that suit colour blindness and grey print), line style and
marker. Differences are measured minus model.
"""

import logging
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from bushfit.errors import BushfitError

if TYPE_CHECKING:
    from bushfit.report.plots import (  # noqa: F401
        batch,
        fits,
        gap,
        inspection,
        master_curve,
        prediction,
        preload,
        response,
        style,
    )

#: matplotlib complains about each line of a user's matplotlibrc that it does not know; our figures do not use the file.
logging.getLogger("matplotlib").setLevel(logging.ERROR)


def __getattr__(name: str) -> Any:
    """Return the module `name` of this folder, imported when it is first used."""
    if name.startswith("_") or find_spec(f"{__name__}.{name}") is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        return import_module(f"{__name__}.{name}")
    except UnicodeDecodeError as error:  # of matplotlib, which reads the file before anybody can stop it
        raise BushfitError(
            "matplotlib cannot read its settings, and no picture is drawn",
            file="matplotlibrc",
            found=f"byte {error.object[error.start]:#04x}, which is not UTF-8",
            expected="a text file in UTF-8",
            hint="remove the file from this folder or from matplotlib's folder of settings, or save it as UTF-8",
        ) from error
