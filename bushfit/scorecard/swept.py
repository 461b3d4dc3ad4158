"""Hidden campaigns of amplitude sweeps: clean tests off the rig, in which nothing is to be found."""

from __future__ import annotations

import numpy as np

from bushfit.campaign.schema import SimulatedLoop, SimulatedSweep, SimulateSettings
from bushfit.geometry import Direction
from bushfit.scorecard.hidden import Sealed, random_bushing
from bushfit.simulation import Simulated, measure, undisturbed

#: Amplitudes of a run, from a hundredth of the largest strain on.
_AMPLITUDES = np.geomspace(0.01, 1.0, 15)
#: Least and largest strain of the largest amplitude; chosen: several times eps_half of most rubbers.
_STRAIN = (0.03, 0.08)
#: Least and largest lowest frequency, and highest frequency [Hz], of the three of a campaign.
_FREQUENCIES = ((1.0, 10.0), (50.0, 150.0))
#: Least and largest scatter of a point, relative to |K|.
_NOISE = (0.002, 0.006)
#: Least and largest scatter of the amplitude reached, relative.
_REACHED = (0.0, 0.03)
#: Gain and phase errors [rad] that a run shares in half of the campaigns; none in the others.
_SHARED = (0.004, float(np.radians(0.2)))
#: Share of the campaigns with a loop.
_WITH_LOOP = 0.5
#: Share of the campaigns with a second direction.
_WITH_RADIAL = 0.7
#: Scatter of a loop's force, of half its range.
_FORCE_NOISE = 3e-3
#: Scatter of a loop's displacement, of its amplitude.
_DISPLACEMENT_NOISE = 1e-4
#: Time steps in a cycle of the rig; chosen for time: within 0.1 % of the closed form.
_STEPS = 512


def swept_campaign(seed: int) -> tuple[Simulated, Sealed]:
    """One clean campaign of amplitude sweeps at three frequencies, one to three repeats; the same seed makes the same.

    The amplitudes are as the rig reached them; half of the campaigns share gain and phase errors in a run.
    """
    random = np.random.default_rng([seed, 91])
    plain = random_bushing(random)
    strain, shared = random.uniform(*_STRAIN), random.random() < 0.5
    low, high = (random.uniform(*ends) for ends in _FREQUENCIES)
    frequencies = tuple(float(f) for f in np.round(np.geomspace(low, high, 3), 1))
    directions = (Direction.AXIAL, Direction.RADIAL)[: 1 + (random.random() < _WITH_RADIAL)]
    largest = {direction: strain / plain.unit_strain(direction) for direction in directions}
    loop = SimulatedLoop(Direction.AXIAL, amplitude=largest[Direction.AXIAL], frequency=0.1)
    plan = SimulateSettings(
        seed=seed,
        repeats=int(random.integers(1, 4)),
        noise=random.uniform(*_NOISE),
        force_noise=_FORCE_NOISE,
        displacement_noise=_DISPLACEMENT_NOISE,
        gain_error=shared * _SHARED[0],
        phase_error=shared * _SHARED[1],
        loops=(loop,) if random.random() < _WITH_LOOP else (),
        sweeps=tuple(
            SimulatedSweep(
                direction,
                tuple((_AMPLITUDES * largest[direction]).tolist()),
                frequencies,
                stepped="amplitude",
                reached=random.uniform(*_REACHED),
            )
            for direction in directions
        ),
    )
    sealed = Sealed((), "", (), dict(plain.values), 0.0, shared, seed)
    return measure(undisturbed(plain, plan, steps_per_cycle=_STEPS), plan), sealed
