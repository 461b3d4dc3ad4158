"""Figures for reports: predictions as in the paper's Figs. 7 to 9, loops and sweeps with the model over them, and
the gap between model and measurement before and after a diagnosis.

The one importer of matplotlib. Nothing here touches its global state, so figures may be made in any process or
thread. Levels differ in colour (of scales that survive colour blindness and grey print), line style and marker.
"""

from bushfit.report.plots.arms import arms_figure
from bushfit.report.plots.comparison import comparison_figure
from bushfit.report.plots.fits import loops_figure, sweeps_figure
from bushfit.report.plots.gap import gap_figure
from bushfit.report.plots.inspection import inspection_figure
from bushfit.report.plots.plan import plan_figure
from bushfit.report.plots.prediction import fine_grid, prediction_figure
from bushfit.report.plots.reduction import reduction_figure
from bushfit.report.plots.resonance import resonance_figure
from bushfit.report.plots.style import to_image

__all__ = [
    "arms_figure",
    "comparison_figure",
    "fine_grid",
    "gap_figure",
    "inspection_figure",
    "loops_figure",
    "plan_figure",
    "prediction_figure",
    "reduction_figure",
    "resonance_figure",
    "sweeps_figure",
    "to_image",
]
