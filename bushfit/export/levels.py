"""The grid of an export as solvers take it: a set of tables over frequency for each amplitude."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from bushfit.effects.contract import Array
from bushfit.errors import ModelError
from bushfit.export.contract import Order
from bushfit.geometry import Direction
from bushfit.prediction import Prediction

#: Degrees of freedom that a direction stands for, the bushing's axis along z: 1 to 3 are x, y and z, 6 turns about z.
DOFS = {Direction.AXIAL: (3,), Direction.RADIAL: (1, 2), Direction.TORSION: (6,)}


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


def middle(rows: Sequence[Table]) -> Table:
    """The table of the middle amplitude, the lower of two."""
    return rows[(len(rows) - 1) // 2]
