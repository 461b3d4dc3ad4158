"""Unnamed: a smooth correction over log frequency and log strain for what no effect of the library explains.

It is a share of the stiffness. Its data are values at some nodes; between these it is what a Gaussian process with a
Matern 5/2 kernel makes of them, see `gaussian_process`. Beyond their range it fades to 0 within the size of what it
corrects. Standard deviations at the nodes go over from node to node just as smoothly: errors of neighbours are nearly
one, their covariance would add little.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

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
    harmonic_response,
)
from bushfit.effects.temperature import REFERENCE
from bushfit.errors import ModelError
from bushfit.gaussian_process import condition, coordinates, in_lengths, matern
from bushfit.validation import Name, Number

#: The name in files and reports.
NAME = "unnamed"
#: Length, in ln frequency and ln strain, over which a correction fades beyond its nodes: chosen, all but gone at a
#: fourfold frequency, because nothing was measured there.
_FADES = 0.5
#: Standard deviations beyond the nodes that make up the size of the gap; chosen: a band of 95 % then holds what was
#: corrected where the tests end.
_DEVIATIONS = 2.0

Row = tuple[Number, ...]


@dataclass(frozen=True)
class Patch:
    """A correction in some directions, as values at nodes.

    Args:
        directions: that share it, by name.
        frequency_Hz: of the nodes, (m,).
        strain: of the nodes, equivalent, zero-to-peak, (m,).
        in_phase, in_quadrature: shares of the stiffness at the nodes, (m,) each.
        in_phase_error, in_quadrature_error: standard deviations there, (m,) each.
        temperature_K: of the nodes, (m,); none where it is not told apart.
    """

    directions: tuple[Name, ...]
    frequency_Hz: Row  # noqa: N815
    strain: Row
    in_phase: Row
    in_quadrature: Row
    in_phase_error: Row
    in_quadrature_error: Row
    temperature_K: Row = ()  # noqa: N815

    def __post_init__(self) -> None:
        lists = (self.frequency_Hz, self.strain, self.in_phase, self.in_quadrature, self.temperature_K or self.strain)
        sizes = {len(each) for each in (*lists, self.in_phase_error, self.in_quadrature_error)}
        if len(sizes) > 1 or sizes == {0}:
            found = f"lists of {' and '.join(map(str, sorted(sizes)))} values"
            raise ValueError(ModelError("no values at nodes", found=found, expected="one value a node, and a node"))
        if min(*self.frequency_Hz, *self.strain) <= 0.0:
            raise ValueError(ModelError("a node without motion", expected="frequency_Hz and strain above 0"))
        if min(*self.in_phase_error, *self.in_quadrature_error) < 0.0:
            raise ValueError(ModelError("a negative standard deviation", expected="errors of 0 or more"))

    @cached_property
    def nodes(self) -> Array:
        """Places of the nodes, (m, 2 or 3)."""
        kelvin = np.array(self.temperature_K) if self.temperature_K else None
        return coordinates(np.array(self.frequency_Hz), np.array(self.strain), kelvin)


@dataclass(frozen=True)
class Unnamed:
    """A smooth correction of the stiffness, as a share of it.

    Args:
        size: standard deviation between nodes that lie far apart.
        lengths: over which it changes, in ln frequency and ln strain; over temperature, as over the frequency that the
            time scale shifts by.
        patches: by direction; what is in none has no correction, within the size of the gap.
    """

    size: Number
    lengths: tuple[Number, Number]
    patches: tuple[Patch, ...]

    def __post_init__(self) -> None:
        if not self.patches:
            raise ValueError(ModelError("a correction without values", expected="a patch for each direction"))
        if min(self.size, *self.lengths) <= 0.0:
            raise ValueError(ModelError("a correction of no size or length", expected="size and lengths above 0"))

    @cached_property
    def _at_nodes(self) -> tuple[Array, Array]:
        """Squares of the values at all nodes, and of their errors, (m,) each."""
        values = [np.square((each.in_phase, each.in_quadrature)).sum(axis=0) for each in self.patches]
        errors = [np.square((each.in_phase_error, each.in_quadrature_error)).sum(axis=0) for each in self.patches]
        return np.concatenate(values), np.concatenate(errors)

    @property
    def largest(self) -> float:
        """The size of the gap: the largest correction at a node, as a share of the stiffness."""
        return float(np.sqrt(self._at_nodes[0].max()))

    @property
    def typical(self) -> float:
        """Root mean square of what it may be at the nodes, as a share of the stiffness."""
        return float(np.sqrt(np.mean(self._at_nodes[0] + self._at_nodes[1])))

    @property
    def uncertainty(self) -> float:
        """Its standard deviation at the nodes over its values, both as root mean squares."""
        values, errors = self._at_nodes
        return float(np.sqrt(errors.mean() / max(values.mean(), np.finfo(float).tiny)))

    @property
    def beyond(self) -> float:
        """Standard deviation of each part of the correction where nothing was measured."""
        return self.largest / _DEVIATIONS

    def at(self, setting: Setting, omega: Array, amplitude: Array) -> tuple[Array, Array, Array]:
        """The correction, complex (..., n), the standard deviations of its two parts, (2, ..., n), and what share of it
        stands, (..., n): 1 among the nodes, 0 far beyond.

        Angular frequencies are in rad/s, amplitudes in m or rad.
        """
        strain = amplitude * geometry.unit_strain(setting.bushing, setting.direction)
        patch = next((patch for patch in self.patches if str(setting.direction) in patch.directions), None)
        if patch is None:
            nothing = np.zeros(np.broadcast_shapes(np.shape(omega), strain.shape))
            return nothing.astype(complex), np.full((2, *nothing.shape), self.beyond), nothing
        warm = REFERENCE if setting.under.temperature is None else setting.under.temperature
        kelvin = np.asarray(warm) if patch.temperature_K else None
        points = coordinates(omega / (2.0 * np.pi), strain, kelvin)
        inside = np.clip(points, patch.nodes.min(axis=0), patch.nodes.max(axis=0))
        stays = matern((points - inside) / _FADES, np.zeros((1, points.shape[-1])))[..., 0]
        weight, variance = condition(in_lengths(inside, self.lengths), in_lengths(patch.nodes, self.lengths))
        value = weight @ (np.array(patch.in_phase) + 1j * np.array(patch.in_quadrature))
        at_nodes = np.array([patch.in_phase_error, patch.in_quadrature_error])
        between = [np.clip(weight @ error, error.min(), error.max()) for error in at_nodes]
        known = np.square(self.size) * variance + np.square(between)
        variance = np.square(stays) * known + (1.0 - np.square(stays)) * np.square(self.beyond)
        return stays * value, np.sqrt(np.maximum(variance, 0.0)), stays


def _correction(setting: Setting, omega: Array, amplitude: Array) -> Array:
    assert setting.unnamed is not None  # a model with this effect has its data
    return setting.unnamed.at(setting, omega, amplitude)[0]


def response(values: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """K (1 + c), complex (..., n) [N/m or N m/rad]."""
    return below(omega, amplitude) * (1.0 + _correction(setting, omega, amplitude))


def first_harmonic(values: Values, below: ForceBelow, displacement: History, setting: Setting) -> Array:
    """The force below, and the correction's share of its first harmonic, (..., n) [N or N m]."""
    force = below(displacement)
    share = _correction(setting, np.atleast_1d(displacement.omega), displacement.amplitude)
    return force + harmonic_response(share, displacement.with_value(force))


EFFECT = Layer(
    name=NAME,
    sentence="What no effect of the library explains, as a smooth correction over frequency and amplitude.",
    equation="(1 + c(ln f, ln X)) K",
    level=Level.COMPONENT,
    parameters=(),
    source="Gaussian process beside the parameters: Kennedy and O'Hagan (2001)",
    confirmed_by="test between the levels and frequencies of these tests, and on another bushing of the compound",
    harmonic_only=True,
    stiffness=response,
    force=first_harmonic,
)
