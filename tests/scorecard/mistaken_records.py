"""Mistakes in what the files of a clean campaign state, each made here and mended nowhere."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from kinds import Bench, Kind, Mask, Sized
from time_rig import Array, Bushing, Change, Complex, Tests

MISTAKEN: dict[str, Kind] = {}


def _some_sweeps(bench: Bench) -> Mask:
    """The sweeps of one direction, or all."""
    return bench.sweeps & ((bench.tests.direction == bench.direction()) | (bench.random.random() < 0.5))


def _loops(bench: Bench) -> Mask:
    return bench.tests.loop


def _register(
    name: str, sentence: str, chosen: Callable[[Bench], Mask], change: Callable[[Mask], Change], **more: Any
) -> None:
    def made(bench: Bench) -> Sized:
        made = change(chosen(bench))
        return lambda _: made

    right = more.pop("right", (name,))
    needs = ("loop",) if chosen is _loops else ("both",)
    MISTAKEN[name] = Kind(sentence, made, right, needs=needs, in_sizes=False, **more)


def _scaled(mask: Mask, displacement: float = 1.0, force: float = 1.0, time: float = 1.0, **_: float) -> Change:
    """Displacements, forces and times of some tests as stated, over those that were measured."""

    def factor(value: float) -> Array:
        return np.where(mask, value, 1.0)

    def stated(tests: Tests) -> Tests:
        return replace(
            tests, amplitude=tests.amplitude * factor(displacement), frequency=tests.frequency / factor(time)
        )

    return Change(
        stated=stated,
        force=lambda _, true: true * factor(force)[:, None],
        record=lambda stiffness: stiffness / factor(displacement),
    )


def _misread(mask: Mask, read: Callable[[Complex], Complex]) -> Change:
    return Change(record=lambda stiffness: np.where(mask, read(stiffness), stiffness))


def _with_loss(stiffness: Complex, loss: Array) -> Complex:
    """The same |K| beside another loss factor."""
    return np.asarray(np.abs(stiffness) * (1.0 + 1j * loss) / np.abs(1.0 + 1j * loss))


def _peak_to_peak(mask: Mask) -> Change:
    return Change(stated=lambda tests: replace(tests, amplitude=tests.amplitude * np.where(mask, 2.0, 1.0)))


def _radii(_: Mask, factor: float) -> Change:
    def stated(tests: Tests) -> Tests:
        true = tests.bushing
        return replace(tests, bushing=Bushing(factor * true.inner, factor * true.outer, true.length))

    return Change(stated=stated)


def _other_direction(mask: Mask) -> Change:
    return Change(stated=lambda tests: replace(tests, direction=np.where(mask, 1 - tests.direction, tests.direction)))


_register("peak_to_peak", "amplitudes are peak-to-peak", _some_sweeps, _peak_to_peak)
_register("other_direction", "the files of two directions were exchanged", lambda bench: bench.sweeps, _other_direction)
_register("diameters", "the radii are diameters", lambda bench: bench.sweeps, partial(_radii, factor=2.0))
_register("radii_halved", "the radii were halved", lambda bench: bench.sweeps, partial(_radii, factor=0.5))
for _name, _sentence, _chosen, _factors in (
    ("kilogram_force", "forces are kgf, not N", _some_sweeps, {"force": 1.0 / 9.80665}),
    ("twice_in_newton", "forces were multiplied by 9.81 twice", _some_sweeps, {"force": 9.80665}),
    ("pound_per_inch", "stiffness is in lbf/in, not N/mm", _some_sweeps, {"force": 1.0 / 0.1751268352}),
    ("inch", "displacements are inches, not mm", _some_sweeps, {"displacement": 1.0 / 25.4}),
    ("pound_force", "forces of the loops are lbf, not N", _loops, {"force": 1.0 / 4.4482216}),
    ("sixty_times_faster", "loops ran 60 times faster than stated", _loops, {"time": 60.0}),
    ("sixty_times_slower", "loops ran 60 times slower than stated", _loops, {"time": 1.0 / 60.0}),
    ("ten_times_faster", "loops ran 10 times faster than stated", _loops, {"time": 10.0}),
    ("loop_clock", "the loops' clock runs 3 times too slow", _loops, {"time": 1.0 / 3.0}),
):
    _register(_name, _sentence, _chosen, partial(_scaled, **_factors))
for _name, _sentence, _form, _read in (
    ("phase_in_radians", "phases are radians", 1, lambda k: np.abs(k) * np.exp(1j * np.radians(np.angle(k)))),
    ("complement", "phases are 90 deg minus the loss angle", 1, lambda k: 1j * np.conj(k)),
    ("loss_in_per_cent", "loss factors are per cent", 0, lambda k: _with_loss(k, 100.0 * k.imag / k.real)),
    ("loss_as_ratio", "loss factors were divided by 100", 0, lambda k: _with_loss(k, 0.01 * k.imag / k.real)),
    ("sin_delta", "loss factors are sin delta", 0, lambda k: _with_loss(k, k.imag / np.abs(k))),
    ("storage_for_magnitude", "the stiffness is K', not |K|", 0, lambda k: k * k.real / np.abs(k)),
    ("magnitude_for_storage", "the storage stiffness is |K|", 2, lambda k: np.abs(k) + 1j * k.imag),
):
    _register(_name, _sentence, _some_sweeps, partial(_misread, read=_read), form=_form)
