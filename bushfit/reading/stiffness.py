"""Complex stiffness of a sweep from its columns."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from bushfit import units
from bushfit.caveat import Caveat
from bushfit.reading.headers import ERRORS, HINTS, Column, Vocabulary
from bushfit.reading.measurement import Complex, Floats
from bushfit.reading.roles import AGREEING_PAIRS, CONVERSIONS, OF_MOTION, PAIRS
from bushfit.reading.si_columns import refuse_other_motion
from bushfit.reading.stated import SweepFile
from bushfit.reading.table import Table

#: Range of the loss factor of a bushing [-]; chosen: noise may make it negative, and every rubber is far below 5.
_LOSS_FACTORS = (-0.5, 5.0)
#: Loss factor that every rubber exceeds somewhere [-]; chosen: a tenth of the least damping rubber.
LEAST_LOSS_FACTOR = 0.005
#: Share of points with a negative loss above which its sign is reversed; chosen: noise may make some positive, and with
#: a delayed channel the loss at low frequencies remains positive.
_THROUGHOUT = 0.95
#: Difference up to which redundant columns agree, relative to |K|; chosen: some are rounded to few digits.
_AGREEMENT = 0.02
#: Ratio of a quantity to the amplitude, as a text and its power, by its role.
_OVER_AMPLITUDE = {"velocity": ("2 pi f", 1), "acceleration": ("(2 pi f)^2", 2), "force_amplitude": ("|K*|", 1)}
#: Names of a damping that can be a loss factor or a damping ratio.
_DAMPING = Vocabulary({"damping": ["damping", "damp", "Dämpfung", "amortissement", "amortiguamiento", "阻尼", "D"]})


def stiffness_pair(table: Table) -> tuple[str, str]:
    """Find two columns of a table that give the complex stiffness.

    Returns:
        Their roles, such as ("stiffness", "loss_factor").

    Raises:
        MeasurementError: the table has no such pair, or its damping can be read in two ways.
    """
    for pair in PAIRS:
        if set(pair) <= set(table.roles):
            return pair
    for role in {role: None for pair in PAIRS for role in pair if role in OF_MOTION}:
        refuse_other_motion(table, role)
    refuse_ambiguous_damping(table)
    raise table.header_error(**ERRORS["no_stiffness"])


def refuse_ambiguous_damping(table: Table) -> None:
    """Raise an error if a table with a stiffness or a force has a column "damping" that may be a factor or a ratio.

    Raises:
        MeasurementError: the table has an ambiguous damping.
    """
    headings = ((header, _DAMPING.heading(header)) for header in table.headers if header)
    damping = next((header for header, one in headings if one and units.is_compatible(one.unit or "1", "1")), None)
    if damping and {"stiffness", "storage_stiffness", "force_amplitude"} & set(table.roles):
        keys = (f'columns = {{ {role} = "{damping}" }}' for role in ("loss_factor", "damping_ratio"))
        coefficient = f'columns = {{ damping_coefficient = "{damping}" }}'
        hint = f"{' or '.join(keys)} or {coefficient} in the campaign"
        raise table.header_error(**ERRORS["ambiguous_damping"], found=f'"{damping}"', hint=hint)


def convert_values(
    values: Mapping[str, Floats], columns: Mapping[str, Column]
) -> tuple[dict[str, Floats], tuple[Caveat, ...]]:
    """Convert columns that took the role of another quantity, such as a damping ratio or a velocity amplitude.

    Args:
        values: values in SI by role, (n,) each.
        columns: columns by role; `Column.role` names the quantity that the numbers are.

    Returns:
        Values in SI by role, and a warning on an amplitude that was converted.
    """
    numbers, notes = dict(values), tuple[Caveat, ...]()
    for role, column in columns.items():
        _, factor, power, _ = CONVERSIONS.get(column.role, (role, 1.0, 1, ""))
        numbers[role] = factor * values[role] ** power
    amplitude = columns.get("amplitude")
    if amplitude and amplitude.role in _OVER_AMPLITUDE:
        divisor = numbers["stiffness"] if amplitude.role == "force_amplitude" else 2.0 * np.pi * numbers["frequency"]
        text, power = _OVER_AMPLITUDE[amplitude.role]
        numbers["amplitude"] /= divisor**power
        notes = (Caveat("column_converted", f'"{amplitude.header}" divided by {text} is read as the amplitude'),)
    return numbers, notes


def with_positive_loss(
    values: Mapping[str, Floats], columns: Mapping[str, Column], test: SweepFile
) -> tuple[dict[str, Floats], tuple[Caveat, ...]]:
    """Correct the sign of a loss that is negative throughout, and the range of a phase.

    Args:
        values: values in SI by role such as "phase", (n,) each.
        columns: columns by role, for the sentences.
        test: table [[sweeps]] of the campaign; its force_sign and phase_sign are None for an automatic correction.

    Returns:
        Corrected values in SI by role, and a warning on each automatic correction.

    Notes:
        A phase is wrapped to -180 to 180 deg. If its median magnitude is above 90 deg, the force has the opposite sign,
        and the phase is turned by 180 deg. A negative phase is that of the displacement relative to the force.
    """
    corrected, notes = dict(values), []
    if (phase := corrected.get("phase")) is not None:
        header = columns["phase"].header
        if np.abs(phase).max() > np.pi * (1.0 + 1e-9):
            phase = np.angle(np.exp(1j * phase))
            notes.append(Caveat("phase_wrapped", f'"{header}" exceeds 180 deg and is wrapped'))
        automatic = test.force_sign is None and np.median(np.abs(phase)) > np.pi / 2.0
        if automatic:
            sentence = f'"{header}" exceeds 90 deg: the force has the opposite sign, and the phase is turned by 180 deg'
            notes.append(Caveat("force_turned", f"{sentence}; to keep the sign, state force_sign = 1"))
        corrected["phase"] = np.angle(-np.exp(1j * phase)) if automatic or test.force_sign == -1 else phase
    size = np.median(values.get("storage_stiffness", values.get("stiffness", np.ones(1))))
    sizes = {"loss_stiffness": size, "loss_compliance": np.median(values.get("storage_compliance", np.ones(1)))}
    sizes["energy"] = np.median(np.abs(values.get("energy", np.ones(1))))
    for role in ("phase", "loss_factor", "damping_coefficient", *sizes):
        if role not in corrected or role not in columns:
            continue
        share = corrected[role] / sizes.get(role, 1.0)
        automatic = test.phase_sign is None and np.mean(share < -LEAST_LOSS_FACTOR) > _THROUGHOUT
        if automatic:
            sentence = f'"{columns[role].header}" is negative throughout and is read with the opposite sign'
            notes.append(Caveat("loss_turned", f"{sentence}; to keep the sign, state phase_sign = 1"))
        corrected[role] = -corrected[role] if automatic or test.phase_sign == -1 else corrected[role]
    return corrected, tuple(notes)


def complex_stiffness(pair: tuple[str, str], values: Mapping[str, Floats]) -> tuple[Complex, Floats]:
    """Return the complex stiffness [N/m or N m/rad, or Pa], (n,), and the loss factor [-], (n,), from two columns.

    Args:
        pair: roles of the two columns, such as ("stiffness", "loss_factor").
        values: values in SI by role, (n,) each; also "amplitude" for a force amplitude or an energy, and "frequency"
            for a damping coefficient.

    Notes:
        K* = K' + i K'' with K'' = 2 pi f c of a damping coefficient c, K'' = W / (pi x^2) of an energy W that is
        dissipated in a cycle of amplitude x.
        A force amplitude F at a displacement amplitude x gives |K*| = F / x. A complex compliance J' - i J'' is the
        reciprocal of the stiffness. The loss factor is NaN from a phase of 90 deg on.
    """
    size, loss = values[pair[0]], values[pair[1]]
    if pair[0] == "storage_compliance":
        return np.reciprocal(size - 1j * loss), loss / size
    if pair[0] == "force_amplitude":
        size = size / values["amplitude"]
    if pair[1] in ("loss_stiffness", "damping_coefficient", "energy"):
        if pair[1] == "damping_coefficient":
            loss = 2.0 * np.pi * values["frequency"] * loss
        elif pair[1] == "energy":
            loss = loss / (np.pi * values["amplitude"] ** 2)
        storage = size if pair[0] == "storage_stiffness" else np.sqrt(size**2 - loss**2)
        return storage + 1j * loss, loss / storage
    factor = loss
    if pair[1] == "phase":
        factor = np.where(np.abs(loss) < np.pi / 2, np.tan(loss), np.nan)
        if pair[0] != "storage_stiffness":
            return size * np.exp(1j * loss), factor
    storage = size if pair[0] == "storage_stiffness" else size / np.hypot(1.0, factor)
    return storage * (1.0 + 1j * factor), factor


def check_stiffness(
    table: Table,
    pair: tuple[str, str],
    columns: Mapping[str, Column],
    values: Mapping[str, Floats],
    stiffness: Complex,
    loss_factor: Floats,
) -> None:
    """Refuse an implausible loss, a loss factor in % that must be a ratio, and redundant columns that disagree.

    Args:
        table: table of the sweep, for errors.
        pair: roles of the two columns that gave the stiffness, such as ("stiffness", "loss_factor").
        columns: columns by role, with their factors to SI.
        values: values in SI by role, (n,) each, with those of redundant columns.
        stiffness: complex stiffness [N/m or N m/rad, or Pa], (n,).
        loss_factor: loss factor [-], (n,).

    Raises:
        MeasurementError: the loss is implausible, or other columns give another stiffness; the sign of their loss is
            not compared.
    """
    column = columns[pair[1]]
    largest = float(np.nan_to_num(np.abs(loss_factor), nan=np.inf).max())
    scale = column.scale if column.role == "loss_factor" else 1.0
    if np.mean(loss_factor < -LEAST_LOSS_FACTOR) > _THROUGHOUT:
        found = f"{np.count_nonzero(loss_factor < 0.0)} of {loss_factor.size} rows below zero"
        raise table.error(**ERRORS["opposite_loss"], column=column, found=found)
    if scale != 1.0 and 0.0 < largest < LEAST_LOSS_FACTOR:
        problem, found = "no rubber has a loss this small", f"{largest / scale:.3g} {column.unit} at most"
        expected = f"a loss factor above {LEAST_LOSS_FACTOR / scale:g} {column.unit} somewhere"
        hint = f'if these are ratios, write "[-]" for "[{column.unit}]" in the header'
        raise table.error(problem, column=column, found=found, expected=expected, hint=hint)
    low, high = _LOSS_FACTORS
    likelier = {"phase": "rad" if column.unit != "rad" else "deg", "loss_factor": "%"}.get(column.role)
    if likelier == "rad" and np.abs(values["phase"]).max() > 2.0 * np.pi * column.scale:
        likelier = None
    other_unit = f', perhaps units = {{ {pair[1]} = "{likelier}" }} in the campaign' if likelier else ""
    table.refuse(
        ~((loss_factor >= low) & (loss_factor <= high)),
        column,
        "no bushing has this loss",
        f"a loss factor (loss over storage stiffness) from {low:g} to {high:g}",
        f"check the unit: a phase in deg or rad, a loss factor in % or as a ratio [-]{other_unit}; {HINTS['loss']}",
    )
    for redundant_pair in AGREEING_PAIRS:
        if redundant_pair == pair or not set(redundant_pair) <= set(values):
            continue
        redundant, _ = complex_stiffness(redundant_pair, values)
        distance = np.hypot(redundant.real - stiffness.real, np.abs(redundant.imag) - np.abs(stiffness.imag))
        used, redundant_headers = (
            " and ".join(f'"{table.roles[role].header}"' for role in both) for both in (pair, redundant_pair)
        )
        table.refuse(
            ~(distance <= _AGREEMENT * np.abs(stiffness)),
            table.roles[redundant_pair[1] if redundant_pair[0] == pair[0] else redundant_pair[0]],
            "the columns contradict each other",
            f"the complex stiffness of {used}, within {100 * _AGREEMENT:g} %, in {redundant_headers}",
            "correct the wrong columns, or remove them",
        )
