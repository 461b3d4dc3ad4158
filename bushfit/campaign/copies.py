"""Leave out copies: tests that a campaign lists under two names, and points that several tests or repeats share."""

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from bushfit.caveat import Caveat, join_names
from bushfit.reading.measurement import AnyTest, Loop, Source, Sweep

#: Minimum number of identical points that are copies; chosen: fewer may agree by chance in rounded files.
_FEWEST_POINTS = 5
#: Number of significant digits that are compared; later digits contain rounding errors of unit conversions.
_DIGITS = 9


def group_copies(loops: Sequence[Loop]) -> list[list[Loop]]:
    """Group loops with identical data in the same direction or of the same specimen, in order of their first loop."""
    groups: defaultdict[object, list[Loop]] = defaultdict(list)
    for loop in loops:
        groups[loop.direction, np.stack((loop.time, loop.displacement, loop.force)).tobytes()].append(loop)
    return list(groups.values())


def copied_points(sweeps: Sequence[Sweep]) -> dict[tuple[int, int], list[int]]:
    """Find the runs of sweeps that are copies: one other run of the sweep, or one other sweep, has all their points.

    Two measurements never agree in all digits; fewer than five points of a file may, and are no copies. Of several
    identical runs, the first is the original.

    Args:
        sweeps: sweeps in order; only those in the same direction or of the same specimen are compared.

    Returns:
        Indices of the copied rows of a sweep, by the indices of this sweep and of the sweep with the original rows.
    """
    runs: dict[tuple[int, Any], list[int]] = {}
    runs_at: defaultdict[object, set[tuple[int, Any]]] = defaultdict(set)
    points = list[list[tuple[Any, ...]]]()
    for index, sweep in enumerate(sweeps):
        columns = sweep.frequency, sweep.amplitude_reached, sweep.stiffness.real, sweep.stiffness.imag
        numbers = np.stack(columns, axis=1)  # rounded, so that equal data have equal numbers
        scale = 10.0 ** (_DIGITS - 1 - np.floor(np.log10(np.maximum(np.abs(numbers), 1e-300))))
        points.append([(sweep.direction, *point) for point in (np.round(numbers * scale) / scale).tolist()])
        for row, level in enumerate(zip(sweep.repeat.tolist(), sweep.run_level.tolist(), strict=True)):
            run = (index, level if sweep.stepped else None)
            runs.setdefault(run, []).append(row)
            runs_at[points[index][row]].add(run)
    copies: defaultdict[tuple[int, int], list[int]] = defaultdict(list)
    for run, rows in reversed(runs.items()):
        index = run[0]
        equal_runs = (runs_at[points[index][row]] - {run} for row in rows)
        # a run of this sweep, or another sweep
        originals = [{twin if twin[0] == index else (twin[0], None) for twin in equal} for equal in equal_runs]
        for original in sorted(number for number, _ in set.intersection(*originals))[:1]:
            copies[index, original] += rows
            for row in rows:
                runs_at[points[index][row]].discard(run)
    files = [sweep.source.file if sweep.source else sweep.name for sweep in sweeps]
    counts = Counter[object]()
    for (index, _), rows in copies.items():
        counts[files[index]] += len(rows)
    return {pair: rows for pair, rows in sorted(copies.items()) if counts[files[pair[0]]] >= _FEWEST_POINTS}


def without_copied_loops(loops: Sequence[Loop]) -> list[Loop]:
    """Leave out the loops of a campaign that are copies of an earlier loop; a note on that loop names its copies."""
    return [_with_note(first, _copy_note(first, copies)) for first, *copies in group_copies(loops)]


def without_copied_points(sweeps: Sequence[Sweep]) -> list[Sweep]:
    """Leave out the runs of sweeps that are copies of another run. A copy contains no further information.

    Args:
        sweeps: sweeps of a campaign in its order.

    Returns:
        The remaining sweeps of the remaining rows, with notes on the copies.
    """
    copies, remaining = copied_points(sweeps), []
    is_copy = [np.zeros(sweep.frequency.size, dtype=bool) for sweep in sweeps]
    for (index, _), rows in copies.items():
        is_copy[index][rows] = True
    for index, sweep in enumerate(sweeps):
        if is_copy[index].all():
            continue
        notes = [_copy_note(sweep, [sweeps[copy] for copy, first in copies if first == index and is_copy[copy].all()])]
        for (_, original), rows in ((pair, rows) for pair, rows in copies.items() if pair[0] == index):
            repeats = [*map(str, sorted(set(sweep.repeat[rows].tolist())))]
            of_repeats = f" of repeat{'s' * (len(repeats) > 1)} {join_names(repeats)}" if original == index else ""
            source = "an earlier repeat" if original == index else sweeps[original].name
            sentence = f"{len(rows)} points{of_repeats} are exact copies of {source} and are left out; "
            sentence += "row numbers in messages do not count the copies"
            notes.append(Caveat("copied_repeats", sentence))
        names = ("frequency", "amplitude", "stiffness", "repeat", "reached", "relative_error", "temperature")
        columns = {name: getattr(sweep, name) for name in names}
        columns = {name: column[~is_copy[index]] for name, column in columns.items() if isinstance(column, np.ndarray)}
        sweep = replace(sweep, **columns) if is_copy[index].any() else sweep
        for note in notes:
            sweep = _with_note(sweep, note)
        remaining.append(sweep)
    return remaining


def _copy_note(first: AnyTest, copies: Sequence[AnyTest]) -> Caveat | None:
    """Note that names the files (or, within one file, the tests) with copies of a test; None without copies."""
    file = first.source.file if first.source else None
    names = [copy.source.file.name if copy.source and copy.source.file != file else copy.name for copy in copies]
    return Caveat("copied_tests", f"{join_names(names)} with the same data: used once") if names else None


def _with_note(test: AnyTest, note: Caveat | None) -> AnyTest:
    """Add a warning, if any, to the notes on how the file of a test was read."""
    source: Source | None = test.source
    return replace(test, source=source.with_note(note)) if source and note else test
