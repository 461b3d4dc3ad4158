"""A model as lists of values, directions and Maxwell arms, as the C sources of an FMU read them."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bushfit.effects import Branch, Effect, Level, Modifier, place_suffix, qualified_name
from bushfit.effects.contract import Array, Circumstances
from bushfit.effects.unnamed import NAME as UNNAMED
from bushfit.errors import ModelError
from bushfit.export.contract import Order
from bushfit.export.deck import band_losses
from bushfit.geometry import Place
from bushfit.model.arms import Arms, model_arms, qualified_size, values_under
from bushfit.model.model import Model
from bushfit.prediction.stiffness import Prediction
from bushfit.units import number

#: The tables of fmu.toml: fields of the C sources by effect, and units.
TABLES = tomllib.loads(Path(__file__).with_name("fmu.toml").read_text(encoding="utf-8"))
FIELDS: Mapping[str, list[str]] = TABLES["fields"]
#: Fields that are 1 in a direction without the effect; all other fields are 0.
UNIT_FIELDS = {"eps_half[0]", "eps_half[1]", "e_s", "spread", "median", "deviation", "scale", "factor", "preload"}


@dataclass(frozen=True)
class FmuValue:
    """A number of the model in SI.

    Args:
        name: name in the FMU.
        unit: SI unit.
        value: start value.
        bounds: least and largest value that can be set.
        meaning: description of the parameter.
        settable: True if an importer can set it.
    """

    name: str
    unit: str
    value: float
    bounds: tuple[float, float]
    meaning: str
    settable: bool = True


@dataclass(frozen=True, eq=False)
class TimeModel:
    """A model as lists.

    Args:
        places: directions and specimens.
        values: constants first, then values that can be set.
        fields: name of the value of each C field, per place; missing fields are neutral.
        levers: lever of the slip force at each place: 1, or a radius [m].
        parts: parameter that the moduli of each group of arms are proportional to.
        arm_rows: index of the part, modulus over the parameter of the part, and relaxation time [s] of each arm.
        losses: effects that are left out or held constant, with the error.
        arms: the arms by the effects that they replace, with their error.
    """

    places: tuple[Place, ...]
    values: tuple[FmuValue, ...]
    fields: tuple[Mapping[str, str], ...]
    levers: tuple[float, ...]
    parts: tuple[str, ...]
    arm_rows: tuple[tuple[int, float, float], ...]
    losses: tuple[str, ...]
    arms: tuple[Arms, ...]


def time_model(order: Order) -> TimeModel:
    """Convert the model of an order to lists.

    Returns:
        Values, fields and lever of each direction, Maxwell arms in time, and the losses.

    Raises:
        ModelError: an effect without a law in time or without a law in the C sources, or no arms within the accuracy.
    """
    model, under = order.result.model.without(Level.INSTRUMENT), order.under
    omitted = [effect.name for effect in model.records if effect.name == UNNAMED or effect.settles]
    model = model.without(*omitted)
    fixed_modifiers = [
        effect.name for effect in model.records if isinstance(effect, Modifier) and not effect.shift_factor
    ]
    for effect in model.records:
        _check_effect(effect)
    arms = model_arms(model, arm_band(order), order.accuracy, under)
    local_values = [
        model.values_at(
            prediction.direction, _geometric_mean(prediction.frequency), _geometric_mean(prediction.amplitude), under
        )
        for prediction in order.predictions
    ]
    values, names = _values(model, order.places, local_values, arms)
    losses = [f"the long memory of the rubber: {part.sentence}, fading below" for part in arms]
    for prediction in order.predictions:
        losses += [*_steady_losses(model, fixed_modifiers, omitted, prediction, under), *band_losses(prediction)]
    sizes = values_under(model, under)
    return TimeModel(
        order.places,
        values,
        tuple(_fields(model, place, own_names, arms) for place, own_names in zip(order.places, names, strict=True)),
        tuple(model.bushing.outer_radius if model.bushing and place.is_rotation else 1.0 for place in order.places),
        tuple(part.size for part in arms),
        tuple(
            (index, float(modulus / sizes[part.size]), float(time))
            for index, part in enumerate(arms)
            for modulus, time in zip(part.modulus, part.time, strict=True)
        ),
        tuple(losses),
        arms,
    )


def arm_band(order: Order) -> tuple[float, float]:
    """Frequency band of the Maxwell arms [Hz]: two decades below and one above the frequencies of fit and grid.

    Loops are slow, and a triangle has overtones.
    """
    grids = [prediction.frequency for prediction in order.predictions]
    fitted = [order.result.measured.frequency] if order.result.measured else []
    frequencies = np.concatenate([*grids, *fitted])
    return float(frequencies.min()) / 100.0, float(frequencies.max()) * 10.0


def _fields_key(effect: Effect) -> str:
    """Key of an effect in FIELDS."""
    return f"{effect.name.partition('.')[0]}." if place_suffix(effect.name) else effect.name


def _check_effect(effect: Effect) -> None:
    """Refuse an effect that cannot run in time."""
    supported = isinstance(effect, Modifier) or _fields_key(effect) in FIELDS
    if effect.harmonic_only or not (supported or (isinstance(effect, Branch) and effect.size)):
        raise ModelError(
            "an FMU follows a motion through time, for which this effect has no law",
            place=effect.name,
            found="a law of the steady first harmonic alone" if effect.harmonic_only else "a law that no FMU has",
            expected="effects with a law in time",
            hint="fit a model without it, or export the stiffness over frequency and amplitude in another format",
        )


def _geometric_mean(values: Array) -> float:
    """Geometric mean of the ends of a range."""
    return float(np.sqrt(values.min() * values.max()))


def _values(
    model: Model, places: tuple[Place, ...], local_values: list[dict[str, float]], arms: tuple[Arms, ...]
) -> tuple[tuple[FmuValue, ...], list[dict[str, str]]]:
    """Values of the FMU, and the names of the values of each place by parameter.

    A parameter that modifiers make different between places becomes one value per place, `<parameter>.<place>`.
    """
    fitted_sizes, sizes = {part.size for part in arms}, {qualified_size(branch) for branch in model.viscoelastic}
    values: dict[FmuValue, None] = {}
    names = [dict[str, str]() for _ in places]
    for effect in model.records:
        size = qualified_size(effect) if isinstance(effect, Branch) and effect.size else None
        if isinstance(effect, Modifier) or (size and size not in fitted_sizes):
            continue
        for parameter in effect.parameters:
            key = qualified_name(effect, parameter)
            shared = len({local[key] for local in local_values}) == 1
            for place, local, place_names in zip(places, local_values, names, strict=True):
                name, value = key if shared else f"{key}.{place}", local[key]
                limits = (*parameter.bounds, value, value if parameter.neutral is None else parameter.neutral)
                bounds, settable = (min(limits), max(limits)), size is None or key in sizes
                values[FmuValue(name, parameter.unit, value, bounds, parameter.meaning, settable)] = None
                place_names[key] = name
    for place, place_names in zip(places, names, strict=True):
        unit = f"1/{place.motion.displacement_unit}" if place.motion.displacement_unit != "1" else "1"
        shape = {
            "unit_strain": (unit, model.unit_strain(place), "equivalent strain per displacement, rotation or strain"),
            "stiffness_per_modulus": ("", model.stiffness_per_modulus(place), "stiffness per equivalent shear modulus"),
        }
        for key, (unit, value, meaning) in shape.items():
            place_names[key] = f"{key}.{place}"
            values[FmuValue(place_names[key], unit, value, (1e-12, 1e12), meaning)] = None
    return tuple(sorted(values, key=lambda value: value.settable)), names


def _fields(model: Model, place: Place, names: Mapping[str, str], arms: tuple[Arms, ...]) -> dict[str, str]:
    """Name of the value of each C field at a place."""
    layers = model.layers(model.setting(place))
    fields = {key: names[key] for key in ("unit_strain", "stiffness_per_modulus")}
    fields |= {f"size[{index}]": names[part.size] for index, part in enumerate(arms)}
    for effect in model.records:
        acts = (isinstance(effect, Branch) or effect in layers) and place_suffix(effect.name) in (None, str(place))
        if acts and _fields_key(effect) in FIELDS:
            parameters = (names[qualified_name(effect, parameter)] for parameter in effect.parameters)
            fields |= dict(zip(FIELDS[_fields_key(effect)], parameters, strict=True))
    return fields


def _steady_losses(
    model: Model, fixed_modifiers: list[str], omitted: list[str], prediction: Prediction, under: Circumstances
) -> list[str]:
    """Sentence on the error in steady stiffness at a place from held modifiers and omitted effects."""
    if not (fixed_modifiers or omitted):
        return []
    place, frequency, amplitude = prediction.direction, prediction.frequency, prediction.amplitude
    middle = _geometric_mean(frequency), _geometric_mean(amplitude)
    plain, values = model.without(*fixed_modifiers), model.values_at(place, *middle)
    written = plain.with_values({name: values[name] for name in plain.values})
    stiffness = written.stiffness(place, frequency, amplitude, under=under)
    complete = prediction.storage_stiffness.value + 1j * prediction.loss_stiffness.value
    error = float(np.max(np.abs(stiffness / complete - 1.0)))
    if error < 1e-6 and not omitted:  # rounding
        return []
    (length, factor), *_ = place.display
    point = f"{number(middle[0], 3)} Hz and {number(factor * middle[1], 3)} {length}"
    parts = [f"{', '.join(fixed_modifiers)}, fixed as at {point}"] * bool(fixed_modifiers) + [
        ", ".join(omitted)
    ] * bool(omitted)
    return [f"{place}: {'; '.join(parts)}: stiffness off by up to {number(100.0 * error, 2)} % over the grid"]
