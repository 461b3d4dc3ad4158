"""Effects of the library in a size that matters."""

import numpy as np

from bushfit.effects import BASE, LIBRARY, qualified_name
from bushfit.geometry import Direction
from bushfit.model.model import Model

#: What the library adds to the paper's model.
ADDED = tuple(name for name in LIBRARY if name not in BASE)


def sized(model: Model, name: str, direction: Direction, amplitude: float, rng: np.random.Generator) -> Model:
    """The model with the effect in a random size that matters at this amplitude."""
    stiffness = abs(complex(np.ravel(model.stiffness(direction, 50.0, amplitude))[0]))
    by_hand = {
        "interface_slip.force": 0.05 * stiffness * amplitude,
        "bump_stop.gap": 0.6 * amplitude,
        "bump_stop.stiffness": 0.3 * stiffness,
        "guide_friction.force": 0.05 * stiffness * amplitude,
        "one_sided_stop.gap": 0.6 * amplitude,
        "one_sided_stop.stiffness": 0.3 * stiffness,
        "force_saturation.level": 0.6 * stiffness * amplitude,
        "clearance.delta": 0.1 * amplitude,
        "fixture_play.delta": 0.1 * amplitude,
        "rig_compliance.compliance": 0.1 / stiffness,
        "sleeve_compliance.compliance": 0.1 / stiffness,
        "rig_compliance.radial": 0.1 / stiffness,
        "sleeve_compliance.radial": 0.1 / stiffness,
        "inertia.mass": 0.05 * stiffness / (2.0 * np.pi * 155.0) ** 2,
        "fixture_resonance.mass": 0.05 * stiffness / (2.0 * np.pi * 155.0) ** 2,
        "self_heating.beta": 0.1 / (100.0 * stiffness * amplitude**2),
        "force_offset.offset": 0.02 * stiffness * amplitude,
    }
    values = {}
    for parameter in LIBRARY[name].parameters:
        key = qualified_name(LIBRARY[name], parameter)
        share = rng.uniform(0.5, 1.5)
        values[key] = by_hand[key] * share if key in by_hand else parameter.value_at_share(share)
    return model.with_effect(name, values)
