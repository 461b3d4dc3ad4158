"""Hysteresis loops read from files, or one error that tells why a file cannot be a loop."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from bushfit.geometry import Place, strain_factor_of_files
from bushfit.reading.headers import LOOP_COLUMNS, Column
from bushfit.reading.measurement import Floats, Loop
from bushfit.reading.source import LEAST_VALUE
from bushfit.reading.stated import LoopFile
from bushfit.reading.table import Table

#: Rows of the shortest loop; chosen: fewer do not show a shape.
_FEWEST_LOOP_ROWS = 10


def read_loop(file: Path, direction: Place, test: LoopFile, *, name: str | None = None, shared: bool = False) -> Loop:
    """Read a hysteresis loop.

    Args:
        file: a table with columns time (optional), displacement and force.
        direction: direction of the test, or its specimen, which settles the headers and units that fit.
        test: what the file does not say itself, and the file as the campaign names it.
        name: of the loop; default the stem of the file.
        shared: whether the file holds other tests, too, so that a column has to tell them apart.

    Raises:
        MeasurementError, UnitError: a file, column, unit or value that cannot be used.
    """
    rows = test.taken(shared=shared)
    table = Table.open(file, LOOP_COLUMNS, test.columns, test.units, test, direction.motion, rows)
    _check_not_swapped(table, direction)
    wanted = _loop_columns(table, direction, test)
    values = table.read(wanted, fewest_rows=_FEWEST_LOOP_ROWS)
    displacement, force, time = values["displacement"], values["force"], values.get("time")
    for role in ("displacement", "force"):
        if np.ptp(values[role][:_FEWEST_LOOP_ROWS]) < LEAST_VALUE and np.ptp(values[role]) < LEAST_VALUE:
            raise table.error(f"the {role} never changes", column=wanted[role], expected="a loop")
    _check_sense(table, wanted["force"], displacement, force, test.force_sign)
    if time is None:
        time = test.clock(displacement)
    else:
        later, hint = "a later time on every row", "if a column tells runs, bushfit init makes a loop of each"
        table.refuse(np.append(False, time[1:] <= time[:-1]), wanted["time"], "time does not increase", later, hint)
        if time[-1] - time[0] < LEAST_VALUE:
            expected = f"{LEAST_VALUE:g} s or more"
            raise table.error("the record takes no time", column=wanted["time"], expected=expected)
    return Loop(
        name or file.stem,
        direction,
        time,
        displacement,
        force,
        test.noise,
        test.source(table.sha256, test.temperature, table.not_understood()),
        "time" in values,
        test.weight,
        temperature=test.temperature,
    )


def _check_not_swapped(table: Table, direction: Place) -> None:
    """Refuse a displacement in units of force beside a force in units of displacement."""
    if table.agrees("displacement", direction.motion.force_unit) and table.agrees(
        "force", direction.motion.displacement_unit
    ):
        displacement, force = (table.roles[role].header for role in ("displacement", "force"))
        raise table.header_error(
            "displacement and force are swapped",
            found=f'"{displacement}" and "{force}"',
            expected="a displacement in units of displacement, and a force in units of force",
            hint="correct the header, or name the columns in the campaign: columns = "
            f'{{ displacement = "{force}", force = "{displacement}" }}',
        )


def _loop_columns(table: Table, direction: Place, test: LoopFile) -> dict[str, Column]:
    """The columns of a loop with their units; only one with a rate or frequency that is stated lacks time."""
    displacement = table.column("displacement", direction.motion.displacement_unit)
    displacement = replace(displacement, scale=strain_factor_of_files(direction) * displacement.scale)
    force = table.column("force", direction.motion.force_unit)
    wanted = {"displacement": displacement, "force": replace(force, scale=test.force_sign * force.scale)}
    if "time" in table.roles:
        wanted["time"] = table.column("time", "s")
    elif test.rate is None and test.frequency is None:
        hint = 'or state rate = "10 mm/min", or frequency = "0.1 Hz" and waveform = "sine", in the campaign'
        raise table.missing("time", "s", hint)
    return wanted


def _check_sense(table: Table, column: Column, displacement: Floats, force: Floats, force_sign: int) -> None:
    """Refuse a force whose covariance with the displacement is negative."""
    if displacement @ force < displacement.sum() * force.sum() / force.size:
        raise table.error(
            "the force falls where the displacement rises",
            column=column,
            expected="force and displacement counted in the same direction",
            hint="if the load cell counts the other way round, write force_sign = -1 in the campaign"
            if force_sign == 1
            else "take force_sign = -1 out of the campaign",
        )
