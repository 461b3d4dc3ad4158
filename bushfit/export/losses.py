"""What formats cannot carry, in words, with the error that it costs over the exported grid."""

from collections.abc import Iterator, Sequence

import numpy as np

from bushfit.effects import Level
from bushfit.export.contract import Order
from bushfit.export.deck import DOFS, Form, Table, directions, middle, tables
from bushfit.prediction.caveats import percent_off
from bushfit.prediction.stiffness import Prediction
from bushfit.units import number

#: What every law over frequency leaves out.
NO_LOOPS = "no law in time: loops, overtones and transients need another format (fmu)"


def of_tables(order: Order, form: Form) -> Iterator[str]:
    """What linear tables over frequency, one set an amplitude, do not carry, and what that costs."""
    for prediction in directions(order):
        own, place = tables(prediction), prediction.direction
        yield from _of_amplitude(own)
        if own[0].frequency.size > 1:
            yield f"{place}: between its frequencies |K| is up to {_percent(_between(order, own, form))} off"
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
        yield f"{place}: the 95 % band, up to {_percent(width)} of |K| either way"
    if prediction.if_rigs:
        off = percent_off(prediction.if_rigs.stiffness.value / band.value)
        yield f"{place}: the other reading, by which |K| is {off} if what is unresolved is the rig's"


def _between(order: Order, own: Sequence[Table], form: Form) -> float:
    """Largest relative error of straight lines between the rows of tables, halfway between two frequencies."""
    model, worst = order.result.model.without(Level.INSTRUMENT), 0.0
    for table in own:
        halfway = 0.5 * (table.frequency[1:] + table.frequency[:-1])
        lines = (0.5 * (part[1:] + part[:-1]) for part in form.parts(table.frequency, table.stiffness))
        exact = model.stiffness(table.direction, halfway, table.amplitude, under=order.under)
        worst = max(worst, float(np.max(np.abs(form.joined(halfway, *lines) / exact - 1.0))))
    return worst


def _percent(share: float) -> str:
    return f"{number(100.0 * share, 2)} %"
