"""A model in the time domain: lists of values, directions and Maxwell arms, as the C sources of an FMU read them."""

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bushfit.caveat import Caveat
from bushfit.effects import Branch, Effect, Level, Modifier, place_suffix, qualified_name
from bushfit.effects.contract import RubberConditions
from bushfit.effects.unnamed import NAME as UNNAMED
from bushfit.effects.unnamed import effect_label
from bushfit.errors import ModelError
from bushfit.export.contract import ExportRequest
from bushfit.export.deck import band_omissions
from bushfit.geometry import Place, bushing_at
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
    """Scalar variable of an FMU: a parameter of the model, or a constant of the bushing's shape.

    Args:
        name: name in the FMU.
        unit: SI unit.
        value: start value, in `unit`.
        bounds: smallest and largest value that can be set, in `unit`.
        meaning: description of the parameter.
        settable: True if the program that runs the FMU can set the value; False for a constant.
    """

    name: str
    unit: str
    value: float
    bounds: tuple[float, float]
    meaning: str
    settable: bool = True


@dataclass(frozen=True, eq=False)
class TimeModel:
    """Time-domain model as flat lists, from which the C sources of an FMU are generated.

    Maxwell arms (spring and damper in series) replace the viscoelastic effects of the model.

    Args:
        places: directions and specimens, each with one input and one output of the FMU.
        values: constants first, then values that can be set.
        fields: name of the value for each field of the C structure `Direction`, for each place; missing fields have
            their neutral value.
        levers: lever arm of the slip force at each place: outer radius [m] for torsion, otherwise 1.
        arms: groups of arms with the effects that they replace, and their error.
        arm_rows: for each arm, index of its group in `arms`, its modulus over the model parameter that scales the
            group (`Arms.size`), and its relaxation time [s].
        omissions: effects that are omitted or constant, with the error that this causes.
    """

    places: tuple[Place, ...]
    values: tuple[FmuValue, ...]
    fields: Sequence[Mapping[str, str]]
    levers: Sequence[float]
    arms: tuple[Arms, ...]
    arm_rows: Sequence[tuple[int, float, float]]
    omissions: Sequence[Caveat]


def time_model(request: ExportRequest) -> TimeModel:
    """Convert the fitted model of an export to a time-domain model for an FMU, without effects of the rig.

    Returns:
        Values, fields and lever arm of each direction, Maxwell arms, and the omissions.

    Raises:
        ModelError: an effect has no law in the time domain or none in the C sources, or no arms reach the accuracy.
    """
    model, conditions = request.result.model.without(Level.INSTRUMENT), request.conditions
    omitted = [effect.name for effect in model.records if effect.name == UNNAMED or effect.is_transient]
    model = model.without(*omitted)
    for effect in model.records:
        has_law = isinstance(effect, Modifier) or fields_of(effect) or (isinstance(effect, Branch) and effect.size)
        if effect.harmonic_only or not has_law:
            steady = "a law for the steady first harmonic only"
            raise ModelError(
                "an FMU follows a motion through time, for which this effect has no law",
                place=effect.name,
                found=steady if effect.harmonic_only else "a law that the FMU sources lack",
                expected="effects whose force can be computed over time",
                hint="fit a model without it, or export the stiffness over frequency and amplitude in another format",
            )
    # loops are slow, and a triangle has overtones: two decades below and one above the frequencies of fit and grid
    fitted = [request.result.measured.frequency] if request.result.measured else []
    frequencies = np.concatenate([*(prediction.frequency for prediction in request.predictions), *fitted])
    band = float(frequencies.min()) / 100.0, float(frequencies.max()) * 10.0
    arms = model_arms(model, band, request.accuracy, conditions)
    values, fields = _values(request, model, arms)
    omissions = [Caveat("format_error", f"{part.sentence}; slower relaxation is left out") for part in arms]
    for prediction in request.predictions:
        omissions += [*_steady_omissions(model, omitted, prediction, conditions), *band_omissions(prediction)]
    sizes = values_under(model, conditions)
    arm_rows = [
        (index, float(modulus / sizes[part.size]), float(time))
        for index, part in enumerate(arms)
        for modulus, time in zip(part.modulus, part.time, strict=True)
    ]
    tubes = [(bushing_at(model.bushing, place), place) for place in request.places]
    levers = [tube.outer_radius if tube and place.is_rotation else 1.0 for tube, place in tubes]
    return TimeModel(request.places, values, fields, levers, arms, arm_rows, omissions)


def fields_of(effect: Effect) -> list[str]:
    """Names of the fields in the C sources of an FMU for the parameters of an effect; empty if they lack the effect."""
    kind = f"{effect.name.partition('.')[0]}." if place_suffix(effect.name) else effect.name
    return FIELDS.get(kind, [])


def middle_point(prediction: Prediction) -> tuple[float, float]:
    """Geometric mean of lowest and highest frequency [Hz], and that of the amplitudes [m, rad or 1] of a prediction."""
    frequency, amplitude = (float(np.sqrt(x.min() * x.max())) for x in (prediction.frequency, prediction.amplitude))
    return frequency, amplitude


def _values(
    request: ExportRequest, model: Model, arms: tuple[Arms, ...]
) -> tuple[tuple[FmuValue, ...], list[dict[str, str]]]:
    """List the values of the FMU, and for each direction or specimen the values that its C structure takes.

    If a parameter differs between places (directions or specimens), each place has a value `<parameter>.<place>`.

    Args:
        request: predictions and settings of the export.
        model: model in the export, without effects of the rig.
        arms: Maxwell arms that replace viscoelastic effects.

    Returns:
        Values, constants first; and for each place, name of the value by field of the C structure, such as
        {"unit_strain": "unit_strain.axial", "size[0]": "m"}.
    """
    places = request.places
    local_values = [
        model.values_at(prediction.direction, *middle_point(prediction), request.conditions)
        for prediction in request.predictions
    ]
    size_fields = {part.size: f"size[{index}]" for index, part in enumerate(arms)}
    sizes = {qualified_size(branch) for branch in model.structure.viscoelastic}
    values: dict[FmuValue, None] = {}
    fields = [dict[str, str]() for _ in places]
    for effect in model.records:
        size = qualified_size(effect) if isinstance(effect, Branch) and effect.size else None
        if isinstance(effect, Modifier) or (size and size not in size_fields):
            continue
        effect_fields = fields_of(effect) or [""] * len(effect.parameters)
        for parameter, field in zip(effect.parameters, effect_fields, strict=True):
            key = qualified_name(effect, parameter)
            shared = len({local[key] for local in local_values}) == 1
            for place, local, place_fields in zip(places, local_values, fields, strict=True):
                name, value = key if shared else f"{key}.{place}", local[key]
                limits = (*parameter.bounds, value, value if parameter.neutral is None else parameter.neutral)
                bounds, settable = (min(limits), max(limits)), size is None or key in sizes
                values[FmuValue(name, parameter.unit, value, bounds, parameter.meaning, settable)] = None
                if key in size_fields:
                    place_fields[size_fields[key]] = name
                if field and effect.acts_at(place) and place_suffix(effect.name) in (None, str(place)):
                    place_fields[field] = name
    for place, place_fields in zip(places, fields, strict=True):
        unit = f"1/{place.motion.displacement_unit}" if place.motion.displacement_unit != "1" else "1"
        for key, key_unit, value, meaning in (
            ("unit_strain", unit, model.unit_strain(place), "equivalent strain per displacement, rotation or strain"),
            ("stiffness_per_modulus", "", model.stiffness_per_modulus(place), "stiffness per equivalent shear modulus"),
        ):
            place_fields[key] = f"{key}.{place}"
            values[FmuValue(place_fields[key], key_unit, value, (1e-12, 1e12), meaning)] = None
    return tuple(sorted(values, key=lambda value: value.settable)), fields


def _steady_omissions(
    model: Model, omitted: list[str], prediction: Prediction, conditions: RubberConditions
) -> Iterator[Caveat]:
    """Yield a warning on the error of |K| in an FMU that omits effects or keeps them constant; none without an error.

    Args:
        model: model in the export, without effects of the rig.
        omitted: names of the effects that are left out.
        prediction: dynamic stiffness over the grid of the export.
        conditions: temperature of the rubber.
    """
    fixed = model.constant_modifiers
    if not (fixed or omitted):
        return
    place, (frequency, amplitude) = prediction.direction, middle_point(prediction)
    plain, values = model.without(*fixed), model.values_at(place, frequency, amplitude)
    written = plain.with_values({name: values[name] for name in plain.values})
    stiffness = written.stiffness(place, prediction.frequency, prediction.amplitude, conditions=conditions)
    error = float(np.max(np.abs(stiffness / prediction.complex_stiffness - 1.0)))
    if error < 1e-6 and not omitted:  # rounding
        return
    point = f"{number(frequency, 3)} Hz and {place.display.displacement.text(amplitude)}"
    parts = [f"{', '.join(fixed)}, fixed as at {point}" if fixed else "", ", ".join(map(effect_label, omitted))]
    effects = "; ".join(filter(None, parts))
    sentence = f"{effects}: error of the stiffness up to {number(100.0 * error, 2)} % over the grid"
    yield Caveat("format_error", sentence).about(place)
