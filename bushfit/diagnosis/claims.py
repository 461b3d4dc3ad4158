"""Mistakes in the record of a campaign, and how well the tests would agree without them.

A mistake has no free parameter, so it costs only the logarithm of the number of mistakes considered. It has to close
the whole gap, and to be more probable than every effect and every fault. The user decides whether it is mended.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from bushfit.effects import BASE
from bushfit.effects.contract import Array
from bushfit.effects.mistakes import MISTAKES, SEPARATOR, Mistake, file_or_name, get_mistake, labelled
from bushfit.errors import ModelError
from bushfit.fitting.preparation import MeasuredSweep, MeasuredTest, prepare_loops, with_gain_errors
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.geometry import Bushing, Place, stiffness_per_modulus, unit_strain
from bushfit.model.model import Model
from bushfit.reading.measurement import Loop, Sweep

#: Values of alpha that are tried before any fit: those of all rubbers.
_ALPHA = np.linspace(0.05, 0.6, 10)
#: Values of eps_half that are tried before any fit: those of all filled rubbers, with room for amplitudes 2 times off.
_EPS_HALF = np.geomspace(2e-4, 0.2, 24)
#: Least relative error of a point that is tried before any fit: what the grid of values misses by.
_COARSE = 1e-3
#: Points of a test that are tried before any fit at most: they show its shape.
_MOST_POINTS = 60
#: Misfit of a claim over that of the tests as they are, before any fit, up to which it is worth a fit: the grid misses
#: what is small.
_WORTH_A_FIT = 1.3
#: Share by which a claim changes the misfit at least; one that does not has a twin among the parameters.
_LEAST_CHANGE = 1e-6
#: Share of mu in a modulus that keeps three columns from being one.
_RIDGE = 1e-12


@dataclass(frozen=True)
class Claim:
    """One mistake, made alike in some tests.

    Args:
        mistake: the mistake.
        tests: indices of the tests, loops before sweeps; empty for a mistake in [bushing].
    """

    mistake: Mistake
    tests: tuple[int, ...]

    @property
    def key(self) -> tuple[str, tuple[int, ...]]:
        """Identity of the claim."""
        return self.mistake.name, self.tests

    @property
    def single_tests(self) -> list[Claim]:
        """Claims about each of the tests alone."""
        return [Claim(self.mistake, (place,)) for place in self.tests] or [self]

    def test(self, data: PreparedCampaign) -> str | None:
        """Name of the only test of the claim; None for [bushing]."""
        return [*data.loops, *data.sweeps][self.tests[0]].name if self.tests else None

    def labels(self, data: PreparedCampaign) -> tuple[str, ...]:
        """The mistake with each of its tests, as --adopt takes it."""
        return tuple(labelled(self.mistake.name, claim.test(data)) for claim in self.single_tests)

    def words(self, data: PreparedCampaign) -> str:
        """Sentence that states the mistake."""
        data_sets = [*data.loops, *data.sweeps]
        files = [file_or_name(data_sets[place].test) for place in self.tests]
        return self.mistake.sentence.format(files=" and ".join(filter(None, (", ".join(files[:-1]), *files[-1:]))))

    def corrections(self, data: PreparedCampaign) -> tuple[str, ...]:
        """Lines to write into the campaign, one for each test."""
        data_sets = [*data.loops, *data.sweeps]
        return tuple(self.mistake.corrected(data_sets[place].test) for place in self.tests) or (
            self.mistake.corrected(None),
        )

    def mended(self, data: PreparedCampaign) -> PreparedCampaign:
        """Campaign as it was measured if the mistake was made.

        Args:
            data: the campaign as it was read.

        Returns:
            The campaign with the tests, or the bushing, corrected.
        """
        campaign = data.campaign
        if not self.tests:
            bushing = campaign.bushing and self.mistake.mended_bushing(campaign.bushing)
            return replace(data, campaign=replace(campaign, bushing=bushing)).in_session()
        loops, sweeps, count = list(data.loops), [sweep.test for sweep in data.sweeps], len(data.loops)
        for place in self.tests:
            test = self.mistake.mended([*data.loops, *data.sweeps][place].test)
            if isinstance(test, Loop):
                loops[place] = prepare_loops([test], data.campaign.rig, without_outliers=data.robust)[0]
            elif isinstance(test, Sweep):
                sweeps[place - count] = test
        data = replace(data, loops=tuple(with_gain_errors(loops, data.campaign.rig)))
        if any(place >= count for place in self.tests):
            data = data.with_sweeps(sweeps)
        return data.in_session()


def adopted(data: PreparedCampaign, names: Collection[str]) -> tuple[PreparedCampaign, list[str]]:
    """Mend the mistakes that the user adopts.

    Args:
        data: the campaign as it was read.
        names: mistakes as --adopt takes them, "mistake:test".

    Returns:
        The mended campaign, and one sentence for each mistake.

    Raises:
        ModelError: a mistake that was not made in the test named, or no such test.
    """
    messages = []
    for name in names:
        claim = _claimed(data, name)
        messages.append(f"corrected by --adopt {name}: read as if {claim.words(data)}; {claim.corrections(data)[0]}")
        data = claim.mended(data)
    return data, messages


def _claimed(data: PreparedCampaign, name: str) -> Claim:
    """Claim that one --adopt option makes."""
    mistake, test = get_mistake(name), name.partition(SEPARATOR)[2]
    data_sets: list[MeasuredTest] = [*data.loops, *data.sweeps]
    possible = [place for place, one in enumerate(data_sets) if mistake and _is_possible(mistake, one, data)]
    tests = tuple(place for place in possible if data_sets[place].name == test)
    if mistake is None or bool(tests) != bool(mistake.kinds) or (test and not tests):
        expected = [labelled(name.partition(SEPARATOR)[0], data_sets[place].name) for place in possible]
        raise ModelError(
            "this mistake is not possible in this test",
            found=name,
            expected="one of " + ", ".join(expected) if expected else "another mistake: no test has room for this one",
        )
    return Claim(mistake, tests)


def _is_possible(mistake: Mistake, data_set: MeasuredTest, data: PreparedCampaign) -> bool:
    """True if a mistake is possible in a test, judged by its columns and by the modulus that it implies."""
    bushing, place = data.campaign.bushing, data_set.direction
    modulus = float(np.median(np.abs(data_set.measured))) / stiffness_per_modulus(bushing, place)
    strain = float(np.max(data_set.amplitude)) * unit_strain(bushing, place)
    return mistake.possible(data_set.test) and mistake.explains(data_set.test, modulus, strain)


def claims(data: PreparedCampaign, without: Collection[str]) -> list[Claim]:
    """List every mistake that may have been made: in one test, in all of a kind or of a direction, or in all.

    Args:
        data: the campaign as it was read.
        without: names of mistakes not to consider, also "mistake:test".

    Returns:
        Claims without duplicates.
    """
    data_sets: list[MeasuredTest] = [*data.loops, *data.sweeps]
    found = []
    for mistake in MISTAKES.values():
        if mistake.name in without:
            continue
        if not mistake.kinds:
            found += [Claim(mistake, ())] if data.campaign.bushing else []
            continue
        places = [
            place
            for place, data_set in enumerate(data_sets)
            if _is_possible(mistake, data_set, data) and labelled(mistake.name, data_set.name) not in without
        ]
        groups: list[tuple[int, ...]] = [(place,) for place in places]
        groups += [tuple(p for p in places if data_sets[p].kind == kind) for kind in ("loop", "sweep")]
        directions = dict.fromkeys(data_set.direction for data_set in data_sets)
        groups += [tuple(p for p in places if data_sets[p].direction == direction) for direction in directions]
        found += [Claim(mistake, group) for group in dict.fromkeys([*groups, tuple(places)]) if group]
    return found


@dataclass(frozen=True, eq=False)
class Screen:
    """Misfit of the plain model under each claim, before any fit.

    Notes:
        The stiffness is linear in mu, m and sigma_fmax; alpha and eps_half are tried on a grid. The normal equations
        are sums over tests, so that each test is evaluated once for each mistake.
    """

    data: PreparedCampaign
    _known: dict[tuple[int, str, Bushing | None], Array] = field(default_factory=dict)
    _responses: dict[tuple[Bushing | None, Place, bytes, bytes], Array] = field(default_factory=dict)

    def best(self, found: Sequence[Claim], limit: int) -> list[Claim]:
        """Select the claims with the smallest misfit.

        Args:
            found: claims to compare.
            limit: maximum number of claims.

        Returns:
            Claims that change the misfit and may lower it in a fit, the best first.
        """
        before, misfits = self.misfit(None), np.array([self.misfit(claim) for claim in found])
        changed = np.abs(misfits - before) > _LEAST_CHANGE * before
        order = np.argsort(misfits, kind="stable")
        return [found[place] for place in order if changed[place] and misfits[place] < _WORTH_A_FIT * before][:limit]

    def misfit(self, claim: Claim | None) -> float:
        """Least sum of squares over the grid of alpha and eps_half.

        Args:
            claim: the mistake that is mended before; None for the tests as they are.

        Returns:
            Sum of squares in units of a coarse noise; infinite if no model has a response.
        """
        bushing = self.data.campaign.bushing
        if claim and not claim.tests and bushing:
            bushing = claim.mistake.mended_bushing(bushing)
        data_sets: list[MeasuredTest] = [*self.data.loops, *self.data.sweeps]
        mistakes = [claim.mistake if claim and place in claim.tests else None for place in range(len(data_sets))]
        try:
            parts = [self._part(place, test, mistakes[place], bushing) for place, test in enumerate(data_sets)]
        except ModelError:  # a shape for which a formula was not checked
            return np.inf
        whole = np.sum(parts, axis=0)
        gram, products, total = whole[:, :3, :3], whole[:, :3, 3], whole[:, 3, 3]
        scale = np.sqrt(np.einsum("gii->gi", gram)) + 1e-300
        unit, right = gram / scale[:, :, None] / scale[:, None, :] + _RIDGE * np.eye(3), products / scale
        explained = np.einsum("gi,gi->g", right, np.linalg.solve(unit, right[..., None])[..., 0])
        return max(_paraboloid_minimum((total - explained).reshape(_EPS_HALF.size, _ALPHA.size)), 0.0)

    def _part(self, place: int, data_set: MeasuredTest, mistake: Mistake | None, bushing: Bushing | None) -> Array:
        """Inner products of three columns and the target of a test at each point of the grid, (g, 4, 4)."""
        key = (place, mistake.name if mistake else "", bushing)
        if key not in self._known:
            direction, frequency, amplitude, stiffness, error = _points(data_set, mistake)
            columns = self._columns(bushing, direction, frequency, amplitude) / (stiffness * error)
            wanted = np.broadcast_to(1.0 / error, (len(columns), 1, error.size))
            rows = np.concatenate((columns, wanted), axis=1)
            rows = np.concatenate((rows.real, rows.imag), axis=-1)
            self._known[key] = rows @ rows.transpose(0, 2, 1)
        return self._known[key]

    def _columns(self, bushing: Bushing | None, direction: Place, frequency: Array, amplitude: Array) -> Array:
        """Columns of `_columns`, computed once for all mistakes that leave the operating points unchanged."""
        key = (bushing, direction, frequency.tobytes(), amplitude.tobytes())
        if key not in self._responses:
            self._responses[key] = _columns(bushing, direction, frequency, amplitude)
        return self._responses[key]


def _paraboloid_minimum(misfit: Array) -> float:
    """Minimum between the points of a grid, of a paraboloid through the smallest value and its neighbours."""
    row, column = (
        int(np.clip(i, 1, n - 2))
        for i, n in zip(np.unravel_index(int(np.argmin(misfit)), misfit.shape), misfit.shape, strict=True)
    )
    y, x = (axis.ravel() for axis in np.mgrid[-1:2, -1:2])
    near = misfit[row - 1 : row + 2, column - 1 : column + 2].ravel()
    terms = np.stack((np.ones(9), x, y, x**2, x * y, y**2), axis=1)
    _, *slope, xx, xy, yy = np.linalg.lstsq(terms, near, rcond=None)[0].tolist()
    if xx <= 0.0 or 4.0 * xx * yy <= xy**2:
        return float(near.min())
    step = np.clip(np.linalg.solve([[2.0 * xx, xy], [xy, 2.0 * yy]], np.negative(slope)), -1.0, 1.0)
    fall = float(np.dot(slope, step) + xx * step[0] ** 2 + xy * step[0] * step[1] + yy * step[1] ** 2)
    return float(near[4]) + min(fall, 0.0)


def _columns(bushing: Bushing | None, direction: Place, frequency: Array, amplitude: Array) -> Array:
    """Stiffness for each unit of mu, m and sigma_fmax at every alpha and eps_half of the grid, (g, 3, n)."""
    names = ("mu", "m", "sigma_fmax")
    alpha, eps_half = (axis.reshape(-1, 1) for axis in np.meshgrid(_ALPHA, _EPS_HALF))
    model = Model.with_defaults(bushing, BASE, {})
    none = {**dict.fromkeys(names, 0.0), "alpha": alpha, "eps_half": eps_half}
    responses = [
        np.broadcast_to(
            model.stiffness(direction, frequency, amplitude, values={**none, name: 1.0}), (alpha.size, frequency.size)
        )
        for name in names
    ]
    return np.stack(responses, axis=1)


def _points(data_set: MeasuredTest, mistake: Mistake | None) -> tuple[Place, Array, Array, Array, Array]:
    """Direction, frequency, amplitude, stiffness and relative error of a test's points, (n,) each, as mended."""
    if isinstance(data_set, MeasuredSweep):
        sweep, noise = data_set.sweep, np.hypot(data_set.relative_noise, max(data_set.noise.shared))
        mended = (mistake and mistake.mended(sweep)) or sweep
    else:
        sweep, noise = (
            Sweep(data_set.name, data_set.direction, data_set.frequency, data_set.amplitude, data_set.measured),
            0.0,
        )
        mended = mistake.mended_cycle(sweep) if mistake else sweep
    points = np.stack((mended.frequency, mended.amplitude_reached))
    distinct, place, count = np.unique(points, axis=1, return_inverse=True, return_counts=True)
    place = place.ravel()
    mean = (np.bincount(place, mended.stiffness.real) + 1j * np.bincount(place, mended.stiffness.imag)) / count
    thin = np.unique(np.linspace(0, count.size - 1, min(count.size, _MOST_POINTS)).round().astype(int))
    error = np.hypot(noise / np.sqrt(count[thin]), _COARSE)
    return mended.direction, *distinct[:, thin], mean[thin], error
