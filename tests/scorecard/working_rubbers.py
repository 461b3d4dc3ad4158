"""Rubbers whose laws are not those of the package, for use while the package is being improved."""

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


#: Rubbers by name.
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
