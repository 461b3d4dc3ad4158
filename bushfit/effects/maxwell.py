"""Maxwell branch: a spring and a dashpot in series, one relaxation time."""

import numpy as np

from bushfit.effects.contract import Array, History, Value, Values


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """Complex modulus of a Maxwell arm, a spring and a dashpot in series.

    Args:
        p: parameter values by name: modulus mu1 [Pa] of the spring, and relaxation time tau [s].
        omega, strain: angular frequency [rad/s] and amplitude e0 of the tensor shear strain e = gamma/2 [1], (..., n).

    Returns:
        Complex modulus of the first harmonic [Pa], (..., n).

    Notes:
        mu^ = mu1 i omega tau/(1 + i omega tau) (J. D. Ferry, Viscoelastic Properties of Polymers, 1980, ch. 3).

    >>> complex(modulus({"mu1": 5e4, "tau": 0.01}, 100.0, 0.01))
    (25000+25000j)
    """
    turn = 1j * np.asarray(omega) * p["tau"]
    return p["mu1"] * turn / (1.0 + turn)


def relax(rate: Value, values: Array, step: Value) -> Array:
    """Solution y of dy/dt + rate y = dx/dt from rest, exact for an x that is linear between samples.

    Args:
        rate: reciprocal of the relaxation time [1/s], a number or (..., 1).
        values: samples of x, (..., n).
        step: time between samples [s].

    Returns:
        y, (..., n).

    Notes:
        y_n = r y_{n-1} + (1 - r)/(rate step) (x_n - x_{n-1}), r = exp(-rate step).

    >>> relax(1.0, np.array([1.0, 2.0, 2.0]), np.log(2.0)).round(3)
    array([0.721, 1.082, 0.541])
    """
    from scipy.special import exprel

    def row(decay: float, values: Array) -> Array:
        return recursion(float(np.exp(-decay)), exprel(-decay) * np.diff(values, prepend=0.0))

    return np.asarray(np.vectorize(row, signature="(),(n)->(n)")(np.atleast_1d(rate * step)[..., 0], values))


def recursion(ratio: complex, added: Array) -> Array:
    """Solve the recursion y_n = ratio y_{n-1} + added_n from y = 0, (n,) -> (n,).

    Args:
        ratio: factor of the previous value.
        added: terms to add, (n,).

    >>> recursion(0.5, np.array([1.0, 0.0, 0.0]))
    array([1.  , 0.5 , 0.25])
    """
    from scipy.linalg import solve_banded

    bands = np.stack((np.ones(added.size), np.full(added.size, -ratio)))
    return np.asarray(solve_banded((1, 0), bands, added, check_finite=False))


def stress(p: Values, history: History) -> Array:
    """Stress of a Maxwell arm, a spring and a dashpot in series, from rest.

    Args:
        p: parameter values by name: modulus mu1 [Pa] of the spring, and relaxation time tau [s].
        history: tensor shear strain e = gamma/2 over time [1], (..., n).

    Returns:
        Stress at each sample [Pa], (..., n).

    Notes:
        Solution s of s + tau ds/dt = 2 mu1 tau de/dt.
    """
    return 2.0 * p["mu1"] * relax(1.0 / p["tau"], history.value, history.step)
