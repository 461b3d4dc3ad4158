"""Leave out copies: tests that a campaign lists under two names, and points that several tests or repeats share.

Copies may be exported again with other units, fewer digits or rows, or another start of time. Rows are therefore equal
if they agree within the last decimal place, in the unit of the file, of the numbers with fewer decimals.
"""

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from itertools import chain, combinations_with_replacement
from typing import Any, NamedTuple

import numpy as np

from bushfit.caveat import Caveat, join_names
from bushfit.effects.contract import Array
from bushfit.reading.measurement import AnyTest, Loop, Sweep, loss_factor
from bushfit.units import si_factor

#: Minimum number of identical points that are copies; chosen: fewer may agree by chance in rounded files.
_FEWEST_POINTS = 5
#: Smallest number of significant digits that are compared, because 0.1 may be a set value, and number below which later
#: digits contain rounding errors of unit conversions.
_DIGITS = 3, 10
#: Distance of a number from a decimal number, in units of its last place, that is rounding of the computer.
_ROUNDING = 1e-4
#: Run of a sweep: index of the sweep, and repeat and level of the run (None if the sweep is one run).
_Run = tuple[int, Any]
#: Number of rows, evenly spread, that show the last decimal place of a column; chosen: one number in ten ends in 0.
_ROWS = 100
#: Units of files, apart from powers of ten.
_UNITS = ("m", "in", "lbf", "lbf/in", "psi", "kgf", "lbf*in", "lbf*ft", "deg", "min")


@cache
def _unit_factors() -> Array:
    """SI factors of `_UNITS`, (units,)."""
    return np.array([si_factor(unit, unit) for unit in _UNITS])


class _Rows(NamedTuple):
    """Numbers of a test, (c, n), and by column, (c, 1), half the last place that its file contains, and the unit there.

    The unit is given by its SI factor, apart from a power of ten.
    """

    numbers: Array
    half_place: Array
    unit: Array

    @classmethod
    def of_columns(cls, *columns: Array) -> "_Rows":
        """Build the rows from c columns in SI, (n,) each, which contain the fewest digits in the unit of the file."""
        numbers, factors = np.stack(columns), _unit_factors()
        largest = np.abs(numbers).max(axis=1, keepdims=True).clip(min=1e-300) / factors
        places = factors * 10.0 ** (np.floor(np.log10(largest))[:, None] + 1.0 - np.arange(*_DIGITS)[:, None])
        in_places = numbers[:, None, None, :: numbers.shape[1] // _ROWS + 1] / places[..., None]
        is_decimal = np.all(np.abs(in_places - np.round(in_places)) < _ROUNDING, axis=-1)
        is_decimal[:, -1, 0] = True
        first = is_decimal.reshape(len(numbers), -1).argmax(axis=1)[:, None]
        places = np.take_along_axis(places.reshape(len(numbers), -1), first, axis=1)
        return cls(numbers, 0.5 * places, factors[first % factors.size])

    def tolerance(self, copy: "_Rows") -> Array:
        """Largest difference of equal numbers of two tests by column, (c, 1): both are rounded if the units differ."""
        larger, smaller = (choose(self.half_place, copy.half_place) for choose in (np.maximum, np.minimum))
        return (1.0 + _ROUNDING) * (larger + smaller * (self.unit != copy.unit))


def group_copies(loops: Sequence[Loop]) -> list[list[Loop]]:
    """Group loops with the same data in the same direction or of the same specimen.

    Returns:
        Groups in order of their first loop, which has the rows of all others and, of equal loops, is the first.
    """
    rows = [_Rows.of_columns(loop.displacement, loop.force, loop.time - loop.time[0]) for loop in loops]
    groups = dict[int, list[int]]()
    for index in sorted(range(len(loops)), key=lambda index: -loops[index].time.size):
        of_direction = (first for first in groups if loops[first].direction == loops[index].direction)
        copied = next((first for first in of_direction if _is_part(rows[index], rows[first])), index)
        groups.setdefault(copied, []).append(index)
    return [[loops[index] for index in groups[first]] for first in sorted(groups)]


def _is_part(part: _Rows, whole: _Rows) -> bool:
    """True if a loop (displacement, force and time as columns) has all rows of another one, at the same intervals."""
    tolerance = whole.tolerance(part)
    tolerance[2] *= 2.0  # of a difference of two times
    middles = 0.5 * (whole.numbers[2, 1:] + whole.numbers[2, :-1])
    is_first = np.all(np.abs(whole.numbers - part.numbers[:, :1])[:2] <= tolerance[:2], axis=0)
    is_long_enough = whole.numbers[2] + part.numbers[2, -1] <= whole.numbers[2, -1] + tolerance[2]
    for first in np.flatnonzero(is_first & is_long_enough):
        start = np.array([[0.0], [0.0], [whole.numbers[2, first]]])
        nearest = np.searchsorted(middles, part.numbers[2] + start[2])
        if np.all(np.abs(whole.numbers[:, nearest] - start - part.numbers) <= tolerance):
            return True
    return False


def copied_points(sweeps: Sequence[Sweep]) -> dict[tuple[int, int], list[int]]:
    """Find the runs of sweeps that are copies: one other run of the sweep, or one other sweep, has all their points.

    Two measurements never agree in all digits; fewer than five points of a file may, and are no copies. Of several
    identical runs, the first is the original. A point that its own run has twice is a copy, too.

    Args:
        sweeps: sweeps in order; only those in the same direction or of the same specimen are compared.

    Returns:
        Indices of the copied rows of a sweep, by the indices of this sweep and of the sweep with the original rows.
    """
    runs, run_of = defaultdict[_Run, list[int]](list), list[list[_Run]]()
    for index, sweep in enumerate(sweeps):
        levels = zip(sweep.repeat.tolist(), sweep.run_level.tolist(), strict=True)
        run_of.append([(index, level if sweep.stepped else None) for level in levels])
        for row, run in enumerate(run_of[-1]):
            runs[run].append(row)
    twins = [[set[_Run]() for _ in of_rows] for of_rows in run_of]
    copies: defaultdict[tuple[int, int], set[int]] = defaultdict(set)
    forms = [_forms(sweep) for sweep in sweeps]
    for first, second in combinations_with_replacement(range(len(sweeps)), 2):
        if sweeps[first].direction == sweeps[second].direction:
            for row, twin in chain.from_iterable(map(_equal_points, forms[first], forms[second])):
                twins[first][row].add(run_of[second][twin])
                twins[second][twin].add(run_of[first][row])
                if row < twin and run_of[first][row] == run_of[second][twin]:
                    copies[first, first].add(twin)
    copied = set[_Run]()
    for run, rows in reversed(runs.items()):
        index = run[0]
        equal_runs = (twins[index][row] - {run} - copied for row in rows)
        # a run of this sweep, or another sweep
        originals = [{twin if twin[0] == index else (twin[0], None) for twin in equal} for equal in equal_runs]
        for original in sorted(number for number, _ in set.intersection(*originals))[:1]:
            copies[index, original].update(rows)
            copied.add(run)
    files = [sweep.source.file if sweep.source else sweep.name for sweep in sweeps]
    counts = Counter(files[index] for (index, _), copied_rows in copies.items() for _ in copied_rows)
    return {pair: sorted(rows) for pair, rows in sorted(copies.items()) if counts[files[pair[0]]] >= _FEWEST_POINTS}


def _forms(sweep: Sweep) -> list[_Rows]:
    """Rows of a sweep in each form in which its stiffness may have been written, which contain its last decimals."""
    stiffness, size = sweep.stiffness, abs(sweep.stiffness)
    pairs = (size, loss_factor(stiffness)), (size, np.angle(stiffness, deg=True)), (stiffness.real, stiffness.imag)
    return [_Rows.of_columns(*pair, sweep.frequency, sweep.amplitude_reached) for pair in pairs]


def _equal_points(first: _Rows, second: _Rows) -> Iterator[tuple[int, int]]:
    """Yield the pairs of row indices at which two sweeps in the same form have equal points."""
    tolerance = first.tolerance(second)
    order = np.argsort(second.numbers[0])
    ends = first.numbers[0] + np.array([[-1.0], [1.0]]) * tolerance[0]
    lowest, highest = np.searchsorted(second.numbers[0, order], ends)
    for row in np.flatnonzero(highest > lowest).tolist():
        near = order[lowest[row] : highest[row]]
        equal = np.all(np.abs(second.numbers[:, near] - first.numbers[:, row : row + 1]) <= tolerance, axis=0)
        yield from ((row, twin) for twin in near[equal].tolist())


def without_copied_loops(loops: Sequence[Loop]) -> list[Loop]:
    """Leave out the loops of a campaign that are copies of an earlier loop; a note on that loop names its copies."""
    return [
        replace(first, source=first.source and first.source.with_notes(_copy_notes(first, copies)))
        for first, *copies in group_copies(loops)
    ]


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
        whole_copies = [sweeps[copy] for copy, first in copies if first == index and is_copy[copy].all()]
        notes = _copy_notes(sweep, whole_copies)
        for (_, original), rows in ((pair, rows) for pair, rows in copies.items() if pair[0] == index):
            repeats = [*map(str, sorted(set(sweep.repeat[rows].tolist())))]
            of_repeats = f" of repeat{'s' * (len(repeats) > 1)} {join_names(repeats)}" if original == index else ""
            source = "other points of the test" if original == index else sweeps[original].name
            sentence = f"{len(rows)} points{of_repeats} are copies of {source} and are left out; "
            sentence += "row numbers in messages do not count the copies"
            notes.append(Caveat("copied_repeats", sentence))
        arrays = {name: values for name, values in vars(sweep).items() if isinstance(values, np.ndarray)}
        columns: dict[str, Any] = {name: values[~is_copy[index]] for name, values in arrays.items()}
        remaining.append(replace(sweep, source=sweep.source and sweep.source.with_notes(notes), **columns))
    return remaining


def _copy_notes(first: AnyTest, copies: Sequence[AnyTest]) -> list[Caveat]:
    """Note that names the files (or, within one file, the tests) with copies of a test, in a list; empty without."""
    file = first.source.file if first.source else None
    names = [copy.source.file.name if copy.source and copy.source.file != file else copy.name for copy in copies]
    return [Caveat("copied_tests", f"{join_names(names)} with the same data: used once")] if names else []
