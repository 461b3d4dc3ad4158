"""Figures for reports: predictions as in the paper's Figs. 7 to 9, loops and sweeps with the model over them, and
the gap between model and measurement before and after a diagnosis.

The one importer of matplotlib, which is slow: a file of this folder is imported when it is first asked for, as in
`plots.gap.gap_figure`. Nothing here touches matplotlib's global state, so figures may be made in any process or thread.
Levels differ in colour (of scales that survive colour blindness and grey print), line style and marker.
"""

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bushfit.report.plots import (  # noqa: F401
        batch,
        fits,
        gap,
        inspection,
        master_curve,
        plan,
        prediction,
        style,
    )


def __getattr__(name: str) -> Any:
    """A file of this folder, imported now."""
    if name.startswith("_") or find_spec(f"{__name__}.{name}") is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return import_module(f"{__name__}.{name}")
