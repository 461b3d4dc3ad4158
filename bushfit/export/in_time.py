"""What of a model runs in time, on lists that the C sources of an FMU read: values, directions and Maxwell arms."""

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
from bushfit.export.deck import of_band
from bushfit.geometry import Place
from bushfit.model.arms import Arms, model_arms, qualified_size, values_under
from bushfit.model.model import Model
from bushfit.prediction.stiffness import Prediction
from bushfit.units import number

#: The tables of fmu.toml: fields of the C sources by effect, and units.
TABLES = tomllib.loads(Path(__file__).with_name("fmu.toml").read_text(encoding="utf-8"))
FIELDS: Mapping[str, list[str]] = TABLES["fields"]
#: Of these fields, those that are 1 where a direction has no such effect; the others are 0.
ONE = {"eps_half[0]", "eps_half[1]", "e_s", "spread", "median", "deviation", "scale", "factor", "preload"}


@dataclass(frozen=True)
class Value:
    """A number of the model: SI, its bounds, and whether it can be set from outside."""

    name: str
    unit: str
    value: float
    bounds: tuple[float, float]
    meaning: str
    settable: bool = True


@dataclass(frozen=True, eq=False)
class InTime:
    """A model on lists.

    Args:
        values: constants first, then what can be set.
        fields: of each place, the C field and the name of its value; what is missing is neutral.
        levers: arm of a slip force at each place: 1, or a radius [m].
        parts: what the moduli of each group of arms go with.
        arm_rows: number of its part, modulus over the size of that, and relaxation time [s] of each.
        losses: what is left out or held, and the error of that.
        arms: the same by what they stand for, with their error.
    """

    places: tuple[Place, ...]
    values: tuple[Value, ...]
    fields: tuple[Mapping[str, str], ...]
    levers: tuple[float, ...]
    parts: tuple[str, ...]
    arm_rows: tuple[tuple[int, float, float], ...]
    losses: tuple[str, ...]
    arms: tuple[Arms, ...]


def in_time(order: Order) -> InTime:
    """The model of an order as far as it runs in time.

    Raises:
        ModelError: an effect that has no law in time, or none in the C sources; or no arms within the accuracy.
    """
    model = order.result.model.without(Level.INSTRUMENT)
    # what has no name, and what is gone once settled
    left = [effect.name for effect in model.records if effect.name == UNNAMED or effect.settles]
    kept = model.without(*left)
    held = [effect.name for effect in kept.records if isinstance(effect, Modifier) and not effect.shift_factor]
    for effect in kept.records:
        _check(effect)
    arms, under = model_arms(kept, band(order), order.accuracy, order.under), order.under
    middle = [kept.values_at(p.direction, _middle(p.frequency), _middle(p.amplitude), under) for p in order.predictions]
    values, names = _values(kept, order.places, middle, arms)
    losses = [f"the whole memory of the rubber: {part.sentence}, fading below" for part in arms]
    for prediction in order.predictions:
        losses += [*_lost(kept, held, left, prediction, under), *of_band(prediction)]
    return InTime(
        order.places,
        values,
        tuple(_fields(kept, place, own, arms) for place, own in zip(order.places, names, strict=True)),
        tuple(kept.bushing.outer_radius if kept.bushing and p.is_rotation else 1.0 for p in order.places),
        tuple(part.size for part in arms),
        tuple(
            (k, float(modulus / values_under(kept, under)[part.size]), float(time))
            for k, part in enumerate(arms)
            for modulus, time in zip(part.modulus, part.time, strict=True)
        ),
        tuple(losses),
        arms,
    )


def band(order: Order) -> tuple[float, float]:
    """The band of the arms [Hz]: that of model and grid, and two decades below and one above."""
    known = [prediction.frequency for prediction in order.predictions]
    every = np.concatenate([*known, *([order.result.measured.frequency] if order.result.measured else [])])
    return float(every.min()) / 100.0, float(every.max()) * 10.0  # loops are slow, and a triangle has overtones


def _kind(effect: Effect) -> str:
    """The key of an effect in FIELDS."""
    return f"{effect.name.partition('.')[0]}." if place_suffix(effect.name) else effect.name


def _check(effect: Effect) -> None:
    """Refuse what cannot run in time."""
    if effect.harmonic_only or not (
        isinstance(effect, Modifier) or _kind(effect) in FIELDS or (isinstance(effect, Branch) and effect.size)
    ):
        raise ModelError(
            "an FMU follows a motion through time, for which there is no law",
            place=effect.name,
            found="a law of the steady first harmonic alone" if effect.harmonic_only else "a law that no FMU has",
            expected="effects with a law in time",
            hint="fit a model without it, or export the stiffness over frequency and amplitude in another format",
        )


def _middle(values: Array) -> float:
    """The geometric middle of a range."""
    return float(np.sqrt(values.min() * values.max()))


def _values(
    model: Model, places: tuple[Place, ...], middle: list[dict[str, float]], arms: tuple[Arms, ...]
) -> tuple[tuple[Value, ...], list[dict[str, str]]]:
    """All values, and for each place the name of its own by that of the parameter: where modifiers make it differ from
    place to place it is called `<parameter>.<place>`."""
    sizes, parts = {part.size for part in arms}, {qualified_size(branch) for branch in model.viscoelastic}
    constants, settable = list[Value](), list[Value]()
    names = [dict[str, str]() for _ in places]
    for effect in model.records:
        for parameter in () if isinstance(effect, Modifier) else effect.parameters:
            name = qualified_name(effect, parameter)
            of_arms = effect.size if isinstance(effect, Branch) else None
            if isinstance(effect, Branch) and effect.size and qualified_size(effect) not in sizes:
                continue
            shared = len({own[name] for own in middle}) == 1
            for place, own, called in zip(places, middle, names, strict=True):
                called[name], size = name if shared else f"{name}.{place}", own[name]
                neutral_size = size if parameter.neutral is None else parameter.neutral
                held = (*parameter.bounds, size, neutral_size)  # what modifiers made of it, and that it is not there
                bounds, settable_now = (min(held), max(held)), not of_arms or name in parts
                value = Value(called[name], parameter.unit, size, bounds, parameter.meaning, settable_now)
                target = settable if value.settable else constants
                if value not in target:
                    target.append(value)
    for place, called in zip(places, names, strict=True):
        unit = f"1/{place.motion.displacement_unit}" if place.motion.displacement_unit != "1" else "1"
        shape = {
            "unit_strain": (unit, model.unit_strain(place), "equivalent strain per displacement, rotation or strain"),
            "stiffness_per_modulus": ("", model.stiffness_per_modulus(place), "stiffness per equivalent shear modulus"),
        }
        called |= {key: f"{key}.{place}" for key in shape}
        settable += [Value(called[key], unit, size, (1e-12, 1e12), what) for key, (unit, size, what) in shape.items()]
    return (*constants, *settable), names


def _fields(model: Model, place: Place, names: Mapping[str, str], arms: tuple[Arms, ...]) -> dict[str, str]:
    """The value of each C field at a place."""
    layers = model.layers(model.setting(place))
    fields = {key: names[key] for key in ("unit_strain", "stiffness_per_modulus")}
    for k, part in enumerate(arms):
        fields[f"size[{k}]"] = names[part.size]
    for effect in model.records:
        here = isinstance(effect, Branch) or effect in layers
        if here and _kind(effect) in FIELDS and place_suffix(effect.name) in (None, str(place)):
            own = (names[qualified_name(effect, parameter)] for parameter in effect.parameters)
            fields |= dict(zip(FIELDS[_kind(effect)], own, strict=True))
    return fields


def _lost(model: Model, held: list[str], left: list[str], prediction: Prediction, under: Circumstances) -> list[str]:
    """What it costs in steady stiffness at a place that modifiers are held, and that some effects are left out."""
    if not (held or left):
        return []
    middle = _middle(prediction.frequency), _middle(prediction.amplitude)
    plain, values = model.without(*held), model.values_at(prediction.direction, *middle)
    own = plain.with_values({name: values[name] for name in plain.values})
    found = own.stiffness(prediction.direction, prediction.frequency, prediction.amplitude, under=under)
    whole = prediction.storage_stiffness.value + 1j * prediction.loss_stiffness.value
    error = float(np.max(np.abs(found / whole - 1.0)))
    if error < 1e-6 and not left:  # rounding
        return []
    (length, factor), *_ = prediction.direction.display
    frequency, amplitude = number(middle[0], 3), number(factor * middle[1], 3)
    said = [f"{', '.join(held)}, held as at {frequency} Hz and {amplitude} {length}"] * bool(held)
    said += [", ".join(left)] * bool(left)
    off = f"stiffness off by up to {number(100.0 * error, 2)} % over the grid"
    return [f"{prediction.direction}: {'; '.join(said)}: {off}"]
