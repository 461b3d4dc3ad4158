"""Effects that the paper's model lacks and a library of laws lists, each written in time from its equation alone."""

from functools import partial

import numpy as np
from kinds import Bench, Kind, Sized, gain
from rubber_in_time import StrainHistory, log_normal_elements, sliders
from scipy.special import erf
from time_rig import SAMPLES, Array, Change, Complex, friction, harmonics, of_harmonics

LISTED: dict[str, Kind] = {}
kind = partial(Kind.into, LISTED)

#: Names of one response of the bushing and of the rig.
_FACTOR = ("stiffness_factor", "transducer_gain", "preload_stiffening")
_COMPLIANCE = ("sleeve_compliance", "rig_compliance")


def _log_uniform(bench: Bench, low: float, high: float) -> float:
    return float(np.exp(bench.random.uniform(np.log(low), np.log(high))))


def _radial(bench: Bench) -> Array:
    """1 for a radial point, 0 for an axial one, (n,)."""
    return (bench.tests.direction == 1).astype(float)


def _strain(bench: Bench) -> Array:
    """Strain amplitude of each point, (n, 1)."""
    return bench.tests.strain * bench.tests.amplitude[:, None]


def _linear(bench: Bench, modulus: Complex) -> Sized:
    """A linear branch in parallel, by its modulus at each harmonic relative to the static one."""
    stiff = 2.0 * bench.rubber.mu * modulus
    return lambda amount: Change(stress=lambda strain: harmonics(strain, amount * stiff))


def _parameters(bench: Bench, **exponents: Array) -> Sized:
    """Parameters of the rubber times exp(amount * exponent), each exponent (n, 1)."""
    return lambda amount: Change(rubber={name: np.exp(amount * value) for name, value in exponents.items()})


def _all_moduli(bench: Bench, lost: Array) -> Sized:
    """Moduli and stresses times 1 - amount * lost, (n, 1)."""
    return lambda amount: Change(rubber=dict.fromkeys(("mu", "m", "sigma_fmax"), 1.0 - amount * lost))


@kind("a dashpot acts beside the rubber", right=("viscous",))
def viscous(bench: Bench) -> Sized:
    return _linear(bench, 1j * of_harmonics(bench.tests.frequency) / bench.steps[-1])


@kind("a part of the rubber relaxes", right=("maxwell", "second_maxwell", "viscous"))
def maxwell(bench: Bench) -> Sized:
    z = 1j * of_harmonics(bench.tests.frequency) / _log_uniform(bench, 10.0, 300.0)
    return _linear(bench, z / (1.0 + z))


@kind("a second springpot acts beside the first", right=("second_springpot", "viscous"))
def second_springpot(bench: Bench) -> Sized:
    return _linear(
        bench, (1j * of_harmonics(bench.tests.frequency) / bench.steps[-1]) ** bench.random.uniform(0.45, 0.85)
    )


@kind("a spring in series limits the springpot", right=("fractional_zener",))
def fractional_zener(bench: Bench) -> Sized:
    rubber, frequency = bench.rubber, of_harmonics(bench.tests.frequency)
    w, z = (2j * np.pi * frequency) ** rubber.alpha, (1j * frequency / 25.0) ** rubber.alpha
    return lambda amount: Change(
        stress=lambda strain: harmonics(strain, -rubber.m * w * amount * z / (1.0 + amount * z))
    )


@kind("the stress grows with the cube of the strain", right=("strain_stiffening",))
def strain_stiffening(bench: Bench) -> Sized:
    scale = 2.0 * bench.rubber.mu / _strain(bench).max() ** 2
    return lambda amount: Change(stress=lambda strain: amount * scale * strain**3)


@kind("the stress grows with the fifth power of the strain", right=("fifth_power_stiffening",))
def fifth_power_stiffening(bench: Bench) -> Sized:
    scale = 2.0 * bench.rubber.mu / _strain(bench).max() ** 4
    return lambda amount: Change(stress=lambda strain: amount * scale * strain**5)


@kind("a second friction yields at smaller strains", right=("second_friction",))
def second_friction(bench: Bench) -> Sized:
    half = _log_uniform(bench, 0.02, 0.1) * bench.rubber.eps_half
    return lambda amount: Change(stress=lambda strain: friction(strain, amount * 2.0 * bench.rubber.mu * half, half))


@kind("springs with sliders of many yield strains act beside the rubber", right=("distributed_sliders", "sliders"))
def distributed_sliders(bench: Bench) -> Sized:
    step = 1.0 / (SAMPLES * bench.tests.frequency[:, None])
    moduli, yields = log_normal_elements(
        2.0 * bench.rubber.mu, _log_uniform(bench, 0.004, 0.02), bench.random.uniform(0.8, 1.4)
    )
    return lambda amount: Change(
        stress=lambda strain: sliders(StrainHistory(strain, step, periodic=True), amount * moduli, yields)
    )


@kind("the friction grows with the frequency", right=("rate_dependent_friction",))
def rate_dependent_friction(bench: Bench) -> Sized:
    return _parameters(bench, sigma_fmax=np.log(bench.tests.frequency / 25.0)[:, None])


@kind("the springpot softens with the strain", right=("coupled_breakdown",))
def coupled_breakdown(bench: Bench) -> Sized:
    return _parameters(bench, m=-np.log(_strain(bench) / 0.01))


@kind("the springpot relaxes faster at larger strains", right=("intrinsic_time",))
def intrinsic_time(bench: Bench) -> Sized:
    strain, alpha = _strain(bench) / 0.01, bench.rubber.alpha
    return lambda amount: Change(rubber={"m": (1.0 + amount * strain) ** -alpha})


@kind("the rubber softens with the power that it dissipates", right=("self_heating",))
def self_heating(bench: Bench) -> Sized:
    tests = bench.tests
    power = tests.frequency * tests.amplitude**2 * bench.clean.stiffness.imag
    return _all_moduli(bench, (power / power.max())[:, None])


@kind("a larger strain before has softened the rubber", right=("mullins_levels",), needs=("loop",))
def mullins_levels(bench: Bench) -> Sized:
    strain = _strain(bench)
    return _all_moduli(bench, erf(1.0 - (strain / np.maximum.accumulate(strain)) ** 2))


@kind("the radial tests ran with a preload that stiffens the spring", right=("elastic_preload",), needs=("both",))
def elastic_preload(bench: Bench) -> Sized:
    sign, radial = bench.sign(), _radial(bench)[:, None]
    return lambda amount: Change(rubber={"mu": 1.0 + sign * amount * radial})


@kind("the radial strain is not that of the formula", right=("strain_scale",), needs=("both",))
def strain_scale(bench: Bench) -> Sized:
    sign, radial = bench.sign(), _radial(bench)[:, None]

    def change(amount: float) -> Change:
        scale = np.exp(sign * amount * radial)
        return Change(motion=lambda asked: asked * scale, force=lambda _, force: force / scale)

    return change


@kind("the bushing or its fixture has play", right=("clearance", "fixture_play"))
def clearance(bench) -> Sized:
    smallest = bench.tests.amplitude[bench.sweeps].min()

    def change(amount: float) -> Change:
        play = min(amount, 0.9) * smallest
        return Change(motion=lambda asked: asked - np.clip(asked, -play, play))

    return change


@kind("a sleeve or a guide rubs", right=("interface_slip", "guide_friction"))
def interface_slip(bench: Bench) -> Sized:
    force = np.pi / 4.0 * float(np.min((bench.size * bench.tests.amplitude)[bench.sweeps]))
    return lambda amount: Change(
        force=lambda motion, true: (
            true + amount * force * np.sign(np.roll(motion, -1, axis=-1) - np.roll(motion, 1, axis=-1))
        )
    )


def _stop(bench: Bench, both_ways: bool) -> Sized:
    gap = bench.random.uniform(0.4, 0.9) * float(np.median(bench.tests.amplitude[bench.sweeps]))
    stiffness = float(np.median(bench.size))

    def touching(motion: Array) -> Array:
        beyond = motion - np.clip(motion, -gap, gap)
        return beyond if both_ways else np.maximum(beyond, 0.0)

    return lambda amount: Change(force=lambda motion, true: true + amount * stiffness * touching(motion))


@kind("a stop is met in both senses", right=("bump_stop",))
def bump_stop(bench: Bench) -> Sized:
    return _stop(bench, both_ways=True)


@kind("a stop is met in one sense", right=("one_sided_stop",))
def one_sided_stop(bench: Bench) -> Sized:
    return _stop(bench, both_ways=False)


@kind("the radial stiffness is not that of the formula", right=_FACTOR, needs=("both",))
def stiffness_factor(bench: Bench) -> Sized:
    sign, radial = bench.sign(), _radial(bench)
    return lambda amount: gain(1.0 + sign * amount * radial)


@kind("a sleeve or the rig gives way in series", right=_COMPLIANCE)
def compliance(bench: Bench) -> Sized:
    return lambda amount: Change(gives=lambda force: amount * force / bench.size.max())


@kind("a sleeve or a fixture gives way under radial load", right=_COMPLIANCE, needs=("both",))
def radial_compliance(bench) -> Sized:
    give = _radial(bench)[:, None] / bench.size.max()
    return lambda amount: Change(gives=lambda force: amount * give * force)


@kind("a mass moves between bushing and load cell", right=("inertia",))
def inertia(bench: Bench) -> Sized:
    omega = 2.0 * np.pi * of_harmonics(bench.tests.frequency)
    mass = float(np.min((bench.size / omega[:, 1] ** 2)[bench.sweeps]))
    return lambda amount: Change(
        force=lambda motion, true: true - harmonics(motion, (amount * mass * omega**2).astype(complex))
    )


@kind("the fixture has a resonance above the band", right=("fixture_resonance", "inertia"))
def fixture_resonance(bench) -> Sized:
    frequency = of_harmonics(bench.tests.frequency)
    own, damping = bench.random.uniform(1.3, 2.2) * bench.steps[-1], 0.03
    added = frequency**2 * own**2 / (own**2 - frequency**2 + 2j * damping * own * frequency)
    scale = float(np.min((bench.size / np.abs(added[:, 1]))[bench.sweeps]))
    return lambda amount: Change(force=lambda motion, true: true - harmonics(motion, amount * scale * added))


@kind("a charge amplifier removes what is slow from the force of the sweeps", right=("high_pass",))
def high_pass(bench: Bench) -> Sized:
    order, sweeps = of_harmonics(bench.tests.frequency) / bench.steps[0], bench.sweeps[:, None]

    def change(amount: float) -> Change:
        filtered = 1j * order / (1j * order + amount)
        return Change(force=lambda _, true: np.where(sweeps, harmonics(true, filtered), true))

    return change


@kind("the force of the sweeps is cut off at the amplifier's rails", right=("force_saturation",))
def force_saturation(bench: Bench) -> Sized:
    largest = float(np.max((bench.size * bench.tests.amplitude)[bench.sweeps]))
    sweeps = bench.sweeps[:, None]

    def change(amount: float) -> Change:
        rail = largest / (1.0 + amount)
        return Change(force=lambda _, true: np.where(sweeps, np.clip(true, -rail, rail), true))

    return change


@kind("the radial displacement is read with a wrong gain", right=("displacement_gain",), needs=("both",))
def displacement_gain(bench: Bench) -> Sized:
    sign, radial = bench.sign(), _radial(bench)[:, None]
    return lambda amount: Change(motion=lambda asked: asked * np.exp(sign * amount * radial))


@kind("the force is recorded late or early", right=("delay",))
def delay(bench: Bench) -> Sized:
    turn = -1j * bench.sign() * of_harmonics(bench.tests.frequency) / bench.steps[-1]
    return lambda amount: Change(force=lambda _, true: harmonics(true, np.exp(amount * turn)))


@kind("the amplitude reached falls with the frequency", right=("amplitude_rolloff",))
def amplitude_rolloff(bench: Bench) -> Sized:
    fall = np.square(bench.tests.frequency / 155.0)[:, None]

    def change(amount: float) -> Change:
        reached = 1.0 - np.minimum(amount * fall, 0.9)
        return Change(motion=lambda asked: asked * reached, force=lambda _, true: true / reached)

    return change


@kind("the force of the loops has another gain", right=("force_gain",), needs=("loop",))
def force_gain(bench: Bench) -> Sized:
    sign = bench.sign()
    return lambda amount: gain(1.0 + sign * amount * bench.tests.loop)


@kind("the gain drifts over the session", right=("drift",))
def drift(bench: Bench) -> Sized:
    onset, sign = _log_uniform(bench, 0.02, 1.0), bench.sign()
    crept = np.log1p(bench.tests.turn / onset) / np.log1p(1.0 / onset)
    return lambda amount: gain(1.0 + sign * amount * crept)
