"""Friction in the time domain against the branches of Eq. 5 in many digits, Berg's loop area and first harmonic."""

from __future__ import annotations

import mpmath
import numpy as np
from agreement import Agree, digits

from bushfit.effects import History
from bushfit.effects.friction import stress

VALUES = {"sigma_fmax": 1.46e4, "eps_half": 1.3e-2}
SCALED = (1e-3, 0.1, 0.5, 3.8, 50.0, 1000.0)  # e0/eps_half


def branches(strain: list[float]) -> list[mpmath.mpf]:
    """Eq. 5 from rest along turning points that alternate."""
    sigma, half = (mpmath.mpf(VALUES[name]) for name in ("sigma_fmax", "eps_half"))
    at, held, out = mpmath.mpf(0), mpmath.mpf(0), []
    for value in map(mpmath.mpf, strain):
        sense, moved = mpmath.sign(value - at), value - at
        held += moved * (sigma - sense * held) / (half * (1 - sense * held / sigma) + sense * moved)
        at = value
        out.append(held)
    return out


def test_branches_from_rest(agree: Agree) -> None:
    random = np.random.default_rng(1)
    signs = np.where(np.arange(2000) % 2, -1.0, 1.0)
    strain = signs * VALUES["eps_half"] * 10.0 ** random.uniform(-2.0, 1.5, 2000)
    with mpmath.workdps(40):
        exact = np.array([float(value) for value in branches(strain.tolist())])
    found = stress(VALUES, History(strain, 1e-3, periodic=False, frequency=1.0))
    agree("friction, 2000 branches from rest", [float(-np.log10(np.max(np.abs(found / exact - 1.0))))])


def berg_area(x: float) -> mpmath.mpf:
    """Dissipation per cycle and volume [J/m^3] as Berg gives it: 2 F (2 x0 - x2 (1 + u)^2 ln(1 + 2 x0/(x2 (1 + u)))),
    u the share of F that the loop reaches."""
    half, x0 = mpmath.mpf(VALUES["eps_half"]), mpmath.mpf(x) * VALUES["eps_half"]
    u = (mpmath.sqrt(half**2 + x0**2 + 6 * half * x0) - half - x0) / (2 * half)
    return 2 * VALUES["sigma_fmax"] * (2 * x0 - half * (1 + u) ** 2 * mpmath.log1p(2 * x0 / (half * (1 + u))))


def in_phase(x: float) -> mpmath.mpf:
    """A of the first harmonic: the integral of a branch of the loop over its phase."""
    y = (mpmath.sqrt(x**2 + 6 * mpmath.mpf(x) + 1) - x - 1) / 2

    def branch(phase: mpmath.mpf) -> mpmath.mpf:
        moved = x * (1 - mpmath.cos(phase))
        return -(-y + moved * (1 + y) / ((1 + y) + moved)) * mpmath.cos(phase)

    return VALUES["sigma_fmax"] * 2 / mpmath.pi * mpmath.quad(branch, mpmath.linspace(0, mpmath.pi, 9))


def test_area_and_first_harmonic_of_the_steady_loop(agree: Agree) -> None:
    """Friction knows no time, so that the samples may lie where Gauss integrates each branch exactly."""
    nodes, weights = np.polynomial.legendre.leggauss(400)
    phase, weight = np.pi / 2.0 * (1.0 + nodes), np.pi / 2.0 * weights
    areas, firsts = [], []
    for x in SCALED:
        e0 = x * VALUES["eps_half"]
        up = -e0 * np.cos(phase)
        cycle = np.concatenate([[-e0], up, [e0], -up])
        loading = stress(VALUES, History.steady(cycle, 1.0))[1 : 1 + up.size]
        with mpmath.workdps(30):
            areas.append((2.0 * weight @ (loading * e0 * np.sin(phase)), float(berg_area(x))))
            firsts.append((-2.0 / np.pi * weight @ (loading * np.cos(phase)), float(in_phase(x))))
        print(f"e0/eps_half = {x:g}: area {digits(*areas[-1]):.1f}, in phase {digits(*firsts[-1]):.1f} digits")
    agree("friction, area of the steady loop", [digits(*np.array(areas).T)])
    agree("friction, in-phase first harmonic", [digits(*np.array(firsts).T)])
