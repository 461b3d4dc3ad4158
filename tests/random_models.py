"""Models of random bushings, with any effect in a size that matters."""

import numpy as np

from bushfit.effects import BASE, LIBRARY, qualified_name
from bushfit.effects.contract import RubberConditions
from bushfit.geometry import Bushing, Direction
from bushfit.model.model import Model

#: What the library adds to the paper's model.
ADDED = tuple(name for name in LIBRARY if name not in BASE)
#: A warm test, late in the session and after a large strain.
UNDER = RubberConditions(temperature=303.0, session_time=0.7, largest_strain=0.08, previous_strain=0.08, rest_time=0.03)


def random_model(rng: np.random.Generator) -> Model:
    """The paper's model of a random bushing of random rubber."""
    inner = rng.uniform(6e-3, 22e-3)
    bushing = Bushing("random", inner, inner * rng.uniform(1.3, 2.2), rng.uniform(20e-3, 70e-3))
    values = {
        "mu": rng.uniform(0.6e6, 2e6),
        "m": rng.uniform(0.8e5, 3.5e5),
        "alpha": rng.uniform(0.15, 0.3),
        "sigma_fmax": rng.uniform(5e3, 3e4),
        "eps_half": rng.uniform(7e-3, 2e-2),
    }
    return Model(bushing, BASE, values)


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


def operating_point(model: Model, rng: np.random.Generator) -> tuple[Direction, float, float]:
    """A direction, a frequency [Hz], and an amplitude [m] of 0.3 to 6 % strain."""
    direction = list(Direction)[rng.integers(2)]
    return (
        direction,
        float(rng.uniform(5.0, 155.0)),
        10 ** rng.uniform(-2.5, -1.2) / model.bushing.unit_strain(direction),
    )
