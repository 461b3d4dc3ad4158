"""Candidate tests: runs that the rig can make, with their duration, and the standard programme."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bushfit.campaign.schema import RigSettings
from bushfit.campaign.simulated import SimulatedLoop, SimulatedSweep
from bushfit.diagnosis.next_test import within_limits
from bushfit.errors import ModelError
from bushfit.geometry import Direction, Place, bushing_at
from bushfit.planning.contract import Knowledge, PlanRequest, Test, operating_points
from bushfit.simulation.exact import PAPER_LOOPS, PAPER_SWEEPS

#: Cycles of the candidate loops: few, and enough to make the noise of the rows negligible.
_LOOP_CYCLES = (3, 20)
#: Indices of the frequencies of candidate sweeps among ten, which are six in equal ratios, three near the top, and the
#: top: all in equal ratios, few, the ends, the lower or upper part, and the top ones with none, one or two of the
#: lowest.
_FREQUENCY_CHOICES = (
    (0, 1, 2, 3, 4, 5, 9),
    (0, 2, 4, 9),
    (0, 3, 9),
    (0, 9),
    (0, 1, 2),
    (4, 5, 9),
    (6, 7, 8, 9),
    (0, 7, 8, 9),
    (0, 1, 6, 7, 8, 9),
)
#: Axial strain per displacement of the paper's bushing [1/m]: 1/sqrt(2 (b^2 - a^2) ln(b/a)), a = 10 mm, b = 18 mm.
_PAPER_STRAIN = float(1.0 / np.sqrt(2.0 * (0.018**2 - 0.010**2) * np.log(1.8)))


def standard_tests(knowledge: Knowledge, request: PlanRequest) -> list[Test]:
    """List the runs of the standard programme, with which a plan is compared: the tests of Garcia Tarrago et al. 2007.

    Args:
        knowledge: model of the bushing or specimens.
        request: limits of the rig, and the specimens if there is no bushing.

    Returns:
        Each run once, at the strains of that paper: axial loops and sweeps and radial sweeps of a bushing, or loops and
        sweeps of each specimen. Loops and points beyond the limits of the rig are left out.
    """
    if knowledge.model.bushing is None:
        return [test for place in request.places for test in paper_tests(knowledge, request.rig, place)]
    axial, radial = (paper_tests(knowledge, request.rig, place) for place in (Direction.AXIAL, Direction.RADIAL))
    return [*axial, *(test for test in radial if isinstance(test, SimulatedSweep))]


def paper_tests(knowledge: Knowledge, rig: RigSettings, place: Place) -> list[Test]:
    """List the axial loops and sweeps of Garcia Tarrago et al. 2007, converted to a direction, one run per amplitude.

    Args:
        knowledge: model of the bushing or specimens.
        rig: limits of the rig.
        place: direction or specimen.

    Returns:
        Loops, then sweeps, at amplitudes that cause the strains of the paper. Loops and points beyond the limits of the
        rig are left out.
    """
    tube = bushing_at(knowledge.model.bushing, place)
    scale = _PAPER_STRAIN / knowledge.model.unit_strain(place)
    if tube and place.axis is Direction.RADIAL:  # the paper's radial displacements are axial
        scale = _PAPER_STRAIN / tube.unit_strain(Direction.AXIAL)
    sweep = PAPER_SWEEPS[0]
    loops = [replace(loop, direction=place, amplitude=float(f"{loop.amplitude * scale:.2g}")) for loop in PAPER_LOOPS]
    sweeps = [replace(sweep, direction=place, amplitudes=(float(f"{x * scale:.2g}"),)) for x in sweep.amplitudes]
    return _tests_within_limits(knowledge, rig, [*loops, *sweeps])


def candidates(knowledge: Knowledge, request: PlanRequest) -> list[Test]:
    """List the runs from which a plan chooses: the standard programme, and sweeps of few points and loops.

    If [rig] states a sufficient max_frequency, frequencies reach twice those of the standard programme: a few points
    near the highest frequency reveal masses, delays and resonances.

    Args:
        knowledge: model that predicts forces and strains.
        request: limits of the rig, directions, and operating points of the predictions.

    Returns:
        Candidate runs, each once.

    Raises:
        ModelError: no test is within the limits of the rig.
    """
    rig = request.rig
    runs = [test for test in standard_tests(knowledge, request) if test.direction in request.places]
    runs += [replace(test, cycles=_LOOP_CYCLES[-1]) for test in runs if isinstance(test, SimulatedLoop)]
    for place in request.places:
        standard = [test for test in paper_tests(knowledge, rig, place) if isinstance(test, SimulatedSweep)]
        if not standard:
            continue
        predicted_rates, predicted_sizes = request.grids.get(place, ((), ()))
        sizes = np.concatenate([predicted_sizes, *(test.amplitudes for test in standard)])
        rates = np.concatenate([predicted_rates, *(test.frequencies for test in standard)])
        amplitudes = [float(f"{x:.2g}") for x in np.geomspace(sizes.min(), 2.0 * sizes.max(), 6)]
        top = min(2.0 * float(rates.max()), rig.max_frequency or float(rates.max()))
        even = np.geomspace(0.2 * rates.min(), top, 7)
        frequencies = [min(float(f"{f:.2g}"), top) for f in (*even[:-1], 0.7 * top, 0.8 * top, 0.9 * top, top)]
        steps = [tuple(sorted({frequencies[i] for i in chosen})) for chosen in _FREQUENCY_CHOICES]
        further: list[Test] = [SimulatedSweep(place, (x,), stepped) for x in amplitudes for stepped in steps]
        further += [SimulatedSweep(place, tuple(amplitudes), (frequencies[i],), "amplitude") for i in (0, 2, 4, 9)]
        # quasi-static loops, and as fast as most rigs still record
        further += [SimulatedLoop(place, x, f, n) for x in amplitudes for f in (0.1, 1.0) for n in _LOOP_CYCLES]
        runs += _tests_within_limits(knowledge, rig, further)
    if not runs:
        places = " and ".join(map(str, request.places))
        raise ModelError(
            "the rig cannot test this bushing",
            place="[rig]",
            found=f"limits below every test that is considered, {places}",
            expected="limits that permit two points of a sweep, or a loop",
        )
    return list(dict.fromkeys(runs))


def _tests_within_limits(knowledge: Knowledge, rig: RigSettings, tests: Sequence[Test]) -> list[Test]:
    """Select the loops and the points of sweeps within the rig's limits and a strain of 50 % or tested before.

    Args:
        knowledge: model that predicts forces and strains.
        rig: limits of the rig.
        tests: runs to check.

    Returns:
        Loops, and sweeps of at least two steps.
    """
    possible: list[Test] = []
    for test in tests:
        (frequency, amplitude), place = operating_points(test), test.direction
        strain = amplitude * knowledge.model.unit_strain(place)
        allowed = strain <= max(0.5, knowledge.strain or 0.0)  # strains that it has borne
        allowed &= within_limits(knowledge.model, rig, place, frequency, amplitude)
        if isinstance(test, SimulatedLoop):
            possible += [test] if allowed.all() else []
        elif np.count_nonzero(allowed) > 1:
            steps = tuple(np.array(test.steps)[allowed].tolist())
            by_frequency = test.stepped == "frequency"
            possible.append(replace(test, frequencies=steps) if by_frequency else replace(test, amplitudes=steps))
    return possible
