"""Data sets of a campaign: one per measured loop, one per sweep."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from bushfit.fitting.data_set import DataSet
from bushfit.fitting.drive import drive_of
from bushfit.fitting.loop_data import LoopData
from bushfit.fitting.noise import sweep_noise
from bushfit.fitting.sweep_data import Residuals, SweepData
from bushfit.reading.measurement import Loop, Sweep

__all__ = ["DataSet", "LoopData", "Residuals", "SweepData", "loop_data", "parted", "sweep_data"]


def loop_data(loops: Sequence[Loop], *, without_outliers: bool = False) -> list[LoopData]:
    """One data set per loop; rows that are outliers carry no weight where they are to be left out."""
    return [LoopData(drive_of(loop, without_outliers=without_outliers)) for loop in loops]


def sweep_data(sweeps: Sequence[Sweep], residuals: Residuals = "complex") -> list[SweepData]:
    """One data set per sweep; their noise is estimated together."""
    if not sweeps:
        return []
    noise = sweep_noise(sweeps)
    return [SweepData(sweep, noise, residuals) for sweep in sweeps]


def parted(data_sets: Iterable[DataSet]) -> tuple[list[LoopData], list[SweepData]]:
    """The loops and the sweeps among some data sets, for what is said of all of a kind together."""
    every = list(data_sets)
    loops = [data_set for data_set in every if isinstance(data_set, LoopData)]
    return loops, [data_set for data_set in every if isinstance(data_set, SweepData)]
