"""Session of a campaign: order of its points, with their temperatures and earlier strains."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from bushfit.campaign.simulated import SimulatedLoop, SimulatedResonance, SimulatedSweep, SimulatedTest
from bushfit.effects.contract import Array, RubberConditions
from bushfit.geometry import Bushing, Place, unit_strain
from bushfit.reading.measurement import Loop, Sweep
from bushfit.reading.preload import Preload

#: Relative difference of amplitudes below which they belong to one level; chosen: more than the error of a rig, and
#: less than the step between levels.
_LEVEL_STEP = 0.15


class SessionTest(NamedTuple):
    """One test of a session; a session is the sequence of all tests on one body.

    Args:
        place: direction of the bushing, or specimen.
        amplitude: zero-to-peak amplitudes [m or rad, or strain] of the points in measured order, (n,); one for a loop.
        temperature: temperature [K], a number or (n,); None if not stated.
        order: number of the test in the session, if the campaign states it; None for its position in the list.
        preload: static displacement [m or rad] or force [N or N m] of the test; None if not stated.
    """

    place: Place
    amplitude: Array
    temperature: Array | float | None = None
    order: float | None = None
    preload: Preload | None = None


def measured_session(bushing: Bushing | None, tests: Sequence[Loop | Sweep]) -> list[RubberConditions]:
    """Conditions of measured tests: temperature, time in the session, earlier strains of each point, and preload.

    Args:
        bushing: the bushing; None if only specimens were tested.
        tests: loops and sweeps, in order; the condition `order` of a test takes precedence.

    Returns:
        Conditions of each test, in the order of `tests`. Temperature [K], session time (0 to 1) and earlier strains
        have one entry per row of a sweep, one entry for a loop.
    """
    session_tests = []
    for test in tests:
        order = test.source.conditions.get("order") if test.source else None
        reached = test.amplitude_reached if isinstance(test, Sweep) else np.array([np.ptp(test.displacement) / 2.0])
        number = None if order is None else float(order)
        session_tests.append(SessionTest(test.direction, reached, test.temperature, number, test.preload))
    return session(bushing, session_tests)


def planned_session(bushing: Bushing | None, tests: Sequence[SimulatedTest], repeats: int) -> list[RubberConditions]:
    """Conditions of planned tests: temperature, time in the session, earlier strains of each point, and preload.

    The strains of a resonance test depend on its result and are assumed to be zero.

    Args:
        bushing: the bushing; None if only specimens are tested.
        tests: loops, sweeps and resonance tests to simulate, in order.
        repeats: number of repeats of a sweep that states none, and of every resonance test; each repeat adds rows.

    Returns:
        Conditions of each test, in the order of `tests`. Temperature [K], session time (0 to 1) and earlier strains
        have one entry per row of all repeats of a sweep or resonance test, one per loop of a record of loops.
    """
    session_tests = []
    for test in tests:
        if isinstance(test, SimulatedSweep):
            amplitudes = np.repeat(test.points[1], test.repeats or repeats, axis=0).ravel()
        elif isinstance(test, SimulatedLoop):
            amplitudes = np.array([amplitude for _, amplitude in test.parts])
        else:
            assert isinstance(test, SimulatedResonance)
            amplitudes = np.zeros(repeats * len(test.frequencies))
        session_tests.append(SessionTest(test.direction, amplitudes, test.temperature, preload=test.parsed_preload))
    return session(bushing, session_tests)


def session(bushing: Bushing | None, tests: Sequence[SessionTest]) -> list[RubberConditions]:
    """Conditions on which the stiffness of each test depends, from the sequence of all tests of a body (its session).

    Args:
        bushing: the bushing; None if only specimens were tested.
        tests: tests of all bodies in the order of the campaign.

    Returns:
        Conditions of each test, in the order of `tests`: temperature [K], time of each point in the session (from 0
        to 1), strain amplitudes before each point, (n,) each, and preload.
    """
    numbers = [place if test.order is None else test.order for place, test in enumerate(tests, start=1)]
    bodies = [test.place.body for test in tests]
    conditions: dict[int, RubberConditions] = {}
    for body in dict.fromkeys(bodies):
        indices = sorted((i for i, tested_body in enumerate(bodies) if tested_body == body), key=numbers.__getitem__)
        strains = [tests[i].amplitude * unit_strain(bushing, tests[i].place) for i in indices]
        ends = np.cumsum([strain.size for strain in strains])
        turn = np.arange(ends[-1]) / max(float(ends[-1]) - 1.0, 1.0)
        largest_strain = np.maximum.accumulate(np.concatenate([[0.0], *strains]))[:-1]
        histories = (turn, largest_strain, *_last_larger(np.concatenate(strains), turn))
        for i, *columns in zip(indices, *(np.split(column, ends[:-1]) for column in histories), strict=True):
            conditions[i] = replace(RubberConditions(tests[i].temperature, *columns), preload=tests[i].preload)
    return [conditions[i] for i in range(len(tests))]


def _last_larger(strain: Array, session_time: Array) -> tuple[Array, Array]:
    """Find, for each point of a session, the last earlier strain amplitude that was larger by about 15 % or more.

    Args:
        strain: strain amplitude of each point, in measured order [1], (n,).
        session_time: time of each point in the session, from 0 to 1, (n,).

    Returns:
        The larger strain amplitude, and the session time since then, (n,) each; 0 and the session time of the point if
        no earlier strain was larger.
    """
    # an unknown strain, of a resonance test, counts as none
    level = np.round(np.log(np.maximum(strain, 1e-9)) / np.log1p(_LEVEL_STEP))
    ends = np.append(np.flatnonzero(np.diff(level)), strain.size - 1)
    larger, since = np.zeros(ends.size), np.zeros(ends.size)
    above: list[int] = []  # ends of runs before, each of a larger level than all after it
    for run, end in enumerate(ends):
        while above and level[above[-1]] <= level[end]:
            above.pop()
        if above:
            larger[run], since[run] = strain[above[-1]], session_time[above[-1]]
        above.append(int(end))
    runs = np.searchsorted(ends, np.arange(strain.size))
    return larger[runs], session_time - since[runs]
