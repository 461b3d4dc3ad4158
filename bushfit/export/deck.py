"""What all solver decks share: tables over frequency for each amplitude, comments, the heading, and what decks cannot
carry, in words, with the error that it costs over the exported grid.
"""

import re
import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from bushfit.effects import Level as EffectLevel
from bushfit.effects.contract import Array
from bushfit.errors import ModelError
from bushfit.export.contract import Order, UnitSystem
from bushfit.geometry import Direction
from bushfit.prediction.caveats import percent_off
from bushfit.prediction.stiffness import Prediction
from bushfit.units import number
from bushfit.version import __version__

#: Characters of a comment's line at most, its mark included: those of a card.
_WIDTH = 80
#: Characters that ASCII has no sign for, or that end a line.
_UNPRINTABLE = re.compile(r"[^\x20-\x7e]")
#: Degrees of freedom that a direction stands for, the bushing's axis along z: 1 to 3 are x, y and z, 6 turns about z.
DOFS = {Direction.AXIAL: (3,), Direction.RADIAL: (1, 2), Direction.TORSION: (6,)}
#: What every law over frequency leaves out.
NO_LOOPS = "no law in time: loops, overtones and transients need another format (fmu)"


class Table(NamedTuple):
    """Complex stiffness of a direction over frequency at one amplitude [Hz; m or rad; N/m or N m/rad], (n,)."""

    direction: Direction
    amplitude: float
    frequency: Array
    stiffness: Array


#: The tables of all directions that one property of a solver holds.
Level = tuple[Table, ...]


def directions(order: Order) -> list[Prediction]:
    """The predictions of the bushing's directions; specimens are no parts of a car.

    Raises:
        ModelError: there is none, or their frequencies differ.
    """
    found = [prediction for prediction in order.predictions if isinstance(prediction.direction, Direction)]
    if not found:
        raise ModelError(
            "there is no direction of a bushing to export",
            found=", ".join(map(str, order.places)),
            expected="axial, radial or torsion",
            hint="csv and xlsx take specimens, too",
        )
    grids = [np.unique(prediction.frequency) for prediction in found]
    if not all(np.array_equal(grid, grids[0]) for grid in grids):
        raise ModelError("directions at different frequencies", expected="one list of frequencies for all directions")
    return found


def tables(prediction: Prediction) -> list[Table]:
    """The tables of one direction, by rising amplitude."""
    direction = Direction(str(prediction.direction))
    stiffness = prediction.storage_stiffness.value + 1j * prediction.loss_stiffness.value
    found = []
    for amplitude in np.unique(prediction.amplitude):
        here = prediction.amplitude == amplitude
        found.append(Table(direction, float(amplitude), prediction.frequency[here], stiffness[here]))
    return found


def levels(order: Order) -> list[Level]:
    """The tables of all directions, level by level: the first amplitude of each, then the second, and so on.

    A direction with fewer amplitudes than others stays at its last.
    """
    each = [tables(prediction) for prediction in directions(order)]
    count = max(map(len, each))
    return [tuple(own[min(rank, len(own) - 1)] for own in each) for rank in range(count)]


def by_dof(level: Level) -> Iterator[tuple[int, Table]]:
    """Each degree of freedom, from 1, that a level says something of, and its table."""
    yield from sorted(((dof, table) for table in level for dof in DOFS[table.direction]), key=lambda pair: pair[0])


class Form(NamedTuple):
    """The two real tables in which a solver takes a complex stiffness.

    Args:
        parts: (frequency, stiffness) -> the two, (n,) each.
        joined: (frequency, first, second) -> stiffness.
    """

    parts: Callable[[Array, Array], tuple[Array, Array]]
    joined: Callable[[Array, Array, Array], Array]

    def in_units(self, table: Table, units: UnitSystem) -> tuple[Array, Array, Array]:
        """Frequency and the two parts of a table, in the units of the deck."""
        frequency = table.frequency * units.frequency.factor
        factor = units.display(table.direction.motion).stiffness.factor
        return frequency, *self.parts(frequency, table.stiffness * factor)


def middle(rows: Sequence[Table]) -> Table:
    """The table of the middle amplitude, the lower of two."""
    return rows[(len(rows) - 1) // 2]


def commented(mark: str, lines: Iterable[str]) -> list[str]:
    """Comments in ASCII, each after its mark and a blank; what is too long goes on below, behind a bar.

    Line ends and other signs are written as escapes, so that no text begins a line of its own.
    """
    found = []
    for line in lines:
        plain = _UNPRINTABLE.sub(lambda sign: ascii(sign[0])[1:-1], line)
        found += textwrap.wrap(plain, _WIDTH, initial_indent=f"{mark} ", subsequent_indent=f"{mark} | ") or [mark]
    return found


def heading(order: Order, units: str, losses: Iterable[str]) -> list[str]:
    """What every deck says of itself: bushing, model and hash, units, axes, what it leaves out, and warnings."""
    bushing, source = order.result.model.bushing, order.source
    sizes = (bushing.inner_radius, bushing.outer_radius, bushing.length) if bushing else ()
    return [
        f"written by bushfit {__version__}{f' on {order.day}' if order.day else ''}",
        f"bushing: {order.result.name}",
        f"inner radius, outer radius, length: {', '.join(number(1e3 * size, 6) for size in sizes)} mm",
        f"model: {source.file}",
        f"sha256: {source.sha256}",
        f"units: {units}",
        "axes: z along the bushing (axial 3, torsion 6), x and y across (radial 1, 2)",
        *map(": ".join, order.remarks(losses)),
    ]


def of_levels(
    order: Order,
    mark: str,
    units: UnitSystem,
    losses: Iterable[str],
    used: str,
    name: str,
    lines_of: Callable[[int, Level], Iterable[str]],
) -> list[str]:
    """A deck: its heading and how it is used, then of each level, from 1, its name and amplitudes, and its lines."""
    about = f"{units}; frequency in {units.frequency.name}, rotation in rad"
    lines = commented(mark, [*heading(order, about, losses), used])
    for rank, level in enumerate(levels(order), start=1):
        lines += [*commented(mark, [f"{name}{rank}: {stated(level)}"]), *lines_of(rank, level)]
    return lines


def stated(level: Iterable[Table]) -> str:
    """The amplitudes of a level in words: "axial at 0.2 mm, torsion at 1 deg"."""
    shown = [(table.direction, table.amplitude, *table.direction.display.displacement) for table in level]
    return ", ".join(f"{place} at {number(amplitude * factor, 6)} {unit}" for place, amplitude, unit, factor in shown)


def real(value: float, digits: int = 5) -> str:
    """A number with so many significant digits, ten for what a table goes over; nothing is 0."""
    return f"{value:.{digits - 1}E}" if value else "0."


def to_bytes(lines: Iterable[str]) -> bytes:
    """The bytes of a deck; a sign beyond ASCII in it is a fault."""
    return ("\n".join(lines) + "\n").encode("ascii")


def of_tables(order: Order, form: Form) -> Iterator[str]:
    """What linear tables over frequency, one set an amplitude, do not carry, and what that costs."""
    model = order.result.model.without(EffectLevel.INSTRUMENT)
    for prediction in directions(order):
        own, place = tables(prediction), prediction.direction
        yield from _of_amplitude(own)
        if own[0].frequency.size > 1:
            worst = 0.0
            for table in own:  # straight lines between its rows, halfway between two frequencies
                halfway = 0.5 * (table.frequency[1:] + table.frequency[:-1])
                lines = (0.5 * (part[1:] + part[:-1]) for part in form.parts(table.frequency, table.stiffness))
                exact = model.stiffness(place, halfway, table.amplitude, under=order.under)
                worst = max(worst, float(np.max(np.abs(form.joined(halfway, *lines) / exact - 1.0))))
            yield f"{place}: between its frequencies |K| is up to {number(100.0 * worst, 2)} % off"
        else:
            yield f"{place}: one frequency, {number(own[0].frequency[0], 4)} Hz: K and loss are constants"
        yield from of_band(prediction)
    yield from of_all(order)


def of_all(order: Order) -> Iterator[str]:
    """What no deck for one element carries: time, coupling, and motions that the model does not know."""
    yield NO_LOOPS
    yield "each direction answers by itself: what motion in one does to another is not in it"
    there = {prediction.direction for prediction in directions(order)}
    missing = [str(direction) for direction in DOFS if direction not in there]
    yield f"no stiffness in {', '.join([*missing, 'rotations about x and y'])}"
    if specimens := [str(place) for place in order.places if place not in DOFS]:
        yield f"specimens: {', '.join(specimens)}"


def _of_amplitude(own: Sequence[Table]) -> Iterator[str]:
    """What it costs that a property of a solver has one amplitude; nothing where there is but one."""
    if len(own) > 1:
        taken = middle(own)
        off = np.concatenate([np.abs(taken.stiffness / table.stiffness) for table in own])
        unit, factor = taken.direction.display.displacement
        low, at, high = (number(table.amplitude * factor, 4) for table in (own[0], taken, own[-1]))
        yield (
            f"{taken.direction}: amplitude, one a property: taken at {at} {unit}, |K| is {percent_off(off)} off at "
            f"{low} to {high} {unit}"
        )


def of_band(prediction: Prediction) -> Iterator[str]:
    """The 95 % band, and the other reading where an effect may as well be the rig's."""
    place, band = prediction.direction, prediction.stiffness
    if (width := float(np.max((band.high - band.low) / (2.0 * band.value)))) > 0.0:
        yield f"{place}: the 95 % band, up to {number(100.0 * width, 2)} % of |K| either way"
    if prediction.if_rigs:
        off = percent_off(prediction.if_rigs.stiffness.value / band.value)
        yield f"{place}: the other reading, by which |K| is {off} if what is unresolved is the rig's"
