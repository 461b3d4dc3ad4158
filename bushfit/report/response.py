"""Tables of a force over time, measured and predicted."""

from collections.abc import Sequence
from typing import Any

import pandas as pd

from bushfit.prediction.response import TimeResponse
from bushfit.prediction.validation import Validation
from bushfit.report.tables import band_columns

#: Headers of the columns of validation.csv by key of diagnosis.json.
_PERCENTAGES = {
    **{"nrmse": "NRMSE [%]", "peak_gap": "peak gap [%]", "energy_gap": "energy gap [%]"},
    **{"share_inside": "points in band [%]", "nrmse_before": "NRMSE before [%]"},
}


def response_table(time: Any, responses: Sequence[TimeResponse], measured: Any = None) -> pd.DataFrame:
    """Table of displacement and force over time.

    Args:
        time: time of each row [s], (n,).
        responses: responses to histories with these times.
        measured: measured force of a validation record [N, N m or Pa], (n,), with its single response; None without.

    Returns:
        Time; then for each direction, in display units, displacement, force and its 95 % band, and measured force if
        given. With several directions their names begin the headers.
    """
    columns = {"time [s]": time}
    for response in responses:
        (length, length_factor), (unit, force_factor), _ = response.direction.display
        moves, resists, _ = response.direction.motion.words
        before = f"{response.direction} " if len(responses) > 1 else ""
        columns[f"{before}{moves} [{length}]"] = length_factor * response.history.value
        columns |= band_columns(f"{before}{resists} [{unit}]", response.force, force_factor)
        columns |= {} if measured is None else {f"measured {resists} [{unit}]": force_factor * measured}
    return pd.DataFrame(columns)


def validation_table(validations: Sequence[Validation]) -> pd.DataFrame:
    """Table of the agreement of predictions with validation records, one row per record.

    Args:
        validations: validation records, compared with the force that the final model predicts.

    Returns:
        Name and direction of each record; NRMSE, relative differences of peak force and energy, share of the points
        inside the band and, if a diagnosis added effects, NRMSE without these effects, all in percent.
    """
    table = pd.DataFrame([validation.entry for validation in validations]).set_index(["test", "direction"])
    return (100.0 * table[[*_PERCENTAGES]].dropna(axis=1)).rename(columns=_PERCENTAGES).reset_index()
