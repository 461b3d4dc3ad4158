"""A test file recognised by its columns and content, and looked at."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from bushfit.campaign.campaign import reader_keywords
from bushfit.campaign.schema import LoopFile, SweepFile
from bushfit.errors import BushfitError, MeasurementError, NoColumnError
from bushfit.geometry import Direction
from bushfit.inspection.channels import clock, odd_channels
from bushfit.inspection.labels import wrong_labels
from bushfit.inspection.loops import look_at_loop
from bushfit.inspection.record import ColumnSeen, Inspected, Kind, Looked
from bushfit.inspection.sweeps import look_at_sweep
from bushfit.reading.directions import direction_of_file, named_direction
from bushfit.reading.headers import LOOP_COLUMNS, SWEEP_COLUMNS, Vocabulary
from bushfit.reading.layout import FileFormat
from bushfit.reading.loops import read_loop
from bushfit.reading.measurement import Loop, Sweep
from bushfit.reading.sweeps import STIFFNESS_PAIRS, read_sweep
from bushfit.reading.table import Table
from bushfit.reduction.steps import reduce, sines
from bushfit.validation import check_tables

#: Steps are of a stepped sine where one is faster than this [Hz], or one is by this factor faster than another; one
#: sine is a loop.
_QUASI_STATIC, _SEVERAL = 1.0, 1.2
_MINUS = {"force_sign": -1}


def stated_of_each(files: Sequence[Path], stated: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """What the user states of each of several files: a column that some of them have is not asked of the others."""
    columns: Mapping[str, str] = stated.get("columns", {})
    has = {role: [_has(file, role, stated) for file in files] for role in columns}
    return [
        {
            **stated,
            "columns": {
                role: header
                for role, header in columns.items()
                if has[role][number] is not False or True not in has[role]
            },
        }
        for number in range(len(files))
    ]


def _has(file: Path, role: str, stated: Mapping[str, Any]) -> bool | None:
    """Whether a file has the column that is stated for a role; None where it cannot be told."""
    names = LOOP_COLUMNS if role in LOOP_COLUMNS else SWEEP_COLUMNS
    try:
        return role in _open(file, names, {**stated, "columns": {role: stated["columns"][role]}}).roles
    except NoColumnError:
        return False
    except BushfitError:  # which the look at the file will tell
        return None


def inspect(file: Path, stated: Mapping[str, Any]) -> Inspected:
    """Recognise a file and look at it.

    Args:
        file: a loop, a sweep or a raw stepped-sine history.
        stated: keys of [[loops]] and [[sweeps]] that the user states, as TOML has them; each is used where it fits.

    Raises:
        MeasurementError, UnitError, CampaignError, FitError: a file or a statement that cannot be used.
    """
    table, is_sweep = _recognised(file, stated)
    direction = _direction(file, table, stated)
    # which of two translations it is makes no difference to reading
    read_as = direction or Direction.AXIAL
    schema = SweepFile if is_sweep else LoopFile
    entry = _entry(schema, stated, table)
    odd: list[str] = []
    measured: Loop | Sweep
    kind: Kind
    if is_sweep:
        measured = _read_sweep(file, read_as, entry)
        kind, looked = "sweep", look_at_sweep(measured, file)
    else:
        measured, entry, odd = _read_loop(file, read_as, entry, table)
        kind, looked = _look(measured, file)
    ranges = _ranges(table, is_sweep=is_sweep)
    columns = tuple(
        _column(header, next((c for c in table.roles.values() if c.index == index), None), ranges)
        for index, header in enumerate(table.headers)
    )
    named = named_direction([file.stem])
    if direction and named and named is not direction:
        odd.append(f"the name says {named}, it is taken for {direction} as stated")
    looked = Looked(looked.facts, (*odd, *looked.odd))
    counted = is_sweep and table.roles["amplitude"].convention is not None
    if is_sweep and "peak-to-peak" in (table.roles["amplitude"].convention, entry.get("amplitude")):
        half = f', half of "{table.roles["amplitude"].header}", which counts peak-to-peak'
        looked = replace(looked, facts={**looked.facts, "amplitudes": looked.facts["amplitudes"] + half})
    return Inspected(file, kind, direction, _written(table), columns, looked, entry, measured, counted)


def read_history(file: Path, stated: Mapping[str, Any]) -> tuple[Loop, Direction | None]:
    """A raw history, and its direction where the file or `stated` say it.

    Raises:
        MeasurementError, UnitError, CampaignError: a file or a statement that cannot be used.
    """
    table, is_sweep = _recognised(file, stated)
    if is_sweep:
        raise table.error(
            "this is a sweep already",
            line=table.layout.header_line,
            found=", ".join(table.headers),
            expected="a raw history: time, displacement, force",
            hint="name it in the campaign under [[sweeps]]",
        )
    direction = _direction(file, table, stated)
    entry = _entry(LoopFile, stated, table)
    return read_loop(**_keywords(file, direction or Direction.AXIAL, entry, LoopFile)), direction


def _direction(file: Path, table: Table, stated: Mapping[str, Any]) -> Direction | None:
    """The direction that the user states, or else the file.

    Raises:
        MeasurementError: units of torsion where the user states another direction.
    """
    turns = any(table.agrees(role, "rad") for role in ("displacement", "amplitude"))
    found = direction_of_file(file, table.headers, turns=turns)
    if "direction" not in stated:
        return found
    if turns and stated["direction"] != Direction.TORSION:
        raise table.error(
            "the units say torsion",
            line=table.layout.header_line,
            found=f"{', '.join(table.headers)}; stated: {stated['direction']}",
            expected="one direction",
            hint="state --direction torsion, or none",
        )
    return Direction(stated["direction"])


def _recognised(file: Path, stated: Mapping[str, Any]) -> tuple[Table, bool]:
    """The table of a file and whether it is a sweep's."""
    opened: list[tuple[Table, bool]] = []
    failed: list[tuple[Mapping[str, Any], BushfitError]] = []
    for names, is_sweep in ((LOOP_COLUMNS, False), (SWEEP_COLUMNS, True)):
        try:
            table = _open(file, names, stated)
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


def _missing(table: Table, *, is_sweep: bool) -> str | None:
    """The first role that a table lacks to be a test; None where it is one."""
    roles = set(table.roles)
    nearest = max(STIFFNESS_PAIRS, key=lambda pair: len(roles & set(pair)))
    needed = ("frequency", "amplitude", *nearest) if is_sweep else ("displacement", "force")
    return next((role for role in needed if role not in roles), None)


def _open(file: Path, names: Mapping[str, Any], stated: Mapping[str, Any]) -> Table:
    own = {
        key: {role: text for role, text in stated.get(key, {}).items() if role in names} for key in ("columns", "units")
    }
    written = FileFormat(**{field.name: stated.get(field.name) for field in fields(FileFormat)})
    return Table.open(file, names, own["columns"], own["units"], written)


def _entry(schema: type[LoopFile | SweepFile], stated: Mapping[str, Any], table: Table) -> dict[str, Any]:
    """The stated keys that this table of a campaign has, less those that the file makes needless."""
    roles = LOOP_COLUMNS if schema is LoopFile else SWEEP_COLUMNS
    known = {field.name for field in fields(schema)} - {"direction"}
    entry = {key: value for key, value in stated.items() if key in known and value not in (None, {})}
    for key in ("columns", "units"):
        own = {role: text for role, text in entry.pop(key, {}).items() if role in roles}
        if own:
            entry[key] = own
    if "time" in table.roles:
        entry = {key: value for key, value in entry.items() if key not in ("rate", "frequency", "waveform")}
    return entry


def _keywords(
    file: Path, direction: Direction, entry: Mapping[str, Any], schema: type[LoopFile] | type[SweepFile]
) -> dict[str, Any]:
    test = check_tables({**entry, "file": str(file), "direction": str(direction)}, file, schema)
    return {**next(reader_keywords(Path(), [test])), "name": file.stem}


def _read_sweep(file: Path, direction: Direction, entry: Mapping[str, Any]) -> Sweep:
    return read_sweep(**_keywords(file, direction, entry, SweepFile))


def _read_loop(
    file: Path, direction: Direction, entry: dict[str, Any], table: Table
) -> tuple[Loop, dict[str, Any], list[str]]:
    """The loop, its keys and what is odd: a force that counts the other way is turned, and that is said."""
    try:
        return read_loop(**_keywords(file, direction, entry, LoopFile)), entry, []
    except MeasurementError as error:
        if "force_sign" in entry:
            raise
        try:
            turned = read_loop(**_keywords(file, direction, {**entry, **_MINUS}, LoopFile))
        except BushfitError:
            raise error from None
    odd = (
        f'"{table.roles["force"].header}" falls where "{table.roles["displacement"].header}" rises: the load cell '
        "counts the other way, and the campaign needs force_sign = -1"
    )
    return turned, {**entry, **_MINUS}, [odd]


def _look(measured: Loop, file: Path) -> tuple[Kind, Looked]:
    """Kind of a recorded test, and what is to be seen of it."""
    found = sines(measured)
    points = {(round(np.log(frequency), 2), round(np.log(amplitude), 1)) for frequency, amplitude, _ in found}
    frequencies = [frequency for frequency, *_ in found] or [0.0]
    fast = max(frequencies) > _QUASI_STATIC
    if len(points) > 1 and (fast or max(frequencies) > _SEVERAL * min(frequencies)):
        with suppress(MeasurementError):  # no steady sine after all
            return "history", _look_at_history(measured, file)
    looked = look_at_loop(measured, file)
    if fast or len(points) > 1:
        what = f"at {max(frequencies):.3g} Hz" if fast else "of several amplitudes"
        either = f"a motion {what} is taken for a loop; should it be a stepped sine, bushfit reduce makes points of it"
        looked = Looked(looked.facts, (*looked.odd, either))
    return "loop", looked


def _look_at_history(history: Loop, file: Path) -> Looked:
    reduction = reduce([history])
    steps = reduction.steps
    unit, factor = history.direction.display.displacement
    levels = sorted({step.level for step in steps})
    frequencies = sorted({step.nominal_frequency for step in steps})
    facts = {
        "steps": f"{len(steps)} with steady cycles, {max(step.repeat for step in steps)} at most at one point",
        "frequencies": f"{len(frequencies)}, from {frequencies[0]:.4g} to {frequencies[-1]:.4g} Hz",
        "amplitudes": f"{', '.join(f'{factor * level:.4g}' for level in levels)} {unit} zero-to-peak, as reached",
        "sampling": f"{clock(history)}, {min(step.rows_per_cycle for step in steps):.3g} rows a cycle at least",
        "noise": f"{100 * max(step.gain_error for step in steps):.2g} % of |K| at most, a point",
    }
    odd = (
        *wrong_labels(file, history.direction, levels, frequencies),
        *odd_channels(history),
        *reduction.warnings,
    )
    return Looked(facts, odd)


def _written(table: Table) -> dict[str, str]:
    """How a file is written, in words."""
    names = {",": "comma", ";": "semicolon", "\t": "tab", "|": "pipe", " ": "blanks"}
    sheet, layout = table.source.sheet, table.layout
    if sheet:
        written = {"sheet": sheet, "header": f"row {layout.header_line}"}
    else:
        mark = "comma" if table.numerals.decimal == "," else "point"
        written = {
            "encoding": table.source.encoding or "UTF-8",
            "columns parted by": names.get(layout.delimiter, layout.delimiter),
            "decimal mark": mark,
            "header": f"line {layout.header_line}",
        }
    if table.numerals.thousands:
        written["thousands parted by"] = repr(table.numerals.thousands)
    if layout.units_line:
        written["units"] = f"line {layout.units_line}"
    return written


def _ranges(table: Table, *, is_sweep: bool) -> dict[str, tuple[float, float]]:
    """Least and largest value of each role in the file's own unit."""
    if is_sweep:
        needed = {role for pair in STIFFNESS_PAIRS for role in pair} | {"frequency", "amplitude", "repeat"}
        wanted = {role: column for role, column in table.roles.items() if role in needed}
    else:
        wanted = dict(table.roles)
    values = table.read(wanted, fewest_rows=1)  # unscaled: as the file has them
    return {role: (float(series.min()), float(series.max())) for role, series in values.items()}


def _column(header: str, column: Any, ranges: Mapping[str, tuple[float, float]]) -> ColumnSeen:
    if column is None:
        return ColumnSeen(header, None, None)
    low, high = ranges.get(column.role, (None, None))
    return ColumnSeen(header, column.role.replace("_", " "), column.unit, low, high)
