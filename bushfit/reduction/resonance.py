"""Stiffness from resonance tests: a mass M on a mount whose base is shaken with a sine (base excitation).

With the complex transmissibility T, acceleration of the mass over that of the base, the mount's stiffness is
K = M omega^2 T/(T - 1), and its deformation |T - 1| times the base's displacement. An error dT makes the relative error
dK/K = dT/(T (T - 1)): K is known well where |T - 1| is large, from somewhat below the resonance on, and badly below.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bushfit.errors import MeasurementError
from bushfit.reading.measurement import Complex, Floats, Sweep
from bushfit.reading.resonance import ResonanceTest
from bushfit.reading.stiffness import LEAST_LOSS_FACTOR

#: Points that a test is thinned to; chosen: some twenty lie within the resonance, and a fit has no use for more.
MOST_POINTS = 100
#: Relative standard error of K beyond which a point is left out; chosen: it tells no fit anything.
LARGEST_ERROR = 0.2
#: Share of the information in a test that has to lie on one side of zero loss, for the sign of the phases to show.
_CLEAR_SHARE = 0.8
#: Median of the magnitude of complex scatter over the standard deviation of its parts, sqrt(2 ln 2).
_MEDIAN_TO_SIGMA = 1.1774100225154747


@dataclass(frozen=True, eq=False)
class Resonance:
    """Points of a reduced resonance test, each with the amplitude that it reached and its standard error.

    Args:
        mass: that moves on the mount [kg].
        turned: whether the test counts phases the other way (loss is positive here).
        frequency: [Hz], (k,).
        amplitude: of the mount's deformation, zero-to-peak [m], (k,).
        stiffness: complex [N/m], (k,).
        relative_error: standard deviation of the real and of the imaginary part of K, relative to |K|, (k,).
        rows: number of rows that each point is the mean of, (k,).
        left_out: frequencies of points whose error is beyond LARGEST_ERROR [Hz], (j,).
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
        """Frequency of the largest transmissibility [Hz], and this |T|."""
        index = int(np.argmax(np.abs(self.test.transmissibility)))
        return float(self.test.frequency[index]), float(abs(self.test.transmissibility[index]))

    @property
    def transmissibility(self) -> Complex:
        """Complex T of each point [-], (k,), with loss that lags behind."""
        return transmissibility(self.stiffness, self.mass, self.frequency)

    @property
    def sweep(self) -> Sweep:
        """The points as a sweep in which neither frequency nor amplitude is held."""
        test, error = self.test, self.relative_error
        points = self.frequency, self.amplitude, self.stiffness
        return Sweep(test.name, test.direction, *points, source=test.source, stepped=None, relative_error=error)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences on points left out, the sign of the phases, and a resonance that was not reached."""
        sentences = []
        omitted, total = self.left_out, self.left_out.size + self.frequency.size
        if omitted.size:
            sentences.append(
                f"{omitted.size} of {total} points left out, {omitted.min():.4g} to {omitted.max():.4g} Hz: the "
                f"standard error of K exceeds {100 * LARGEST_ERROR:g} % there, because the mass moves almost as "
                "the base does"
            )
        if self.turned:
            sentences.append(
                "the phases of this file have the opposite sign: read with the sign that makes the loss positive"
            )
        frequency, largest = self.peak
        if frequency in (self.test.frequency[0], self.test.frequency[-1]):
            sentences.append(
                f"no resonance: |T| is largest, {largest:.3g}, at the end of the sweep ({frequency:.4g} Hz)"
            )
        return tuple(sentences)


def transmissibility(stiffness: Complex, mass: float, frequency: Floats) -> Complex:
    """Complex transmissibility of a mass on a mount, T = K/(K - M omega^2).

    Args:
        stiffness: complex K of the mount [N/m], (n,).
        mass: M [kg].
        frequency: [Hz], (n,).

    Returns:
        Motion of the mass over that of the base [-], (n,).
    """
    return stiffness / (stiffness - mass * (2.0 * np.pi * frequency) ** 2)


def response(
    stiffness: Callable[[Floats], Complex], mass: float, frequency: Floats, base_amplitude: Floats
) -> tuple[Floats, Complex]:
    """Response of a mass on a mount whose stiffness depends on its amplitude X.

    Args:
        stiffness: complex K [N/m], (n,), at the frequencies for zero-to-peak amplitudes of the mount [m], (n,).
        mass: that moves on the mount [kg].
        frequency: [Hz], (n,).
        base_amplitude: displacement of the base, zero-to-peak [m], (n,).

    Returns:
        Amplitude X [m] and complex transmissibility [-], (n,) each.

    Notes:
        Solves X = |T(K(X)) - 1| X_base by halving an interval of ln X. If several X are solutions, as with
        two branches of a softening resonance, the result is one of them.
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
    """Reduce a resonance test to stiffness over frequency and the amplitude reached.

    Args:
        test: at least a dozen rows.
        mass: that moves on the mount [kg].

    Returns:
        Points with their standard errors.

    Raises:
        MeasurementError: phases that show no loss of either sign, a storage stiffness below zero, or no point with an
            error within LARGEST_ERROR.

    Notes:
        Neighbouring rows are averaged to MOST_POINTS points by their flexibility 1/K = (1 - 1/T)/(M omega^2), to which
        an error of T contributes independently of |T - 1|. The relative standard error of T is the scatter of these
        points about a smooth curve (`transmissibility_scatter`), which includes errors common to neighbouring rows. It
        includes an error common to all points, such as the gain of an accelerometer, only where no smooth stiffness
        explains it, and never that of a wrong mass.
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
        raise MeasurementError(
            "no point of this test determines the stiffness",
            file=test.source.file,
            found=f"{100 * error.min():.3g} % at best",
            expected=f"a standard error of K of at most {100 * LARGEST_ERROR:g} % somewhere",
            hint="sweep through the resonance, or look at the accelerations: they scatter",
        )
    return Resonance(
        test,
        mass,
        turned,
        frequency[is_kept],
        amplitude[is_kept],
        stiffness[is_kept],
        error[is_kept],
        rows[is_kept],
        frequency[~is_kept],
    )


def counts_phases_backwards(test: ResonanceTest) -> bool:
    """Return True if the phases count the other way: with them, the loss is below zero.

    Raises:
        MeasurementError: phases that show no loss of either sign, or a storage stiffness below zero.

    Notes:
        Rows have the weight (ln |T|)^2: most at the resonance and far above it, where they determine K well, and the
        same if base and mass are swapped, which then shows as a stiffness below zero.
    """
    ratio = test.transmissibility
    flexibility = (1.0 - 1.0 / ratio) / test.frequency**2
    weight = np.log(np.abs(ratio)) ** 2
    weight /= max(float(weight.sum()), np.finfo(float).tiny)
    share = float(np.sum(weight[flexibility.imag < 0.0]))
    loss = -float(np.sum(weight * np.sin(np.angle(flexibility))))
    if max(share, 1.0 - share) < _CLEAR_SHARE or abs(loss) < LEAST_LOSS_FACTOR:
        raise MeasurementError(
            "the phases show no loss with either sign",
            file=test.source.file,
            found=f"a mean loss factor of {loss:.2g}, above zero in {100 * share:.0f} % of the points that the "
            "test determines",
            expected="a mass that lags behind the base through the whole resonance",
            hint="check the unit of the phases, deg or rad, and that they are those of base and mass",
        )
    positive = float(np.sum(weight[flexibility.real > 0.0]))
    if positive < _CLEAR_SHARE:
        raise MeasurementError(
            "the stiffness is negative",
            file=test.source.file,
            found=f"a stiffness above zero in {100 * positive:.0f} % of the points that the test determines",
            expected="a mass that moves with the base at low frequency, and more around the resonance",
            hint="check that base and mass are not swapped, and that no phase is off by 180 deg",
        )
    return loss < 0.0


def transmissibility_scatter(frequency: Floats, amplitude: Floats, ratio: Complex) -> Floats:
    """Standard deviation of the relative error of the transmissibility at each point, by the points around it.

    Args:
        frequency: [Hz], (k,).
        amplitude: of the mount's deformation [m], (k,).
        ratio: complex transmissibility T, (k,).

    Returns:
        Standard deviation of the real and of the imaginary part of dT/T, (k,).

    Notes:
        1/T = 1 - M omega^2/K is linear in the flexibility 1/K. That is fitted over all points by a function linear in
        ln f and quadratic in ln X, by least squares of dT/T with Huber's weights (a point pulls less from two standard
        deviations on); the scatter is the median of |dT/T| about it over the nearest 15 points. A true
        stiffness that bends more adds to the scatter.
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
