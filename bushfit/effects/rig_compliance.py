"""Rig compliance: the rig is elastic in series with the bushing, which therefore moves less than the rig imposes."""

import numpy as np
from scipy.fft import next_fast_len

from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Values
from bushfit.errors import ModelError

#: Tolerance of the secant method in the logarithm of the amplitude, before one last step.
_NEAR = 1e-8
#: Maximum number of iterations; chosen: many more than a rig stiffer than the bushing needs.
_ROUNDS = 60
#: Ratio of an iteration's error to the smallest error so far, below which the iteration is an improvement.
_NEARER = 0.9
#: Successive iterations without improvement after which the iteration ends; chosen: slow convergence needs twelve.
_IDLE = 20
#: Ratio of an iteration's error to the previous one, below which the next step is assumed to reach this ratio, too.
_FAST = 0.1
#: Largest error, relative to the force, of a start that is kept as the solution of the last of many models. A tiny
#: compliance alone does not show that the start is a solution: the motion that it changes is as tiny.
_SOLVED = 1e-6
#: Number of past differences in Anderson mixing; chosen: three reduce the iterations to a third, more do not help.
_REMEMBERED = 3


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """Complex stiffness with a compliance in series.

    Args:
        p: parameter values by name: compliance c [m/N] in series with the bushing.
        below: complex stiffness K without this effect, as a function of omega and amplitude.
        omega, amplitude: angular frequency [rad/s] and displacement amplitude X [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Complex stiffness with the effect [N/m or N m/rad], (..., n).

    Notes:
        K/(1 + c K), springs in series (ISO 10846-2:2008), with K at the amplitude X e^v that reaches the bushing. Does
        not act in torsion. Solves v + ln|1 + c K(X e^v)| = 0 by the secant method; the last secant also extrapolates K.

    >>> spring = lambda omega, amplitude: np.full(1, 1e6 + 0j)
    >>> stiffness({"compliance": 1e-6}, spring, np.ones(1), np.full(1, 1e-4), sweep).round()
    array([500000.+0.j])
    """
    compliance = p["compliance"]

    def excess(v: Array, inside: Array) -> Array:
        """Residual v + ln|1 + c K| of the equation for v, the log of the ratio of the bushing's to the rig's amplitude.

        Args:
            v: natural log of the ratio of amplitudes, (..., n).
            inside: complex stiffness K of the bushing at this amplitude, (..., n).
        """
        relative = compliance * inside
        return v + 0.5 * np.log1p(2.0 * relative.real + relative.real**2 + relative.imag**2)

    old = np.zeros(np.broadcast_shapes(np.shape(compliance), np.shape(amplitude)))
    inside_old = below(omega, np.broadcast_to(amplitude, old.shape))
    excess_old = excess(old, inside_old)
    new = -excess_old
    for _ in range(_ROUNDS):
        inside = below(omega, amplitude * np.exp(new))
        error = excess(new, inside)
        run, rise = new - old, error - excess_old
        slope = np.where((rise != 0.0) & (rise * run > 0.0), rise / np.where(run == 0.0, 1.0, run), 1.0)
        step = -error / slope
        if np.all(np.abs(error) <= _NEAR):
            inside = inside + (inside - inside_old) * step / np.where(run == 0.0, 1.0, run)
            break
        old, excess_old, inside_old, new = new, error, inside, new + step
    return inside / (1.0 + compliance * inside)


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """Force with a compliance in series.

    Args:
        p: parameter values by name: compliance c [m/N] in series with the bushing.
        below: force F without this effect, as a function of the displacement history.
        history: displacement over time [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Force with the effect at each sample [N or N m], (..., n).

    Notes:
        Force F [N] of the motion x - c F that reaches the bushing.

        Solved for the whole history at once. Each iteration computes the force for the motion x - c F and adds its
        difference from F, times 1/(1 + c K), harmonic by harmonic. K is measured once with a pulse; an inaccurate K
        costs iterations, not accuracy. The solution starts from K and F of the previous solution for this motion.
        Compliances in inner layers start from their solution of the previous iteration. Anderson mixing reduces the
        iterations that inner friction needs. If an iteration does not reduce the error, the next steps are halved; if
        it does, they are doubled up to the full step. The direction of inner dry friction is that of the imposed
        motion: momentary sticking is neglected.
    """
    compliance = p["compliance"]
    if not np.any(compliance):
        return below(history)
    imposed, solved, history = history.value, history.solved, history.as_driver()
    count = imposed.shape[-1]
    length = count if history.periodic else next_fast_len(count, real=True)
    inner_solved = solved.setdefault("beneath", {})  # of compliances in inner layers, such as a sleeve
    stiffness_below, estimate = solved.pop("compliance", (None, np.zeros_like(imposed)))
    if estimate.shape not in (imposed.shape[-1:], imposed.shape):
        stiffness_below, estimate = None, np.zeros_like(imposed)
    if stiffness_below is None:
        stiffness_below = _pulse_stiffness(below, history, length)
    softening = 1.0 / (1.0 + compliance * stiffness_below)
    largest = np.max(np.abs(imposed), axis=-1, keepdims=True)
    limit = 2.0 * largest  # of the motions that an iteration tries
    best = last = np.full_like(largest, np.inf)
    step_factor, idle, mixing, common = np.ones_like(largest), 0, None, np.zeros_like(imposed)
    for number in range(_ROUNDS):
        motion = np.clip(imposed - compliance * estimate, -limit, limit)
        computed = below(history.with_value(motion, inner_solved)) - common
        if number == 0 and computed.ndim > imposed.ndim:  # many models, which start from the solution of the last
            shared = computed[-1] - estimate
            is_solved = np.max(np.abs(compliance)) * np.max(np.abs(shared)) <= history.accuracy * largest
            is_solved &= np.max(np.abs(shared)) <= _SOLVED * np.max(np.abs(computed[-1]))
            common = shared * is_solved
            computed = computed - common
        residual = computed - estimate
        error = np.max(np.abs(compliance * residual), axis=-1, keepdims=True)
        change = np.fft.irfft(softening * np.fft.rfft(residual, n=length), n=length)[..., :count]
        mixing = mixing or _AndersonMixing(change.shape)
        step = mixing.step(estimate, change)
        # a step after one that reduced the error tenfold is expected to reduce it tenfold, too
        reduction = np.where((error < _FAST * last) & np.isfinite(last), _FAST, 1.0)
        # NaN counts as settled, so that one motion without a solution does not stop the others
        if not np.any(reduction * error > history.accuracy * largest) and _differences_resolved(
            estimate, reduction * residual
        ):
            estimate = estimate + step
            many = imposed.ndim > 1  # else of many models on one motion the last is kept
            latest = (stiffness_below, estimate)
            latest = latest if many else tuple(rows.reshape(-1, rows.shape[-1])[-1].copy() for rows in latest)
            poor = number >= 16  # iterations, twice the usual: K is measured anew for the next solution
            solved["compliance"] = (None if poor else latest[0], latest[1])
            return estimate
        idle = 0 if np.any(error < _NEARER * best) else idle + 1
        if idle == _IDLE:
            break
        best = np.where(error < _NEARER * best, error, best)
        step_factor, last = np.where(error < last, np.minimum(1.0, 2.0 * step_factor), 0.5 * step_factor), error
        estimate = estimate + step_factor * step
    if not history.periodic and np.any(error > 1e-3 * largest):  # less than any test resolves
        raise ModelError(
            "a rig or sleeve is too compliant to be simulated in time",
            found=f"{float(np.max(compliance)):.3g} m/N",
            expected="a rig or sleeve several times stiffer than the bushing",
        )
    return computed


def _differences_resolved(estimate: Array, residual: Array) -> bool:
    """True if an iteration for the forces of several models is accurate enough for the differences between the models.

    The differences, from which a fit computes derivatives, must be accurate to a thousandth or to rounding.

    Args:
        estimate: forces of the models after this iteration, (models, n) [N].
        residual: change of the forces that the next iteration would make, (models, n) [N].
    """
    if residual.ndim == 1:
        return True
    estimate = np.broadcast_to(estimate, residual.shape)
    spread, error = (np.max(np.abs(rows - rows[-1]), axis=-1) for rows in (estimate, residual))
    return not np.any(error > np.maximum(1e-3 * spread, 1e-13 * np.max(np.abs(estimate), axis=-1)))


class _AndersonMixing:
    """Anderson mixing (D. G. Anderson, J. ACM 12 (1965) 547), which reduces the iterations for the force.

    Keeps the last three differences between iterations of the force and of its proposed change.
    """

    def __init__(self, shape: tuple[int, ...]) -> None:
        self._changed, self._both = np.zeros((2, *shape[:-1], _REMEMBERED, shape[-1]))
        self._products = np.zeros((*shape[:-1], _REMEMBERED, _REMEMBERED))
        self._place = 0
        self._before: tuple[Array, Array] | None = None

    def step(self, estimate: Array, change: Array) -> Array:
        """Improve the change of the force that the fixed-point iteration proposes, by the previous iterations.

        Args:
            estimate: force of this iteration [N], (..., n).
            change: proposed change of this force [N], (..., n).

        Returns:
            Change to apply [N], (..., n).
        """
        before, self._before = self._before, (estimate, change)
        if before is None:
            return change
        k, self._place = self._place, (self._place + 1) % _REMEMBERED
        changed = change - before[1]
        self._changed[..., k, :], self._both[..., k, :] = changed, changed + estimate - before[0]
        products = self._products
        products[..., k, :] = products[..., :, k] = (self._changed @ changed[..., None])[..., 0]
        # above rounding, so that two differences that teach the same do no harm
        regular = 1e-12 * np.einsum("...ii->...", products)[..., None, None] + np.finfo(float).tiny
        weights = np.linalg.solve(products + regular * np.eye(_REMEMBERED), self._changed @ change[..., None])
        return np.asarray(change - (weights.mT @ self._both)[..., 0, :])


def _pulse_stiffness(below: ForceBelow, history: History, length: int) -> Array:
    """Complex stiffness [N/m] at each harmonic of a record: force over displacement of a single pulse.

    The pulse, some samples after the start, has the amplitude of the motion, but at least 1 nm. The force is relative
    to the initial force before the pulse, and to the last force after it: friction keeps a force after the pulse, which
    would otherwise appear as a stiffness at low frequencies. The real part of the result is never negative.

    Args:
        below: force without the compliance, as a function of the displacement history.
        history: displacement over time, which gives the amplitude of the pulse and the sampling.
        length: number of samples of the Fourier transform.

    Returns:
        Stiffness, (..., length // 2 + 1).
    """
    pulse = np.zeros_like(history.value)
    pulse[..., 4:5] = np.maximum(history.amplitude, 1e-9)
    answer = below(history.with_value(pulse).as_driver())
    answer = answer - np.where(np.arange(history.value.shape[-1]) < 5, answer[..., :1], answer[..., -1:])
    measured = np.fft.rfft(answer, n=length) / np.fft.rfft(pulse, n=length)
    return np.maximum(measured.real, 0.0) + 1j * measured.imag
