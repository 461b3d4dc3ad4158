"""Rubbers whose laws are not those of the package."""

import numpy as np
from numpy.random import Generator
from rubber_in_time import (
    Array,
    StrainHistory,
    StressLaw,
    fractional_derivative,
    log_normal_elements,
    relax,
    relax_in_steps,
    sliders,
)


def log_normal_sliders(random: Generator) -> StressLaw:
    """Kelvin-Voigt power law with 40 sliders of log-normal yield strains.

    Iwan 1967, J. Appl. Mech. 34, 612; power law: Nutting 1921, J. Franklin Inst. 191, 679.
    """
    shear, viscous, order = random.uniform(0.5e6, 0.9e6), random.uniform(0.25e6, 0.5e6), random.uniform(0.12, 0.25)
    elements = log_normal_elements(random.uniform(0.3e6, 0.9e6), random.uniform(0.004, 0.02), random.uniform(0.8, 1.4))
    return lambda history: (
        2.0 * shear * history.strain + viscous * fractional_derivative(history, order) + sliders(history, *elements)
    )


def two_springpots(random: Generator) -> StressLaw:
    """Two fractional elements of different order with three sliders.

    Koeller 1984, J. Appl. Mech. 51, 299; sliders: Besseling 1958, J. Appl. Mech. 25, 529.
    """
    shear = random.uniform(0.6e6, 1.1e6)
    slow, fast = random.uniform(0.15e6, 0.35e6), random.uniform(2e3, 6e3)
    slow_order, fast_order = random.uniform(0.08, 0.16), random.uniform(0.5, 0.7)
    scale = random.uniform(0.006, 0.015)
    modulus, yield_strain = random.uniform(0.3e6, 0.7e6) * np.array([0.5, 0.3, 0.2]), scale * np.array([0.3, 1.0, 3.0])
    return lambda history: (
        2.0 * shear * history.strain
        + slow * fractional_derivative(history, slow_order)
        + fast * fractional_derivative(history, fast_order)
        + sliders(history, modulus, yield_strain)
    )


def filler_breakdown(random: Generator) -> StressLaw:
    """Filler network whose bonds break with strain and strain rate and re-form (thixotropy).

    Kraus 1984, J. Appl. Polym. Sci.: Appl. Polym. Symp. 39, 75, with the kinetics written in time; rate-dependent
    breaking: Mewis and Wagner 2009, Adv. Colloid Interface Sci. 147-148, 214. The intact share N of the bonds obeys
    dN/dt = k (1 - N) - k |2 e/e_c|^p (|de/dt|/r)^q N.
    """
    shear, network, order = random.uniform(0.5e6, 0.8e6), random.uniform(0.6e6, 1.0e6), random.uniform(0.08, 0.14)
    critical, power = random.uniform(0.03, 0.06), random.uniform(0.9, 1.2)
    speed, rate_power, reference = random.uniform(0.5, 2.0), random.uniform(0.08, 0.16), 1.0

    def stress(history: StrainHistory) -> Array:
        breaking = np.abs(2.0 * history.strain / critical) ** power * (np.abs(history.rate) / reference) ** rate_power
        rate = speed * (1.0 + breaking)
        intact = relax(history, np.full_like(rate, speed), rate, start=1.0)
        return 2.0 * shear * history.strain + intact * network * fractional_derivative(history, order)

    return stress


def stiffening_with_dry_friction(random: Generator) -> StressLaw:
    """Yeoh's elastic law in simple shear with Dahl's friction and a power law.

    Yeoh 1993, Rubber Chem. Technol. 66, 754; Dahl 1968, The Aerospace Corporation, TOR-0158(3107-18)-1: an exponential
    approach to the sliding stress, ds/de = k (1 - sgn(de/dt) s/s_c).
    """
    shear, softening, stiffening = random.uniform(0.7e6, 1.1e6), random.uniform(5.0, 30.0), random.uniform(3e3, 9e3)
    viscous, order = random.uniform(0.15e6, 0.35e6), random.uniform(0.15, 0.25)
    sliding, initial = random.uniform(6e3, 1.4e4), random.uniform(0.5e6, 1.0e6)

    def friction(history: StrainHistory) -> Array:
        before = history.strain[:, -1:] if history.periodic else np.zeros((history.strain.shape[0], 1))
        change = np.diff(history.strain, axis=1, prepend=before)
        decay = initial / sliding * np.abs(change) + 1e-12  # along the path: ds = k de - (k/s_c) s |de|
        return relax_in_steps(initial * change, decay, periodic=history.periodic)

    def stress(history: StrainHistory) -> Array:
        strain = history.strain
        elastic = 2.0 * shear * strain * (1.0 - softening * strain**2 + stiffening * strain**4)
        return elastic + viscous * fractional_derivative(history, order) + friction(history)

    return stress


def rate_dependent_sliders(random: Generator) -> StressLaw:
    """Sliders whose yield stress grows with the logarithm of the strain rate, with a power law.

    Eyring 1936, J. Chem. Phys. 4, 283: the yield stress is multiplied by 1 + c asinh(|de/dt|/r).
    """
    shear, viscous, order = random.uniform(0.5e6, 0.9e6), random.uniform(0.15e6, 0.35e6), random.uniform(0.12, 0.2)
    elements = log_normal_elements(
        random.uniform(0.4e6, 0.8e6), random.uniform(0.004, 0.01), random.uniform(0.7, 1.2), 15
    )
    growth, reference = random.uniform(0.06, 0.15), random.uniform(0.01, 0.05)

    def stress(history: StrainHistory) -> Array:
        factor = 1.0 + growth * np.arcsinh(np.abs(history.rate) / reference)
        linear = 2.0 * shear * history.strain + viscous * fractional_derivative(history, order)
        return linear + sliders(history, *elements, factor=factor)

    return stress


#: Rubbers by name, for use while the package is being improved.
WORKING_RUBBERS = {
    make.__name__: make
    for make in (
        log_normal_sliders,
        two_springpots,
        filler_breakdown,
        stiffening_with_dry_friction,
        rate_dependent_sliders,
    )
}


def intrinsic_time(random: Generator) -> StressLaw:
    """Maxwell elements on an intrinsic time scale that runs faster in motion.

    Lion and Kardelky 2004, Int. J. Plasticity 20, 1313; Hoefer and Lion 2009, J. Mech. Phys. Solids 57, 500:
    ds/dt = 2 G de/dt - (1 + d q) s/tau, dq/dt = (|de/dt| - q)/lambda.
    """
    shear, order = random.uniform(0.6e6, 1.0e6), random.uniform(0.1, 0.18)
    times = np.geomspace(2e-4, 200.0, 13)
    moduli = random.uniform(0.15e6, 0.3e6) * (times / 0.01) ** -order * 0.5
    speeding, memory = random.uniform(3.0, 12.0), random.uniform(2.0, 10.0)

    def stress(history: StrainHistory) -> Array:
        rate = history.rate
        process = relax(history, np.abs(rate) / memory, np.full_like(rate, 1.0 / memory))
        speed = 1.0 + speeding * process
        arms = (relax(history, 2.0 * modulus * rate, speed / time) for modulus, time in zip(moduli, times, strict=True))
        return np.asarray(2.0 * shear * history.strain + sum(arms))

    return stress


def bouc_wen(random: Generator) -> StressLaw:
    """Smooth hysteresis of Bouc and Wen with a power law.

    Bouc 1967, Proc. 4th Conf. Nonlinear Oscillation, 315; Wen 1976, J. Eng. Mech. Div. 102, 249:
    dz/de = 1 - |z|^n (b sgn(z de) + 1 - b), z = stress over its limit, strain over its scale.
    """
    shear, viscous, order = random.uniform(0.6e6, 1.0e6), random.uniform(0.2e6, 0.4e6), random.uniform(0.12, 0.22)
    limit, scale = random.uniform(6e3, 1.4e4), random.uniform(0.008, 0.02)
    power, share = random.uniform(0.7, 1.5), random.uniform(0.55, 0.75)

    def hysteresis(history: StrainHistory) -> Array:
        strain = history.strain / scale
        before = strain[:, -1:] if history.periodic else np.zeros((strain.shape[0], 1))
        change = np.diff(strain, axis=1, prepend=before)

        def slope(z: Array, sense: Array) -> Array:
            return np.asarray(1.0 - np.abs(z) ** power * (share * np.sign(z * sense) + 1.0 - share))

        z, values = np.zeros(strain.shape[0]), np.empty_like(strain)
        for _ in range(6 if history.periodic else 1):
            for sample in range(strain.shape[1]):
                step = change[:, sample]
                middle = z + 0.5 * step * slope(z, step)
                z = z + step * slope(middle, step)
                values[:, sample] = z
        return values

    return lambda history: (
        2.0 * shear * history.strain + viscous * fractional_derivative(history, order) + limit * hysteresis(history)
    )


def uniform_sliders(random: Generator) -> StressLaw:
    """Sliders whose yield strains are distributed uniformly, and a Zener element of fractional order.

    Iwan 1966, J. Appl. Mech. 33, 893; fractional Zener: Pritz 1996, J. Sound Vib. 195, 103.
    """
    shear, friction = random.uniform(0.7e6, 1.1e6), random.uniform(0.25e6, 0.6e6)
    width = random.uniform(0.02, 0.06)
    yield_strain = width * (np.arange(30) + 0.5) / 30
    modulus = np.full(30, friction / 30)
    glassy, order, time = random.uniform(1.5e6, 4e6), random.uniform(0.3, 0.45), random.uniform(2e-5, 2e-4)

    def relaxing(history: StrainHistory) -> Array:
        """Stress of a spring in series with a springpot, by the harmonics of the strain or its zero-padded spectrum."""
        count = history.strain.shape[1]
        size = count if history.periodic else 2 * count
        omega = 2.0 * np.pi * np.arange(size // 2 + 1) / (size * history.step)
        z = (1j * omega * time) ** order
        return np.fft.irfft(glassy * z / (1.0 + z) * np.fft.rfft(history.strain, size), size)[:, :count]

    return lambda history: 2.0 * shear * history.strain + relaxing(history) + sliders(history, modulus, yield_strain)


def softening_prony_series(random: Generator) -> StressLaw:
    """Prony series whose moduli fall with the largest strain of the cycle.

    Prony series: Wiechert 1893, Ann. Phys. 286, 335; fall of the moduli with strain: Ulmer 1996, Rubber Chem. Technol.
    69, 15. G_i = G_i0/(1 + (2 e/e_i)^p), with e_i rising from the slow to the fast elements.
    """
    shear = random.uniform(0.6e6, 1.0e6)
    times = np.geomspace(3e-4, 30.0, 9)
    moduli = random.uniform(0.08e6, 0.16e6) * np.geomspace(1.4, 0.7, 9)
    critical = random.uniform(0.02, 0.05) * np.geomspace(2.0, 0.5, 9)
    power = random.uniform(0.7, 1.1)

    def stress(history: StrainHistory) -> Array:
        rate, largest = history.rate, 2.0 * history.largest
        arms = (
            relax(history, 2.0 * modulus * rate, np.full_like(rate, 1.0 / time)) / (1.0 + (largest / strain) ** power)
            for modulus, time, strain in zip(moduli, times, critical, strict=True)
        )
        return np.asarray(2.0 * shear * history.strain + sum(arms))

    return stress


def process_dependent_viscosity(random: Generator) -> StressLaw:
    """Maxwell elements whose viscosity falls with the stress that they carry, and a power law.

    Haupt and Sedlan 2001, Arch. Appl. Mech. 71, 89: viscoplastic overstress with process-dependent viscosity; here
    ds/dt = 2 G de/dt - s/tau (1 + (|e|/e_c)^2), on five relaxation times.
    """
    shear, viscous, order = random.uniform(0.6e6, 1.0e6), random.uniform(0.15e6, 0.3e6), random.uniform(0.1, 0.2)
    times = np.geomspace(0.02, 500.0, 5)
    moduli = random.uniform(0.05e6, 0.12e6) * np.ones(5)
    critical = random.uniform(0.001, 0.004)

    def stress(history: StrainHistory) -> Array:
        speed = 1.0 + (history.largest / critical) ** 2
        rate = history.rate
        arms = (relax(history, 2.0 * modulus * rate, speed / time) for modulus, time in zip(moduli, times, strict=True))
        return np.asarray(2.0 * shear * history.strain + viscous * fractional_derivative(history, order) + sum(arms))

    return stress


#: Rubbers that are held back: no result on them is looked at while the package is being improved.
HELD_BACK_RUBBERS = {
    make.__name__: make
    for make in (intrinsic_time, bouc_wen, uniform_sliders, softening_prony_series, process_dependent_viscosity)
}
