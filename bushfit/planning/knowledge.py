"""Knowledge before the tests of a plan: from a campaign and its diagnosis, a model, or hardness and filler."""

from collections import defaultdict
from collections.abc import Container, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from bushfit.campaign.quantities import Compound
from bushfit.campaign.schema import RigSettings, SimulatedLoop, SimulatedSweep
from bushfit.diagnosis.evidence import Evidence, fit, result_of
from bushfit.diagnosis.propose import proposals
from bushfit.diagnosis.record import Diagnosis
from bushfit.diagnosis.refit import refitted
from bushfit.diagnosis.workflow import diagnose
from bushfit.effects import BASE, LIBRARY, twins_of
from bushfit.errors import ModelError, did_you_mean
from bushfit.fitting.coordinates import Bounds, Coordinates
from bushfit.fitting.information import relative_sizes
from bushfit.fitting.preparation import MeasuredTest, split_by_kind
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.rig_class import of_class
from bushfit.geometry import Bushing
from bushfit.model.covariance import Z95
from bushfit.model.model import FIVE, Model
from bushfit.model.result import Result
from bushfit.planning.contract import Knowledge, Noise, Test
from bushfit.planning.sensitivity import ROWS_PER_CYCLE, relative_slopes
from bushfit.units import number

#: Density of carbon black [g/cm^3]; handbooks: 1.7 to 1.9.
_BLACK_DENSITY = 1.8
#: Density of polymers [g/cm^3]; handbooks.
_DENSITY = {"natural": 0.92, "SBR": 0.94, "EPDM": 0.86, "NBR": 1.0, "CR": 1.23, "IIR": 0.92}
#: Filler of the paper's compound [phr].
_PAPER_FILLER = 27.0
#: Angular frequency that a reading of a durometer after 3 s stands for [rad/s]: its inverse.
_READING = 1.0 / 3.0
#: Angular frequency at which springpot and spring are compared, 10 Hz [rad/s]: the middle of usual sweeps.
_MIDDLE = 2.0 * np.pi * 10.0
#: Springpot over spring at 10 Hz [1], from Table 1: 0.2/2 62.8^0.24/1.09.
_SPRINGPOT = 0.25
#: Order of the springpot, from Table 1.
_ORDER = 0.24
#: Friction at small strain over spring [1], from Table 1: 14.6/(2 0.013 1090).
_FRICTION = 0.515
#: Strain at half of the friction, from Table 1.
_HALF_STRAIN = 0.013
#: Power of the filler's volume share with which its network stiffens; Heinrich and Klueppel 2002: 3.5.
_NETWORK = 3.5
#: Volume share of filler at least: the little friction of rubber without filler.
_LEAST_SHARE = 0.02
#: Standard deviation of a stated hardness [Shore A]: compounds are sold within 5 degrees, which is taken for 95 %.
_HARDNESS_ERROR = 2.5
#: Of ln G where the hardness is known; chosen: relations between hardness and modulus differ by some 20 %, and rubber
#: in a mould is not rubber in a sheet.
_MODULUS_ERROR = 0.2
#: Of ln q, ln alpha, ln r and ln eps_half in natural rubber: factors of 2.4, 1.7, 2.7 and 2.2 hold 95 %.
_SHAPE_ERRORS = np.array([0.45, 0.27, 0.5, 0.4])
#: The same in other rubbers, none of which the numbers come from; an EPDM that was measured has alpha below 0.1.
_OTHER_ERRORS = np.array([0.7, 0.5, 0.7, 0.5])
#: Of the power of the network's stiffness: blacks differ in it.
_NETWORK_ERROR = 1.0


def from_result(result: Result, noise: Noise | None = None, source: str = "") -> Knowledge:
    """Make knowledge from a fitted model; values of a model that was not fitted are within a factor of 2.7.

    Args:
        result: model and covariance.
        noise: of the rig; None for an assumed rig.
        source: origin of the knowledge, as a phrase; empty for a standard one.

    Returns:
        Knowledge of the parameters that have a standard error, or of all if the model was not fitted.
    """
    model, fitted = result.model, result.covariance
    names = tuple(name for name in fitted.names if fitted.stderr(name)) or tuple(model.parameters)
    covariance, origin = np.eye(len(names)) / 4.0, "values given by hand, taken as right within a factor of 2.7"
    if fitted.names:
        size = Coordinates.of_parameters(model, names).slopes(model.values) * relative_sizes(model, names)
        covariance, origin = fitted.restricted(names).matrix / np.outer(size, size), "a fitted model"
    strain = result.measured.strain[1] if result.measured else None
    return Knowledge(
        model,
        names,
        covariance,
        source or origin,
        noise or Noise(),
        strain=strain,
        specimens=result.specimens,
        warnings=tuple(result.warnings),
        result=result,
    )


def from_campaign(data: PreparedCampaign, rivals: Sequence[str] | None = None) -> Knowledge:
    """Knowledge from the tests of a campaign, fitted together, and with each rival effect added in turn.

    The errors of the class of the rig are noise, whether [rig] states them or not, as in the planned tests. If there
    are rivals, the model also has the effects that a diagnosis named for certain, and the first effect of each other
    set that the diagnosis cannot separate.

    Args:
        data: tests of the campaign.
        rivals: names of effects; empty for those that a diagnosis of these tests cannot separate, None for no
            rivals.

    Returns:
        Knowledge of the likeliest model, with its rivals.

    Raises:
        FitError: data that cannot support the fit.
        ModelError: effects that these tests could not show, or a diagnosis without rivals.
    """
    _check_rivals(rivals or (), LIBRARY)
    diagnosis = None if rivals is None else diagnose(data)
    noise = noise_of(data)
    data = PreparedCampaign.from_campaign(replace(data.campaign, rig=rig_of(data.campaign.rig, noise)))
    data_sets = data.data_sets
    model = data.starting_model(data.effects, data_sets, {})
    fixed = [name for name in model.parameters if name not in data.free(tuple(model.parameters))]
    source = f"the tests of {data.campaign.name}"

    def knowledge(evidence: Evidence) -> Knowledge:
        result = replace(result_of(evidence, data.bounds, ()), specimens=data.campaign.specimens)
        strain = max(float(np.max(tests.amplitude)) * model.unit_strain(tests.direction) for tests in data_sets)
        plain = replace(from_result(result, noise, source), strain=strain, tests=tuple(_tests(data)))
        bounded = tuple(evidence.solution.at_bound)
        return _with_bounded(plain, bounded, data_sets) if bounded else plain

    if diagnosis is None or rivals is None:
        return knowledge(fit(model, data_sets, fixed, data.bounds))
    sets = look_alikes(diagnosis)
    names = list(dict.fromkeys(twins_of(name)[0] for name in rivals or next(iter(sets), ())))
    if not names:
        raise ModelError(
            "there are no rivals to be told apart",
            file=data.campaign.path,
            found=f"the diagnosis of these tests is {diagnosis.verdict}",
            expected="ambiguous",
            hint="name effects with --rivals, or plan for parameters or predictions",
        )
    certain = [name for name in diagnosis.result.model.effects if name not in model.effects]
    leaders = [effects[0] for effects in sets if not {*names} & {*effects}]
    plain = fit(model, data_sets, fixed, data.bounds)
    for name in (*certain, *leaders):
        if name not in names:
            plain = _add_effects(plain, [name], fixed, data.bounds).get(name, plain)
    fits = _add_effects(plain, names, fixed, data.bounds)
    _check_rivals(names, fits)
    probabilities = defaultdict[str, float](float)
    for label, (_, share) in zip(diagnosis.odds.labels, diagnosis.odds.told, strict=True):
        for name in label.split(" + "):
            probabilities[name] += share
    smallest = min(probabilities.values(), default=1.0)
    models = [replace(knowledge(fits[name]), probability=probabilities[name] or smallest) for name in names]
    return replace(models[0], rivals=tuple(models))


def _check_rivals(names: Iterable[str], possible: Container[str]) -> None:
    """Raise a ModelError for names that are no effect, or that these tests could not show."""
    if unknown := [name for name in names if name not in possible]:
        raise ModelError(
            "this is no rival in these tests",
            place="--rivals",
            found=", ".join(unknown),
            expected="effects of the library that the model lacks, and the tests could show",
            hint=None if unknown[0] in LIBRARY else did_you_mean(unknown[0], LIBRARY),
        )


def _with_bounded(knowledge: Knowledge, bounded: tuple[str, ...], data_sets: Sequence[MeasuredTest]) -> Knowledge:
    """Knowledge that treats parameters at a bound as free, except those that the tests do not show.

    The excess of noise over the assumed noise follows from the errors of the other parameters.
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


def _add_effects(plain: Evidence, names: Sequence[str], fixed: Sequence[str], bounds: Bounds) -> dict[str, Evidence]:
    """The fit with each of these effects added in turn, by name; without those that the tests could not show."""
    proposed = [proposal for proposal in proposals(plain, (), fixed) if proposal.name in names]
    return refitted(plain, proposed, {}, fixed, bounds)


def look_alikes(diagnosis: Diagnosis) -> list[tuple[str, ...]]:
    """Sets of effects that a diagnosis cannot separate, without mistakes and faults, which no test separates.

    Args:
        diagnosis: of a campaign.

    Returns:
        Names of the effects of each set, without those that all explanations of the set share.
    """
    sets, all_named = [], [effect.name for effect in diagnosis.effects]
    for effect in diagnosis.effects:
        if effect.alternatives and not effect.test and not effect.alternatives[0].startswith("fault:"):
            labels = [label.split(" + ") for label in effect.alternatives]
            explanations = [all_named if max(map(len, labels)) > 1 else [effect.name], *labels]
            names = [name for name in dict.fromkeys(chain(*explanations)) if name.partition(".")[0] in LIBRARY]
            sets.append(tuple(name for name in names if not all(name in effects for effects in explanations)))
    return [names for names in sets if len(names) > 1]


def noise_of(data: PreparedCampaign) -> Noise:
    """Estimate the noise of the rig of a campaign.

    Args:
        data: tests of the campaign.

    Returns:
        Noise as the tests show it; assumed where they do not.
    """
    loops, sweeps = split_by_kind(data.data_sets)
    estimate = replace(Noise(), level=of_class(data.campaign.rig))
    if sweeps:
        noise = sweeps[0].noise
        gain, phase = np.sqrt(np.mean(np.square(list(noise.random.values())), axis=0)).tolist()
        estimate = replace(estimate, scatter=(gain, phase), shared=noise.shared)
    if loops:
        rows = [loop.test.time.size / loop.drive.cycles for loop in loops]
        forces = [
            loop.relative_noise * np.sqrt(ROWS_PER_CYCLE / count) for loop, count in zip(loops, rows, strict=True)
        ]
        as_one = float(np.mean([loop.drive.row_noise.rows_as_one for loop in loops]))
        force = float(np.sqrt(np.mean(np.square(forces))))
        estimate = replace(estimate, force=force, rows_as_one=as_one)
    return estimate


def rig_of(rig: RigSettings, noise: Noise) -> RigSettings:
    """Settings of the rig with its class as a plan assumes it."""
    return replace(rig, gain_error=noise.level[0], phase_error=noise.level[1], displacement_error=None)


def _tests(data: PreparedCampaign) -> Iterator[Test]:
    """Runs of a campaign as a plan has them, without free oscillations."""
    for loop in data.loops:
        yield SimulatedLoop(
            loop.direction, loop.drive.amplitude, loop.drive.frequency, max(round(loop.drive.cycles), 1)
        )
    for sweep in data.sweeps:
        stepped = sweep.sweep.stepped
        for block in np.split(np.arange(sweep.frequency.size), sweep.block_starts[1:]) if stepped else ():
            steps = tuple(sweep.step[block].tolist())
            level = (float(sweep.held[block[0]]),)
            amplitudes, frequencies = (level, steps) if stepped == "frequency" else (steps, level)
            yield SimulatedSweep(sweep.direction, amplitudes, frequencies, stepped or "frequency")


def gent_modulus(shore: float) -> float:
    """Shear modulus [Pa] of a hardness in Shore A: a third of Young's modulus by Gent (1958)."""
    return 1e6 * 0.0981 * (56.0 + 7.66 * shore) / (0.137505 * (254.0 - 2.54 * shore)) / 3.0


def guess_parameters(bushing: Bushing, compound: Compound) -> Knowledge:
    """Guess the parameters of a rubber that was not tested, with their uncertainty, from hardness and filler.

    Args:
        bushing: geometry.
        compound: hardness [Shore A], carbon black [phr] and polymer.

    Returns:
        Knowledge of the five parameters.

    Notes:
        The laws of the guess:

            E   = 0.0981 (56 + 7.66 S) / (0.137505 (254 - 2.54 S)) MPa, S in Shore A               (Gent 1958)
            G   = E/3 = mu + Re m/2 (i omega_S)^alpha        a durometer is read some seconds after it is put down
            phi = (n/1.8) / (n/1.8 + 100/density)            volume share of n phr of carbon black
            X   = 1 + 2.5 phi + 14.1 phi^2                   strain of the rubber between particles   (Guth 1945)
            q   = m/2 omega_0^alpha / mu = 0.25, alpha = 0.24               omega_0 = 2 pi 10 Hz
            r   = sigma_fmax/(2 eps_half mu) = 0.51 (phi/phi_0)^3.5 X_0/X                             (Payne effect)
            eps_half = 0.013 X_0/X

        The numbers are those of the paper's bushing (natural rubber, phi_0 of 27 phr, Table 1). Three laws apply them
        to another compound: a filler network stiffens with phi^3.5, filler amplifies strain by X, and filler amplifies
        spring and springpot equally, so their ratio q is the same.

        Sources: A. N. Gent, Rubber Chemistry and Technology 31 (1958) 896-906, whose relation is quoted with 7.66, as
        here, or with 7.62336, which gives 0.5 % less; E. Guth, J. Applied Physics 16 (1945) 20-25; G. Heinrich,
        M. Klueppel, Advances in Polymer Science 160 (2002) 1-44, for phi^3.5; Garcia Tarrago et al. 2007, Table 1.

        ln G, ln q, ln alpha, ln r and ln eps_half are guessed independently, each with a standard deviation above.
        These are chosen: one published and one measured compound lie inside (tests/planning), and two compounds prove
        little. Where stiffness follows a power of frequency over four decades, as
        that of the measured one does, mu falls to nothing in a fit, and no guess of a spring holds it.
    """
    share, paper = _filled(compound.filler, _DENSITY[compound.rubber]), _filled(_PAPER_FILLER, _DENSITY["natural"])
    strained = _amplified(paper) / _amplified(share)
    modulus, more = gent_modulus(compound.hardness), float(np.log(share / paper))
    friction, eps_half = _FRICTION * strained * np.exp(_NETWORK * more), _HALF_STRAIN * strained
    at_reading = _SPRINGPOT * (_READING / _MIDDLE) ** _ORDER * np.exp(0.5j * np.pi * _ORDER)
    mu = modulus / (1.0 + at_reading.real)
    values = {
        "mu": mu,
        "m": 2.0 * _SPRINGPOT * mu * _MIDDLE**-_ORDER,
        "alpha": _ORDER,
        "sigma_fmax": 2.0 * eps_half * friction * mu,
        "eps_half": eps_half,
    }
    by_hardness = np.log(gent_modulus(compound.hardness + 0.5) / gent_modulus(compound.hardness - 0.5))
    errors = np.array(_SHAPE_ERRORS if compound.rubber == "natural" else _OTHER_ERRORS)
    errors[2] = np.hypot(errors[2], _NETWORK_ERROR * more)
    errors = np.array([np.hypot(_MODULUS_ERROR, _HARDNESS_ERROR * by_hardness), *errors])
    # rows: ln mu, ln m, ln alpha, ln sigma_fmax, ln eps_half; columns: ln G, ln q, ln alpha, ln r, ln eps_half
    weight = at_reading / (1.0 + at_reading.real)
    of_order = -_ORDER * (weight * (np.log(_READING / _MIDDLE) + 0.5j * np.pi)).real
    spring = np.array([1.0, -weight.real, of_order, 0.0, 0.0])
    slopes = np.outer([1.0, 1.0, 0.0, 1.0, 0.0], spring) + np.diag([0.0, 1.0, 1.0, 1.0, 1.0])
    slopes[1, 2] -= _ORDER * np.log(_MIDDLE)
    slopes[3, 4] += 1.0
    scaled = slopes * errors
    covariance = scaled @ scaled.T
    widths = zip(FIVE, np.exp(Z95 * np.sqrt(np.diag(covariance))).tolist(), strict=True)
    source = (
        f"a guess from {number(compound.hardness, 3)} Shore A and {number(compound.filler, 3)} phr of carbon black in "
        f"{compound.rubber} rubber: Gent's relation for the modulus, the paper's compound for the rest; 95 % are taken "
        f"to lie within factors of {', '.join(f'{number(factor, 2)} ({name})' for name, factor in widths)}"
    )
    return Knowledge(Model(bushing, BASE, values), FIVE, covariance, source)


def _filled(filler: float, density: float) -> float:
    """Volume share of so many phr of carbon black in a polymer of a density [g/cm^3]."""
    volume = filler / _BLACK_DENSITY
    return max(volume / (volume + 100.0 / density), _LEAST_SHARE)


def _amplified(share: float) -> float:
    """X, the strain of rubber between particles over that of the compound (Guth 1945)."""
    return 1.0 + 2.5 * share + 14.1 * share**2
