"""Mean misfit of one line of a sweep over its repeats."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bushfit.effects.contract import Array
from bushfit.fitting.measured_sweep import MeasuredSweep
from bushfit.fitting.measured_test import shown_amplitude
from bushfit.fitting.repeats import to_unit_interval
from bushfit.geometry import Place
from bushfit.model.model import Model
from bushfit.reading.measurement import Stepped
from bushfit.reading.preload import Preload, add_preload

#: Degree of the Legendre polynomials, in the logarithm of the stepped quantity, that represent smooth misfit.
_SMOOTH_DEGREE = 3


@dataclass(frozen=True, eq=False)
class LineMisfit:
    """Mean misfit of one line of a sweep (the runs at one held amplitude or frequency) over its repeats.

    Args:
        name: name of the test.
        direction: direction or specimen of the test.
        preload: preload of the test; None if it is unknown.
        stepped: quantity that varies along the line, "frequency" or "amplitude"; None if neither is held.
        frequency: frequency of each point [Hz], (n,).
        amplitude: zero-to-peak amplitude of each point [m or rad], (n,).
        misfit: complex relative difference K_measured/K_model - 1 of each point, averaged over the repeats, (n,).
        noise: standard deviation of the relative gain and of the phase [rad] of one mean value, (2,).
    """

    name: str
    direction: Place
    preload: Preload | None
    stepped: Stepped | None
    frequency: Array
    amplitude: Array
    misfit: Array
    noise: Array

    @property
    def step(self) -> Array:
        """Frequency [Hz] or amplitude [m or rad] of each point of the line, whichever changes along it, (n,)."""
        return self.amplitude if self.stepped == "amplitude" else self.frequency

    @property
    def label(self) -> str:
        """Text of the held amplitude or frequency and preload, "0.1 mm" or "10 Hz"; else the name of the test."""
        held = f"{self.frequency[0]:.4g} Hz" if self.stepped else self.name
        if self.stepped == "frequency":
            held = shown_amplitude(self.direction, float(self.amplitude[0]))
        return add_preload(held, self.preload, self.direction)

    @cached_property
    def smooth(self) -> Array:
        """Smooth part of `misfit` (K_measured/K_model - 1): a polynomial in the log of `step`, complex (n,)."""
        x = np.log(self.step)
        basis = np.polynomial.legendre.legvander(to_unit_interval(x), min(_SMOOTH_DEGREE, np.unique(x).size - 1))
        return basis @ np.linalg.lstsq(basis.astype(complex), self.misfit, rcond=None)[0]


def line_misfits(sweep: MeasuredSweep, model: Model) -> Iterator[LineMisfit]:
    """Compare a model with each line of a sweep: the runs at one held amplitude or frequency.

    Yields:
        Mean misfit along a line, over its repeats.
    """
    ratio = sweep.measured / sweep.stiffness(model) - 1.0
    for held_value in np.unique(sweep.held_value):
        mask = sweep.held_value == held_value
        _, first, index = np.unique(sweep.step[mask], return_index=True, return_inverse=True)
        counts = np.bincount(index)
        mean = (np.bincount(index, ratio[mask].real) + 1j * np.bincount(index, ratio[mask].imag)) / counts
        variance = np.square(sweep.noise.random[sweep.name, float(held_value)]) + np.square(sweep.noise.shared)
        noise = np.sqrt(variance / np.median(counts) + np.square(sweep.noise.level))
        frequency, amplitude = (values[mask][first] for values in (sweep.frequency, sweep.amplitude))
        held = sweep.name, sweep.direction, sweep.sweep.preload, sweep.sweep.stepped
        yield LineMisfit(*held, frequency, amplitude, mean, noise)
