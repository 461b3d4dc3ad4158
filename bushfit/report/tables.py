"""Tables for spreadsheets: units in every header, one row per point."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from bushfit.effects.contract import Array, RubberConditions
from bushfit.errors import printable
from bushfit.fitting.master_curve import ShiftedSweep
from bushfit.fitting.preparation import MeasuredLoop, MeasuredSweep
from bushfit.geometry import ROTATION, STRAINING, TRANSLATION, Display, Place
from bushfit.model.arms import Arms, arm_rows
from bushfit.model.covariance import Z95
from bushfit.model.model import Model
from bushfit.prediction.bands import Band
from bushfit.prediction.resonance import PredictedResonance
from bushfit.prediction.static_curve import StaticCurve
from bushfit.prediction.stiffness import Prediction
from bushfit.reading.measurement import loss_factor
from bushfit.reduction.harmonics import series
from bushfit.units import CELSIUS

#: Display unit of amplitudes and its factor from SI, by SI unit: mm for m, % for strain.
DISPLAYS = {motion.displacement_unit: motion.display.displacement for motion in (TRANSLATION, ROTATION, STRAINING)}
#: Suffix of headers and labels of predictions that assume an unresolved effect to belong to the test rig.
IF_RIGS = "if caused by the rig"


def quantity_words(place: Place) -> tuple[str, str, str]:
    """Words for headers: "amplitude", "force", "stiffness", or "strain amplitude", "stress", "modulus"."""
    if place.motion is not STRAINING:
        return "amplitude", "force", "stiffness"
    strain, stress, modulus = STRAINING.words
    return f"{strain} amplitude", stress, modulus


def response_headers(place: Place) -> tuple[str, str, str]:
    """Headers of amplitude, stiffness and force, such as ("amplitude [mm]", "stiffness [N/mm]", "force [N]")."""
    (length, _), (force, _), (stiffness, _) = place.display
    motion_name, resisting, resisted = quantity_words(place)
    return f"{motion_name} [{length}]", f"{resisted} [{stiffness}]", f"{resisting} [{force}]"


def displacement_header(place: Place) -> str:
    """Column header, with unit, of displacement, rotation or strain for a direction or specimen."""
    motion_name = "strain" if place.motion is STRAINING else "displacement"
    return f"{motion_name} [{place.display.displacement.name}]"


def response_columns(place: Place, stiffness: Array, before: str = "") -> dict[str, Array]:
    """Table columns of stiffness magnitude (display unit) and loss factor, by their headers.

    Args:
        place: direction or specimen.
        stiffness: complex stiffnesses [SI], (n,).
        before: prefix of both headers, such as "model ".
    """
    magnitude = np.abs(stiffness) * place.display.stiffness.factor
    return {f"{before}{response_headers(place)[1]}": magnitude, f"{before}loss factor [-]": loss_factor(stiffness)}


def band_columns(header: str, band: Band, factor: float = 1.0) -> dict[str, Array]:
    """Table columns of a predicted quantity and of both ends of its 95 % band, by header, (n,) each.

    Args:
        header: header of the quantity; ", low" and ", high" are added for the ends of the band.
        band: quantity and band [SI].
        factor: factor from SI to the unit in the header.
    """
    return dict(zip((header, f"{header}, low", f"{header}, high"), factor * band.ends, strict=True))


def prediction_table(prediction: Prediction, display: Display | None = None) -> pd.DataFrame:
    """Table of predicted stiffness and loss, with the ends of the 95 % bands; a row per operating point.

    Args:
        prediction: prediction for one direction or specimen.
        display: units of the table; None for the display units of the direction or specimen.

    Returns:
        Columns: frequency, amplitude, stiffness, loss factor, storage and loss stiffness; "low" and "high" ends of the
            last four; if there is an unresolved effect, the four again under the assumption that the effect belongs to
            the rig; if known, measured stiffness and loss factor; temperature and preload, if the model depends on
            them; and the large motion, if there is one.
    """
    (length, length_factor), _, (stiffness, factor) = display or prediction.direction.display
    motion_name, _, resisted = quantity_words(prediction.direction)
    force = f"{resisted} [{stiffness}]"
    quantities = {
        force: ("stiffness", factor),
        "loss factor [-]": ("loss_factor", 1.0),
        f"storage {force}": ("storage_stiffness", factor),
        f"loss {force}": ("loss_stiffness", factor),
    }
    columns: dict[str, Any] = {"frequency [Hz]": prediction.frequency}
    columns[f"{motion_name} [{length}]"] = prediction.amplitude * length_factor
    bands = [band_columns(name, getattr(prediction, key), scale) for name, (key, scale) in quantities.items()]
    columns |= {name: band[name] for name, band in zip(quantities, bands, strict=True)}
    for band in bands:
        columns |= band
    if rig := prediction.if_in_rig:
        columns |= {f"{name}, {IF_RIGS}": getattr(rig, key).value * scale for name, (key, scale) in quantities.items()}
    if (measured := prediction.measured) is not None:
        columns |= {f"measured {force}": np.abs(measured) * factor, "measured loss factor [-]": loss_factor(measured)}
    columns |= condition_columns(prediction.conditions, prediction.direction)
    if over := prediction.over:
        columns["large motion, frequency [Hz]"] = over.frequency
        columns[f"large motion, displacement [{length}]"] = over.displacement * length_factor
    return pd.DataFrame(columns)


def wide_table(prediction: Prediction, display: Display | None = None) -> pd.DataFrame:
    """Table of predicted stiffness and loss factor in wide form: a row per frequency, a column per amplitude.

    Args:
        prediction: prediction for one direction or specimen.
        display: units of the table; None for the display units of the direction or specimen.

    Returns:
        Frequency, then a stiffness column for each amplitude, then a loss factor column for each; cells are empty where
        the prediction has no operating point.
    """
    (length, length_factor), _, (stiffness, factor) = display or prediction.direction.display
    resisted = quantity_words(prediction.direction)[2]
    points = pd.DataFrame({"frequency [Hz]": prediction.frequency, "amplitude": prediction.amplitude})
    points[resisted], points["loss factor"] = prediction.stiffness.value * factor, prediction.loss_factor.value
    units = {resisted: stiffness, "loss factor": "-"}
    wide = points.pivot_table([*units], "frequency [Hz]", "amplitude", "last")[[*units]]
    levels: list[Any] = wide.columns.tolist()
    wide.columns = [f"{name} {level * length_factor:.10g} {length} [{units[name]}]" for name, level in levels]
    return wide.reset_index()


def predicted_resonance_table(resonance: PredictedResonance) -> pd.DataFrame:
    """Table of the predicted resonance of a mass on a mount whose base is shaken.

    Args:
        resonance: predicted response of the mass over frequency.

    Returns:
        A row per frequency: transmissibility, phase, deformation amplitude, stiffness and loss factor. If the tests do
        not show whether an effect belongs to the bushing or the rig, the same again as if it belongs to the rig.
    """
    place = resonance.direction
    columns: dict[str, Any] = {
        "frequency [Hz]": resonance.frequency,
        "transmissibility [-]": np.abs(resonance.transmissibility),
        "phase [deg]": np.degrees(np.angle(resonance.transmissibility)),
        response_headers(place)[0]: resonance.amplitude * place.display.displacement.factor,
        **response_columns(place, resonance.stiffness),
        **condition_columns(resonance.conditions, place),
    }
    table = pd.DataFrame(columns)
    if resonance.if_in_rig:
        if_in_rig = predicted_resonance_table(resonance.if_in_rig).iloc[:, 1:].add_suffix(f", {IF_RIGS}")
        table = pd.concat([table, if_in_rig], axis=1)
    return table


def static_table(curve: StaticCurve) -> pd.DataFrame:
    """Table of a static curve, with the ends of the 95 % bands; a row per displacement.

    Returns:
        Columns: displacement, rate; mean, loading and unloading force, and stiffness (slope of the mean), each with
        its "low" and "high" ends; temperature and preload, if the model depends on them.
    """
    (length, to_length), (_, to_force), (_, to_stiffness) = curve.direction.display
    _, stiffness, force = response_headers(curve.direction)
    columns: dict[str, Any] = {displacement_header(curve.direction): curve.displacement * to_length}
    columns[f"rate [{length}/min]"] = 60.0 * curve.rate * to_length
    for header, band, scale in (
        (force, curve.mean, to_force),
        (f"loading {force}", curve.loading, to_force),
        (f"unloading {force}", curve.unloading, to_force),
        (stiffness, curve.slope, to_stiffness),
    ):
        columns |= band_columns(header, band, scale)
    return pd.DataFrame(columns | condition_columns(curve.conditions, curve.direction))


def arms_table(model: Model, arms: Sequence[Arms], places: Sequence[Place]) -> pd.DataFrame:
    """Table of Maxwell arms (spring and dashpot in series) that replace effects of a model, parallel spring first.

    Args:
        model: model whose effects the arms replace.
        arms: Maxwell arms of each replaced effect.
        places: directions and specimens whose stiffness is listed.

    Returns:
        A row per arm: name of the replaced effect, relaxation time [s], shear modulus [MPa], and stiffness of the arm
        in each direction or specimen.
    """
    names, moduli, times = zip(*arm_rows(model, arms), strict=True)
    modulus = np.array(moduli)
    columns = {"branch": names, "relaxation time [s]": times, "shear modulus [MPa]": 1e-6 * modulus}
    for place in places:
        *_, (unit, factor) = place.display
        columns[f"{place} {quantity_words(place)[2]} [{unit}]"] = factor * model.stiffness_per_modulus(place) * modulus
    return pd.DataFrame(columns)


def loops_table(model: Model, data_sets: Sequence[MeasuredLoop]) -> pd.DataFrame:
    """Table of the measured and modelled force of hysteresis loops, with their residuals.

    The residual is measured minus model, in units of the noise of one row. Outliers were excluded from the fit.

    Args:
        model: model to compare with the tests.
        data_sets: measured loops.

    Returns:
        A row per sample, or per bin of phase of a long loop: name, direction, time [s], frequency [Hz], displacement,
        measured and modelled force (display units), residual [noise], and outlier ("yes" or "no").
    """
    tables = []
    for data_set in data_sets:
        place = data_set.direction
        (_, length), (_, factor), _ = place.display
        force = response_headers(place)[2]
        binned = data_set.phase.size < data_set.test.force.size
        outliers = np.empty(0) if binned else data_set.faulty_rows["force"].rows
        columns: dict[str, Any] = {
            "loop": data_set.name,
            "direction": str(place),
            "time [s]": data_set.phase / data_set.frequency,
            "frequency [Hz]": data_set.frequency[0],
            displacement_header(place): series(data_set.coefficients, data_set.phase) * length,
            force: data_set.measured_force * factor,
            f"model {force}": data_set.response(model) * factor,
            "residual [noise]": -data_set.displayed_residual(model),
            "outlier": np.where(np.isin(np.arange(data_set.phase.size), outliers), "yes", "no"),
        }
        tables.append(pd.DataFrame(columns))
    return pd.concat(tables, ignore_index=True)


def sweeps_table(model: Model, data_sets: Sequence[MeasuredSweep]) -> pd.DataFrame:
    """Table of the measured and modelled dynamic stiffness of sweeps, with their residuals.

    Residuals are measured minus model, in units of noise. Temperature, part and stated error are columns only if a
    test states them.

    Args:
        model: model to compare with the tests.
        data_sets: measured sweeps.

    Returns:
        A row per measured point, sorted by fixed quantity (amplitude or frequency), repeat and stepped quantity: name,
        direction, conditions, frequency, amplitude, repeat, measured and modelled stiffness and loss factor, residuals
        of stiffness and loss [noise], their ratio and difference, and outlier ("yes" or "no").
    """
    tables = []
    for data_set in data_sets:
        place, modelled = data_set.direction, data_set.response(model)
        gain, phase = np.split(-data_set.displayed_residual(model), 2)
        columns: dict[str, Any] = {
            "sweep": data_set.name,
            "direction": str(place),
            **sweep_condition_columns(data_set),
            "frequency [Hz]": data_set.frequency,
            response_headers(place)[0]: data_set.amplitude * place.display.displacement.factor,
            "repeat": data_set.repeat,
            **response_columns(place, data_set.measured),
            **response_columns(place, modelled, "model "),
            "stiffness residual [noise]": gain,
            "loss residual [noise]": phase,
            "measured over model [-]": np.abs(data_set.measured / modelled),
            "loss factor difference [-]": loss_factor(data_set.measured) - loss_factor(modelled),
            "outlier": np.where(data_set.weights > 0.0, "no", "yes"),
        }
        tables.append(pd.DataFrame(columns))
    return pd.concat(tables, ignore_index=True)


def condition_columns(conditions: RubberConditions, place: Place) -> dict[str, Any]:
    """Columns of temperature and preload of a test or prediction.

    Returns:
        Temperature [degC] and preload in the unit of the place, by column header; without those that are unknown.
    """
    columns = dict[str, Any]()
    if conditions.temperature is not None:
        columns["temperature [degC]"] = conditions.temperature - CELSIUS
    if conditions.preload is not None:
        value, unit = conditions.preload.in_display_unit(place)
        columns[f"preload [{unit}]"] = value
    return columns


def sweep_condition_columns(data_set: MeasuredSweep) -> dict[str, Any]:
    """Table columns on the conditions of a sweep: stepped quantity, temperature, preload, part and stated error.

    Returns:
        Values by column header: one value for the whole sweep, or one for each of its n points, (n,).
    """
    sweep, conditions = data_set.test, data_set.source.conditions if data_set.source else {}
    kelvin = None if sweep.temperature is None else data_set.temperature
    columns: dict[str, Any] = {"stepped": sweep.stepped or "neither"}
    columns |= condition_columns(RubberConditions(kelvin, preload=sweep.preload), sweep.direction)
    if "specimen_number" in conditions:
        columns["part"] = str(conditions["specimen_number"])
    if sweep.relative_error is not None:
        columns["stated error [-]"] = sweep.relative_error[data_set.order]
    return columns


def master_curve_table(shifted_sweeps: Sequence[ShiftedSweep]) -> pd.DataFrame:
    """Table of sweeps at several temperatures, as measured and shifted to 23 degC (time-temperature superposition).

    Returns:
        A row per point: temperature, amplitude, and frequency, stiffness and loss factor, both measured and reduced.
    """
    tables = []
    for shifted in shifted_sweeps:
        sweep, place = shifted.sweep, shifted.sweep.direction
        columns = {"sweep": sweep.name, "direction": str(place), "temperature [degC]": sweep.temperature - CELSIUS}
        columns["frequency [Hz]"] = sweep.frequency
        columns[response_headers(place)[0]] = sweep.amplitude * place.display.displacement.factor
        columns |= response_columns(place, sweep.measured) | {"reduced frequency [Hz]": shifted.reduced_frequency}
        tables.append(pd.DataFrame(columns | response_columns(place, shifted.reduced_stiffness, "reduced ")))
    return pd.concat(tables, ignore_index=True)


def shift_factors_table(shifted_sweeps: Sequence[ShiftedSweep]) -> pd.DataFrame:
    """Table of the temperature shift factors log10 a_T of sweeps, with 95 % intervals.

    Returns:
        A row per sweep: temperature, shift factor of the law fitted to all sweeps, and shift factor fitted to the sweep
        alone.
    """
    columns: dict[str, Any] = {
        "sweep": [shifted.sweep.name for shifted in shifted_sweeps],
        "direction": [str(shifted.sweep.direction) for shifted in shifted_sweeps],
        "temperature [degC]": [shifted.temperature - CELSIUS for shifted in shifted_sweeps],
    }
    for name, key in (("log10 a_T [-]", "shift"), ("log10 a_T of the sweep alone [-]", "best_shift")):
        value, error = np.array([getattr(shifted, key) for shifted in shifted_sweeps]).T / np.log(10.0)
        columns |= {name: value, f"{name}, low": value - Z95 * error, f"{name}, high": value + Z95 * error}
    return pd.DataFrame(columns)


def table_columns(table: pd.DataFrame) -> dict[str, list[Any]]:
    """Convert a table to lists by column header, with None for empty cells."""
    return {str(name): [None if x != x else x for x in column.tolist()] for name, column in table.items()}


def shorten(name: str, letters: int) -> str:
    """Shorten a name to at most `letters` characters by an ellipsis in its middle; control characters are escaped."""
    name = printable(name)
    return name if len(name) <= letters else f"{name[: (letters - 1) // 2]}…{name[-(letters // 2) :]}"


def spread_indices(count: int, maximum: int) -> Array:
    """Indices of at most `maximum` of `count` elements, evenly from the first to the last, (min(count, maximum),)."""
    return np.linspace(0, count - 1, min(maximum, count)).round().astype(int)
