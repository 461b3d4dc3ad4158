"""FMUs for the tests: orders, and an FMU that is run sample by sample through FMPy."""

from collections.abc import Mapping, Sequence
from ctypes import c_double, c_int, c_uint
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave

from bushfit.effects.contract import Array
from bushfit.export.contract import ExportRequest
from bushfit.export.fmu import export
from bushfit.geometry import Direction, Place
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.prediction.stiffness import predict
from bushfit.reading.measurement import Source

FREQUENCIES = np.arange(5.0, 156.0, 10.0)
#: Amplitudes of the grid by direction [m or rad].
LEVELS = {
    Direction.AXIAL: (1e-4, 2e-4, 5e-4),
    Direction.RADIAL: (1e-4, 2e-4, 5e-4),
    Direction.TORSION: tuple(np.radians((0.5, 1.0, 2.0))),
}


def request_of(
    model: Model, places: Sequence[Place] = tuple(LEVELS), accuracy: float = 0.01, **result: Any
) -> ExportRequest:
    """A request of these places over the paper's grid."""
    found = Result(model, **result)
    grids = [LEVELS.get(place, (0.01, 0.05)) if isinstance(place, Direction) else (0.01, 0.05) for place in places]
    predictions = [predict(found, place, FREQUENCIES, grid) for place, grid in zip(places, grids, strict=True)]
    return ExportRequest(found, Source(Path("model.json"), "0" * 64), tuple(predictions), accuracy)


def written(wanted: ExportRequest, folder: Path) -> Path:
    """The FMU of an order, written into a folder."""
    ((name, content),) = export(wanted).files.items()
    (folder / name).write_bytes(content)
    return folder / name


class Running:
    """An FMU on disk that can be run again and again, in one instance or several."""

    def __init__(self, file: Path, folder: Path) -> None:
        self.file = file
        self.description = fmpy.read_model_description(str(file), validate=True)
        self._folder = fmpy.extract(str(file), unzipdir=str(folder))
        self.reference = {each.name: each.valueReference for each in self.description.modelVariables}
        self.inputs = [each.name for each in self.description.modelVariables if each.causality == "input"]
        self.outputs = [each.name for each in self.description.modelVariables if each.causality == "output"]

    def instance(self, values: Mapping[str, float] | None = None, guid: str | None = None) -> FMU2Slave:
        """An instance before its initialization, with some parameters set."""
        made = FMU2Slave(
            guid=guid or self.description.guid,
            unzipDirectory=self._folder,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName="tested",
        )
        made.instantiate()
        made.setupExperiment(startTime=0.0)
        if values:
            made.setReal([self.reference[name] for name in values], list(values.values()))
        return made

    def begun(self, made: FMU2Slave, at: Sequence[float] | None = None) -> FMU2Slave:
        """The same after its initialization at a displacement of each direction."""
        made.enterInitializationMode()
        made.setReal([self.reference[name] for name in self.inputs], list(at or [0.0] * len(self.inputs)))
        made.exitInitializationMode()
        return made

    def follow(self, made: FMU2Slave, motion: Array, step: float | Array) -> Array:
        """Forces, (n, directions), of motions, (n, directions), each straight from sample to sample; it has begun."""
        count = len(self.inputs)
        inputs = (c_uint * count)(*(self.reference[name] for name in self.inputs))
        outputs = (c_uint * count)(*(self.reference[name] for name in self.outputs))
        first, values, slopes, found = (c_int * count)(*[1] * count), *((c_double * count)() for _ in range(3))
        steps = np.broadcast_to(step, len(motion) - 1)
        rates = np.diff(motion, axis=0) / steps[:, None]
        made.fmi2GetReal(made.component, outputs, count, found)
        forces = [list(found)]
        for at, rate, own in zip(motion, rates, steps, strict=False):
            values[:], slopes[:] = at, rate
            made.fmi2SetReal(made.component, inputs, count, values)
            made.fmi2SetRealInputDerivatives(made.component, inputs, count, first, slopes)
            made.fmi2DoStep(made.component, 0.0, own, 1)
            made.fmi2GetReal(made.component, outputs, count, found)
            forces.append(list(found))
        return np.array(forces)

    def run(self, motion: Array, step: float | Array, values: Mapping[str, float] | None = None) -> Array:
        """The same of a fresh instance, which is freed."""
        made = self.begun(self.instance(values), motion[0].tolist())
        forces = self.follow(made, motion, step)
        made.terminate()
        made.freeInstance()
        return forces


def wandering(count: int, step: float, seed: int, highest: float = 60.0) -> Array:
    """A random displacement of size 1 with many turning points, from 0, (count,)."""
    rng = np.random.default_rng(seed)
    frequency, phase = rng.uniform(1.0, highest, (40, 1)), rng.uniform(0.0, 2.0 * np.pi, (40, 1))
    time = np.arange(count) * step
    motion = np.sum(np.sin(2.0 * np.pi * frequency * time + phase) - np.sin(phase), axis=0)
    return motion / np.abs(motion).max()


def off(found: Array, expected: Array) -> float:
    """Root mean square of the difference over that of what is expected."""
    return float(np.sqrt(np.mean(np.square(found - expected)) / np.mean(np.square(expected))))
