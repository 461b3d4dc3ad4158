"""Displacement histories read from files: evenly sampled channels of one or more directions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bushfit.caveat import Caveat
from bushfit.errors import MeasurementError, error_location
from bushfit.geometry import TRANSLATION, Direction, Place, Specimen, get_places
from bushfit.reading.finding import find_table
from bushfit.reading.headers import DISPLACEMENT_COLUMNS, ERRORS
from bushfit.reading.layout import FileFormat
from bushfit.reading.loops import increasing_time, time_column
from bushfit.reading.measurement import Floats
from bushfit.reading.names import direction_of_file
from bushfit.reading.si_columns import si_column
from bushfit.reading.times import sampling_rate_above

#: Smallest number of rows of a history, and largest number of evenly sampled rows; chosen: their results take 2 GB.
FEWEST_ROWS, _MOST_ROWS = 10, 10_000_000
#: Largest deviation of a time from even sampling, relative to the step, that is taken as rounding.
_ROUNDING = 0.1
#: Largest ratio of evenly sampled to recorded rows; chosen: more would be guessed than was recorded.
_MOST_ADDED = 3.0


@dataclass(frozen=True, eq=False)
class DisplacementHistory:
    """Evenly sampled displacement in one direction.

    Args:
        direction: direction or specimen.
        displacement: displacement [m, rad or 1], (n,).
        step: time between samples [s].
        start: time of the first sample [s].
        notes: warnings on how the file was read, and on corrections.
    """

    direction: Place
    displacement: Floats
    step: float
    start: float = 0.0
    notes: tuple[Caveat, ...] = ()

    @property
    def time(self) -> Floats:
        """Time of each sample [s], (n,)."""
        return self.start + self.step * np.arange(self.displacement.size, dtype=float)


def read_displacements(
    file: Path,
    direction: str | None = None,
    specimens: Sequence[Specimen] = (),
    *,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    file_format: FileFormat | None = None,
) -> tuple[DisplacementHistory, ...]:
    """Read the displacement histories of a file, one for each direction in its headers and each of several bushings.

    Args:
        file: table or recording with a time and one or more displacements.
        direction: direction, specimen or bushing, if the file does not state it or if not all of several are wanted.
        specimens: specimens of the model, which names of bushings and directions select.
        columns: headers or numbers of columns with unusual names, by role (time, displacement, axial, radial, torsion).
        units: units that the file does not state, by role.
        file_format: format of the file; default detected.

    Returns:
        Histories with even steps. Uneven times are resampled by straight lines, which a note states.

    Raises:
        MeasurementError, UnitError: a column, its unit, the direction or the time cannot be used.
    """
    named_places = get_places(direction, specimens) if direction else []
    motion = named_places[0].motion if len({place.axis for place in named_places}) == 1 else None
    table = find_table(file, DISPLACEMENT_COLUMNS, columns, units, file_format, motion or TRANSLATION)
    headed = [axis for axis in Direction if str(axis) in table.roles]
    places = named_places or [place for axis in headed for place in get_places(axis, specimens)]
    roles = {place: str(place.axis) for place in places if place.axis in headed}
    if not roles:
        turns = table.agrees("displacement", "rad")
        tested = named_places[0] if motion else Direction.TORSION if turns else Direction.AXIAL
        column = si_column(table, "displacement", tested)
        axis = direction_of_file(table.file, [column.header], turns=turns, sheet=table.source.sheet)
        if axis and not motion:
            named_places = [place for place in named_places or get_places(axis, specimens) if place.axis == axis]
        if len({place.axis for place in named_places}) != 1:
            hint = f"state it: --direction {next(map(repr, map(str, named_places)), 'axial (or radial, torsion)')}"
            raise table.header_error(**ERRORS["no_axis_of_displacement"], found=f'"{column.header}"', hint=hint)
        roles = dict.fromkeys(named_places, "displacement")
    wanted = {role: si_column(table, role, place) for place, role in roles.items()}
    rate, note = (None, "") if "time" in table.roles else sampling_rate_above(table)
    wanted |= {} if rate else {"time": time_column(table, next(iter(roles)))}
    values, notes = table.read(wanted, fewest_rows=FEWEST_ROWS)
    if rate:
        time = np.arange(next(iter(values.values())).size) / rate
        more: tuple[Caveat, ...] = (Caveat("rate_from_header", note),)
    else:
        time, more = increasing_time(table.needing(wanted), wanted["time"], values["time"])
    with error_location(table.file, "time"):
        even, correction = even_time(time)
    notes = (*(note for note in notes if "displacement" in wanted or note not in table.notes), *more, *correction)
    return tuple(
        DisplacementHistory(
            place,
            np.interp(even, time, values[role]) if correction else values[role],
            float(even[1] - even[0]),
            float(even[0]),
            notes,
        )
        for place, role in roles.items()
    )


def even_time(time: Floats) -> tuple[Floats, tuple[Caveat, ...]]:
    """Space the times of a record [s], (n,), evenly.

    Returns:
        Even times [s], (n,); and a warning if the recorded times deviate from them by more than rounding.

    Raises:
        MeasurementError: the times are too uneven, or too many.
    """
    even = np.linspace(time[0], time[-1], time.size)
    steps, correction = np.diff(time), tuple[Caveat, ...]()
    step = float(np.median(steps))
    if np.any(np.abs(time - even) > _ROUNDING * step):
        count = round((time[-1] - time[0]) / step) + 1
        if count > _MOST_ADDED * time.size:
            found, expected = f"steps of {steps.min():.3g} to {steps.max():.3g} s", f"even steps, such as {step:.3g} s"
            raise MeasurementError(**ERRORS["uneven_times"], found=found, expected=expected)
        even = np.linspace(time[0], time[-1], count)
        rows = np.round(steps / step).astype(int)
        gaps = rows > 1
        kind, reason = "resampled", f"the time steps are {steps.min():.3g} to {steps.max():.3g} s"
        if gaps.any():
            longest = f"the longest gap is {steps.max():.3g} s from {time[steps.argmax()]:.6g} s"
            missing = rows[gaps].sum() - gaps.sum()
            reason = f"{missing} rows are missing, {longest}" if missing > 1 else f"1 row is missing, {longest}"
            kind = "rows_missing"
        sentence = f"{reason}: resampled evenly at {1.0 / step:.6g} Hz by linear interpolation"
        correction = (Caveat(kind, sentence),)
    if even.size > _MOST_ROWS:
        raise MeasurementError("the history is too long", found=f"{even.size} rows", expected=f"up to {_MOST_ROWS}")
    return even, correction
