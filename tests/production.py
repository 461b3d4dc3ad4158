"""A simulated production run: one design, scatter of its compound, a rig that drifts, and two parts that differ."""

from pathlib import Path

import numpy as np

from bushfit.model.model import Model
from bushfit.reading.measurement import loss_factor

#: Bushings of the run, and the numbers of those that differ, counted in the order of the manifest.
COUNT, LOSSY, SOFT = 30, 7, 20
#: mu drifts by this share of its size from the first test to the last; the last of the manifest was tested first.
DRIFT = 0.10
LIMITS = """
parameters = { mu = { min = "0.9 MPa", max = "1.25 MPa" }, alpha = { sigma = 3 } }
stiffness = [{ at = "axial 25 Hz 0.2 mm", max = "1000 N/mm" }]
"""


def make(folder: Path, model: Model) -> None:
    """A campaign of one sweep in two repeats for each bushing, and the limits."""
    random = np.random.default_rng(4)
    frequency = np.tile([2.0, 5.0, 10.0, 25.0, 50.0, 100.0], 6)
    amplitude = np.repeat([1e-4, 2e-4, 5e-4], 12)
    repeat = np.tile(np.repeat([1, 2], 6), 3)
    for number in range(COUNT):
        values = {name: value * (1.0 + 0.01 * random.normal()) for name, value in model.values.items()}
        values["mu"] *= 1.0 + DRIFT * (COUNT - 1 - number) / (COUNT - 1)
        values["alpha"] *= 1.5 if number == LOSSY else 1.0
        values["mu"] *= 0.7 if number == SOFT else 1.0
        noise = 1.0 + 0.003 * (random.normal(size=36) + 1j * random.normal(size=36))
        stiffness = model.with_values(values).stiffness("axial", frequency, amplitude) * noise
        columns = (frequency, 1e3 * amplitude, repeat, 1e-3 * np.abs(stiffness), loss_factor(stiffness))
        place = folder / f"part_{number:02}"
        place.mkdir()
        header = "frequency [Hz],amplitude [mm],repeat,stiffness [N/mm],loss factor [-]"
        np.savetxt(place / "sweep.csv", np.array(columns).T, "%.7g", ",", header=header, comments="")
        (place / "bushing.toml").write_text(
            f'[bushing]\nname = "SN {900 + number}"\ninner_radius = "10 mm"\nouter_radius = "18 mm"\nlength = "34 mm"\n'
            f'[[sweeps]]\nfile = "sweep.csv"\ndirection = "axial"\ndate = "2026-05-{COUNT - number:02}"\n'
        )
    (folder / "limits.toml").write_text(LIMITS)
