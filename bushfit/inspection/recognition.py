"""Which test a file holds, by its columns, and in which direction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from bushfit.errors import BushfitError
from bushfit.geometry import Direction
from bushfit.reading.directions import direction_of_file
from bushfit.reading.headers import Vocabulary
from bushfit.reading.layout import FileFormat
from bushfit.reading.sweeps import STIFFNESS_PAIRS
from bushfit.reading.table import Table
from bushfit.reading.words import LOOP_COLUMNS, SWEEP_COLUMNS


def recognised(file: Path, stated: Mapping[str, Any]) -> tuple[Table, bool]:
    """The table of a file, and whether it is a sweep's and not a loop's.

    Args:
        file: the file.
        stated: keys of [[loops]] and [[sweeps]] that the user states, as TOML has them; each is used where it fits.

    Raises:
        MeasurementError, UnitError: a file that cannot be opened as a table, or whose columns make no test.
    """
    opened: list[tuple[Table, bool]] = []
    failed: list[tuple[Mapping[str, Sequence[str]], BushfitError]] = []
    for names, is_sweep in ((LOOP_COLUMNS, False), (SWEEP_COLUMNS, True)):
        try:
            table = open_table(file, names, stated)
        except BushfitError as error:
            failed.append((names, error))
            continue
        opened.append((table, is_sweep))
        if _missing(table, is_sweep=is_sweep) is None:
            return table, is_sweep
    if not opened:
        raise failed[0][1]
    best, is_sweep = max(opened, key=lambda one: len(one[0].roles))
    for usual, failure in failed:
        if len(best.roles) <= max(1, len(Vocabulary(usual, {}).roles(best.headers))):
            raise failure
    known = ", ".join(role.replace("_", " ") for role in best.roles)
    raise best.error(
        "the columns do not make a test",
        line=best.layout.header_line,
        found=", ".join(best.headers) + (f" (understood: {known})" if known else ""),
        expected="time, displacement and force; or frequency, amplitude, and stiffness with loss factor or phase",
        hint=f"correct the header, or name the column: --column {_missing(best, is_sweep=is_sweep)}=...",
    )


def direction_of(file: Path, table: Table, stated: Mapping[str, Any]) -> Direction | None:
    """The direction of a test as the user states it, or else as its file does; None where neither does.

    Raises:
        MeasurementError: units of torsion where the user states another direction.
    """
    turns = any(table.agrees(role, "rad") for role in ("displacement", "amplitude"))
    found = direction_of_file(file, table.headers, turns=turns)
    if "direction" not in stated:
        return found
    if turns and not Direction(stated["direction"]).is_rotation:
        raise table.error(
            "the units say torsion",
            line=table.layout.header_line,
            found=f"{', '.join(table.headers)}; stated: {stated['direction']}",
            expected="one direction",
            hint="state --direction torsion, or none",
        )
    return Direction(stated["direction"])


def _missing(table: Table, *, is_sweep: bool) -> str | None:
    """The first role that a table lacks to be a test; None where it is one."""
    roles = set(table.roles)
    nearest = max(STIFFNESS_PAIRS, key=lambda pair: len(roles & set(pair)))
    needed = ("frequency", "amplitude", *nearest) if is_sweep else ("displacement", "force")
    return next((role for role in needed if role not in roles), None)


def open_table(file: Path, names: Mapping[str, Sequence[str]], stated: Mapping[str, Any]) -> Table:
    """The table of a file if it is that of a test whose columns go by `names`, with what the user states of those."""
    own = {
        key: {role: text for role, text in stated.get(key, {}).items() if role in names} for key in ("columns", "units")
    }
    written = FileFormat(**{field.name: stated.get(field.name) for field in fields(FileFormat)})
    return Table.open(file, names, own["columns"], own["units"], written)
