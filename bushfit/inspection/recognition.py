"""Recognition of a test file: loop or sweep by its columns, and the direction or specimen that was tested."""

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import fields
from itertools import product
from pathlib import Path
from typing import Any

from bushfit.campaign.bodies import SpecimenSettings
from bushfit.errors import BushfitError, NoTestError, ResonanceTestError, quote_path
from bushfit.geometry import ROTATION, STRAINING, TRANSLATION, Motion, Place, Specimen
from bushfit.reading.finding import direction_of_table, find_table
from bushfit.reading.headers import ERRORS, HINTS, LOOP_COLUMNS, RESONANCE_COLUMNS, SWEEP_COLUMNS, Vocabulary
from bushfit.reading.labelled import Rows
from bushfit.reading.layout import FileFormat
from bushfit.reading.parts import OpenedFile, open_file
from bushfit.reading.resonance import is_resonance
from bushfit.reading.roles import PAIRS, names_for_motion, si_unit
from bushfit.reading.si_columns import columns_key
from bushfit.reading.stiffness import refuse_ambiguous_damping
from bushfit.reading.table import Table
from bushfit.units import is_compatible
from bushfit.validation import validate_tables

#: Keys of [[specimens]] for the sizes of a block in shear.
BLOCK_KEYS = ("area", "thickness", "elements")
#: Headers of a bar in tension: E', |E*|, "storage modulus E'", "tensile strain".
_TENSILE = re.compile(r"(?<![^\W_])E(?![^\W_])|young|tensile|tension|traction|zug", re.IGNORECASE)


def recognize_table(file: Path, test_options: Mapping[str, Any]) -> tuple[Table, bool]:
    """Open a test file as a loop or a sweep, by its columns.

    Args:
        file: test file.
        test_options: keys of [[loops]] and [[sweeps]], as TOML gives them; keys that do not apply are ignored.

    Returns:
        The table, and True if it is a sweep.

    Raises:
        NoTestError: a file that cannot be opened as a table, or whose columns are not those of a test.
        MeasurementError, UnitError: unclear columns or units, which may be those of a test.
    """
    opened: list[tuple[Table, bool]] = []
    complete: list[tuple[Table, bool]] = []
    failed: list[tuple[Mapping[str, Sequence[str]], BushfitError]] = []
    try:
        content = open_content(file, test_options)
    except BushfitError as error:
        raise NoTestError(**vars(error)) from None
    for names, motion in product((SWEEP_COLUMNS, LOOP_COLUMNS), (TRANSLATION, STRAINING)):
        is_sweep = names is SWEEP_COLUMNS
        try:
            table = open_table(content, names, test_options, motion)
        except BushfitError as error:
            failed.append((names_for_motion(names, motion), error))
            continue
        opened.append((table, is_sweep))
        if missing_role(table, is_sweep=is_sweep) is None:
            complete.append((table, is_sweep))
        elif is_sweep and not complete:
            refuse_ambiguous_damping(table)
    largest = max((len(table.roles) for table, _ in opened), default=0)  # of f, A, K and phi, f and phi are no loop
    complete = [one for one in complete if one[1] or 2 * len(one[0].roles) > largest + 1]
    if complete:  # a sweep before a loop, and columns of a stiffness or modulus before the amplitude of a force
        direct = [pair for pair in PAIRS if pair[0] != "force_amplitude"]

        def rank(candidate: tuple[Table, bool]) -> tuple[bool, bool, int, int]:
            """Key that sorts candidates (table, and True for a sweep): the smallest is preferred."""
            table, is_sweep = candidate
            is_direct = any({*pair} <= {*table.roles} for pair in direct)
            return not is_sweep, not is_direct, count_other_units(table), -len(table.roles)

        return min(complete, key=rank)
    resonance: Table | None = None
    with suppress(BushfitError):  # whose columns are not those of a resonance test
        resonance = open_table(content, RESONANCE_COLUMNS, test_options)
    if resonance and is_resonance(resonance):
        hint = f'to convert it to a sweep: bushfit reduce {quote_path(file)} --mass "..."'
        raise resonance.error(**ERRORS["resonance_test"], kind=ResonanceTestError, hint=hint)
    if not opened:
        errors = [error for _, error in failed]
        raise NoTestError(**vars(next((one for one in errors if one.problem != "there is no known header"), errors[0])))
    best, is_sweep = max(opened, key=lambda one: (len(one[0].roles), not one[1]))
    for usual, failure in failed:
        if len(best.roles) <= max(1, len(Vocabulary(usual, {}).roles(best.headers))):
            raise failure
    understood = ", ".join(role.replace("_", " ") for role in best.roles)
    lacking = missing_role(best, is_sweep=is_sweep) or "force"
    column = columns_key(best, lacking, si_unit(lacking, best.motion))
    advice = f"correct the header, or name the column: {HINTS['loss_factor'] if lacking == 'loss_factor' else column}"
    if set(best.roles) in ({"time", "displacement"}, {"time", "force"}) and '"..."' in column:
        history = "a displacement alone is a history for bushfit respond; " * (lacking == "force")
        advice = f"{history}a test needs a column for the {lacking}, too: if another file has it, join the two"
    found = ", ".join(best.headers) + f" (understood: {understood})" if understood else None
    raise best.header_error(**ERRORS["not_a_test"], kind=NoTestError, found=found, hint=advice)


def count_other_units(table: Table) -> int:
    """Number of columns whose unit does not fit the kind of motion of the table, such as a modulus in MPa."""
    motions = (STRAINING,) if table.motion is STRAINING else (TRANSLATION, ROTATION)
    expected = {role: [si_unit(role, motion) for motion in motions] for role in table.roles}
    return sum(
        column.unit is not None and not any(is_compatible(column.unit, si) for si in expected[role])
        for role, column in table.roles.items()
    )


def missing_role(table: Table, *, is_sweep: bool) -> str | None:
    """Role of the first column that a test needs and the table lacks, such as "force"; None if the table is complete.

    Frequency and amplitude of a sweep are not required, because they may be constant and stated outside the table.
    """
    roles = set(table.roles)
    if not is_sweep:
        return next((role for role in ("displacement", "force") if role not in roles), None)
    pairs = [pair for pair in PAIRS if pair[0] != "force_amplitude" or {"frequency", "amplitude"} <= roles]
    nearest = max(pairs, key=lambda pair: len(roles & set(pair)))
    return next((role for role in nearest if role not in roles), None)


def tested_body(table: Table, test_options: Mapping[str, Any]) -> Place | None:
    """Determine the direction of the bushing, or the specimen, that was tested.

    A modulus belongs to a specimen, a stiffness to the bushing unless the options give the sizes of a block in shear.

    Args:
        table: table of the file.
        test_options: what the user states on the test, by campaign key such as "direction".

    Returns:
        Direction or specimen; None if neither options nor file state it.

    Raises:
        MeasurementError: units of torsion although an option states another direction.
        CampaignError, UnitError, ModelError: invalid sizes of a specimen.
    """
    keys: dict[str, Any] = {"kind": "shear"} | {key: test_options[key] for key in BLOCK_KEYS if key in test_options}
    if table.motion is STRAINING:
        headers = table.layout.written or [column.header for column in table.roles.values()]
        keys = {"kind": "modulus"} | ({"strain": "tension"} if any(map(_TENSILE.search, headers)) else {})
    elif len(keys) == 1:
        return direction_of_table(table, test_options.get("direction"))
    name = test_options.get("specimen", "bar" if "strain" in keys else "coupon")
    return Specimen(**vars(validate_tables({"name": name, **keys}, None, SpecimenSettings)))


def open_content(file: Path, test_options: Mapping[str, Any]) -> OpenedFile:
    """Open a test file with the format options (keys of `FileFormat`) that the user states.

    Raises:
        MeasurementError: the file cannot be read.
    """
    stated = {field.name: test_options[field.name] for field in fields(FileFormat) if field.name in test_options}
    return open_file(file, validate_tables(stated, None, FileFormat))


def open_table(
    file: Path | OpenedFile,
    names: Mapping[str, Sequence[str]],
    test_options: Mapping[str, Any],
    motion: Motion = TRANSLATION,
) -> Table:
    """Open a test file as a table of one kind of test.

    Args:
        file: test file, or its opened content.
        names: known headers of the columns of this kind of test, by role such as "force".
        test_options: what the user states on the test, by campaign key; columns of other tests are ignored.
        motion: kind of motion that the columns describe.

    Returns:
        Table with the roles of its columns.

    Raises:
        MeasurementError, UnitError: columns that are missing or unclear.
    """
    relevant = {
        key: {role: text for role, text in test_options.get(key, {}).items() if role in names}
        for key in ("columns", "units")
    }
    rows = Rows(test_options.get("direction"), test_options.get("specimen_number"), test_options.get("rows", {}))
    opened = file if isinstance(file, OpenedFile) else open_content(file, test_options)
    return find_table(opened, names, relevant["columns"], relevant["units"], None, motion, rows if any(rows) else None)
