"""How well a discrepancy can be seen at all: what the best clean model leaves of a noise-free campaign."""

from dataclasses import dataclass

import numpy as np
from time_rig import Array, Complex, Rubber, Tests, first_harmonic, respond

#: Step of the parameters' logarithms for slopes, the farthest that a round goes, and its shares that are tried.
_STEP, _FARTHEST, _SHARES = 1e-3, 0.5, (1.0, 0.3, 0.1)
#: Rounds of the fit.
ROUNDS = 5
#: Cycles of a loop's record.
CYCLES = 3


@dataclass(frozen=True)
class Noise:
    """Errors of a rig, all as standard deviations.

    Args:
        scatter: of a sweep's point, of |K|, in each of its two parts.
        force: of a loop's force, of half its range.
        correlation: of one row of a loop with the next.
        run: gain, and phase [rad], that a run shares.
        level: the same that all repeats of a level share, in units of a run's; a reader allows for one unit.
    """

    scatter: float
    force: float
    correlation: float
    run: tuple[float, float]
    level: float


def seen(
    tests: Tests, rubber: Rubber, stiffness: Complex, force: Array, noise: Noise, rounds: int = ROUNDS
) -> tuple[float, float]:
    """Largest share of |K| that the five parameters leave, and chi-square beside free errors of runs and levels.

    Args:
        stiffness: of the sweeps as it stands in the record without noise [N/m], (n,).
        force: of the loops likewise [N], (n, SAMPLES).
    """
    sweeps, loops = ~tests.loop, tests.loop
    size = np.abs(stiffness[sweeps]) * noise.scatter
    keep = noise.correlation
    alike = np.sqrt((1.0 + keep) / (1.0 - keep) / CYCLES)  # rows that depend on each other tell less
    spread = noise.force * alike * 0.5 * np.ptp(force[loops], axis=-1, keepdims=True)

    def column(moved: Complex, waves: Array) -> Array:
        """Changes of K and of the loops' forces, in units of noise."""
        swept = moved[sweeps] / size
        return np.concatenate([swept.real, swept.imag, (waves[loops] / spread).ravel()])

    errors = []
    for rows in (*tests.runs(), *tests.runs(repeats=False)):
        chosen = np.isin(np.arange(tests.loop.size), rows)
        gain, phase = noise.run
        errors.append(column(gain * stiffness * chosen, gain * force * chosen[:, None]))
        if not tests.loop[rows].any():
            errors.append(column(1j * phase * stiffness * chosen, np.zeros_like(force)))
    names = tuple(vars(rubber))
    logs = np.log([getattr(rubber, name) for name in names])

    def model(values: Array) -> tuple[Complex, Array]:
        response = respond(tests, Rubber(*np.exp(values)))
        return response.stiffness, response.force

    shared = np.array(errors).T
    inner = np.linalg.inv(np.eye(len(errors)) + shared.T @ shared)

    def cleared(columns: Array) -> Array:
        """The covariance's inverse times columns: what errors of runs and levels do not make of them."""
        return np.asarray(columns - shared @ (inner @ (shared.T @ columns)))

    k, waves = model(logs)
    gap = column(stiffness - k, force - waves)
    misfit = float(gap @ cleared(gap))
    for _ in range(rounds):
        moved = [model(logs + step) for step in _STEP * np.eye(logs.size)]
        slopes = np.array([column(other - k, others - waves) for other, others in moved]).T / _STEP
        aim = np.linalg.lstsq(slopes.T @ cleared(slopes), slopes.T @ cleared(gap), rcond=1e-10)[0]
        for share in _SHARES:
            tried = logs + np.clip(share * aim, -_FARTHEST, _FARTHEST)
            tried_k, tried_waves = model(tried)
            tried_gap = column(stiffness - tried_k, force - tried_waves)
            tried_misfit = float(tried_gap @ cleared(tried_gap))
            if tried_misfit < misfit:
                logs, k, waves, gap, misfit = tried, tried_k, tried_waves, tried_gap, tried_misfit
                break
        else:
            break
    shares = np.where(loops, first_harmonic(force - waves) / first_harmonic(force), (stiffness - k) / stiffness)
    return float(np.max(np.abs(shares))), misfit
