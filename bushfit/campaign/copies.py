"""Leave out copies: tests that a campaign lists under two names, and repeats that were copied within a file."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from bushfit.caveat import Caveat
from bushfit.reading.measurement import Loop, Source, Sweep

#: Minimum number of identical points that are copies; chosen: fewer may agree by chance in rounded files.
_FEWEST_POINTS = 5
#: Number of significant digits that are compared; later digits contain rounding errors of unit conversions.
_DIGITS = 9

_Test = TypeVar("_Test", Loop, Sweep)


def group_copies(tests: Sequence[_Test]) -> list[list[_Test]]:
    """Group tests with identical data in the same direction or of the same specimen.

    Two measurements never agree in all digits; sweeps of fewer than five points may, and are never grouped.

    Args:
        tests: loops, or sweeps, in order.

    Returns:
        Groups in the order of their first test; a test without copies is a group by itself.
    """
    groups: defaultdict[object, list[_Test]] = defaultdict(list)
    for number, test in enumerate(tests):
        if isinstance(test, Loop):
            numbers: bytes | int = np.stack((test.time, test.displacement, test.force)).tobytes()
        else:
            numbers = _fingerprint(test) if test.frequency.size >= _FEWEST_POINTS else number
        groups[test.direction, numbers].append(test)
    return list(groups.values())


def without_copied_tests(tests: Sequence[_Test]) -> list[_Test]:
    """Leave out tests that are copies of an earlier test. A copy contains no further information.

    Args:
        tests: loops, or sweeps, of a campaign in its order.

    Returns:
        The remaining tests, each with a note that names its copies.
    """
    remaining = []
    for first, *copies in group_copies(tests):
        files = [copy.source.file.name if copy.source else copy.name for copy in copies]
        note = Caveat("copied_tests", f"{_join_names(files)} with the same data: used once") if files else None
        remaining.append(_with_note(first, note) if note else first)
    return remaining


def without_copied_repeats(sweep: Sweep) -> Sweep:
    """Leave out runs of a sweep that are copies of an earlier run.

    Args:
        sweep: sweep of a campaign.

    Returns:
        Sweep of the remaining rows, with a note on the copied repeats; the same sweep if it has no copies.
    """
    runs: set[bytes] = set()
    is_copy, repeats = np.zeros(sweep.frequency.size, dtype=bool), dict[int, None]()
    for repeat, level in sorted(set(zip(sweep.repeat.tolist(), sweep.held_value.tolist(), strict=True))):
        rows = (sweep.repeat == repeat) & (sweep.held_value == level)
        numbers = _fingerprint(sweep, rows)
        if numbers in runs:
            is_copy |= rows
            repeats[repeat] = None
        runs.add(numbers)
    points = int(np.count_nonzero(is_copy))
    if sweep.stepped is None or points < _FEWEST_POINTS:
        return sweep
    names = ("frequency", "amplitude", "stiffness", "repeat", "reached", "relative_error", "temperature")
    columns = {name: getattr(sweep, name) for name in names}
    columns = {name: values[~is_copy] for name, values in columns.items() if isinstance(values, np.ndarray)}
    note = Caveat(
        "copied_repeats",
        f"{points} points of repeat{'s' * (len(repeats) > 1)} {_join_names([*map(str, repeats)])} are exact copies of "
        "an earlier repeat and are left out; row numbers in messages do not count the copies",
    )
    return _with_note(replace(sweep, **columns), note)


def _fingerprint(sweep: Sweep, rows: NDArray[np.bool_] | slice = slice(None)) -> bytes:
    """Bytes of frequency, amplitude and stiffness of sweep rows, rounded and sorted; equal data have equal bytes."""
    stiffness = sweep.stiffness[rows]
    numbers = np.stack([sweep.frequency[rows], sweep.amplitude_reached[rows], stiffness.real, stiffness.imag])
    scale = 10.0 ** (_DIGITS - 1 - np.floor(np.log10(np.maximum(np.abs(numbers), 1e-300))))
    numbers = np.round(numbers * scale) / scale
    return numbers[:, np.lexsort(numbers[::-1])].tobytes()


def _with_note(test: _Test, note: Caveat) -> _Test:
    """Add a warning to the notes on how the file of a test was read."""
    source: Source | None = test.source
    return replace(test, source=source and source.with_note(note))


def _join_names(names: Sequence[str]) -> str:
    """Join names as in "a, b and c"."""
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))
