"""What is known before tests are planned: from a campaign and its diagnosis, or from a model."""

from collections import defaultdict
from collections.abc import Container, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from bushfit.campaign.schema import RigSettings, SimulatedLoop, SimulatedSweep
from bushfit.diagnosis.evidence import Evidence, fit, result_of
from bushfit.diagnosis.propose import proposals
from bushfit.diagnosis.record import Diagnosis
from bushfit.diagnosis.refit import refitted
from bushfit.diagnosis.workflow import diagnose
from bushfit.effects import LIBRARY, twins_of
from bushfit.errors import ModelError, did_you_mean
from bushfit.fitting.coordinates import Bounds, Coordinates
from bushfit.fitting.data import Data
from bushfit.fitting.data_sets import DataSet, parted
from bushfit.fitting.information import relative_sizes
from bushfit.fitting.rig_class import of_class
from bushfit.model.result import Result
from bushfit.planning.contract import Knowledge, Noise, Test
from bushfit.planning.sensitivity import ROWS_PER_CYCLE, relative_slopes


def of_result(result: Result, noise: Noise | None = None, source: str = "") -> Knowledge:
    """What a fitted model tells; of one that was not fitted, the values within a factor of 2.7."""
    model, fitted = result.model, result.covariance
    names = tuple(name for name in fitted.names if fitted.stderr(name)) or tuple(model.parameters)
    covariance, words = np.eye(len(names)) / 4.0, "values given by hand, taken as right within a factor of 2.7"
    if fitted.names:
        size = Coordinates.of(model, names).slopes(model.values) * relative_sizes(model, names)
        covariance, words = fitted.restricted(names).matrix / np.outer(size, size), "a fitted model"
    strain = result.measured.strain[1] if result.measured else None
    return Knowledge(
        model,
        names,
        covariance,
        source or words,
        noise or Noise(),
        strain=strain,
        specimens=result.specimens,
        warnings=tuple(result.warnings),
        result=result,
    )


def of_campaign(data: Data, rivals: Sequence[str] | None = None) -> Knowledge:
    """What the tests of a campaign tell, fitted together; and of each rival effect, added to the model in turn.

    The class of the rig counts as noise, stated or not, as it does in what is planned. Beside rivals the model has
    what a diagnosis is sure of, and the leaders of its other sets of look-alikes.

    Args:
        rivals: names of effects, of twins any; none for those that a diagnosis of these tests cannot tell apart, None
            for no rivals.

    Raises:
        FitError: data that cannot support the fit.
        ModelError: effects that these tests could not show, or a diagnosis without rivals.
    """
    _check_rivals(rivals or (), LIBRARY)
    found = None if rivals is None else diagnose(data)
    noise = noise_of(data)
    data = Data.of(replace(data.campaign, rig=rig_of(data.campaign.rig, noise)))
    data_sets = data.data_sets
    model = data.started(data.effects, data_sets, {})
    held = [name for name in model.parameters if name not in data.free(tuple(model.parameters))]
    source = f"the tests of {data.campaign.name}"

    def known(evidence: Evidence) -> Knowledge:
        result = replace(result_of(evidence, data.bounds, ()), specimens=data.campaign.specimens)
        strain = max(float(np.max(each.amplitude)) * model.unit_strain(each.direction) for each in data_sets)
        plain = replace(of_result(result, noise, source), strain=strain, tests=tuple(_tests(data)))
        bounded = tuple(evidence.solution.at_bound)
        return _with_bounded(plain, bounded, data_sets) if bounded else plain

    if found is None or rivals is None:
        return known(fit(model, data_sets, held, data.bounds))
    sets = look_alikes(found)
    names = list(dict.fromkeys(twins_of(name)[0] for name in rivals or next(iter(sets), ())))
    if not names:
        raise ModelError(
            "there are no rivals to be told apart",
            file=data.campaign.path,
            found=f"the diagnosis of these tests is {found.verdict}",
            expected="ambiguous",
            hint="name effects with --rivals, or plan for parameters or predictions",
        )
    sure = [name for name in found.result.model.effects if name not in model.effects]
    leaders = [others[0] for others in sets if not {*names} & {*others}]
    plain = fit(model, data_sets, held, data.bounds)
    for name in (*sure, *leaders):
        if name not in names:
            plain = _each_added(plain, [name], held, data.bounds).get(name, plain)
    rivalling = _each_added(plain, names, held, data.bounds)
    _check_rivals(names, rivalling)
    told = zip(found.odds.labels, found.odds.told, strict=True)
    odds = defaultdict[str, float](float)
    for label, (_, share) in told:
        for name in label.split(" + "):
            odds[name] += share
    least = min(odds.values(), default=1.0)
    every = [replace(known(rivalling[name]), probability=odds[name] or least) for name in names]
    return replace(every[0], rivals=tuple(every))


def _check_rivals(names: Iterable[str], possible: Container[str]) -> None:
    """Refuse effects that are none, which costs no diagnosis, or that these tests could not show."""
    if unknown := [name for name in names if name not in possible]:
        raise ModelError(
            "this is no rival in these tests",
            place="--rivals",
            found=", ".join(unknown),
            expected="effects of the library that the model lacks, and the tests could show",
            hint=None if unknown[0] in LIBRARY else did_you_mean(unknown[0], LIBRARY),
        )


def _with_bounded(known: Knowledge, bounded: tuple[str, ...], data_sets: Sequence[DataSet]) -> Knowledge:
    """What the tests tell where parameters at rest on a bound count as free, but those of which they tell nothing; what
    noise is more than was counted is told by the errors of the others, with those held."""
    k = len(known.names)
    slopes = relative_slopes(replace(known, bounded=bounded), data_sets)
    own, others = slopes[:k], slopes[k:]
    answer = -np.linalg.lstsq(own.T, others.T)[0]
    beside = others + answer.T @ own
    seen = np.linalg.norm(beside, axis=1) > 1e-6 * np.linalg.norm(others, axis=1)  # of rounding
    if not seen.any():
        return known
    information = own @ own.T
    live = np.diag(information) > 0.0
    excess = float(np.mean(np.diag(known.covariance @ information)[live])) if live.any() else 1.0
    answer, beside = answer[:, seen], beside[seen]
    alone = excess * np.linalg.inv(beside @ beside.T)
    shared = answer @ alone
    covariance = np.block([[known.covariance + shared @ answer.T, shared], [shared.T, alone]])
    return replace(known, bounded=tuple(np.array(bounded)[seen].tolist()), covariance=covariance)


def _each_added(plain: Evidence, names: Sequence[str], held: Sequence[str], bounds: Bounds) -> dict[str, Evidence]:
    """The fit with each of these effects added in turn, by name; without those that the tests could not show."""
    proposed = [proposal for proposal in proposals(plain, (), held) if proposal.name in names]
    return refitted(plain, proposed, {}, held, bounds)


def look_alikes(found: Diagnosis) -> list[tuple[str, ...]]:
    """The sets of effects that a diagnosis cannot tell apart; without mistakes and faults, which no plan tells, and of
    effects that make one explanation together without those that every explanation has."""
    sets, every = [], [each.name for each in found.effects]
    for named in found.effects:
        if named.alternatives and not named.test and not named.alternatives[0].startswith("fault:"):
            others = [label.split(" + ") for label in named.alternatives]
            own = every if max(map(len, others)) > 1 else [named.name]
            names = [name for name in dict.fromkeys(chain(own, *others)) if name in LIBRARY]
            sets.append(tuple(name for name in names if not all(name in each for each in (own, *others))))
    return [names for names in sets if len(names) > 1]


def noise_of(data: Data) -> Noise:
    """How well the rig of a campaign measures, as its tests show; what they do not show is assumed."""
    loops, sweeps = parted(data.data_sets)
    found = replace(Noise(), level=of_class(data.campaign.rig))
    if sweeps:
        noise = sweeps[0].noise
        gain, phase = np.sqrt(np.mean(np.square(list(noise.random.values())), axis=0)).tolist()
        found = replace(found, scatter=(gain, phase), shared=noise.shared)
    if loops:
        rows = [loop.test.time.size / loop.drive.cycles for loop in loops]
        each = [loop.relative_noise * np.sqrt(ROWS_PER_CYCLE / count) for loop, count in zip(loops, rows, strict=True)]
        as_one = float(np.mean([loop.drive.row_noise.rows_as_one for loop in loops]))
        found = replace(found, force=float(np.sqrt(np.mean(np.square(each)))), rows_as_one=as_one)
    return found


def rig_of(rig: RigSettings, noise: Noise) -> RigSettings:
    """The rig with its class stated as a plan counts it."""
    return replace(rig, gain_error=noise.level[0], phase_error=noise.level[1], displacement_error=None)


def _tests(data: Data) -> Iterator[Test]:
    """The runs of a campaign, as a plan has them; what swings free is none."""
    for loop in data.loops:
        yield SimulatedLoop(
            loop.direction, loop.drive.amplitude, loop.drive.frequency, max(round(loop.drive.cycles), 1)
        )
    for sweep in data.sweeps:
        stepped = sweep.sweep.stepped
        for block in np.split(np.arange(sweep.frequency.size), sweep.block_starts[1:]) if stepped else ():
            steps = tuple(sweep.step[block].tolist())
            held = (float(sweep.held[block[0]]),)
            amplitudes, frequencies = (held, steps) if stepped == "frequency" else (steps, held)
            yield SimulatedSweep(sweep.direction, amplitudes, frequencies, stepped or "frequency")
