"""The rubber tube between two rigid sleeves by finite elements: stiffness, and the strain that friction sees.

Linear elasticity; the rubber is bonded to both sleeves, its ends are free, the inner sleeve moves by d against the
outer one. The field is one harmonic of the angle, u_r = U cos(n phi), u_phi = -V sin(n phi), u_z = W cos(n phi), with
n = 1 for a radial and n = 0 for an axial motion; so only (r, z) is meshed, and of the length only one half.
Displacement and pressure are unknowns of their own (quadratic and linear, Taylor-Hood): nearly incompressible rubber
does not lock. The mesh is graded towards the corners where a free end meets a sleeve: there the strain is infinite.

Lengths are in outer radii, moduli in shear moduli. `python tests/reference/finite_tube.py` prints the mesh's
convergence and the coefficients of `bushfit.geometry.shape`, fitted anew (a few minutes).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from numpy.polynomial.chebyshev import chebvander2d
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.sparse import bmat
from skfem import Basis, BilinearForm, ElementQuad1, ElementQuad2, ElementVector, MeshQuad, condense, solve
from skfem.helpers import grad

from bushfit.effects.friction import harmonic_shape
from bushfit.geometry import Bushing, Direction
from bushfit.geometry.shape import INCOMPRESSIBLE, RADIUS_RATIO_RANGE, SLENDERNESS_RANGE, coordinates

Array = NDArray[np.float64]

#: Bulk over shear modulus at which the softening by a finite bulk modulus is taken: 2 GPa over 1 MPa.
_SOFTER = 2e3
#: Strain amplitudes over eps_half at which one strain is to stand for the uneven field: half a decade to either side.
FRICTION_RANGE = np.geomspace(0.3, 3.0, 13)
#: Smallest element, in the corners, over thickness or half length, whichever is less; chosen: see the convergence.
_SMALLEST = 2e-3
#: Length of an element over that of its neighbour nearer to a corner.
_GROWTH = 1.6
#: Angles of a quarter circle at which the local strain is taken, in the middle of as many equal parts.
_ANGLES = 16
#: Classes of local strain that its distribution is counted in: chosen, 0.5 % wide and less.
_CLASSES = 2000
#: Degrees of the polynomials for stiffness, strain and softening in the two coordinates of a shape; chosen.
_DEGREES = ((5, 10), (5, 10), (4, 6))
#: Weight of a shape whose stiffness does not depend on the bulk modulus, over that of one which it takes away; chosen.
_LEAST_WEIGHT = 1e-3
#: Smallest local strain that counts, over the largest; smaller ones hold 1e-8 of the energy.
_LEAST_STRAIN = 1e-4


@dataclass(frozen=True, eq=False)
class Solution:
    """A tube's answer to a unit displacement of its inner sleeve; outer radius and shear modulus are 1.

    Args:
        stiffness: force over displacement.
        volume: of the rubber.
        strain: local equivalent strain sqrt(e_ij e_ij/2), rising, (n,).
        share: share of the distortion's energy at that strain, (n,), 1 in all.
        unknowns: of the finite elements.
    """

    stiffness: float
    volume: float
    strain: Array
    share: Array
    unknowns: int

    @property
    def energy_strain(self) -> float:
        """The even strain that stores the same energy, sqrt(K/(4 G V))."""
        return float(np.sqrt(self.stiffness / (4.0 * self.volume)))

    @cached_property
    def friction_strain(self) -> float:
        """The strain at which the friction branch gives what its integral over the field gives.

        Over the field, h of `harmonic_shape` is weighted with the energy: K_f = integral of 4 G_f(e d) e^2 dV. The
        strain s with K/G h(s d) nearest to it (least squares of real and imaginary part, s d/eps_half from 0.3 to 3
        in even steps of its logarithm) is taken. The misfit is counted in the modulus and not relative to friction's,
        because the elastic modulus adds a constant to both.
        """
        guess = float(self.share @ np.log(self.strain))
        misfit = lambda log: float(np.sum(np.abs(self._off(np.exp(log))) ** 2))  # noqa: E731
        return float(np.exp(minimize_scalar(misfit, bracket=(guess - 0.05, guess), tol=1e-8).x))

    @property
    def friction_misfit(self) -> float:
        """Largest distance of the one strain's friction modulus from the field's in that range, relative."""
        return float(np.max(np.abs(self._off(self.friction_strain) / harmonic_shape(FRICTION_RANGE))))

    def _off(self, strain: float) -> NDArray[np.complex128]:
        field = harmonic_shape(np.outer(FRICTION_RANGE, self.strain) / strain) @ self.share
        return field - harmonic_shape(FRICTION_RANGE)


def mesh(inner: float, length: float, fineness: float) -> MeshQuad:
    """Half a tube in (r, z) with its free end at z = length/2; twice the `fineness` has elements half as large."""
    thickness, half = 1.0 - inner, 0.5 * length
    smallest = _SMALLEST * min(thickness, half) / fineness**3
    across = _graded(0.5 * thickness, smallest, 0.12 * thickness / fineness)
    along = _graded(half, smallest, min(0.25, 0.25 * half) / fineness)
    return MeshQuad.init_tensor(np.concatenate((inner + across, 1.0 - across[-2::-1])), half - along[::-1])


def _graded(extent: float, smallest: float, largest: float) -> Array:
    """Mesh lines from 0, where elements are smallest, to `extent`."""
    sizes = [smallest]
    while sum(sizes) < extent:
        sizes.append(min(sizes[-1] * _GROWTH, largest))
    lines = np.concatenate(([0.0], np.cumsum(sizes)))
    return lines * extent / lines[-1]


def _strains(u: Any, r: Array, n: int) -> tuple[Array, ...]:
    """e_rr, e_phiphi and e_zz, e_rz, all over cos(n phi); e_rphi and e_phiz over -sin(n phi)."""
    g, (U, V, W) = grad(u), (u[0], u[1], u[2])
    return (
        g[0][0],
        (U - n * V) / r,
        g[2][1],
        0.5 * (g[0][1] + g[2][0]),
        0.5 * (g[1][0] + (n * U - V) / r),
        0.5 * (g[1][1] + n * W / r),
    )


def _forms(n: int) -> tuple[BilinearForm, BilinearForm, BilinearForm]:
    """Twice the energy of distortion, the pressure's work, and p^2; each per radian and half length."""

    def distortion(u: Any, v: Any, w: Any) -> Array:
        e, f = _strains(u, w.x[0], n), _strains(v, w.x[0], n)
        return 2.0 * w.x[0] * sum((1.0 if i < 3 else 2.0) * e[i] * f[i] for i in range(6))

    def pressure(u: Any, q: Any, w: Any) -> Array:
        return -w.x[0] * q * sum(_strains(u, w.x[0], n)[:3])

    return BilinearForm(distortion), BilinearForm(pressure), BilinearForm(lambda p, q, w: w.x[0] * p * q)


def _clamped(basis: Basis, inner: float, n: int) -> tuple[Array, Array]:
    """Displacements, 0 but on the inner sleeve, and which are given: the sleeves', and those that symmetry forbids."""
    at_inner, at_outer, middle = (
        basis.get_dofs(lambda x, i=i, value=value: np.abs(x[i] - value) < 1e-12)
        for i, value in ((0, inner), (0, 1.0), (1, 0.0))
    )
    x = np.zeros(basis.N)
    for name in ("u^1", "u^2") if n else ("u^3",):
        x[at_inner.all(name)] = 1.0
    given = [at_inner.all(), at_outer.all(), middle.all("u^3" if n else "u^1")]
    if not n:
        given.append(basis.get_dofs(elements=True).all("u^2"))
    return x, np.unique(np.concatenate(given))


def solve_tube(
    inner: float, length: float, *, n: int = 1, bulk: float = 1.0 / INCOMPRESSIBLE, fineness: float = 1.0
) -> Solution:
    """The tube's stiffness and strains.

    Args:
        inner: inner over outer radius.
        length: length over outer radius.
        n: harmonic of the angle: 1 for a radial, 0 for an axial motion.
        bulk: bulk over shear modulus.
        fineness: of the mesh.
    """
    basis = Basis(mesh(inner, length, fineness), ElementVector(ElementQuad2(), 3), intorder=5)
    pressures = basis.with_element(ElementQuad1())
    distortion, work, square = _forms(n)
    mixed = work.assemble(basis, pressures)
    compliance = square.assemble(pressures) / (bulk - 2.0 / 3.0)
    matrix = bmat([[distortion.assemble(basis), mixed.T], [mixed, -compliance]], "csr")
    displaced, given = _clamped(basis, inner, n)
    start = np.concatenate((displaced, np.zeros(pressures.N)))
    x = solve(*condense(matrix, x=start, D=given))

    r = np.asarray(basis.global_coordinates()[0])
    e = _strains(basis.interpolate(x[: basis.N]), r, n)
    angle = (np.arange(_ANGLES) + 0.5) * np.pi / (2 * _ANGLES) * n
    cosine, sine = (f(angle)[:, None, None] ** 2 for f in (np.cos, np.sin))
    both = cosine * (e[0] ** 2 + e[1] ** 2 + e[2] ** 2 + 2.0 * e[3] ** 2), sine * (e[4] ** 2 + e[5] ** 2)
    squared = 0.5 * both[0] + both[1]
    strain, share = _distribution(np.sqrt(squared), squared * (r * basis.dx))
    around = 2.0 * (np.pi if n else 2.0 * np.pi)  # of both halves
    return Solution(around * float(x @ (matrix @ x)), np.pi * (1.0 - inner**2) * length, strain, share, matrix.shape[0])


def _distribution(strain: Array, energy: Array) -> tuple[Array, Array]:
    """Classes of strain that are even on a logarithmic scale, and the share of the energy in each, (n,) both."""
    log = np.log(np.maximum(strain, _LEAST_STRAIN * strain.max())).ravel()
    share, edges = np.histogram(log, _CLASSES, weights=energy.ravel() / energy.sum())
    return np.exp(0.5 * (edges[1:] + edges[:-1]))[share > 0], share[share > 0]


def shapes(radii: int, lengths: int) -> list[tuple[float, float]]:
    """Inner over outer radius and length over outer radius on a grid that is dense at the ends of its ranges."""
    (low, high), (flat, long) = RADIUS_RATIO_RANGE, SLENDERNESS_RANGE
    nodes = [0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, count)) for count in (radii, lengths)]
    thickness = (1.0 / high - 1.0) * ((1.0 / low - 1.0) / (1.0 / high - 1.0)) ** nodes[0]
    return list(product((1.0 / (1.0 + thickness)).tolist(), (flat * (long / flat) ** nodes[1]).tolist()))


def corrections(tubes: Sequence[tuple[float, float]], *, fineness: float = 1.0) -> Array:
    """Stiffness over Eq. 11, strain over Eq. 8 and softening of each shape, (n, 3), on meshes of this fineness."""
    rows = []
    for inner, length in tubes:
        paper, solved = Bushing("tube", inner, 1.0, length), solve_tube(inner, length, fineness=fineness)
        soft = solve_tube(inner, length, bulk=_SOFTER, fineness=fineness)
        rows.append(
            (
                solved.stiffness / paper.stiffness_per_modulus(Direction.RADIAL),
                solved.friction_strain / paper.unit_strain(Direction.RADIAL),
                (solved.stiffness / soft.stiffness - 1.0) / (1.0 / _SOFTER - INCOMPRESSIBLE),
            )
        )
    return np.array(rows)


def fitted(tubes: Sequence[tuple[float, float]], solved: Array) -> list[Array]:
    """Coefficients of ln(stiffness), ln(strain) and ln(softening); the last weighted by what it does to a stiffness."""
    places = np.array([coordinates(*tube) for tube in tubes]).T
    lowered = 1.0 - 1.0 / (1.0 + solved[:, 2] * (1.0 / _SOFTER - INCOMPRESSIBLE))
    weights = (np.ones(len(tubes)), np.ones(len(tubes)), np.sqrt(_LEAST_WEIGHT + lowered))
    tables = []
    for degrees, values, weight in zip(_DEGREES, np.log(solved).T, weights, strict=True):
        rows = chebvander2d(*places, degrees) * weight[:, None]
        tables.append(np.linalg.lstsq(rows, values * weight)[0].reshape([degree + 1 for degree in degrees]))
    return tables


def _main() -> None:
    for inner, length in (*product(RADIUS_RATIO_RANGE, SLENDERNESS_RANGE), (10 / 18, 34 / 18)):
        for fineness in (0.7, 1.0, 1.5, 2.0):
            found = solve_tube(inner, length, fineness=fineness)
            print(
                f"a/b {inner:.3f}, L/b {length:.3f}: {found.unknowns:6d} unknowns, stiffness {found.stiffness:.6g}, "
                f"strain of equal energy {found.energy_strain:.6g}, for friction {found.friction_strain:.6g}"
            )
    tubes = shapes(9, 17)
    for name, table in zip(("stiffness", "strain", "softening"), fitted(tubes, corrections(tubes)), strict=True):
        print(f"{name} = {table.round(4).tolist()}")


if __name__ == "__main__":
    _main()
