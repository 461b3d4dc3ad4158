"""Campaign prepared for fits: tests with their noise, and bounds, priors and ties of parameters."""

from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.constraints import constraints_of
from bushfit.campaign.session import measured_session
from bushfit.caveat import Caveat
from bushfit.effects import BASE, effect_name_of, get_effect, with_base
from bushfit.errors import FitError, ModelError, error_location
from bushfit.fitting.assess import check_strain, mixed_condition_warnings, reduced_chi_square
from bushfit.fitting.coordinates import Bounds
from bushfit.fitting.design import start_with_effects
from bushfit.fitting.preload import with_preload
from bushfit.fitting.preparation import (
    MeasuredLoop,
    MeasuredSweep,
    MeasuredTest,
    prepare_loops,
    prepare_sweeps,
    split_by_kind,
    with_level_errors,
)
from bushfit.fitting.problem import FitProblem
from bushfit.fitting.rig_class import describe_class
from bushfit.fitting.starts import start_values
from bushfit.geometry import Direction, get_places
from bushfit.model.constraints import UNCONSTRAINED, Constraints
from bushfit.model.model import Model
from bushfit.model.result import Outlier
from bushfit.reading.measurement import Sweep

#: Difference of two amplitudes relative to their size up to which they are the same level.
_SAME_LEVEL = 1e-3

_Kind = TypeVar("_Kind", MeasuredLoop, MeasuredSweep, MeasuredLoop | MeasuredSweep)


@dataclass(frozen=True, eq=False)
class PreparedCampaign:
    """Campaign prepared for fits: its tests with their noise, and bounds, priors and ties of its parameters.

    Args:
        campaign: campaign as read from its file.
        loops: measured loops with their noise.
        sweeps: measured sweeps with their noise.
        bounds: limits of parameters from [fit] [SI], by name.
        preload_notes: warnings that state whether the tests show an influence of the preload.
        constraints: priors and ties of parameters, for every model that is fitted.
    """

    campaign: Campaign
    loops: tuple[MeasuredLoop, ...]
    sweeps: tuple[MeasuredSweep, ...]
    bounds: Bounds = field(default_factory=dict)
    preload_notes: tuple[Caveat, ...] = ()
    constraints: Constraints = UNCONSTRAINED

    @classmethod
    def from_campaign(cls, campaign: Campaign) -> "PreparedCampaign":
        """Prepare the tests of a campaign with the residuals, loss, bounds and priors of its [fit].

        Returns:
            The campaign with its measured tests.

        Raises:
            FitError: a loop has no whole cycle, lacks rows or releases energy.
            ModelError: [fit] effects contains an unknown effect, or the same effect twice.
        """
        fit, rig = campaign.fit, campaign.rig
        with error_location(campaign.path, place="[fit] effects"):
            Model.with_defaults(None, with_base(fit.effects), {})
        loops = prepare_loops(campaign.loops, rig, without_outliers=fit.loss != "linear")
        sweeps = prepare_sweeps(campaign.sweeps, fit.residuals, rig)
        compliance = rig.compliance_error or 0.0
        loops = [replace(loop, compliance_error=compliance) for loop in loops]
        sweeps = [replace(sweep, compliance_error=compliance) for sweep in sweeps]
        bounds = {name: (setting.min, setting.max) for name, setting in fit.parameters.items()}
        data = cls(campaign, tuple(loops), tuple(sweeps), bounds, constraints=constraints_of(campaign))
        return with_preload(data.with_rubber_conditions())

    def with_rubber_conditions(self) -> "PreparedCampaign":
        """Return the campaign with temperature and strain history, from the stated order of tests, at every point."""
        conditions = iter(measured_session(self.campaign.bushing, [data_set.test for data_set in self.data_sets]))
        loops = tuple(replace(loop, test_conditions=next(conditions).select(0)) for loop in self.loops)
        sweeps = tuple(replace(sweep, test_conditions=next(conditions)) for sweep in self.sweeps)
        return replace(self, loops=loops, sweeps=sweeps)

    @property
    def data_sets(self) -> list[MeasuredTest]:
        """All measured tests of the campaign with their noise, loops first."""
        return [*self.loops, *self.sweeps]

    @property
    def notes(self) -> list[Caveat]:
        """Warnings about the recorded data of the tests, and about mixed specimens or preloads."""
        of_tests = [note.about(test.name) for test in self.data_sets for note in test.notes]
        return [*of_tests, *mixed_condition_warnings(self.data_sets)]

    @property
    def assumptions(self) -> list[Caveat]:
        """Warnings about assumptions: on the influence of preload, and on an accuracy class of the rig not stated."""
        is_assumed = any(sweep.noise.origin == "assumed" for sweep in self.sweeps)
        if not is_assumed or None not in self.campaign.rig.stiffness_errors:
            return [*self.preload_notes]
        sentence = (
            "no test was repeated at three points or more: errors shared by a run are taken from the class of the "
            f"rig, {describe_class(self.campaign.rig)}"
        )
        return [*self.preload_notes, Caveat("assumed_rig_class", sentence)]

    @property
    def robust(self) -> bool:
        """True if the fit is robust (loss soft_l1), which leaves outliers out."""
        return self.campaign.fit.loss != "linear"

    def require_tests(
        self, tests: Sequence[_Kind], message: str, hint: str, found: str = "no [[loops]] and no [[sweeps]]"
    ) -> Sequence[_Kind]:
        """Check that there are tests to fit and that none strains rubber beyond its limits, and return the tests.

        Args:
            tests: loops or sweeps.
            message: error message if there are no tests.
            hint: next step for the user.
            found: text on the tests that the campaign has instead.

        Raises:
            FitError: there are no tests, or one strains rubber beyond its limits.
        """
        if not tests:
            raise FitError(message, file=self.campaign.path, found=found, hint=hint)
        with error_location(self.campaign.path):
            check_strain(self.campaign.bushing, tests)
        return tests

    def without(self, outliers: Sequence[Outlier]) -> "PreparedCampaign":
        """Return the campaign with weight 0 on given outliers of sweeps; outliers of loops have weight 0 already."""
        sweeps = []
        for data_set in self.sweeps:
            rows = [outlier.row - 1 for outlier in outliers if outlier.test == data_set.name]
            sweeps.append(data_set.without(np.flatnonzero(np.isin(data_set.order, rows))))
        return replace(self, sweeps=tuple(sweeps))

    def with_sweeps(self, sweeps: Sequence[Sweep]) -> "PreparedCampaign":
        """Return the campaign with new, such as corrected, sweeps of the same rows, and their noise estimated."""
        fit, new = self.campaign.fit, list[MeasuredTest]()
        for old, data_set in zip(self.sweeps, prepare_sweeps(sweeps, fit.residuals, self.campaign.rig), strict=True):
            rows = old.order[old.weights == 0.0]
            new.append(data_set.without(np.flatnonzero(np.isin(data_set.order, rows))))
        noise = self.sweeps[0].noise
        return replace(self, sweeps=tuple(split_by_kind(with_level_errors(new, noise.level, noise.level_freedom))[1]))

    @property
    def given_values(self) -> dict[str, float]:
        """Start values and fixed values of parameters given in [fit] of the campaign [SI], by name."""
        settings = self.campaign.fit.parameters
        return {name: setting.value for name, setting in settings.items() if setting.value is not None}

    def start_values(self, data_sets: Sequence[MeasuredTest]) -> dict[str, float]:
        """Start values of mu, m, alpha, sigma_fmax and eps_half [SI] by name: given in [fit], or else estimated."""
        with error_location(self.campaign.path):
            return start_values(self.campaign.bushing, data_sets, self.given_values)

    def starting_model(
        self, effects: Sequence[str], data_sets: Sequence[MeasuredTest], stage_fixed: Mapping[str, float] | None = None
    ) -> Model:
        """Build the model that a fit starts from, with values given in [fit] or estimated from the tests.

        Of values given and estimated, those with the lower chi-square are used.

        Args:
            effects: names of the model's effects.
            data_sets: tests to fit.
            stage_fixed: values of parameters that this fit keeps fixed, by name [SI]; None without any.

        Returns:
            Model with start values.
        """
        bushing, given_values, stage_fixed = self.campaign.bushing, self.given_values, stage_fixed or {}
        fixed = {name: value for name, value in given_values.items() if not self.free_names((name,))}
        choices = [given_values] if fixed == given_values else [given_values, fixed]
        with error_location(self.campaign.path):
            starts = [start_values(bushing, data_sets, {**values, **stage_fixed}) for values in choices]
        models = [Model.with_defaults(bushing, effects, values, constraints=self.constraints) for values in starts]
        chi_squares = np.full(len(models), np.inf)
        for i, model in enumerate(models if len(models) > 1 else ()):
            with suppress(ModelError), np.errstate(all="ignore"):
                chi_squares[i] = np.nan_to_num(reduced_chi_square(model, data_sets, 0)[0], nan=np.inf)
        best = int(np.argmin(chi_squares))
        named = {effect_name_of(name) for name in given_values}
        added = [name for name in effects if name not in BASE and name not in named]
        added = [name for name in added if get_effect(name).replaces not in effects]
        if not added:
            return models[best]
        replaced = {get_effect(name).replaces for name in added}
        before = [name for name in (*BASE, *effects) if name in replaced or (name in effects and name not in added)]
        plain = Model.with_defaults(bushing, [*dict.fromkeys(before)], starts[best], constraints=self.constraints)
        names = [*models[best].parameters, *plain.parameters]
        still = [name for name in names if not self.free_names((name,))]
        return start_with_effects(models[best], plain, data_sets, still, self.bounds)

    def problem(self, model: Model, data_sets: Sequence[MeasuredTest], fixed: Collection[str] = ()) -> FitProblem:
        """Build the least-squares problem of a model's parameters, except tied ones and those that the campaign fixes.

        Args:
            model: model with the start values, as of `starting_model`.
            data_sets: tests to fit.
            fixed: names of further parameters that this fit keeps fixed.
        """
        names = [name for name in self.free_names(tuple(model.parameters)) if name not in (*fixed, *model.tied_names)]
        return FitProblem(model, data_sets, names, self.bounds)

    def free_names(self, names: Sequence[str]) -> tuple[str, ...]:
        """Names among `names` of the parameters that [fit] of the campaign does not fix."""
        settings = self.campaign.fit.parameters
        return tuple(name for name in names if name not in settings or settings[name].vary)

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects of the model in [fit]: elastic, springpot and friction, and the added effects."""
        return with_base(self.campaign.fit.effects)

    def select_tests(self, places: Sequence[str] | None) -> list[MeasuredTest]:
        """Select the tests of some directions and specimens.

        Args:
            places: names of directions, specimens or bushings. None: all specimens, and the axial tests; without
                axial loops, all loops, and without axial sweeps, all sweeps.

        Returns:
            Loops, then sweeps.

        Raises:
            FitError: no test is selected.
            ModelError: a name is neither a direction nor a specimen of the campaign.
        """
        hint = "add measured tests, or simulate some with bushfit simulate"
        data_sets = self.require_tests(self.data_sets, "there is nothing to fit", hint)
        if places is None:
            chosen = []
            for tests in (self.loops, self.sweeps):
                any_axial = any(test.direction.axis is Direction.AXIAL for test in tests)
                chosen += [test for test in tests if not any_axial or test.direction.axis in (None, Direction.AXIAL)]
            return chosen
        with error_location(self.campaign.path):
            wanted = [place for name in places for place in get_places(str(name), self.campaign.specimens)]
        chosen = [data_set for data_set in data_sets if data_set.direction in wanted]
        if not chosen:
            raise FitError(
                "no test in the requested directions",
                file=self.campaign.path,
                found=", ".join(sorted({str(data_set.direction) for data_set in data_sets})),
                expected=", ".join(places),
            )
        return chosen

    def static_loops(self) -> list[MeasuredLoop]:
        """Loops that `fit-static` uses: axial loops; without these, all loops of the bushing; else all loops."""
        hint = "add a quasi-static loop, or run bushfit fit for the sweeps alone"
        return _preferred_tests(self.require_tests(self.loops, "fit-static needs a loop", hint, "no [[loops]]"))

    @cached_property
    def smallest_sweep(self) -> MeasuredSweep:
        """Sweep that `fit-dynamic` uses, reduced to the amplitudes of the campaign, else to the smallest amplitude.

        Frequency sweeps are preferred to others, then axial sweeps, then sweeps of the bushing. An amplitude sweep is
        reduced to the smallest amplitude at each frequency. A sweep in which both vary keeps all points.

        Raises:
            FitError: the campaign has no sweep, or none at the amplitudes that it names.
        """
        hint = "add a stepped-sine file, or run bushfit fit-static for the loops alone"
        available = self.require_tests(self.sweeps, "fit-dynamic needs a sweep", hint, "no [[sweeps]]")
        sweeps = _preferred_tests([sweep for sweep in available if sweep.test.stepped == "frequency"] or available)
        wanted = self.campaign.fit.dynamic_amplitudes
        if not wanted:
            sweep = min(sweeps, key=lambda sweep: float(sweep.amplitude.min()))
            amplitudes = sweep.amplitude
            if sweep.test.stepped == "frequency":
                amplitudes = amplitudes.min(keepdims=True)
            elif sweep.test.stepped == "amplitude":
                amplitudes = np.array([amplitudes[sweep.frequency == f].min() for f in np.unique(sweep.frequency)])
            return sweep.select(np.isin(sweep.amplitude, amplitudes))
        for sweep in sweeps:
            selected = np.any(np.isclose(sweep.amplitude[:, None], wanted, rtol=_SAME_LEVEL), axis=1)
            if selected.any():
                return sweep.select(selected)
        levels = sorted({float(x) for sweep in sweeps for x in sweep.amplitude})
        unit, factor = sweeps[0].direction.display.displacement
        raise FitError(
            "no sweep at these amplitudes",
            file=self.campaign.path,
            place="[fit] dynamic_amplitudes",
            found=", ".join(f"{factor * x:.4g}" for x in wanted) + f" {unit}",
            expected="some of " + ", ".join(f"{factor * x:.4g}" for x in levels) + f" {unit}",
        )


def _preferred_tests(data_sets: Sequence[_Kind]) -> list[_Kind]:
    """Select the axial tests, else all tests of the bushing, else all tests; only those at the smallest preload."""
    axial = [test for test in data_sets if test.direction.axis is Direction.AXIAL]
    tests = axial or [test for test in data_sets if test.direction.axis] or list(data_sets)
    loads = [abs(test.test.preload.value) if test.test.preload else 0.0 for test in tests]
    return [test for test, load in zip(tests, loads, strict=True) if load == min(loads)]
