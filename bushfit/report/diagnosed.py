"""Tables of a diagnosis: the gap at every point, and the effects that were considered."""

import re
from typing import Any

import numpy as np
import pandas as pd

from bushfit.diagnosis.document import DiagnosisFile
from bushfit.diagnosis.record import Diagnosis, level_of
from bushfit.effects import get_parameter
from bushfit.fitting.preparation import MeasuredSweep
from bushfit.report.tables import loops_table, sweep_condition_columns, sweeps_table

#: Headers of the measured and modelled responses and of the outlier flag in the tables of loops and sweeps.
_MEASURED = re.compile(
    r"outlier$|(strain amplitude|(model )?"
    r"(displacement|rotation|strain|force|moment|stress|stiffness|modulus|loss factor)) \["
)

#: What the numbers may be used for, by the verdict of a diagnosis.
_WITH_BANDS = "Use stiffness and loss within the tested range, with their 95 % bands."
_USES = {
    "consistent": "Use the model within the tested range, with its 95 % bands.",
    "named": "Use the model, which includes the named effect, within the tested range.",
    "ambiguous": f"{_WITH_BANDS} Do not state one cause yet.",
    "described": f"{_WITH_BANDS} The cause is not known and may be the rig.",
    "partly": f"{_WITH_BANDS} Part of the gap is not explained.",
    "unexplained": "Do not release these numbers: the model misses the tests, and the cause is not known.",
}


def permitted_use(document: DiagnosisFile) -> str:
    """Find out what the numbers may be used for after a diagnosis (content of diagnosis.json).

    Returns:
        One or two sentences.
    """
    verdict, effects = document["verdict"], document["effects"]
    if any(effect["correction"] for effect in effects):
        return "Correct the record first: the numbers are those of the uncorrected tests."
    if verdict == "unexplained" and not document["where"] and "prior_contradicted" in document["warning_kinds"]:
        return "Do not release these numbers: the model meets the tests, but the tests contradict a prior."
    if verdict == "ambiguous" and not all(effect["alternatives"] for effect in effects):
        return f"{_WITH_BANDS} Do not state one cause of the rest yet."
    return _USES[verdict]


def gap_table(diagnosis: Diagnosis) -> pd.DataFrame:
    """Table of the gap, measured minus model, with the model before and after a diagnosis adds effects to it.

    The gap is in units of noise and in percent: of |K| for sweeps, of half the force range for loops. Frequency and
    amplitude are listed as recorded, even if the diagnosis corrects a mistake in the record.

    Args:
        diagnosis: finished diagnosis with the models before and after.

    Returns:
        A row per point of a sweep or row of a loop: test, kind ("sweep" or "loop"), direction, conditions, frequency
        and amplitude; gap in columns such as "storage before [noise]", "loss after [%]" and, for loops, "force after
        [%]"; then the measured response and the response of the final model.
    """
    before, after = diagnosis.before, diagnosis.after
    tables = []
    for data_set, corrected in zip(before.data_sets, after.data_sets, strict=True):
        columns: dict[str, Any] = {"test": data_set.name, "kind": data_set.kind, "direction": str(data_set.direction)}
        responses: Any  # a table, whose headers are texts
        unit, factor = data_set.direction.display.displacement
        if isinstance(data_set, MeasuredSweep):
            responses = sweeps_table(diagnosis.result.model, [data_set])
            columns |= {**sweep_condition_columns(data_set), "frequency [Hz]": data_set.frequency}
            columns |= {f"amplitude [{unit}]": data_set.amplitude * factor, "repeat": data_set.repeat}
        else:
            responses = loops_table(diagnosis.result.model, [data_set])
            columns |= {name: responses[name] for name in ("time [s]", "frequency [Hz]")}
            columns[f"amplitude [{unit}]"] = float(data_set.amplitude[0]) * factor
        for name, model, test in (("before", before.model, data_set), ("after", after.model, corrected)):
            in_noise = np.split(-test.misfit(model), test.residuals_per_point)
            percent = -100.0 * test.relative_difference(model)
            columns |= {
                f"{part} {name} [noise]": column for part, column in zip(test.components, in_noise, strict=True)
            }
            columns |= {f"{part} {name} [%]": column for part, column in zip(test.components, percent, strict=True)}
        tables.append(pd.DataFrame(columns | {name: responses[name] for name in responses if _MEASURED.match(name)}))
    return pd.concat(tables, ignore_index=True)


def candidates_table(diagnosis: Diagnosis) -> pd.DataFrame:
    """Table of the results of a diagnosis for every effect that could explain the gap.

    Returns:
        A row per effect: name, level (material, component, instrument, record), decrease of chi-square as expected from
        the linearised model and as found in a refit (empty without one), probability that the effect is present, fitted
        parameters with units as one text, and reason for accepting or rejecting the effect.
    """
    rows = [
        {
            "effect": judged.name,
            "level": level_of(judged.name),
            "expected chi-square gain": judged.score,
            "chi-square gain": judged.gain,
            "probability": round(judged.probability, 9),
            "parameters": "; ".join(
                f"{name} = {value:.6g} {get_parameter(name).unit}".removesuffix(" 1")
                for name, value in judged.parameters.items()
            ),
            "why": judged.why,
        }
        for judged in diagnosis.candidates
    ]
    return pd.DataFrame(rows)
