"""Tables of the reduction of raw histories and of resonance tests: sweep files with the quality of each point."""

import numpy as np
import pandas as pd

from bushfit.geometry import Direction
from bushfit.reduction.resonance import Resonance
from bushfit.reduction.result import Reduction
from bushfit.report.tables import response_columns, response_headers

#: Headers of the columns on the quality and origin of each point, and the attribute of a step that fills each.
_OF_STEPS = {
    "frequency found [Hz]": "frequency",
    "displacement distortion [-]": "displacement_distortion",
    "force distortion [-]": "force_distortion",
    "cycles used": "cycles",
    "rows per cycle": "rows_per_cycle",
    "start [s]": "start",
    "end [s]": "end",
    "history": "name",
}


def reduced_table(reduction: Reduction) -> pd.DataFrame:
    """Table of raw time histories reduced to operating points; it can be read again as a sweep file.

    Args:
        reduction: operating points of the histories of one direction.

    Returns:
        A row per operating point, sorted by amplitude, repeat and frequency: the columns of a sweep file, then standard
        errors, distortion, and the history and time interval that the point was computed from.
    """
    place, steps = reduction.direction, pd.DataFrame([vars(step) for step in reduction.steps])
    (length, length_factor), _, (stiffness, _) = place.display
    responses = response_columns(place, steps["stiffness"].to_numpy())
    magnitude, factors = responses.values()
    columns = {
        "frequency [Hz]": [float(f"{frequency:.5g}") for frequency in steps["nominal_frequency"]],
        f"amplitude [{length}]": [float(f"{length_factor * level:.5g}") for level in steps["level"]],
        f"amplitude reached [{length}]": steps["amplitude"] * length_factor,
        "repeat": steps["repeat"],
        **responses,
        f"stiffness std error [{stiffness}]": steps["gain_error"] * magnitude,
        "loss factor std error [-]": steps["phase_error"] * (1.0 + factors**2),
        **{header: steps[key] for header, key in _OF_STEPS.items()},
    }
    order = [f"amplitude [{length}]", "repeat", "frequency [Hz]"]
    return pd.DataFrame(columns).sort_values(order, ignore_index=True, kind="stable")


def resonance_table(resonance: Resonance) -> pd.DataFrame:
    """Table of a resonance test reduced to stiffness over frequency; it can be read again as a sweep file.

    Args:
        resonance: reduced resonance test.

    Returns:
        A row per frequency: the columns of a sweep file, then relative error, transmissibility and averaged rows.
    """
    place = Direction.AXIAL  # or radial: the units are the same
    columns = {
        "frequency [Hz]": resonance.frequency,
        response_headers(place)[0]: resonance.amplitude * place.display.displacement.factor,
        **response_columns(place, resonance.stiffness),
        "relative error [-]": resonance.relative_error,
        "transmissibility [-]": np.abs(resonance.transmissibility),
        "rows averaged": resonance.rows,
    }
    return pd.DataFrame(columns)
