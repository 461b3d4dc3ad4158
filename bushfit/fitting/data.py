"""A campaign made ready to fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from bushfit.campaign.campaign import Campaign
from bushfit.errors import FitError
from bushfit.fitting.data_sets import DataSet, LoopData, SweepData, loop_data, sweep_data
from bushfit.fitting.solve import Bounds
from bushfit.geometry import Direction, Place
from bushfit.model.result import Outlier

#: Difference of two amplitudes relative to their size up to which they are the same level.
_SAME_LEVEL = 1e-3

_Kind = TypeVar("_Kind", LoopData, SweepData, DataSet)


@dataclass(frozen=True, eq=False)
class Data:
    """A campaign made ready to fit: one data set per loop and per sweep, and the user's settings.

    Args:
        campaign: as read.
        loops: a data set per loop, in the order of the campaign.
        sweeps: a data set per sweep, in the order of the campaign.
        bounds: least and largest value of each parameter that [fit] names; None for none.
    """

    campaign: Campaign
    loops: tuple[LoopData, ...]
    sweeps: tuple[SweepData, ...]
    bounds: Bounds = field(default_factory=dict)

    @classmethod
    def of(cls, campaign: Campaign) -> Data:
        """The data sets of a campaign as its [fit] asks for them.

        Raises:
            FitError: a loop is not one whole cycle or more, rows of it are missing, or it gives energy.
        """
        return cls(
            campaign,
            tuple(loop_data(campaign.loops, without_outliers=campaign.fit.loss != "linear")),
            tuple(sweep_data(campaign.sweeps, campaign.fit.residuals)),
            {name: (setting.min, setting.max) for name, setting in campaign.fit.parameters.items()},
        )

    @property
    def robust(self) -> bool:
        """Whether outliers are left out."""
        return self.campaign.fit.loss != "linear"

    def some(
        self, tests: Sequence[_Kind], message: str, hint: str, found: str = "no [[loops]] and no [[sweeps]]"
    ) -> Sequence[_Kind]:
        """Those tests.

        Raises:
            FitError: there is none.
        """
        if not tests:
            raise FitError(message, file=self.campaign.path, found=found, hint=hint)
        return tests

    def without(self, outliers: Sequence[Outlier]) -> Data:
        """The same data with no weight on these outliers of the sweeps.

        Those of loops have none from the start where `robust`.
        """
        sweeps = []
        for data_set in self.sweeps:
            rows = [outlier.row - 1 for outlier in outliers if outlier.test == data_set.name]
            sweeps.append(data_set.without(np.flatnonzero(np.isin(data_set.order, rows))))
        return replace(self, sweeps=tuple(sweeps))

    @property
    def given(self) -> dict[str, float]:
        """Values the campaign gives, to start from or to hold."""
        settings = self.campaign.fit.parameters
        return {name: setting.value for name, setting in settings.items() if setting.value is not None}

    def free(self, names: Sequence[str]) -> tuple[str, ...]:
        """Those names that the campaign does not hold."""
        settings = self.campaign.fit.parameters
        return tuple(name for name in names if name not in settings or settings[name].vary)

    def chosen(self, directions: Sequence[Place] | None) -> list[DataSet]:
        """Data sets of the given directions; by default the axial loops and sweeps, as in the paper.

        Where no loop is axial, all loops are taken by default, and so with sweeps.

        Raises:
            FitError: there is none.
        """
        hint = "add measured tests, or make some with bushfit simulate"
        data_sets = self.some([*self.loops, *self.sweeps], "there is nothing to fit", hint)
        if directions is None:
            return [*_axial(self.loops), *_axial(self.sweeps)]
        chosen = [data_set for data_set in data_sets if data_set.direction in directions]
        if not chosen:
            raise FitError(
                "no test in the directions asked for",
                file=self.campaign.path,
                found=", ".join(sorted({str(data_set.direction) for data_set in data_sets})) or "no tests",
                expected=", ".join(str(direction) for direction in directions),
            )
        return chosen

    def static_loops(self) -> list[DataSet]:
        """The loops `fit-static` uses: the axial ones, or all where none is axial.

        Raises:
            FitError: there is no loop.
        """
        hint = "add a quasi-static loop, or run bushfit fit for the sweeps alone"
        return [*_axial(self.some(self.loops, "fit-static needs a loop", hint, "no [[loops]]"))]

    @cached_property
    def smallest_sweep(self) -> SweepData:
        """The sweep levels `fit-dynamic` uses: those the campaign names, else the smallest axial one.

        Raises:
            FitError: no sweep, or none at the amplitudes named.
        """
        hint = "add a stepped-sine file, or run bushfit fit-static for the loops alone"
        sweeps = _axial(self.some(self.sweeps, "fit-dynamic needs a sweep", hint, "no [[sweeps]]"))
        wanted = self.campaign.fit.dynamic_amplitudes
        if not wanted:
            sweep = min(sweeps, key=lambda data_set: float(data_set.amplitude.min()))
            return sweep.at_amplitudes((float(sweep.amplitude.min()),))
        for sweep in sweeps:
            there = np.isclose(sweep.amplitude[:, None], wanted, rtol=_SAME_LEVEL).any(axis=1)
            if there.any():
                return sweep.at_amplitudes(sweep.amplitude[there])
        levels = sorted({float(x) for sweep in sweeps for x in sweep.amplitude})
        raise FitError(
            "no sweep at these amplitudes",
            file=self.campaign.path,
            place="[fit] dynamic_amplitudes",
            found=", ".join(f"{x:.4g}" for x in wanted),
            expected="some of " + ", ".join(f"{x:.4g}" for x in levels),
        )


def _axial(data_sets: Sequence[_Kind]) -> Sequence[_Kind]:
    """The axial ones, or all where none is."""
    return [data_set for data_set in data_sets if data_set.direction is Direction.AXIAL] or data_sets
