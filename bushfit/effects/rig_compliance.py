"""Rig compliance: the rig gives way in series with the bushing, which is moved less than the rig imposes."""

from collections.abc import Sequence

import numpy as np
from scipy.fft import next_fast_len

from bushfit.effects.contract import Array, ForceBelow, Setting, StiffnessBelow, Value, Values
from bushfit.effects.history import History
from bushfit.errors import ModelError

#: The iterations stop when what is missing of the motion is less than this, relative to the imposed motion: rounding.
TOLERANCE = 1e-14
#: The same of a history, before a last step that counts as linear and leaves a hundredth of it.
_LAST = 1e-10
#: Most rounds of an iteration: chosen, many more than a rig takes that is stiffer than the bushing.
ROUNDS = 60
#: Share of the least that was missing so far, below which a round brought the motion nearer.
_NEARER = 0.9
#: Rounds in a row that bring it no nearer, after which it stays as it is; chosen: a slow approach needs twelve.
_IDLE = 20
#: What may be missing of the motion when all rounds are used up, relative to the imposed motion: less than any test
#: resolves.
_UNSETTLED = 1e-3
#: Rounds after which K was poor, and is measured anew for the next solution; chosen: twice the usual.
_MANY_ROUNDS = 16
#: Largest motion of the bushing that an iteration may try, relative to the imposed motion.
_LARGEST_MOTION = 2.0
#: Differences between the last rounds from which the next is foreseen; chosen: three take a third of the rounds, more
#: no less.
_REMEMBERED = 3
#: Share of all their squares that is added to each, so that two that teach the same do no harm: above rounding.
_SAME_DIRECTION = 1e-12
#: The name of its solutions.
_NAME = "compliance"
#: The name of the solutions of what gives way beneath it, as a sleeve in a rig.
_BENEATH = "beneath"
#: Sample at which the pulse stands that measures a stiffness: a few after the start, for the force before it.
_PULSE_AT = 4


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """K/(1 + c K) [N/m] with K at the amplitude X/|1 + c K| that reaches the bushing; does not act in torsion."""
    compliance = p["compliance"]
    inside = below(omega, amplitude * np.exp(_log_share(compliance, below, omega, amplitude)))
    return inside / (1.0 + compliance * inside)


def _log_share(compliance: Value, below: StiffnessBelow, omega: Array, amplitude: Array) -> Array:
    """Logarithm v of the share of the amplitude that reaches the bushing: v + ln|1 + c K(X e^v)| = 0, by secants."""

    def lost(v: Array) -> Array:
        """ln|1 + c K| at the amplitude X e^v."""
        given = compliance * below(omega, amplitude * np.exp(v))
        return 0.5 * np.log1p(2.0 * given.real + given.real**2 + given.imag**2)

    old = np.zeros(np.broadcast_shapes(np.shape(compliance), np.shape(amplitude)))
    old_excess = lost(old)
    new = -old_excess
    for _ in range(ROUNDS):
        excess = new + lost(new)
        if np.all(np.abs(excess) <= TOLERANCE):
            break
        run, rise = new - old, excess - old_excess
        slope = np.where((rise != 0.0) & (rise * run > 0.0), rise / np.where(run == 0.0, 1.0, run), 1.0)
        old, old_excess, new = new, excess, new - excess / slope
    return new


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """Force [N] of the motion x_b = x - c F(x_b) that reaches the bushing.

    Notes:
        Solved for the whole history at once. Each round computes what is missing of the motion, x - x_b - c F(x_b), and
        adds it to x_b times 1/(1 + c K), harmonic by harmonic. K is measured once with a pulse: a poor K costs rounds,
        not accuracy. So K and x_b of the last model that was asked about this motion are where the next one starts.
        What gives way beneath starts each round from its solution of the round before.
        Friction below that turns sharply would make it many rounds: so those before tell the next. Where a round does
        not bring x_b nearer, the next steps are halved. Dry friction below turns its sense with the imposed motion:
        that it sticks for a moment is neglected.
    """
    compliance = p["compliance"]
    if not np.any(compliance):
        return below(history)
    imposed, solved, history = history.value, history.solved, history.driven()
    count = imposed.shape[-1]
    length = count if history.periodic else next_fast_len(2 * count, real=True)
    beneath = solved.setdefault(_BENEATH, {})
    rigid, reached = solved.pop(_NAME, (None, imposed))
    if reached.shape not in (imposed.shape[-1:], imposed.shape):
        rigid, reached = None, imposed
    if rigid is None:
        rigid = _pulse_stiffness(below, history, length)
    yielding = 1.0 / (1.0 + compliance * rigid)
    size = np.max(np.abs(imposed), axis=-1, keepdims=True)
    felt = below(history.with_value(reached, beneath))
    last, pace, before, past = np.inf * size, np.ones_like(size), None, list[tuple[Array, Array]]()
    best, idle = last, 0
    for number in range(ROUNDS):
        missing = imposed - reached - compliance * felt
        off = np.max(np.abs(missing), axis=-1, keepdims=True)
        turned = yielding * np.fft.rfft(missing, n=length)
        if np.all(off <= _LAST * size):
            many = imposed.ndim > 1  # else of many models on one motion the last is kept
            kept = [each if many else each.reshape(-1, each.shape[-1])[-1] for each in (rigid, reached)]
            solved[_NAME] = (kept[0] if number < _MANY_ROUNDS else None, kept[1])
            return felt + np.fft.irfft(rigid * turned, n=length)[..., :count]
        idle = 0 if np.any((off < _NEARER * best) & (off > _LAST * size)) else idle + 1
        if idle == _IDLE:
            break
        best = np.where(off < _NEARER * best, off, best)
        pace, last = np.where(off < last, pace, 0.5 * pace), off
        change = np.fft.irfft(turned, n=length)[..., :count]
        if before is not None:
            changed = change - before[1]
            past = [*past[1 - _REMEMBERED :], (changed, changed + reached - before[0])]
        before = reached, change
        reached = reached + pace * (change - _foreseen(past, change))
        reached = np.clip(reached, -_LARGEST_MOTION * size, _LARGEST_MOTION * size)
        felt = below(history.with_value(reached, beneath))
    if not history.periodic and np.any(off > _UNSETTLED * size):
        raise ModelError(
            "the rig gives way too much to be followed through time",
            place="rig_compliance.compliance",
            found=f"{float(np.max(compliance)):.3g} m/N",
            expected="a rig several times stiffer than the bushing",
        )
    return felt


def _foreseen(past: Sequence[tuple[Array, Array]], change: Array) -> Array | float:
    """What the last rounds teach of the next change (D. G. Anderson, J. ACM 12 (1965) 547): the combination of their
    differences that takes most off this one, (..., n).

    Args:
        past: by how much the change differed from one round to the next, (..., n), and that with the motion's
            difference.
    """
    if not past:
        return 0.0
    changed = np.stack([each for each, _ in past], axis=-2)
    normal = changed @ changed.mT
    little = _SAME_DIRECTION * np.einsum("...ii->...", normal)[..., None, None] + np.finfo(float).tiny
    weights = np.linalg.solve(normal + little * np.eye(len(past)), changed @ change[..., None])
    return sum(weights[..., k, :] * both for k, (_, both) in enumerate(past))


def _pulse_stiffness(below: ForceBelow, history: History, length: int) -> Array:
    """Complex stiffness [N/m] at each harmonic of `length` samples: force over displacement of a single pulse.

    The pulse is as high as the amplitude of the motion. Its force counts from the one before it, to which friction does
    not let it return; the real part is never negative.
    """
    pulse = np.zeros(history.value.shape)
    pulse[..., _PULSE_AT : _PULSE_AT + 1] = history.amplitude
    answer = below(history.with_value(pulse).driven())
    measured = np.fft.rfft(answer - answer[..., :1], n=length) / np.fft.rfft(pulse, n=length)
    return np.maximum(measured.real, 0.0) + 1j * measured.imag
