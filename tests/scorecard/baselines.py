"""Two baselines for the benchmark: what is known of regression, on bushfit's readers, noise and list of effects."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import lmfit
import numpy as np

from bushfit.campaign.campaign import load_campaign
from bushfit.diagnosis.fits import fit_model
from bushfit.diagnosis.propose import missing_effects, parameter_basis, sensitivity
from bushfit.effects import BASE, Effect
from bushfit.effects.contract import Array
from bushfit.errors import BushfitError
from bushfit.fitting.coordinates import Coordinates, coordinate_bounds
from bushfit.fitting.measured_sweep import MeasuredSweep
from bushfit.fitting.preparation import with_gain_weighting
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.problem import FitResult
from bushfit.model.model import Model
from tests.fits import residual

#: Effects that forward selection adds at most.
_MOST = 5
#: Evaluations of one fit by lmfit.
_EVALUATIONS = 400


def _plain_fit(folder: Path) -> tuple[FitResult, list[Effect]]:
    """The paper's model fitted to all tests, and the effects that it lacks."""
    data = PreparedCampaign.from_campaign(load_campaign(folder / "bushing.toml"))
    data_sets = with_gain_weighting(data.data_sets, weigh=True)
    evidence = fit_model(data.starting_model(BASE, data_sets), data_sets, (), {})
    places = [str(test.direction) for test in evidence.data_sets]
    return evidence, [effect for effect in missing_effects(evidence.model, places) if effect.replaces is None]


def _bic(evidence: FitResult, chi_square: float, parameters: int) -> float:
    """BIC as lmfit has it, for noise of unknown size: n ln(chi-square/n) + k ln n, n independent points."""
    count = sum(test.independent_count for test in evidence.data_sets)
    return float(count * np.log(chi_square / count) + parameters * np.log(count))


def _answer(evidence: FitResult, names: list[str], change: Array) -> dict[str, Any]:
    """The answer that names effects, whose change of the residuals, in units of noise, shows where."""
    where = []
    for test, rows in evidence.residual_rows.items():
        if isinstance(test, MeasuredSweep) and names:
            parts = np.abs(change[rows])[: 2 * test.frequency.size].reshape(2, -1)
            for row in np.flatnonzero(np.max(parts, axis=0) > 1.0).tolist():
                frequency, amplitude = float(test.frequency[row]), 1e3 * float(test.amplitude[row])
                where.append(
                    {
                        "direction": str(test.direction),
                        "frequency_Hz": [frequency, frequency],
                        "amplitude_mm": [amplitude, amplitude],
                    }
                )
    return {"sees": bool(names), "claims": [[name.partition(".")[0]] for name in names], "where": where}


def sparse(folder: Path) -> dict[str, Any]:
    """Forward selection of linear columns beside the paper's five parameters, while BIC falls.

    The columns are the derivatives of all residuals by the amount of each effect, on a grid of its other parameters.
    """
    evidence, effects = _plain_fit(folder)
    names, columns = [], []
    for effect in effects:
        shapes, found = sensitivity(evidence.model, evidence.data_sets, effect)
        names += [effect.name] * len(shapes)
        columns += list(found) if shapes else []
    library, chosen, own = np.array(columns), list[int](), parameter_basis(evidence.jacobian)
    basis, left = own, evidence.residual
    while len(chosen) < min(_MOST, len(library)):
        clear = library - (library @ basis) @ basis.T
        lengths = np.linalg.norm(clear, axis=1)
        usable = lengths > 1e-4 * np.linalg.norm(library, axis=1)
        gains = np.where(usable, np.square(clear @ left) / np.where(usable, lengths, 1.0) ** 2, 0.0)
        best = int(np.argmax(gains))
        if _bic(evidence, left @ left - gains[best], 1) >= _bic(evidence, left @ left, 0):
            break
        chosen.append(best)
        basis = np.column_stack([basis, clear[best] / lengths[best]])
        left = left - basis[:, -1] * (basis[:, -1] @ left)
    if not chosen:
        return _answer(evidence, [], left)
    amounts = np.linalg.lstsq(np.vstack([own.T, library[chosen]]).T, -evidence.residual)[0]
    change = amounts[-len(chosen) :] @ library[chosen]
    return _answer(evidence, list(dict.fromkeys(names[i] for i in chosen)), change)


def single(folder: Path) -> dict[str, Any]:
    """The one effect whose fit by lmfit, beside the paper's five parameters, has the least BIC; none if no fit has a
    smaller one than the plain model."""
    evidence, effects = _plain_fit(folder)
    best, least, change = "", _bic(evidence, evidence.chi_square, 0), evidence.residual
    for effect in effects:
        with suppress(BushfitError, ValueError):
            model = _started(evidence.model.with_effect(effect.name), effect)
            fitted, chi_square = _fitted_by_lmfit(evidence, model)
            bic = _bic(evidence, chi_square, len(effect.parameters))
            if bic < least:
                bare = evidence.model.with_values({name: fitted.values[name] for name in evidence.model.values})
                best, least = effect.name, bic
                change = residual(fitted, evidence.data_sets) - residual(bare, evidence.data_sets)
    return _answer(evidence, [best] if best else [], change)


def _started(model: Model, effect: Effect) -> Model:
    """The model with the effect at a tenth of its typical amount."""
    name = next(name for name, parameter in model.parameters.items() if parameter is effect.amount)
    return model.with_values({name: effect.amount.value_at_share(0.1)})


def _fitted_by_lmfit(evidence: FitResult, model: Model) -> tuple[Model, float]:
    """The model after `lmfit.minimize` on the whitened residuals, and chi-square."""
    coordinates = Coordinates.of_parameters(model, tuple(model.values))
    low, high = coordinate_bounds(coordinates, {})
    start = np.clip(coordinates.point(model.values), low, high)
    parameters = lmfit.Parameters()
    for number, (value, least, most) in enumerate(zip(start, low, high, strict=True)):
        parameters.add(f"u{number}", value=float(value), min=float(least), max=float(most))

    def moved(tried: lmfit.Parameters) -> Model:
        return model.with_values(coordinates.values(list(tried.valuesdict().values())))

    solution = lmfit.minimize(
        lambda tried: residual(moved(tried), evidence.data_sets), parameters, method="leastsq", max_nfev=_EVALUATIONS
    )
    return moved(solution.params), float(solution.chisqr)


BASELINES: Mapping[str, Callable[[Path], dict[str, Any]]] = {"sparse": sparse, "single": single}
