"""Knowledge before the tests of a plan (model, covariance, noise): from a campaign, or from a model."""

from collections import defaultdict
from collections.abc import Container, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from bushfit.campaign.schema import RigSettings
from bushfit.campaign.simulated import SimulatedLoop, SimulatedSweep
from bushfit.caveat import join_names
from bushfit.diagnosis.fits import fit_model, fit_rivals, result_of, start_rivals
from bushfit.diagnosis.propose import proposals
from bushfit.diagnosis.record import Diagnosis
from bushfit.diagnosis.workflow import diagnose
from bushfit.effects import LIBRARY, get_effect, place_suffix, twins_of
from bushfit.effects.unnamed import effect_label
from bushfit.errors import ModelError, did_you_mean
from bushfit.fitting.coordinates import Bounds, Coordinates, coordinate_per_relative_change
from bushfit.fitting.preparation import MeasuredTest, split_by_kind
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.problem import FitResult
from bushfit.fitting.rig_class import class_errors
from bushfit.model.result import Result
from bushfit.planning.contract import Knowledge, Noise, Test
from bushfit.planning.information import ROWS_PER_CYCLE, relative_slopes


def from_result(result: Result, noise: Noise | None = None, source: str = "") -> Knowledge:
    """Convert a model with its covariance to the starting point of a plan.

    Values of a model that was not fitted are assumed to be known within a factor of 2.7.

    Args:
        result: model and covariance of its parameters.
        noise: measurement errors of the rig; None for a typical rig.
        source: origin of the knowledge, as a phrase; empty for a standard phrase.

    Returns:
        Knowledge on the parameters that have a standard error, or on all parameters if the model was not fitted.
    """
    model, fitted = result.model, result.covariance
    names = tuple(name for name in fitted.names if fitted.stderr(name)) or tuple(model.parameters)
    covariance, origin = np.eye(len(names)) / 4.0, "given values, assumed to be known within a factor of 2.7"
    if fitted.names:
        size = Coordinates.of_parameters(model, names).slopes(model.values) * coordinate_per_relative_change(
            model, names
        )
        covariance, origin = fitted.select(names).matrix / np.outer(size, size), "a fitted model"
    return Knowledge(result, names, covariance, source or origin, noise or Noise())


def from_campaign(data: PreparedCampaign, rivals: Sequence[str] | None = None) -> Knowledge:
    """Fit the tests of a campaign as the starting point of a plan; with rivals, one fit for each rival effect.

    The fits treat gain and phase errors of the rig, as [rig] states them or as assumed, as noise, as in the planned
    tests. With rivals, the model also has the effects that a diagnosis names, and the first effect of each other set
    that the diagnosis cannot separate.

    Args:
        data: tests of the campaign.
        rivals: names of the rival effects; empty for the effects that a diagnosis of these tests cannot separate, None
            for no rivals.

    Returns:
        Knowledge of the likeliest model, with its rivals: the fitted model, or if it misses the tests the model of a
        diagnosis.

    Raises:
        FitError: the data cannot support the fit.
        ModelError: these tests could not show a given effect, or the diagnosis finds no rivals.
    """
    _check_rivals([name for name in rivals or () if not place_suffix(name)], LIBRARY)
    diagnosis = None if rivals is None else diagnose(data)
    noise, unchanged = estimate_noise(data), data
    data = PreparedCampaign.from_campaign(replace(data.campaign, rig=with_rig_class(data.campaign.rig, noise)))
    data_sets = data.require_tests(data.data_sets, "there is nothing to fit", "add measured tests to the campaign")
    model = data.starting_model(data.effects, data_sets)
    fixed = [name for name in model.parameters if name not in data.free_names(tuple(model.parameters))]
    source = f"the tests of {data.campaign.name}"

    def knowledge(fit: FitResult) -> Knowledge:
        """Knowledge from one fit of the campaign."""
        result = replace(result_of(fit, data.bounds, ()), specimens=data.campaign.specimens)
        plain = replace(from_result(result, noise, source), tests=tuple(_campaign_runs(data)))
        bounded = tuple(name for name in fit.at_bound if name not in plain.names)
        return _with_bounded_parameters(plain, bounded, data_sets) if bounded else plain

    if diagnosis is None or rivals is None:
        fitted = knowledge(fit_model(model, data_sets, fixed, data.bounds))
        if fitted.result.model_error is None:
            return fitted
        found = diagnose(unchanged)
        added = [name for name in found.result.model.effects if name not in model.effects]
        source += f", with {join_names(map(effect_label, added))} as bushfit diagnose adds to the model"
        return replace(from_result(found.result, noise, source), tests=fitted.tests) if added else fitted
    sets = undecided_effects(diagnosis)
    names = list(dict.fromkeys(twins_of(name)[0] for name in rivals or next(iter(sets), ())))
    if not names:
        raise ModelError(
            "there are no rivals that a loop or sweep distinguishes",
            file=data.campaign.path,
            found=f"verdict {diagnosis.verdict}; next test: {diagnosis.next_test or 'none'}",
            expected="several possible effects that a further loop or sweep of the bushing distinguishes",
            hint="make the next test, name effects with --rivals, or plan for parameters or predictions",
        )
    certain = [name for name in diagnosis.result.model.effects if name not in model.effects]
    leaders = [effects[0] for effects in sets if not {*names} & {*effects}]
    plain = fit_model(model, data_sets, fixed, data.bounds)
    for name in (*certain, *leaders):
        if name not in names:
            plain = _add_effects(plain, [name], fixed, data.bounds).get(name, plain)
    fits = _add_effects(plain, names, fixed, data.bounds)
    _check_rivals(names, fits)
    probabilities = defaultdict[str, float](float)
    for labels, (_, share) in zip(diagnosis.odds.labels, diagnosis.odds.explanations, strict=True):
        for name in labels:
            probabilities[name] += share
    smallest = min(probabilities.values(), default=1.0)
    models = [replace(knowledge(fits[name]), probability=probabilities[name] or smallest) for name in names]
    return replace(models[0], rivals=tuple(models))


def _check_rivals(names: Iterable[str], possible: Container[str]) -> None:
    """Raise a ModelError if one of the effects in `names` is not among the `possible` effects."""
    if unknown := [name for name in names if name not in possible]:
        raise ModelError(
            "this is not a rival in these tests",
            place="--rivals",
            found=", ".join(unknown),
            expected="effects of the library that the model lacks, and the tests could show",
            hint=None if unknown[0] in LIBRARY else did_you_mean(unknown[0], LIBRARY),
        )


def _with_bounded_parameters(
    knowledge: Knowledge, bounded: tuple[str, ...], data_sets: Sequence[MeasuredTest]
) -> Knowledge:
    """Add the parameters at a bound to the knowledge before a plan, with the covariance they would have if free.

    Parameters without effect on these tests are omitted. If the residuals of the fit exceed the assumed noise, the
    covariance is larger by the same ratio as that of the other parameters.

    Args:
        knowledge: knowledge of the parameters that are not at a bound.
        bounded: names of the parameters at a bound.
        data_sets: tests of the campaign.
    """
    k = len(knowledge.names)
    slopes = relative_slopes(replace(knowledge, bounded=bounded), data_sets)
    free, at_bound = slopes[:k], slopes[k:]
    response = -np.linalg.lstsq(free.T, at_bound.T)[0]
    remainder = at_bound + response.T @ free
    is_visible = np.linalg.norm(remainder, axis=1) > 1e-6 * np.linalg.norm(at_bound, axis=1)  # of rounding
    if not is_visible.any():
        return knowledge
    information = free @ free.T
    live = np.diag(information) > 0.0
    excess = float(np.mean(np.diag(knowledge.covariance @ information)[live])) if live.any() else 1.0
    response, remainder = response[:, is_visible], remainder[is_visible]
    alone = excess * np.linalg.inv(remainder @ remainder.T)
    shared = response @ alone
    covariance = np.block([[knowledge.covariance + shared @ response.T, shared], [shared.T, alone]])
    return replace(knowledge, bounded=tuple(np.array(bounded)[is_visible].tolist()), covariance=covariance)


def _add_effects(plain: FitResult, names: Sequence[str], fixed: Sequence[str], bounds: Bounds) -> dict[str, FitResult]:
    """Fit the model with each effect added in turn.

    Args:
        plain: fit without the effects.
        names: names of the effects.
        fixed: names of parameters that are not fitted.
        bounds: limits of parameters [SI], inside their default limits.

    Returns:
        Fit with each effect, by its name, and with any effect that it requires (second_maxwell requires maxwell).
        Effects without influence on these tests are omitted.
    """
    models = {proposal.name: proposal.model for proposal in proposals(plain, (), fixed) if proposal.name in names}
    fits = fit_rivals(start_rivals(models, plain.data_sets, {}, fixed, bounds))
    for name in names:
        needed = get_effect(name).after
        if name not in fits and needed and needed not in plain.model.effects:
            for beside in _add_effects(plain, [needed], fixed, bounds).values():
                fits |= _add_effects(beside, [name], fixed, bounds)
    return fits


def undecided_effects(diagnosis: Diagnosis) -> list[tuple[str, ...]]:
    """List sets of effects that explain the tests equally well, between which a further test may decide.

    Mistakes in the campaign and faults of the rig are excluded, because no planned test separates them.

    Args:
        diagnosis: diagnosis of a campaign.

    Returns:
        Names of the effects of each set, without the effects that all explanations of the set have.
    """
    sets, all_named = [], [effect.name for effect in diagnosis.effects]
    for effect in diagnosis.effects:
        first, *_ = effect.alternatives or [None]
        if first and not effect.test and (first.causes or not first.faulty_parts):
            labels = [composition.labels for composition in effect.alternatives]
            explanations = [all_named if max(map(len, labels)) > 1 else [effect.name], *labels]
            names = [name for name in dict.fromkeys(chain(*explanations)) if name.partition(".")[0] in LIBRARY]
            sets.append(tuple(name for name in names if not all(name in effects for effects in explanations)))
    return [names for names in sets if len(names) > 1]


def estimate_noise(data: PreparedCampaign) -> Noise:
    """Estimate the measurement errors of the rig from the tests of a campaign.

    Returns:
        Standard deviations; typical values for errors that the tests do not determine.
    """
    loops, sweeps = split_by_kind(data.data_sets)
    estimate = replace(Noise(), level=class_errors(data.campaign.rig))
    if sweeps:
        noise = sweeps[0].noise
        gain, phase = np.sqrt(np.mean(np.square(list(noise.random.values())), axis=0)).tolist()
        estimate = replace(estimate, random=(gain, phase), shared=noise.shared)
    if loops:
        squares = [loop.relative_noise**2 * ROWS_PER_CYCLE * loop.cycles / loop.test.time.size for loop in loops]
        as_one = float(np.mean([loop.row_noise.rows_as_one for loop in loops]))
        estimate = replace(estimate, force=float(np.sqrt(np.mean(squares))), rows_as_one=as_one)
    return estimate


def with_rig_class(rig: RigSettings, noise: Noise) -> RigSettings:
    """Copy of the settings [rig] with the accuracy class (gain and phase errors) that a plan assumes."""
    return replace(rig, gain_error=noise.level[0], phase_error=noise.level[1], displacement_error=None)


def _campaign_runs(data: PreparedCampaign) -> Iterator[Test]:
    """Generate the runs of a campaign's loops and sweeps as tests of a plan; free oscillations are omitted."""
    for loop in data.loops:
        amplitude, frequency = float(loop.amplitude[0]), float(loop.frequency[0])
        yield SimulatedLoop(loop.direction, amplitude, frequency, max(round(loop.cycles), 1))
    for sweep in data.sweeps:
        stepped = sweep.test.stepped
        for block in np.split(np.arange(sweep.frequency.size), sweep.block_starts[1:]) if stepped else ():
            steps = tuple(sweep.step[block].tolist())
            level = (float(sweep.run_level[block[0]]),)
            amplitudes, frequencies = (level, steps) if stepped == "frequency" else (steps, level)
            yield SimulatedSweep(sweep.direction, amplitudes, frequencies, stepped or "frequency")
