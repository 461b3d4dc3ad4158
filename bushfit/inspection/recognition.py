"""Which test a table holds, by its columns, and on which body or in which direction."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from bushfit.campaign.schema import SpecimenTable
from bushfit.errors import BushfitError, NoTestError, typed
from bushfit.geometry import STRAINING, TRANSLATION, Direction, Motion, Place, Specimen
from bushfit.reading.columns import Rows
from bushfit.reading.headers import LOOP_COLUMNS, RESONANCE_COLUMNS, SWEEP_COLUMNS, Vocabulary, of_motion
from bushfit.reading.layout import FileFormat
from bushfit.reading.names import direction_of_file
from bushfit.reading.resonance import is_resonance
from bushfit.reading.sweeps import STIFFNESS_PAIRS
from bushfit.reading.table import Table
from bushfit.validation import check_tables

#: Sizes of a block in shear, as [[specimens]] has them.
BLOCK_KEYS = ("area", "thickness", "elements")
#: Headers of a bar in tension: E', |E*|, "storage modulus E'", "tensile strain".
_TENSILE = re.compile(r"(?<![^\W_])E(?![^\W_])|young|tensile|tension|traction|zug", re.IGNORECASE)


def recognised(file: Path, stated: Mapping[str, Any]) -> tuple[Table, bool]:
    """The table of a file, and whether it is a sweep's and not a loop's.

    The user states keys of [[loops]] and [[sweeps]], as TOML has them; each is used where it fits.

    Raises:
        NoTestError: a file that cannot be opened as a table, or whose columns make no test.
        MeasurementError, UnitError: one whose columns might, if they were clear.
    """
    opened: list[tuple[Table, bool]] = []
    failed: list[tuple[Mapping[str, Sequence[str]], BushfitError]] = []
    kinds = [(names, motion) for motion in (TRANSLATION, STRAINING) for names in (LOOP_COLUMNS, SWEEP_COLUMNS)]
    for names, motion in kinds:
        is_sweep = names is SWEEP_COLUMNS
        try:
            table = open_table(file, names, stated, motion)
        except BushfitError as error:
            failed.append((of_motion(names, motion), error))
            continue
        opened.append((table, is_sweep))
        if _missing(table, is_sweep=is_sweep) is None:
            return table, is_sweep
    _refuse_resonance(file, stated)
    if not opened:
        raise NoTestError(**vars(failed[0][1]))
    best, is_sweep = max(opened, key=lambda one: len(one[0].roles))
    for usual, failure in failed:
        if len(best.roles) <= max(1, len(Vocabulary(usual, {}).roles(best.headers))):
            raise failure
    known = ", ".join(role.replace("_", " ") for role in best.roles)
    raise best.header_error(
        "the columns do not make a test",
        kind=NoTestError,
        found=", ".join(best.headers) + (f" (understood: {known})" if known else ""),
        expected="time, displacement and force; or frequency, amplitude, and stiffness with loss factor or phase",
        hint=f"correct the header, or name the column: --column {_missing(best, is_sweep=is_sweep)}=...",
    )


def _refuse_resonance(file: Path, stated: Mapping[str, Any]) -> None:
    """Refuse a resonance test, with the way to make a sweep of it."""
    try:
        table = open_table(file, RESONANCE_COLUMNS, stated)
    except BushfitError:  # then it is none
        return
    if is_resonance(table):
        raise table.error(
            "this is a resonance test, not a sweep",
            kind=NoTestError,
            expected="loops and sweeps",
            hint=f'bushfit reduce {typed(file)} --mass "..." makes a sweep of it',
        )


def place_of(file: Path, table: Table, stated: Mapping[str, Any]) -> Place | None:
    """What a test was made on: a specimen, or the bushing in a direction, as stated or as the file says; else None.

    A modulus is that of a specimen, a stiffness that of the bushing unless sizes of a block in shear are stated.

    Raises:
        MeasurementError: units of torsion where the user states another direction.
        CampaignError, UnitError, ModelError: sizes that make no specimen.
    """
    keys: dict[str, Any] = {"kind": "shear"} | {key: stated[key] for key in BLOCK_KEYS if key in stated}
    if table.motion is STRAINING:
        headers = table.layout.written or [column.header for column in table.roles.values()]
        keys = {"kind": "modulus"} | ({"strain": "tension"} if any(map(_TENSILE.search, headers)) else {})
    elif len(keys) == 1:
        return direction_of(file, table, stated)
    name = stated.get("specimen", "bar" if "strain" in keys else "coupon")
    return Specimen(**vars(check_tables({"name": name, **keys}, None, SpecimenTable)))


def direction_of(file: Path, table: Table, stated: Mapping[str, Any]) -> Direction | None:
    """The direction of a test of the bushing as the user states it, or else as its file does; None where neither does.

    Raises:
        MeasurementError: a file that says another direction than the user.
    """
    turns = any(table.agrees(role, "rad") for role in ("displacement", "amplitude"))
    headers = table.layout.written or table.headers
    in_column = dict.fromkeys(table.row_labels.get("direction", (0, ()))[1])
    named = direction_of_file(file, headers, turns=turns, sheet=table.source.sheet)
    found = Direction(*in_column) if len(in_column) == 1 else named
    if "direction" not in stated:
        if len(in_column) > 1:
            problem, hint = "this file holds tests in several directions", "state one: --direction axial"
            raise table.header_error(problem, found=", ".join(in_column), expected="one direction", hint=hint)
        return found
    if found and found != stated["direction"] and len(in_column) < 2:
        raise table.header_error(
            f"{'the units say' if turns else 'the file says'} {found}, and --direction {stated['direction']}",
            found=", ".join([*filter(None, [file.name, table.source.sheet]), *headers]),
            expected="one direction",
            hint="leave --direction out; or give the file a name that says its direction, which goes before its header",
        )
    return Direction(stated["direction"])


def _missing(table: Table, *, is_sweep: bool) -> str | None:
    """The first role that a table lacks to be a test; None where it is one.

    Of a sweep, frequency or amplitude may be held, and stated outside the table.
    """
    roles = set(table.roles)
    nearest = max(STIFFNESS_PAIRS, key=lambda pair: len(roles & set(pair)))
    if is_sweep and not roles & {"frequency", "amplitude"}:
        return "frequency"
    needed = nearest if is_sweep else ("displacement", "force")
    return next((role for role in needed if role not in roles), None)


def open_table(
    file: Path, names: Mapping[str, Sequence[str]], stated: Mapping[str, Any], motion: Motion = TRANSLATION
) -> Table:
    """The table of a file if it is that of a test whose columns go by `names`, with what the user states of those."""
    own = {
        key: {role: text for role, text in stated.get(key, {}).items() if role in names} for key in ("columns", "units")
    }
    written = FileFormat(**{field.name: stated.get(field.name) for field in fields(FileFormat)})
    rows = Rows(stated.get("direction"), stated.get("specimen_number"), stated.get("rows", {}))
    return Table.open(file, names, own["columns"], own["units"], written, motion, rows if any(rows) else None)
