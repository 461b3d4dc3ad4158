"""Model families fitted to one campaign, and the family to use."""

from collections.abc import Sequence
from dataclasses import replace
from string import ascii_uppercase

import numpy as np

from bushfit.campaign.campaign import Campaign
from bushfit.caveat import Caveat
from bushfit.commands.fit import prepare_tests
from bushfit.diagnosis.families import FittedFamily, fit_families
from bushfit.diagnosis.fits import result_of
from bushfit.effects import Level
from bushfit.geometry import Specimen
from bushfit.model.result import Result
from bushfit.prediction.parameter_comparison import holm
from bushfit.units import format_range, number

#: Specimen whose modulus over strain is compared if the results have no direction in common.
COMPOUND = Specimen("compound", "modulus")
#: Probability from which on a family is a possible explanation.
_LIKELY = 0.05
#: Relative difference of moduli below which families agree: the scatter of bushings of one batch.
_AGREED = 0.05
#: Factor by which the comparison of families extends the tested range, and number of points in it.
_BEYOND, _POINTS = 10.0, 400


def fit_campaign_families(
    campaign: Campaign, names: Sequence[str], directions: Sequence[str] | None
) -> tuple[list[FittedFamily], list[Result], list[Caveat]]:
    """Fit model families (sets of effects) to a campaign: the model of [fit], then the named families.

    Args:
        campaign: the campaign.
        names: names of families, such as "kraus+inertia"; empty for all families of the library.
        directions: directions or specimens whose tests are fitted; None for the default.

    Returns:
        The fitted families, their results in the same order, and warnings.
    """
    data = prepare_tests(campaign)
    data_sets = [data_set.with_weight() for data_set in data.select_tests(directions or None)]
    model = data.starting_model(data.effects, data_sets)
    fixed = [name for name, setting in campaign.fit.parameters.items() if not setting.vary]
    families, unlikely = fit_families(model, data_sets, names, fixed, data.bounds)
    adjusted = holm([family.p for family in families])
    families = [replace(family, p=p) for family, p in zip(families, adjusted, strict=True)]
    results = [result_of(family.fit, data.bounds, model.effects, rig=campaign.rig) for family in families]
    notes = list[Caveat]()
    if results[0].model_error is None:
        sentence = "the first family meets these tests within their noise: the tests need no other family"
        notes.append(Caveat("first_family_enough", sentence))
    if unlikely:
        percent = number(100.0 * sum(unlikely.values()), 2)
        sentence = f"{len(unlikely)} more families have a probability of {percent} % together: {', '.join(unlikely)}"
        notes.append(Caveat("unlikely_families", sentence))
    return families, [replace(result, specimens=campaign.specimens) for result in results], notes


def family_to_use(families: Sequence[FittedFamily], results: Sequence[Result]) -> str:
    """Sentence on the most probable model family, and the ranges in which all probable families agree.

    Args:
        families: model families, fitted to the same tests.
        results: result of each family.

    Returns:
        The sentence, without a full stop.
    """
    rows = list(zip(ascii_uppercase, families, results, strict=False))
    label, family, result = max(rows, key=lambda row: row[1].probability)
    likely = [row for row in rows if row[1].probability >= _LIKELY and row[0] != label]
    sentence = f"use {label}, {family.name}: probability {number(100.0 * family.probability, 2)} %"
    if not likely or result.measured is None:
        return f"{sentence}; every other family is below {100.0 * _LIKELY:g} %"
    models = [one.model.without(Level.INSTRUMENT) for one in (result, *(row[2] for row in likely))]
    ends = np.array([result.measured.frequency, result.measured.strain])
    ends[1] /= result.model.unit_strain(COMPOUND)  # as laboratories state strain
    middle, reach = np.sqrt(ends.prod(axis=1)), []
    for axis, (low, high) in enumerate(ends):
        points = np.repeat(middle[:, None], _POINTS, axis=1)
        values = points[axis] = np.geomspace(low / _BEYOND, high * _BEYOND, _POINTS)
        moduli = np.abs([model.stiffness(COMPOUND, *points) for model in models])
        differing = values[moduli.max(axis=0) > (1.0 + _AGREED) * moduli.min(axis=0)]
        below, above = differing[differing < middle[axis]], differing[differing > middle[axis]]
        reach.append((below.max(initial=values[0]), above.min(initial=values[-1])))
    frequencies, strains = format_range("Hz", *reach[0]), format_range("%", *(100.0 * end for end in reach[1]))
    return (
        f"{sentence}; {', '.join(row[0] for row in likely)} (at least {100.0 * _LIKELY:g} %) have the same modulus "
        f"within {100.0 * _AGREED:g} % over {frequencies} and {strains} shear strain. Outside this range, the tests "
        "cannot distinguish them"
    )
