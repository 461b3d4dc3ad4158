"""Tables for spreadsheets: units in every header, one row a point."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from bushfit.effects import effect_named
from bushfit.geometry import Direction

if TYPE_CHECKING:
    import pandas as pd

    from bushfit.diagnosis.record import Diagnosis
    from bushfit.effects.contract import Array
    from bushfit.fitting.terms import LoopTerm, SweepTerm, Term
    from bushfit.measurement import Loop, Sweep
    from bushfit.model import Model
    from bushfit.prediction import Prediction
    from bushfit.reduction import Reduction

#: How a text begins that a spreadsheet takes for a formula, in ASCII or full width, be it after blanks.
_FORMULA = re.compile("[\\s\"']*[=+\\-@\uff1d\uff0b\uff0d\uff20|%]|\\t")
_LINES = re.compile("[\\r\\n]+")
#: Displacement and stiffness as engineers read them: unit and factor from SI.
_TRANSLATION = {"length": ("mm", 1e3), "force": ("N", 1.0), "stiffness": ("N/mm", 1e-3)}
_ROTATION = {"length": ("deg", 180.0 / np.pi), "force": ("N m", 1.0), "stiffness": ("N m/rad", 1.0)}


def display_units(direction: Direction) -> Mapping[str, tuple[str, float]]:
    """Unit and factor from SI of length, force and stiffness in a direction."""
    return _ROTATION if direction is Direction.TORSION else _TRANSLATION


def prediction_table(prediction: Prediction) -> pd.DataFrame:
    """The table of `predict`: six columns, then low and high of the last four."""
    import pandas as pd

    units = display_units(prediction.direction)
    length, length_factor = units["length"]
    stiffness, factor = units["stiffness"]
    columns = {
        "frequency [Hz]": prediction.frequency,
        f"amplitude [{length}]": prediction.amplitude * length_factor,
    }
    bands = {
        f"stiffness [{stiffness}]": (prediction.stiffness, factor),
        "loss factor [-]": (prediction.loss_factor, 1.0),
        f"storage stiffness [{stiffness}]": (prediction.storage_stiffness, factor),
        f"loss stiffness [{stiffness}]": (prediction.loss_stiffness, factor),
    }
    columns |= {name: band.value * scale for name, (band, scale) in bands.items()}
    for name, (band, scale) in bands.items():
        columns |= {f"{name}, low": band.low * scale, f"{name}, high": band.high * scale}
    return pd.DataFrame(columns)


def loops_table(model: Model, terms: Sequence[LoopTerm]) -> pd.DataFrame:
    """Measured and modelled force of every loop, row by row (or by bin of phase where a loop is long)."""
    import pandas as pd

    frames = []
    for term in terms:
        units = display_units(term.direction)
        (length, length_factor), (force, force_factor) = units["length"], units["force"]
        drive = term.drive
        frames.append(
            pd.DataFrame(
                {
                    "loop": term.loop.name,
                    "direction": str(term.direction),
                    "time [s]": drive.phase / drive.frequency,
                    f"displacement [{length}]": drive.displacement(drive.phase) * length_factor,
                    f"force [{force}]": drive.force * force_factor,
                    f"model force [{force}]": term.force(model) * force_factor,
                    "residual [noise]": term.shown(model),
                }
            )
        )
    return pd.concat(frames, ignore_index=True)


def sweeps_table(model: Model, terms: Sequence[SweepTerm]) -> pd.DataFrame:
    """Measured and modelled dynamic stiffness of every sweep, sorted by amplitude, repeat and frequency."""
    import pandas as pd

    frames = []
    for term in terms:
        units = display_units(term.direction)
        (length, length_factor), (stiffness, factor) = units["length"], units["stiffness"]
        modelled = term.stiffness(model)
        gain, phase = np.split(term.shown(model), 2)
        frames.append(
            pd.DataFrame(
                {
                    "sweep": term.sweep.name,
                    "direction": str(term.direction),
                    "frequency [Hz]": term.frequency,
                    f"amplitude [{length}]": term.amplitude * length_factor,
                    "repeat": term.sweep.repeat[term.order],
                    f"stiffness [{stiffness}]": np.abs(term.measured) * factor,
                    "loss factor [-]": _loss_factor(term.measured),
                    f"model stiffness [{stiffness}]": np.abs(modelled) * factor,
                    "model loss factor [-]": _loss_factor(modelled),
                    "stiffness residual [noise]": gain,
                    "loss residual [noise]": phase,
                }
            )
        )
    return pd.concat(frames, ignore_index=True)


def gap_table(before: Model, after: Model, terms: Sequence[Term]) -> pd.DataFrame:
    """Every residual of a diagnosis, before and after, in units of noise: a row a sweep point, or a loop's row."""
    import pandas as pd

    frames = []
    for term in terms:
        columns: dict[str, Any] = {"test": term.name, "kind": term.kind, "direction": str(term.direction)}
        length, factor = display_units(term.direction)["length"]
        first, second = (term.residual(model) for model in (before, after))
        if term.kind == "loop":
            columns |= {"time [s]": term.drive.phase / term.drive.frequency}
            columns |= {"frequency [Hz]": term.drive.frequency, f"amplitude [{length}]": term.drive.amplitude * factor}
            columns |= {"force before [noise]": first, "force after [noise]": second}
        else:
            columns |= {"frequency [Hz]": term.frequency, f"amplitude [{length}]": term.amplitude * factor}
            columns |= {"repeat": term.sweep.repeat[term.order]}
            for name, values in (("before", first), ("after", second)):
                storage, loss = np.split(values, 2)
                columns |= {f"storage {name} [noise]": storage, f"loss {name} [noise]": loss}
        frames.append(pd.DataFrame(columns))
    return pd.concat(frames, ignore_index=True)


def candidates_table(diagnosis: Diagnosis) -> pd.DataFrame:
    """Every effect of the library, judged: score, gain, BIC, held-out gap, parameters, and why it won or lost."""
    import pandas as pd

    rows = [
        {
            "effect": judged.name,
            "level": str(effect_named(judged.name).level),
            "score": judged.score,
            "chi-square gain": judged.gain,
            "BIC gain": judged.bic,
            "held-out gap [noise]": judged.heldout,
            "parameters": "; ".join(f"{name} = {value:.6g}" for name, value in judged.parameters.items()),
            "why": judged.why,
        }
        for judged in diagnosis.candidates
    ]
    return pd.DataFrame(rows)


def raw_loop_table(loop: Loop) -> pd.DataFrame:
    """A loop as a rig writes it: time, displacement, force."""
    import pandas as pd

    units = display_units(loop.direction)
    (length, length_factor), (force, force_factor) = units["length"], units["force"]
    return pd.DataFrame(
        {
            "time [s]": loop.time,
            f"displacement [{length}]": loop.displacement * length_factor,
            f"force [{force}]": loop.force * force_factor,
        }
    )


def raw_sweep_table(sweep: Sweep) -> pd.DataFrame:
    """A sweep as a rig writes it: frequency, amplitude, repeat, stiffness, loss factor."""
    import pandas as pd

    units = display_units(sweep.direction)
    (length, length_factor), (stiffness, factor) = units["length"], units["stiffness"]
    return pd.DataFrame(
        {
            "frequency [Hz]": sweep.frequency,
            f"amplitude [{length}]": sweep.amplitude * length_factor,
            "repeat": sweep.repeat,
            f"stiffness [{stiffness}]": np.abs(sweep.stiffness) * factor,
            "loss factor [-]": _loss_factor(sweep.stiffness),
        }
    )


def reduced_table(reduction: Reduction) -> pd.DataFrame:
    """Raw histories reduced to a sweep: what the sweep reader takes, then what tells how good each point is."""
    import pandas as pd

    units = display_units(reduction.direction)
    (length, length_factor), (stiffness, factor) = units["length"], units["stiffness"]
    steps = reduction.steps
    measured = np.array([step.stiffness for step in steps])
    loss_factor = _loss_factor(measured)
    frame = pd.DataFrame(
        {
            "frequency [Hz]": [float(f"{step.nominal_frequency:.5g}") for step in steps],
            f"amplitude [{length}]": [float(f"{length_factor * step.level:.5g}") for step in steps],
            f"amplitude reached [{length}]": [step.amplitude * length_factor for step in steps],
            "repeat": [step.repeat for step in steps],
            f"stiffness [{stiffness}]": np.abs(measured) * factor,
            "loss factor [-]": loss_factor,
            f"stiffness std error [{stiffness}]": [step.gain_error * abs(step.stiffness) * factor for step in steps],
            "loss factor std error [-]": [
                step.phase_error * (1.0 + eta**2) for step, eta in zip(steps, loss_factor, strict=True)
            ],
            "frequency found [Hz]": [step.frequency for step in steps],
            "displacement distortion [-]": [step.displacement_distortion for step in steps],
            "force distortion [-]": [step.force_distortion for step in steps],
            "cycles used": [step.cycles for step in steps],
            "rows per cycle": [step.rows_per_cycle for step in steps],
            "start [s]": [step.start for step in steps],
            "end [s]": [step.end for step in steps],
            "history": [step.name for step in steps],
        }
    )
    order = [f"amplitude [{length}]", "repeat", "frequency [Hz]"]
    return frame.sort_values(order, ignore_index=True, kind="stable")


def _loss_factor(stiffness: Array) -> Array:
    return np.imag(stiffness) / np.real(stiffness)


def to_csv(table: pd.DataFrame) -> bytes:
    """Comma, decimal point, UTF-8, seven digits; no text that a spreadsheet would run as a formula."""
    import pandas as pd

    cells = {defused(str(name)): _cells(column) for name, column in table.items()}
    return pd.DataFrame(cells).to_csv(index=False, lineterminator="\n").encode("utf-8", "replace")


def _cells(column: pd.Series) -> object:
    """A column as it is written. pandas would take longer to put a loop's numbers into words than to fit them."""
    import pandas as pd

    if column.dtype == float:
        return ["" if value != value else f"{value:.7g}" for value in column.tolist()]
    if column.dtype == object or pd.api.types.is_string_dtype(column):
        cells = column.to_numpy(dtype=object).tolist()
        words = {cell: defused(cell) for cell in set(cells) if isinstance(cell, str)}
        return [words.get(cell, cell) for cell in cells]
    return column


def defused(text: str) -> str:
    """A text as one line, with an apostrophe before one that a spreadsheet would run as a formula."""
    line = " ".join(_LINES.split(text))
    return f"'{line}" if _FORMULA.match(line) else line
