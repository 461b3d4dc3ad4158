"""Cross-validation of several bushings: predict each bushing by a fit to the others."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from bushfit.effects import place_suffix
from bushfit.effects.contract import Array
from bushfit.fitting.preparation import MeasuredTest, log_slopes
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.procedures import fit_joint
from bushfit.geometry import Specimen
from bushfit.model.covariance import Z95
from bushfit.model.result import Result
from bushfit.model.transfer import FACTOR_SPREAD, factor_spread, with_factor
from bushfit.prediction.bands import uncertainty
from bushfit.prediction.conditions import OperatingPoints


def predict_each_bushing(
    data: PreparedCampaign, effects: Sequence[str], directions: Sequence[str] | None = None
) -> pd.DataFrame:
    """Cross-validate several bushings: predict the tests of each by a model that is fitted to the others.

    If the model has a free stiffness factor for each bushing, the band includes the spread of these factors.

    Args:
        data: prepared campaign.
        effects: names of the effects of the model.
        directions: names of the directions, specimens or bushings whose tests are used; None for the default of a fit.

    Returns:
        A row per bushing; none for tests of fewer than two. Columns: name; number of operating points; root mean square
        error of the prediction, relative to |K|, or for a loop to half its force range [%]; mean square error in units
        of noise; mean relative difference of |K|, measured minus predicted [%]; and share of the points whose |K| is in
        the 95 % band of prediction and noise [%].
    """
    tests = data.select_tests(directions)
    places = [test.direction for test in tests if isinstance(test.direction, Specimen) and test.direction.bushing]
    names = list(dict.fromkeys(place.body for place in places))
    rows = []
    for name in names if len(names) > 1 else ():
        left_out = [test for test in tests if test.direction.body == name]
        fitted_places = list(dict.fromkeys(str(test.direction) for test in tests if test.direction.body != name))
        labels = {name, *(str(test.direction) for test in left_out)}
        kept_effects = [effect for effect in effects if place_suffix(effect) not in labels]
        result = fit_joint(data, effects=kept_effects, directions=fitted_places)
        misfits = [misfit for misfit in result.tests if misfit.held is None and misfit.place in labels]
        if f"stiffness_factor.{name}" in effects:
            result = with_factor(result, [name], factor_spread(result) or FACTOR_SPREAD)
        points = [misfit.points for misfit in misfits]
        figures = [(misfit.nrmse**2, misfit.reduced_chi_square, misfit.gain) for misfit in misfits]
        square, chi_square, gain = np.average(figures, axis=0, weights=points)
        inside = np.concatenate([_are_in_band(result, test) for test in left_out]).mean()
        rows.append((name, sum(points), 100.0 * np.sqrt(square), chi_square, 100.0 * gain, 100.0 * inside))
    return pd.DataFrame(rows, columns=["bushing", "points", "NRMSE [%]", "chi2 [-]", "mean gap [%]", "in band [%]"])


def _are_in_band(result: Result, test: MeasuredTest) -> Array:
    """Mask of the operating points of a test whose |K| is in the 95 % band of prediction and noise, (n,)."""
    ratio = test.measured / test.noise_free(result.model).measured
    points = OperatingPoints(test.direction, test.frequency, test.amplitude, test.conditions)
    errors = uncertainty(result, result.model, points)
    slopes = log_slopes(result.model, test, errors.covariance.names)
    band = errors.band(np.zeros(ratio.size), np.concatenate((slopes, errors.relative)).real)
    noise = test.relative_noise
    return np.abs(np.log(np.abs(ratio))) <= np.hypot(band.high, Z95 * noise)
