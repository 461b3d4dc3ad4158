"""The files of one laboratory visit, simulated with the paper's bushing, each as another machine writes it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from bushfit.campaign.schema import SimulatedLoop, SimulatedSweep, SimulateSettings
from bushfit.geometry import Direction
from bushfit.model.model import Model
from bushfit.reading.measurement import Sweep
from bushfit.simulation.measured import measure
from bushfit.simulation.undisturbed import undisturbed

FREQUENCIES = tuple(float(f) for f in range(5, 156, 15))
AMPLITUDES = (5e-5, 1e-4, 2e-4, 5e-4)
INFO = [
    ["Prüfbericht", ""],
    ["Kunde", "Muster AG"],
    ["Prüftemperatur", "23 °C"],
    ["Datum", "2024-05-03"],
    ["Hinweis", "Werte nach 3 Vorzyklen"],
]


def write_visit(folder: Path, truth: Model) -> None:
    """All files of the visit."""
    loop = SimulatedLoop(Direction.AXIAL, 1e-3, 0.1, cycles=3)
    sweeps = tuple(SimulatedSweep(place, AMPLITUDES, FREQUENCIES) for place in (Direction.AXIAL, Direction.RADIAL))
    noise = {"noise": 2e-3, "force_noise": 2e-3, "displacement_noise": 5e-4}
    plan = SimulateSettings(loops=(loop,), sweeps=sweeps, **noise)
    clean = undisturbed(truth, plan)
    first, second, third = (measure(clean, SimulateSettings(**vars(plan) | {"seed": seed})) for seed in range(3))
    with pd.ExcelWriter(folder / "Buchse 7.xlsx") as book:
        pd.DataFrame(INFO).to_excel(book, sheet_name="Info", index=False, header=False)
        for name, sweep in zip(("axial", "radial"), first.sweeps, strict=True):
            long(sweep).to_excel(book, sheet_name=name, index=False)
    axial, radial = second.sweeps
    for level in AMPLITUDES:
        rows = axial.amplitude == level
        text = long(axial)[rows].drop(columns="Amplitude [mm]").to_csv(sep=";", decimal=",", index=False)
        (folder / f"Dyn_axial_A{1e3 * level:g}mm.csv".replace(".", ",", 1)).write_text(text, encoding="cp1252")
    (folder / "radial wide.csv").write_text(wide(radial), encoding="utf-8")
    (folder / "MTS_radial.txt").write_text(mts(third.sweeps[1]), encoding="utf-8")
    (recorded,) = first.loops
    columns = (recorded.time, 1e3 * recorded.displacement + 1.25, 1e-3 * recorded.force + 0.9)
    rows = [";".join(f"{value:.6f}".replace(".", ",") for value in row) for row in zip(*columns, strict=True)]
    head = "Prüfer: 3\nVorkraft: 0,9 kN\n\nZeit;Axialweg;Axialkraft\ns;mm;kN\n"
    (folder / "Hysterese 0,1Hz.csv").write_text(head + "\n".join(rows) + "\n", encoding="cp1252")
    (folder / "Notizen.txt").write_text("Mittwoch: Buchse eingebaut.\nDonnerstag: fertig.\n", encoding="utf-8")


def long(sweep: Sweep) -> pd.DataFrame:
    """A row for each point, with German headers."""
    return pd.DataFrame(
        {
            "Frequenz [Hz]": sweep.frequency,
            "Amplitude [mm]": np.round(1e3 * sweep.amplitude, 6),
            "dyn. Steifigkeit [N/mm]": np.round(1e-3 * np.abs(sweep.stiffness), 4),
            "Verlustfaktor [-]": np.round(sweep.stiffness.imag / sweep.stiffness.real, 6),
        }
    )


def wide(sweep: Sweep) -> str:
    """Frequencies down and amplitudes across, a block for stiffness and one for loss side by side."""
    table = long(sweep)
    frequency, level, *values = table.columns
    stiffness, loss = (table.pivot_table(index=frequency, columns=level, values=name) for name in values)
    names = [f"K* {level:g} mm [N/mm]" for level in stiffness] + [f"tan delta {level:g} mm" for level in loss]
    return pd.concat((stiffness, loss), axis=1).set_axis(names, axis=1).reset_index().to_csv(index=False)


def mts(sweep: Sweep) -> str:
    """Tabs, a preamble, and amplitudes that count peak-to-peak."""
    table = long(sweep)
    table["Amplitude [mm]"] *= 2.0
    names = ["Frequency (Hz)", "Dynamic Displacement p-p (mm)", "K* (N/mm)", "Tan Delta"]
    head = "MTS Elastomer\nTest:\tDynamic characterization\nOperator:\t2\nTemperature:\t23.0 deg C\n\n"
    return head + table.set_axis(names, axis=1).to_csv(sep="\t", index=False)
