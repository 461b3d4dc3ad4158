"""Data sets of a campaign: one per measured loop, one per sweep."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TypeVar

import numpy as np

from bushfit.campaign.schema import Residuals
from bushfit.fitting.data_set import DataSet
from bushfit.fitting.drive import drive_of
from bushfit.fitting.loop_data import LoopData
from bushfit.fitting.noise import sweep_noise
from bushfit.fitting.sweep_data import SweepData
from bushfit.geometry import Specimen
from bushfit.reading.measurement import Loop, Source, Sweep

Kind = TypeVar("Kind", LoopData, SweepData)

__all__ = ["DataSet", "LoopData", "SweepData", "loop_data", "parted", "sources", "sweep_data"]


def loop_data(loops: Sequence[Loop], *, without_outliers: bool = False) -> list[LoopData]:
    """One data set per loop; rows that are outliers carry no weight where they are to be left out."""
    return [_weighed(LoopData(drive_of(loop, without_outliers=without_outliers))) for loop in loops]


def _weighed(data_set: Kind) -> Kind:
    """A data set with the weight that the campaign gives its test."""
    return data_set if data_set.test.weight == 1.0 else data_set.weighted(np.array(data_set.test.weight))


def sweep_data(sweeps: Sequence[Sweep], residuals: Residuals = "complex") -> list[SweepData]:
    """One data set per sweep; the noise of those of one rig, the bushing's or a specimen's, is estimated together."""
    rigs = [sweep.direction if isinstance(sweep.direction, Specimen) else None for sweep in sweeps]
    noises = {rig: sweep_noise([sweep for sweep, own in zip(sweeps, rigs, strict=True) if own == rig]) for rig in rigs}
    data_sets = [SweepData(sweep, noises[rig], residuals) for sweep, rig in zip(sweeps, rigs, strict=True)]
    return [_weighed(data_set) for data_set in data_sets]


def parted(data_sets: Iterable[DataSet]) -> tuple[list[LoopData], list[SweepData]]:
    """The loops and the sweeps among some data sets, for what is said of all of a kind together."""
    every = list(data_sets)
    loops = [data_set for data_set in every if isinstance(data_set, LoopData)]
    return loops, [data_set for data_set in every if isinstance(data_set, SweepData)]


def sources(data_sets: Iterable[DataSet]) -> tuple[Source, ...]:
    """The files that data sets came from, each once: a record may hold several loops."""
    found = [data_set.source for data_set in data_sets if data_set.source is not None]
    return tuple(source for place, source in enumerate(found) if source not in found[:place])
