"""Stiffness from resonance tests: a mass M on a mount whose base is shaken with a sine (base excitation).

With the complex transmissibility T, acceleration of the mass over acceleration of the base, the stiffness of the mount
is K = M omega^2 T/(T - 1), and its deformation is |T - 1| times the displacement of the base. An error dT causes the
relative error dK/K = -dT/(T (T - 1)): K is accurate for large |T - 1|, from somewhat below the resonance upwards, and
inaccurate below.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bushfit.caveat import Caveat
from bushfit.errors import MeasurementError
from bushfit.reading.headers import ERRORS
from bushfit.reading.measurement import Complex, Floats, Sweep
from bushfit.reading.resonance import ResonanceTest
from bushfit.reading.stiffness import LEAST_LOSS_FACTOR

#: Largest number of points of a reduced test; chosen: some twenty are within the resonance, and a fit needs no more.
MOST_POINTS = 100
#: Relative standard error of K above which a point is omitted; chosen: such a point has no weight in a fit.
LARGEST_ERROR = 0.2
#: Smallest share of the information in a test on one side of zero loss that determines the sign of the phases.
_CLEAR_SHARE = 0.8
#: Median of the magnitude of complex scatter over the standard deviation of its parts, sqrt(2 ln 2).
_MEDIAN_TO_SIGMA = 1.1774100225154747


@dataclass(frozen=True, eq=False)
class Resonance:
    """Stiffness of a mount at the k points of a reduced resonance test, with the amplitude reached and standard errors.

    Args:
        test: measured resonance test.
        mass: moving mass on the mount [kg].
        turned: True if the file has the opposite sign of the phases; the stiffness here has positive loss.
        frequency: frequency of each point [Hz], (k,).
        amplitude: zero-to-peak deformation of the mount [m], (k,).
        stiffness: complex stiffness of the mount [N/m], (k,).
        relative_error: standard error of the real and of the imaginary part of K, relative to |K|, (k,).
        rows: number of measured rows averaged in each point, (k,).
        left_out: frequencies of the omitted points, whose relative error exceeds 20 % (LARGEST_ERROR) [Hz], (j,).
    """

    test: ResonanceTest
    mass: float
    turned: bool
    frequency: Floats
    amplitude: Floats
    stiffness: Complex
    relative_error: Floats
    rows: NDArray[np.intp]
    left_out: Floats

    @property
    def peak(self) -> tuple[float, float]:
        """Frequency of the largest measured transmissibility [Hz], and its magnitude |T| [-]."""
        index = int(np.argmax(np.abs(self.test.transmissibility)))
        return float(self.test.frequency[index]), float(abs(self.test.transmissibility[index]))

    @property
    def transmissibility(self) -> Complex:
        """Complex transmissibility of each point [-], (k,), with the sign convention of positive loss."""
        return transmissibility(self.stiffness, self.mass, self.frequency)

    @property
    def sweep(self) -> Sweep:
        """Points of the resonance test as a sweep for the fit, in which neither frequency nor amplitude is constant."""
        test, error = self.test, self.relative_error
        points = self.frequency, self.amplitude, self.stiffness
        return Sweep(test.name, test.direction, *points, source=test.source, stepped=None, relative_error=error)

    @property
    def warnings(self) -> tuple[Caveat, ...]:
        """Warnings on omitted points, the sign of the phases, and a resonance that the test did not reach."""
        warnings = []
        omitted, total = self.left_out, self.left_out.size + self.frequency.size
        if omitted.size:
            sentence = (
                f"{omitted.size} of {total} points left out, {omitted.min():.4g} to {omitted.max():.4g} Hz: the "
                f"standard error of K exceeds {100 * LARGEST_ERROR:g} % there, because mass and base "
                "move almost equally"
            )
            warnings.append(Caveat("points_left_out", sentence))
        if self.turned:
            sentence = "the phases of this file have the opposite sign: read with the sign that makes the loss positive"
            warnings.append(Caveat("phases_turned", sentence))
        frequency, largest = self.peak
        if frequency in (self.test.frequency[0], self.test.frequency[-1]):
            sentence = f"no resonance: |T| is largest, {largest:.3g}, at the end of the sweep ({frequency:.4g} Hz)"
            warnings.append(Caveat("no_resonance", sentence))
        return tuple(warnings)


def transmissibility(stiffness: Complex, mass: float, frequency: Floats) -> Complex:
    """Compute the complex transmissibility of a mass on a mount, T = K/(K - M omega^2).

    Args:
        stiffness: complex stiffness K of the mount [N/m], (n,).
        mass: moving mass M on the mount [kg].
        frequency: frequency of each point [Hz], (n,).

    Returns:
        Motion of the mass over motion of the base [-], (n,).
    """
    return stiffness / (stiffness - mass * (2.0 * np.pi * frequency) ** 2)


def shaken_response(
    stiffness: Callable[[Floats], Complex], mass: float, frequency: Floats, base_amplitude: Floats
) -> tuple[Floats, Complex]:
    """Compute the response of a mass on a mount whose stiffness depends on the amplitude X of its deformation.

    Args:
        stiffness: function that returns the complex stiffness at the frequencies [N/m], (n,), for zero-to-peak
            amplitudes of the mount's deformation [m], (n,).
        mass: moving mass on the mount [kg].
        frequency: frequency of each point [Hz], (n,).
        base_amplitude: zero-to-peak displacement of the base [m], (n,).

    Returns:
        Zero-to-peak deformation X of the mount [m] and complex transmissibility [-], (n,) each.

    Notes:
        Solves X = |T(K(X)) - 1| X_base by bisection of ln X. If several X are solutions, as in a softening resonance
        with two branches, the result is one of them.
    """
    inertia = mass * (2.0 * np.pi * frequency) ** 2

    def excess(amplitude: Floats) -> Floats:
        return amplitude * np.abs(stiffness(amplitude) - inertia) - inertia * base_amplitude

    low = high = base_amplitude
    while (above := excess(low) > 0.0).any():
        low = np.where(above, low / 2.0, low)
    while (below := excess(high) < 0.0).any():
        high = np.where(below, high * 2.0, high)
    for _ in range(50):  # halvings: a width of up to 20 in ln X then is 2e-14
        middle = np.sqrt(low * high)
        above = excess(middle) > 0.0
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    amplitude = np.sqrt(low * high)
    return amplitude, transmissibility(stiffness(amplitude), mass, frequency)


def reduce_resonance(test: ResonanceTest, mass: float) -> Resonance:
    """Reduce a resonance test to the complex stiffness of the mount over frequency and the amplitude reached.

    Args:
        test: transmissibility over frequency, at least a dozen rows.
        mass: moving mass on the mount [kg].

    Returns:
        Stiffness at the points of the test, with standard errors.

    Raises:
        MeasurementError: the phases show no loss of either sign, the storage stiffness is negative, or every point has
            an error above LARGEST_ERROR.

    Notes:
        Neighbouring rows are averaged to MOST_POINTS points by their flexibility 1/K = (1 - 1/T)/(M omega^2), to which
        an error of T contributes independently of |T - 1|. The relative standard error of T is the scatter of these
        points about a smooth curve (`transmissibility_scatter`), which includes errors common to neighbouring rows. It
        excludes errors common to all points that a smooth stiffness can explain, such as the gain of an accelerometer
        or a wrong mass.
    """
    turned = counts_phases_backwards(test)
    ratio = np.conj(test.transmissibility) if turned else test.transmissibility
    count = min(test.frequency.size, MOST_POINTS)
    starts = np.arange(count) * test.frequency.size // count
    rows = np.diff(np.append(starts, test.frequency.size))

    omega = 2.0 * np.pi * test.frequency
    deformation = np.abs(ratio - 1.0) * test.base_acceleration / omega**2
    sums = np.add.reduceat([test.frequency, deformation, (1.0 - 1.0 / ratio) / (mass * omega**2)], starts, axis=1)
    flexibility = sums[2] / rows
    frequency, amplitude = sums[:2].real / rows
    moving = flexibility != 0.0
    stiffness = np.where(moving, flexibility, 1.0 + 0j) ** -1
    thinned = transmissibility(stiffness, mass, frequency)
    error = np.full(count, np.inf)
    if np.count_nonzero(moving) >= 8:  # twice the terms of the smooth curve
        around = transmissibility_scatter(frequency[moving], amplitude[moving], thinned[moving])
        error[moving] = around / np.abs(thinned[moving] - 1.0)
    is_kept = (error <= LARGEST_ERROR) & (stiffness.real > 0.0)
    if not is_kept.any():
        expected = f"a standard error of K of at most {100 * LARGEST_ERROR:g} % somewhere"
        found = f"{100 * error.min():.3g} % at best"
        raise MeasurementError(
            **ERRORS["undetermined_stiffness"], file=test.source.file, found=found, expected=expected
        )
    points = frequency[is_kept], amplitude[is_kept], stiffness[is_kept], error[is_kept], rows[is_kept]
    return Resonance(test, mass, turned, *points, left_out=frequency[~is_kept])


def counts_phases_backwards(test: ResonanceTest) -> bool:
    """Return True if the phases of a resonance test have the opposite sign, so that the loss stiffness is negative.

    Raises:
        MeasurementError: the phases show no loss of either sign, or the storage stiffness is negative.

    Notes:
        Rows have the weight (ln |T|)^2, which is largest at the resonance and far above it, where they determine K
        well. The weight is the same if base and mass are swapped; the storage stiffness is then negative.
    """
    ratio = test.transmissibility
    flexibility = (1.0 - 1.0 / ratio) / test.frequency**2
    weight = np.log(np.abs(ratio)) ** 2
    weight /= max(float(weight.sum()), np.finfo(float).tiny)
    share = float(np.sum(weight[flexibility.imag < 0.0]))
    loss = -float(np.sum(weight * np.sin(np.angle(flexibility))))
    if max(share, 1.0 - share) < _CLEAR_SHARE or abs(loss) < LEAST_LOSS_FACTOR:
        found = f"a mean loss factor of {loss:.2g}, above zero in {100 * share:.0f} % of the points that the test "
        found += "determines"
        raise MeasurementError(**ERRORS["no_positive_loss"], file=test.source.file, found=found)
    positive = float(np.sum(weight[flexibility.real > 0.0]))
    if positive < _CLEAR_SHARE:
        found = f"a stiffness above zero in {100 * positive:.0f} % of the points that the test determines"
        raise MeasurementError(**ERRORS["negative_stiffness"], file=test.source.file, found=found)
    return loss < 0.0


def transmissibility_scatter(frequency: Floats, amplitude: Floats, ratio: Complex) -> Floats:
    """Estimate the relative error of the transmissibility at each point from the scatter of the points around it.

    Args:
        frequency: frequency of each point [Hz], (k,).
        amplitude: zero-to-peak deformation of the mount [m], (k,).
        ratio: complex transmissibility T [-], (k,).

    Returns:
        Standard deviation of the real and of the imaginary part of dT/T, (k,).

    Notes:
        1/T = 1 - M omega^2/K is linear in the flexibility 1/K. The flexibility of all points is fitted by a function
        linear in ln f and quadratic in ln X, by least squares of dT/T with Huber's weights (less weight beyond two
        standard deviations). The scatter is the median of |dT/T| about this function over the nearest 15 points. A
        stiffness with more curvature increases the estimate.
    """
    logs = [np.log(values) - np.mean(np.log(values)) for values in (frequency, amplitude)]
    terms = np.stack([np.ones_like(frequency), *logs, logs[1] ** 2], axis=1)
    design = terms * (np.abs(ratio) * frequency**2)[:, None]
    measured = (1.0 - 1.0 / ratio) * np.abs(ratio)
    weight = np.ones_like(frequency)
    for _ in range(10):  # in which the weights settle; chosen: they change by per cents after five
        root = np.sqrt(weight)
        residual = np.abs(measured - design @ np.linalg.lstsq(root[:, None] * design, root * measured, rcond=None)[0])
        sigma = np.median(residual) / _MEDIAN_TO_SIGMA
        weight = np.minimum(1.0, 2.0 * sigma / np.maximum(residual, np.finfo(float).tiny))
    nearest = np.argsort(np.abs(logs[0][:, None] - logs[0]), axis=1, kind="stable")[:, :15]
    freedom = frequency.size / (frequency.size - terms.shape[1])
    return np.median(residual[nearest], axis=1) / _MEDIAN_TO_SIGMA * np.sqrt(freedom)
