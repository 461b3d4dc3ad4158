"""Hidden campaigns with a mistake in the record: clean tests off the rig, of which a file says something else.

How a mistake is made is written here, how it is mended in `effects.mistakes`: the one is no use of the other.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.random import Generator

from bushfit.effects.mistakes import MISTAKES, Mistake, labelled, other_direction
from bushfit.geometry import ROTATION, Direction, Place
from bushfit.reading.measurement import Complex, Floats, Loop, Sweep
from bushfit.simulation.measured import Simulated
from cards.hidden import Sealed, hidden_campaign


def _with_loss(stiffness: Complex, loss: Floats) -> Complex:
    """The same |K| beside another loss factor, as a file with these two columns is read."""
    return np.asarray(np.abs(stiffness) * (1.0 + 1j * loss) / np.abs(1.0 + 1j * loss))


#: The complex stiffness that is read from a file with the mistake, by that which was measured.
_STATED: dict[str, Callable[[Complex], Complex]] = {
    "phase_in_radians": lambda k: np.abs(k) * np.exp(1j * np.radians(np.angle(k))),
    "complement": lambda k: np.abs(k) * np.exp(1j * (np.pi / 2.0 - np.angle(k))),
    "loss_in_per_cent": lambda k: _with_loss(k, 100.0 * k.imag / k.real),
    "loss_as_ratio": lambda k: _with_loss(k, 0.01 * k.imag / k.real),
    "sin_delta": lambda k: _with_loss(k, k.imag / np.abs(k)),
    "storage_for_magnitude": lambda k: k * k.real / np.abs(k),
    "magnitude_for_storage": lambda k: np.abs(k) + 1j * k.imag,
}


def mistaken_campaign(seed: int, name: str) -> tuple[Simulated, Sealed]:
    """One clean hidden campaign with a mistake of that name in one test, or in all of a kind; the same seed, the same.

    A mistake that only a test of rotation can have is made in one whose second direction is torsion.
    """
    mistake, random = MISTAKES[name], np.random.default_rng([seed, 11])
    turns = mistake.motion is ROTATION
    second = Direction.TORSION if turns else Direction.RADIAL
    clean, sealed = hidden_campaign(seed, (), directions=(Direction.AXIAL, second))
    if not mistake.kinds:
        bushing = clean.truth.bushing
        assert bushing is not None  # hidden campaigns have one
        share = 1.0 / mistake.displacement
        stated = replace(bushing, inner_radius=share * bushing.inner_radius, outer_radius=share * bushing.outer_radius)
        truth = replace(clean.truth, bushing=stated)
        return replace(clean, truth=truth), replace(sealed, hidden=(name,))
    tests = _chosen(mistake, [*clean.loops, *clean.sweeps], random)
    simulated = replace(
        clean,
        loops=tuple(_stated_loop(mistake, loop) if loop in tests else loop for loop in clean.loops),
        sweeps=tuple(_stated_sweep(mistake, sweep) if sweep in tests else sweep for sweep in clean.sweeps),
    )
    return simulated, replace(sealed, hidden=tuple(labelled(name, test.name) for test in tests))


def _chosen(mistake: Mistake, tests: Sequence[Loop | Sweep], random: Generator) -> list[Loop | Sweep]:
    """One of the tests in which it can be made, or all of its kind."""
    possible = [
        test
        for test in tests
        if ("loop" if isinstance(test, Loop) else "sweep") in mistake.kinds
        and mistake.motion in (None, test.direction.motion)
    ]
    one = possible[int(random.integers(len(possible)))]
    return [one] if random.random() < 0.5 else [test for test in possible if type(test) is type(one)]


def _stated_loop(mistake: Mistake, loop: Loop) -> Loop:
    return replace(
        loop,
        direction=_stated_direction(mistake, loop),
        time=loop.time / mistake.time,
        displacement=loop.displacement / mistake.displacement,
        force=loop.force / mistake.force,
    )


def _stated_sweep(mistake: Mistake, sweep: Sweep) -> Sweep:
    made = _STATED.get(mistake.name)
    return replace(
        sweep,
        direction=_stated_direction(mistake, sweep),
        amplitude=sweep.amplitude / mistake.displacement,
        stiffness=made(sweep.stiffness) if made else sweep.stiffness / mistake.force,
    )


def _stated_direction(mistake: Mistake, test: Loop | Sweep) -> Place:
    """The direction that the campaign states."""
    return (other_direction(test.direction) if mistake.swaps else None) or test.direction
