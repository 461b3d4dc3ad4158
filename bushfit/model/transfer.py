"""Transfer the compound of a fitted model to another bushing, with a stiffness factor for a bushing without tests."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bushfit.caveat import Caveat
from bushfit.effects import Level
from bushfit.effects.unnamed import effect_label
from bushfit.geometry import Bushing, Direction
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.units import number

#: Standard deviation of the stiffness of a bushing over its formula; chosen: 0.2 mm of 8 mm of rubber, as moulded parts
#: vary, is 2.5 %, and the modulus varies by 2 % within a batch.
FACTOR_SPREAD = 0.03


def factor_spread(result: Result) -> float | None:
    """Relative standard deviation of measured from computed bushing stiffness, by the priors of stiffness factors.

    Returns:
        Root mean square distance from 1 of the stiffness factors that the campaign's priors expect [1]; None if no
        bushing has a free factor.
    """
    names = [f"stiffness_factor.{bushing.name}" for bushing in result.bushings]
    priors = [result.priors[name] for name in names if name in result.priors]
    distances = [(prior.mean - 1.0, prior.deviation) for prior in priors if not prior.source.endswith(".json")]
    if not distances:  # a prior from a file is of one bushing, and not of their spread
        return FACTOR_SPREAD if priors else None
    return float(np.sqrt(np.mean(np.square(distances).sum(axis=1))))


def with_factor(result: Result, places: Sequence[str], spread: float) -> Result:
    """Add a stiffness factor of 1, with the spread between bushings, to directions or bushings without a test.

    Args:
        result: fitted model.
        places: names of directions or bushings.
        spread: standard deviation of the factor.

    Returns:
        Result with the factors in its models and in its covariance.
    """
    names = tuple(f"stiffness_factor.{place}" for place in places)

    def with_factors(model: Model) -> Model:
        """Add the stiffness factors, with the value 1, to a model."""
        effects = (*model.effects, *names)
        return Model.with_defaults(model.bushing, effects, model.values, model.unnamed, model.constraints)

    return replace(
        result,
        model=with_factors(result.model),
        covariance=result.covariance.with_independent(names, spread),
        alternatives=tuple(
            replace(rival, model=with_factors(rival.model), covariance=rival.covariance.with_independent(names, spread))
            for rival in result.alternatives
        ),
    )


def transfer_compound(result: Result, bushing: Bushing) -> tuple[Result, Caveat]:
    """Transfer the compound of a fitted model to another bushing.

    Effects of the material and factors of specimens are kept; effects of the first bushing and its rig are left out. If
    several bushings were fitted with free factors, the other bushing has a factor too, with its spread.

    Args:
        result: fitted model.
        bushing: geometry of the other bushing.

    Returns:
        Result for the other bushing, and a warning that lists the effects that are left out.
    """
    coupons = tuple(specimen for specimen in result.specimens if not specimen.bushing)
    names = [coupon.name for coupon in coupons]

    def transfer(model: Model) -> Model:
        """Model of the other bushing, with the effects of the material."""
        effects = [
            record.name for record in model.records if record.level is Level.MATERIAL or record.corrects in names
        ]
        return Model.with_defaults(bushing, effects, model.values)

    model = transfer(result.model)
    measured = result.measured
    if measured:
        sources = dict.fromkeys(name if name in names else result.name for name in measured.directions)
        measured = replace(measured, directions=tuple(sources), preloads=())
    elsewhere = Result(
        model,
        fitted=tuple(name for name in result.fitted if name in model.values),
        covariance=result.covariance.select([*model.values]),
        measured=measured,
        warnings=tuple(line.about(result.name) for line in result.warnings if line not in result.rival_warnings),
        inputs=result.inputs,
        specimens=coupons,
        unresolved=tuple(name for name in result.unresolved if name in model.effects),
        model_error=result.model_error or result.model.unnamed,
        alternatives=tuple(replace(record, model=transfer(record.model)) for record in result.alternatives),
    )
    sentence = f"{bushing.name}: predicted from the compound of {result.name}; no bushing of this shape was tested"
    if omitted := [effect_label(one.name) for one in result.model.records if one.name not in model.effects]:
        sentence += f"; left out, because they belong to {result.name} or its rig: {', '.join(omitted)}"
    if spread := factor_spread(result):
        elsewhere = with_factor(elsewhere, [*Direction], spread)
        sentence += f"; the bands include {number(100.0 * spread, 2)} % of stiffness, by which bushings differ"
    return elsewhere, Caveat("shape_not_tested", sentence)
