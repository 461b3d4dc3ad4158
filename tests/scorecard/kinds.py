"""Kinds of discrepancy that no page of bushfit lists: of rig, record, rubber and the software between them.

Each is brought to one of three sizes, in shares of |K| at its largest. Half of them are held back: no verdict on those
is looked at while anything is tuned.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import discrepancies as made
import numpy as np
from discrepancies import Bench, Sized
from time_rig import Change, Response, respond

#: Shares of |K| to which a kind is brought: hardly seen, plain, gross.
SIZES = (0.015, 0.04, 0.10)
#: Tries in which its amount is found, and how near is near enough (logarithm of the ratio).
_TRIES, _NEAR = 14, 0.05

Place = Literal["level", "frequency", "repeat", "loop", "direction"]


@dataclass(frozen=True)
class Kind:
    """A kind of discrepancy, and what may be said of it.

    Args:
        sentence: what happened.
        held_back: whether its verdicts are left alone until the end.
        made: by a bench, what changes by an amount.
        right: effects of the library that describe it truly; a family, such as "stiffness_factor", is all its places.
        place: parts of the tests that alone are off.
        needs: what the tests must have.
    """

    sentence: str
    held_back: bool
    made: Callable[[Bench], Sized]
    right: tuple[str, ...] = ()
    place: tuple[Place, ...] = ()
    needs: tuple[Literal["both", "loop", "repeats"], ...] = ()


_GIVES = ("sleeve_compliance", "rig_compliance")
_FACTOR = ("stiffness_factor", "transducer_gain", "preload_stiffening")

#: Every kind by name; which are held back was fixed before any was diagnosed.
KINDS: dict[str, Kind] = {
    "range_switch": Kind(
        "the amplifier of one direction has another gain above a force", False, made.range_switch, (), ("level",)
    ),
    "guide_sticks": Kind("a guide rubs at one level of one direction", False, made.guide_sticks, (), ("level",)),
    "mains_hum": Kind("mains hum leaks into the force near its frequencies", False, made.hum, (), ("frequency",)),
    "loosening": Kind("a clamp loosens from the middle of the session on", False, made.loosening, ("drift",)),
    "row_shift": Kind(
        "the stiffness column of one level slipped down some rows", False, made.row_shift, (), ("level",)
    ),
    "rounded_stiffness": Kind(
        "the stiffness of one file was rounded", False, made.rounded_stiffness, (), ("direction",)
    ),
    "adhesive": Kind("the adhesive flexes in series, with a springpot of its own", False, made.adhesive, _GIVES),
    "buckling": Kind("in one sense the rubber softens beyond a strain", False, made.buckling, ("asymmetry",)),
    "ageing": Kind(
        "the rubber aged before its second direction",
        False,
        made.ageing,
        (*_FACTOR, "elastic_preload"),
        ("direction",),
        ("both",),
    ),
    "orifice": Kind(
        "liquid is pressed through an orifice: a force that goes with the square of the speed", False, made.orifice
    ),
    "leakage": Kind("records with an offset are cut off within a cycle", False, made.leakage, (), ("frequency",)),
    "detrended": Kind(
        "a straight line was taken off the force of few cycles", False, made.detrended, (), ("frequency",)
    ),
    "too_much_mass": Kind("the software makes up for more mass than moves", False, made.too_much_mass),
    "noise_floor": Kind("noise counts as displacement", False, made.noise_floor, (), ("level",)),
    "anti_alias": Kind("the force alone goes through a low-pass", True, made.anti_alias, ("delay",)),
    "thermal_repeat": Kind(
        "one repeat warms up while it runs", True, made.thermal_repeat, (), ("repeat",), ("repeats",)
    ),
    "overshoot": Kind(
        "the controller overshoots in a band, and the command is recorded", True, made.overshoot, (), ("frequency",)
    ),
    "tilted": Kind(
        "the specimen of one direction was clamped tilted", True, made.tilted, _FACTOR, ("direction",), ("both",)
    ),
    "rounded_phase": Kind("phases were rounded", True, made.rounded_phase),
    "reversed_rows": Kind(
        "some rows of one level stand in reverse", True, made.reversed_rows, (), ("level", "frequency")
    ),
    "cole_cole": Kind(
        "the second phase of a blend relaxes over a broad band", True, made.cole_cole, ("maxwell", "second_springpot")
    ),
    "edge_slip": Kind("the bonded edges slip beyond a strain", True, made.edge_slip, ("sliders",)),
    "crystals": Kind("slow tests have time to crystallise beyond a strain", True, made.crystals),
    "smoothed_across": Kind("the columns were smoothed across the ends of runs", True, made.smoothed_across),
    "peak_picking": Kind("peaks of the force are read off few samples", True, made.peak_picking),
    "loop_filter": Kind(
        "the force of the loops alone was averaged over some samples", True, made.loop_filter, (), ("loop",), ("loop",)
    ),
    "too_much_compliance": Kind("the software makes up for more give than there is", True, made.too_much_compliance),
    "late_specimen": Kind("the top level was tested on another specimen", True, made.late_specimen, (), ("level",)),
}


def largest(bench: Bench, response: Response, change: Change) -> float:
    """Largest difference of a noise-free record from the clean one, of |K|."""
    stiffness = change.record(response.stiffness)
    return float(np.max(np.abs(stiffness - bench.clean.stiffness) / bench.size))


def sized(bench: Bench, kind: Kind, size: float) -> Change:
    """The kind, brought as near to a size as it comes: one that goes in steps may not reach it."""
    by, amount = kind.made(bench), size
    best, off = by(amount), np.inf
    for _ in range(_TRIES):
        change = by(amount)
        ratio = np.log(max(largest(bench, respond(bench.tests, bench.rubber, change), change), 1e-12) / size)
        if abs(ratio) < off:
            best, off = change, abs(ratio)
        if off < _NEAR:
            break
        amount *= float(np.exp(-np.clip(ratio, -2.0, 2.0)))
    return best
