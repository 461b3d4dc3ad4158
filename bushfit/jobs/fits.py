"""fit-static, fit-dynamic and fit: one frame, three procedures; and what every result says of its campaign."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from bushfit.campaign.campaign import Campaign
from bushfit.effects import with_base
from bushfit.errors import FitError, quote_path
from bushfit.fitting.data import Data
from bushfit.fitting.data_sets import DataSet, SweepData
from bushfit.fitting.master_curve import can_shift
from bushfit.fitting.procedures import fit_dynamic, fit_joint, fit_static, given_static
from bushfit.jobs.grid import measured_levels
from bushfit.model.file import to_document
from bushfit.model.result import Result
from bushfit.prediction.caveats import warnings_of
from bushfit.report.artifacts import fit_contents, temperature_contents
from bushfit.report.contents import Contents, Kinds

#: Tables and pictures of sweeps whose temperatures are known, beside a model with an effect of temperature.
_AT_TEMPERATURES = ("master_curve", "shift_factors")


def document_of(result: Result, campaign: Mapping[str, Any]) -> dict[str, Any]:
    """The JSON document of a result, with all its warnings, and the campaign that it comes from."""
    return {**to_document(result), "warnings": warnings_of(result), "campaign": campaign}


def campaign_document(data: Data, command: str, options: Iterable[str] = ()) -> dict[str, Any]:
    """The campaign as JSON-ready data: its name, file and tests, and the command with all that settles its numbers."""
    campaign = data.campaign
    loss = () if campaign.fit.loss == "linear" else ("--loss", campaign.fit.loss)
    return {
        "name": campaign.name,
        "file": campaign.path.name,
        "sha256": campaign.sha256,
        "command": command_line(command, campaign.path.name, *options, *loss),
        "tests": [_test(data_set) for data_set in data.data_sets],
        "report": campaign.report.lines,
        "logo": campaign.logo,
    }


def command_line(command: str, *words: str) -> str:
    """A command of bushfit as it is typed into a terminal."""
    return " ".join(["bushfit", command, *(quote_path(Path(word)) for word in words)])


def options_typed(**options: str | bool | Iterable[str] | None) -> tuple[str, ...]:
    """The words of options by their keys: a value, each of several, or a flag that is set; none of None."""
    words = list[str]()
    for key, value in options.items():
        name = "--" + key.replace("_", "-")
        if isinstance(value, bool | None):
            words += [name] if value else []
        else:
            words += [word for each in ([value] if isinstance(value, str) else value) for word in (name, each)]
    return tuple(words)


def _test(data_set: DataSet) -> dict[str, Any]:
    """A test: what it was made on, its range [SI], and its file with the conditions that the campaign states."""
    source, sweep = data_set.test.source, data_set.sweep if isinstance(data_set, SweepData) else None
    return {
        "test": data_set.name,
        "kind": data_set.kind,
        "place": str(data_set.direction),
        "stepped": sweep and sweep.stepped,
        "frequency_Hz": _ends(data_set.frequency),
        "amplitude": _ends(data_set.amplitude),
        "frequencies_Hz": measured_levels([sweep], "frequency").tolist() if sweep else [],
        "amplitudes": measured_levels([sweep], "amplitude").tolist() if sweep else [],
        "unit": data_set.direction.motion.displacement_unit,
        "repeats": int(sweep.repeat.max()) if sweep else 1,
        "rows": data_set.size // data_set.parts,
        "file": source and str(source.file),
        "sha256": source and source.sha256,
        "conditions": dict(source.conditions) if source else {},
    }


def _ends(values: Any) -> list[float]:
    return [float(values.min()), float(values.max())]


@dataclass(frozen=True, eq=False, repr=False)
class Fitted:
    """The outcome of a fit: `<stem>.json`, tables and plots of some kinds of test, a result a step, the last final.

    `campaign` is what its document says of the campaign.
    """

    stem: str
    kinds: tuple[str, ...]
    data: Data
    reports: tuple[tuple[str, Result], ...]
    campaign: Mapping[str, Any]

    def __repr__(self) -> str:
        return repr(self.result)

    @property
    def result(self) -> Result:
        return self.reports[-1][1]

    @cached_property
    def document(self) -> Mapping[str, Any]:
        return document_of(self.result, self.campaign)

    @property
    def contents(self) -> Contents:
        return Contents({self.stem: self.document}) | contents_of_tests(self.data, self.result, self.kinds)


@dataclass(frozen=True)
class FitStatic:
    """mu, sigma_fmax and eps_half from the loops, the springpot held at a result where one is given."""

    dynamic: Result | None = None

    def kinds(self, campaign: Campaign) -> Kinds:
        return Kinds(("static",)) + Kinds.shown(["loops"])

    def run(self, data: Data) -> Fitted:
        result = fit_static(data, self.dynamic)
        campaign = campaign_document(data, "fit-static", ("--dynamic", "DYNAMIC.json") if self.dynamic else ())
        return Fitted("static", ("loops",), data, (("static fit of the loops", result),), campaign)


@dataclass(frozen=True)
class FitDynamic:
    """m and alpha from the smallest sweep, the rest held at a result, the campaign's values, or a fit of its loops."""

    static: Result | None = None

    def kinds(self, campaign: Campaign) -> Kinds:
        return Kinds(("dynamic",)) + Kinds.shown(["sweeps"])

    def run(self, data: Data) -> Fitted:
        static, reports = self.static or given_static(data), []
        if static is None:
            if not data.loops:
                raise FitError(
                    "nothing says at which mu, sigma_fmax and eps_half to hold the fit",
                    file=data.campaign.path,
                    found="no --static, no [[loops]], and no values of all three in [fit]",
                    hint="give --static static.json, add a loop, or run bushfit fit for all five parameters together",
                )
            static = fit_static(data)
            reports.append(("static fit of the loops, because no --static was given", static))
        reports.append(("dynamic fit of the smallest sweep", fit_dynamic(data, static)))
        campaign = campaign_document(data, "fit-dynamic", ("--static", "STATIC.json") if self.static else ())
        return Fitted("dynamic", ("sweeps",), data, tuple(reports), campaign)


@dataclass(frozen=True)
class Fit:
    """All parameters together: of the paper's branches and further effects, from the tests of some directions.

    `profile` asks for profile likelihoods.
    """

    directions: tuple[str, ...] = ()
    effects: tuple[str, ...] = ()
    profile: bool = False

    def kinds(self, campaign: Campaign) -> Kinds:
        return Kinds(("model",)) + Kinds.shown(kinds_of_test(campaign, self._added(campaign)))

    def _added(self, campaign: Campaign) -> tuple[str, ...]:
        """The effects that [fit] of the campaign adds to the paper's, and those asked for."""
        return tuple(dict.fromkeys((*campaign.fit.effects, *self.effects)))

    def run(self, data: Data) -> Fitted:
        added = self._added(data.campaign)
        result = fit_joint(data, effects=with_base(added), directions=self.directions or None, profile=self.profile)
        options = options_typed(direction=self.directions, effect=self.effects, profile=self.profile)
        kinds = kinds_of_test(data.campaign, added)
        return Fitted("model", kinds, data, (("joint fit", result),), campaign_document(data, "fit", options))


def kinds_of_test(campaign: Campaign, effects: Collection[str]) -> tuple[str, ...]:
    """The kinds of test that a campaign has: loops, sweeps; and what a model of effects makes of their temperatures."""
    warm = "temperature" in effects and any(map(can_shift, campaign.sweeps))
    return (*(kind for kind in ("loops", "sweeps") if getattr(campaign, kind)), *(_AT_TEMPERATURES if warm else ()))


def contents_of_tests(data: Data, result: Result, kinds: Collection[str]) -> Contents:
    """Tables and pictures of tests of some kinds beside a model, with the outliers that its fit left out marked."""
    marked, title = data.without(result.outliers), result.model.name if result.model.bushing else data.campaign.name
    loops, sweeps = (getattr(marked, kind) if kind in kinds else () for kind in ("loops", "sweeps"))
    found = fit_contents(result, title, loops, sweeps)
    return found | temperature_contents(result, title, sweeps) if set(_AT_TEMPERATURES) <= set(kinds) else found
