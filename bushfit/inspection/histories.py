"""What a raw stepped-sine history holds: its steps, levels and sampling, and what is odd about it."""

from __future__ import annotations

from bushfit.inspection.channels import clock, odd_channels
from bushfit.inspection.labels import wrong_labels
from bushfit.inspection.record import Looked
from bushfit.reading.measurement import Loop
from bushfit.reading.names import Said
from bushfit.reduction.steps import reduce


def look_at_history(history: Loop, named: Said) -> Looked:
    """Facts and oddities of a history; `named` is what the names of its file and sheet say.

    Raises:
        MeasurementError: no steady sine in it.
    """
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
        *wrong_labels(named, history.direction, levels, frequencies),
        *odd_channels(history),
        *reduction.warnings,
    )
    return Looked(facts, odd)
