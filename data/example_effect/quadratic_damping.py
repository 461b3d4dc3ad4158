"""Quadratic damping: a stress that grows with the square of the strain rate."""

import numpy as np

#: Record of the effect, with the keys of bushfit's library.toml.
EFFECT = {
    "sentence": "Damping that grows with the square of the strain rate: loss rises with frequency and with amplitude.",
    "equation": "i 8/(3 pi) c omega^2 e0",
    "source": "equivalent linear damping: J. P. Den Hartog, Mechanical Vibrations, 4th ed., 1956, section 8.9",
    "confirmed_by": "sweeps of three amplitudes: the added loss stiffness is proportional to the amplitude",
    "parameters": {
        "c": {"unit": "Pa*s^2", "bounds": [0.0, 1e6], "neutral": 0.0, "typical": 20.0, "meaning": "quadratic damping"},
    },
}


def modulus(p, omega, strain):
    """Complex modulus of the first harmonic [Pa]: i 8/(3 pi) c omega^2 e0."""
    return 1j * 8.0 / (3.0 * np.pi) * p["c"] * np.asarray(omega) ** 2 * strain


def stress(p, history):
    """Stress over time [Pa]: 2 c |de/dt| de/dt."""
    return 2.0 * p["c"] * np.abs(history.rate) * history.rate
