"""Unnamed: a smooth relative correction of the stiffness for a gap that no effect of the library explains.

The correction is a function of ln frequency and ln strain, given by its values at nodes and interpolated by a Gaussian
process with a Matern 5/2 kernel (see `gaussian_process`). Outside the range of the nodes it fades to 0. The standard
deviations at the nodes are interpolated in the same way, because errors of neighbouring nodes are nearly equal.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated

import numpy as np
from pydantic import Field

from bushfit import geometry
from bushfit.effects.contract import (
    Array,
    ForceBelow,
    History,
    Layer,
    Level,
    Setting,
    StiffnessBelow,
    Values,
)
from bushfit.effects.temperature import REFERENCE
from bushfit.errors import ModelError
from bushfit.gaussian_process import condition, coordinates, in_lengths, matern
from bushfit.geometry import Direction, Place
from bushfit.validation import Name, Number

#: Name of the effect in files and reports.
NAME = "unnamed"
#: Length in ln frequency and ln strain over which a correction fades outside its nodes; chosen: it is almost 0 at four
#: times the largest frequency.
_FADE_LENGTH = 0.5
#: Largest correction over the standard deviation far from the nodes; chosen: a 95 % band there contains the correction
#: at the ends of the tests.
_DEVIATIONS = 2.0

Row = tuple[Number, ...]
Positive = Annotated[Number, Field(gt=0)]
Deviations = tuple[Annotated[Number, Field(ge=0)], ...]


@dataclass(frozen=True)
class Patch:
    """Relative correction of the stiffness at m nodes, for one or more directions or specimens.

    Args:
        directions: names of the directions and specimens.
        frequency_Hz: frequency at the nodes [Hz], (m,).
        strain: equivalent strain amplitude at the nodes, (m,).
        in_phase, in_quadrature: parts of the correction at the nodes, relative to the stiffness, (m,) each.
        in_phase_error, in_quadrature_error: standard deviations of the two parts, (m,) each.
        temperature_K: temperature at the nodes [K], (m,); empty if the correction does not depend on temperature.
    """

    directions: tuple[Name, ...]
    frequency_Hz: tuple[Positive, ...]  # noqa: N815
    strain: tuple[Positive, ...]
    in_phase: Row
    in_quadrature: Row
    in_phase_error: Deviations
    in_quadrature_error: Deviations
    temperature_K: Row = ()  # noqa: N815

    def __post_init__(self) -> None:
        """Raise a ValueError for empty lists, or lists of unequal length."""
        lists = (self.frequency_Hz, self.strain, self.in_phase, self.in_quadrature, self.temperature_K or self.strain)
        sizes = {len(values) for values in (*lists, self.in_phase_error, self.in_quadrature_error)}
        if len(sizes) > 1 or sizes == {0}:
            found = f"lists of {' and '.join(map(str, sorted(sizes)))} values"
            raise ValueError(ModelError("lists of unequal length", found=found, expected="equal lists, not empty"))

    @cached_property
    def nodes(self) -> Array:
        """Coordinates of the tabulated points in ln frequency and ln strain, (m, 2), or (m, 3) with temperature."""
        kelvin = np.array(self.temperature_K) if self.temperature_K else None
        return coordinates(np.array(self.frequency_Hz), np.array(self.strain), kelvin)


@dataclass(frozen=True)
class SmoothCorrection:
    """Smooth relative correction of the stiffness over frequency and strain, for a gap that no known effect explains.

    Args:
        size: standard deviation of the Gaussian process, relative to |K|.
        lengths: correlation lengths in ln frequency and ln strain; a change of temperature is converted to
            the change of frequency that shifts the time scale equally.
        patches: corrections of the directions; a direction without a patch has the correction 0, with the standard
            deviation `far_deviation`.
    """

    size: Positive
    lengths: tuple[Positive, Positive]
    patches: Annotated[tuple[Patch, ...], Field(min_length=1)]

    @cached_property
    def _at_nodes(self) -> tuple[Array, Array]:
        """Squared magnitudes of the relative correction, and of its standard deviation, at all m nodes, (m,) each."""
        values = [np.square((patch.in_phase, patch.in_quadrature)).sum(axis=0) for patch in self.patches]
        errors = [np.square((p.in_phase_error, p.in_quadrature_error)).sum(axis=0) for p in self.patches]
        return np.concatenate(values), np.concatenate(errors)

    @property
    def largest(self) -> float:
        """Largest magnitude of the correction of the stiffness, relative to |K|, over the points of its grid."""
        return float(np.sqrt(self._at_nodes[0].max()))

    @property
    def rms(self) -> float:
        """Root mean square of the relative correction c with its standard deviation s, sqrt(mean(c^2 + s^2))."""
        return float(np.sqrt(np.mean(self._at_nodes[0] + self._at_nodes[1])))

    @property
    def uncertainty(self) -> float:
        """Relative uncertainty of the correction: rms standard deviation over rms value at the nodes."""
        values, errors = self._at_nodes
        return float(np.sqrt(errors.mean() / max(values.mean(), np.finfo(float).tiny)))

    @property
    def far_deviation(self) -> float:
        """Standard deviation of the real and of the imaginary part of the relative correction, far from all nodes."""
        return self.largest / _DEVIATIONS

    def with_untested(self, place: Place) -> "SmoothCorrection":
        """Apply the relative correction of the tested directions to an untested direction of the same bushing.

        Args:
            place: direction or specimen.

        Returns:
            The correction, valid for `place` as well; unchanged if `place` is tested or belongs to another bushing or
            specimen, or if the corrections of the tested directions differ.
        """
        patch, body = self.patches[0], {f"{place.body} {axis}".strip() for axis in Direction}
        if len(self.patches) > 1 or str(place) in patch.directions or body.isdisjoint(patch.directions):
            return self
        return replace(self, patches=(replace(patch, directions=(*patch.directions, str(place))),))

    def evaluate(self, setting: Setting, omega: Array, amplitude: Array) -> tuple[Array, Array, Array]:
        """Evaluate the smooth correction of the stiffness, relative to the uncorrected stiffness, at operating points.

        Args:
            setting: direction and conditions of the test that the points belong to.
            omega: angular frequency [rad/s], (..., n).
            amplitude: zero-to-peak displacement [m or rad], (..., n).

        Returns:
            Complex relative correction, (..., n); standard deviations of its real and imaginary part, (2, ..., n); and
            weight of the correction, (..., n): 1 within the range of the nodes, 0 far outside.
        """
        strain = amplitude * geometry.unit_strain(setting.bushing, setting.direction)
        patch = next((patch for patch in self.patches if str(setting.direction) in patch.directions), None)
        if patch is None:
            zero = np.zeros(np.broadcast_shapes(np.shape(omega), strain.shape))
            return zero.astype(complex), np.full((2, *zero.shape), self.far_deviation), zero
        temperature = REFERENCE if setting.conditions.temperature is None else setting.conditions.temperature
        kelvin = np.asarray(temperature) if patch.temperature_K else None
        points = coordinates(omega / (2.0 * np.pi), strain, kelvin)
        inside = np.clip(points, patch.nodes.min(axis=0), patch.nodes.max(axis=0))
        fade = matern((points - inside) / _FADE_LENGTH, np.zeros((1, points.shape[-1])))[..., 0]
        weight, variance = condition(in_lengths(inside, self.lengths), in_lengths(patch.nodes, self.lengths))
        value = weight @ (np.array(patch.in_phase) + 1j * np.array(patch.in_quadrature))
        node_errors = np.array([patch.in_phase_error, patch.in_quadrature_error])
        interpolated = [np.clip(weight @ error, error.min(), error.max()) for error in node_errors]
        inner = np.square(self.size) * variance + np.square(interpolated)
        variance = np.square(fade) * inner + (1.0 - np.square(fade)) * np.square(self.far_deviation)
        return fade * value, np.sqrt(np.maximum(variance, 0.0)), fade


def _correction(setting: Setting, omega: Array, amplitude: Array) -> Array:
    """Complex correction c of the stiffness, relative to K, at angular frequencies [rad/s] and amplitudes, (..., n)."""
    assert setting.unnamed is not None  # a model with this effect has its data
    return setting.unnamed.evaluate(setting, omega, amplitude)[0]


def response(values: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """Complex stiffness K (1 + c) with a relative correction c, interpolated between tabulated frequencies and strains.

    Args:
        values: not used; the data of the correction are in the setting.
        below: complex stiffness K without this effect, as a function of omega and amplitude.
        omega, amplitude: angular frequency [rad/s] and displacement amplitude X [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Corrected complex stiffness K (1 + c), (..., n) [N/m or N m/rad].
    """
    return below(omega, amplitude) * (1.0 + _correction(setting, omega, amplitude))


def first_harmonic(values: Values, below: ForceBelow, displacement: History, setting: Setting) -> Array:
    """Force whose first harmonic is multiplied by 1 + c, with c interpolated from the table of a smooth correction.

    The mean and the overtones are unchanged, because c is known at the frequency of the cycle only.

    Args:
        values: not used; the data of the correction are in the setting.
        below: force F without this effect, as a function of the displacement history.
        displacement: displacement over time [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Corrected force at each sample, (..., n) [N or N m].

    >>> from dataclasses import replace
    >>> patch = Patch(("axial",), (5.0,), (0.01,), (0.1,), (0.0,), (0.0,), (0.0,))
    >>> amplitude = 0.01 / geometry.unit_strain(loop.bushing, loop.direction)
    >>> motion = History.steady(amplitude * np.array([0.0, 1.0, 0.0, -1.0]), 5.0)
    >>> test = replace(loop, unnamed=SmoothCorrection(0.1, (1.0, 1.0), (patch,)))
    >>> force = first_harmonic({}, lambda history: 1e5 * history.value, motion, test)
    >>> round(float(force[1]) / (1e5 * amplitude), 6)
    1.1
    """
    force = below(displacement)
    share = _correction(setting, np.atleast_1d(displacement.omega), displacement.amplitude)
    return force + np.real(share * displacement.with_value(force).fundamental)


def effect_label(name: str) -> str:
    """Name of an effect in texts for users; the unnamed correction is "a smooth correction"."""
    return "a smooth correction" if name == NAME else name


EFFECT = Layer(
    name=NAME,
    sentence="A smooth function of frequency and amplitude corrects the stiffness.",
    equation="(1 + c(ln f, ln X)) K",
    level=Level.COMPONENT,
    parameters=(),
    source="Gaussian process beside the parameters: Kennedy and O'Hagan (2001)",
    confirmed_by="test between the levels and frequencies of these tests, and on another bushing of the compound",
    harmonic_only=True,
    stiffness=response,
    force=first_harmonic,
)
