"""Files of a simulated campaign: test tables as a laboratory writes them, the campaign file, and the true model."""

from __future__ import annotations

import json
from collections.abc import Collection
from pathlib import Path

import numpy as np
import pandas as pd
from typing_extensions import TypedDict

from bushfit.campaign.toml import specimen_lines, toml_value
from bushfit.effects import ORIGINS
from bushfit.errors import quote_path
from bushfit.geometry import STRAINING, Direction, Display, Place, Unit, strain_factor_of_files
from bushfit.model.document import ModelFile
from bushfit.model.file import to_document
from bushfit.reading.measurement import Loop, Sweep, loss_factor
from bushfit.reading.resonance import ResonanceTest
from bushfit.reading.tablefile import Form, ending, to_bytes
from bushfit.simulation.measured import SimulatedData
from bushfit.templates import render_template
from bushfit.units import CELSIUS


class SimulationDocument(TypedDict):
    """JSON document on a simulated campaign: the true model and the names of the files.

    Args:
        truth: True model, as in truth.json.
        files: names of the written files.
    """

    truth: ModelFile
    files: list[str]


def to_files(simulated: SimulatedData, form: Form = "csv", effects: Collection[str] = ()) -> dict[str, bytes]:
    """Convert a simulated campaign to the files of a laboratory.

    Args:
        simulated: simulated campaign.
        form: file format of the tables.
        effects: effects that a fit of the tests has, such as the stiffness factor of a bushing.

    Returns:
        Content by file name: tables of the tests, `campaign.toml`, and the true model in `truth.json`. Comments in
        `campaign.toml` state the `bushfit reduce` command of each resonance test.
    """
    tables = {
        **{loop.name: raw_loop_table(loop) for loop in (*simulated.loops, *simulated.validation)},
        **{sweep.name: raw_sweep_table(sweep) for sweep in simulated.sweeps},
        **{test.name: raw_resonance_table(test) for _, test in simulated.resonances},
    }
    origins = (ORIGINS[name] for name in simulated.truth.effects if name in ORIGINS)
    campaign = render_template(
        Path(__file__).with_name("campaign.toml.jinja"),
        plan=simulated.plan,
        laws=sorted({Path(origin.file).resolve().as_posix() for origin in origins if origin.file}),
        bushing=simulated.truth.bushing,
        specimens=simulated.specimens,
        effects=effects,
        tests=[(kind, getattr(simulated, kind)) for kind in ("loops", "sweeps", "validation")],
        resonances=simulated.resonances,
        directions=list(Direction),
        ending=ending(form),
        quoted=lambda text: quote_path(Path(str(text))),
        specimen_lines=specimen_lines,
        toml_value=toml_value,
        celsius=CELSIUS,
    )
    return {
        **{f"{name}.{ending(form)}": to_bytes(name, table, form) for name, table in tables.items()},
        "campaign.toml": campaign.encode(),
        "truth.json": (json.dumps(to_document(simulated.result), indent=1) + "\n").encode(),
    }


def raw_loop_table(loop: Loop) -> pd.DataFrame:
    """Convert a simulated loop to a test table as a laboratory writes it, in display units.

    Args:
        loop: simulated loop.

    Returns:
        Columns of time [s], displacement and force, or time, strain and stress; one row per instant.
    """
    moves, resists, _ = loop.direction.motion.words
    (length, length_factor), (force, force_factor), _ = _file_units(loop.direction)
    return pd.DataFrame(
        {
            "time [s]": loop.time,
            f"{moves} [{length}]": loop.displacement * length_factor,
            f"{resists} [{force}]": loop.force * force_factor,
        }
    )


def raw_sweep_table(sweep: Sweep) -> pd.DataFrame:
    """Convert a simulated sweep to a test table as a laboratory writes it, in display units.

    If the amplitude is stepped, the table has the amplitudes that the rig reached instead of the nominal ones.

    Args:
        sweep: simulated sweep.

    Returns:
        Columns of frequency [Hz], amplitude, repeat, stiffness and loss factor; one row per point.
    """
    motion = sweep.direction.motion
    amplitude, relates = "strain amplitude" if motion is STRAINING else "amplitude", motion.words[2]
    (length, length_factor), _, (stiffness, factor) = _file_units(sweep.direction)
    level, reached = sweep.amplitude, sweep.reached
    if sweep.stepped == "amplitude" and reached is not None:
        level, reached = reached, None
    return pd.DataFrame(
        {
            "frequency [Hz]": sweep.frequency,
            f"{amplitude} [{length}]": level * length_factor,
            **({} if reached is None else {f"amplitude reached [{length}]": reached * length_factor}),
            "repeat": sweep.repeat,
            f"{relates} [{stiffness}]": np.abs(sweep.stiffness) * factor,
            "loss factor [-]": loss_factor(sweep.stiffness),
        }
    )


def raw_resonance_table(test: ResonanceTest) -> pd.DataFrame:
    """Convert a simulated resonance test to a test table as a laboratory writes it.

    Args:
        test: simulated resonance test.

    Returns:
        Columns of frequency [Hz], base and mass acceleration [m/s^2], and phase of the mass [deg].
    """
    return pd.DataFrame(
        {
            "frequency [Hz]": test.frequency,
            "base acceleration [m/s^2]": test.base_acceleration,
            "mass acceleration [m/s^2]": test.base_acceleration * np.abs(test.transmissibility),
            "phase [deg]": np.degrees(np.angle(test.transmissibility)),
        }
    )


def _file_units(place: Place) -> Display:
    """Units of displacement, force and stiffness in the files of a direction or specimen; tensor strain is gamma/2."""
    (unit, factor), force, stiffness = place.display
    ratio = strain_factor_of_files(place)
    return Display(Unit(unit, factor / ratio), force, stiffness)
