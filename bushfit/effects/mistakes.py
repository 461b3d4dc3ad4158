"""Mistakes that laboratories make: what a file, or the campaign, says is not what was measured.

Each is an effect of the level `record` and has no parameter: it either is so or it is not. Nothing is mended unless the
user says so.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from bushfit.effects import effect_named
from bushfit.effects.contract import Effect
from bushfit.effects.mistake import Mistake
from bushfit.errors import ModelError
from bushfit.geometry import ROTATION, TRANSLATION
from bushfit.reading.measurement import Complex

#: [N] A kilogram-force.
_KILOGRAM_FORCE = 9.80665
#: [N] A pound-force.
_POUND_FORCE = 4.4482216152605
#: [mm] An inch.
_INCH = 25.4
#: [deg] A radian.
_RADIAN = float(np.degrees(1.0))
#: Loss factor below which that of a filled rubber is in doubt; chosen: the least damping of them have twice that.
_LEAST_LOSS = 0.02
#: Loss factor above which that of a rubber in a bushing is in doubt; chosen: the largest reach it at no temperature of
#: use.
_MOST_LOSS = 1.0

#: What puts between the name of a mistake and that of the test it was made in.
SEPARATOR = ":"


def _loss(stiffness: Complex) -> float:
    """Median loss factor."""
    return float(np.median(stiffness.imag / stiffness.real))


def _little_loss(stiffness: Complex) -> bool:
    return 0.0 < _loss(stiffness) < _LEAST_LOSS


def _much_loss(stiffness: Complex) -> bool:
    return _loss(stiffness) > _MOST_LOSS


def _times_loss(factor: float, stiffness: Complex) -> Complex:
    """The same |K|, and the loss factor times a factor."""
    loss = 1.0 + 1j * factor * stiffness.imag / stiffness.real
    return np.asarray(np.abs(stiffness) * loss / np.abs(loss))


def _sine(stiffness: Complex) -> Complex:
    """The same |K|, with K''/|K| where its loss factor was stated."""
    sine = np.clip(stiffness.imag / stiffness.real, -1.0, 1.0)
    return np.asarray(np.abs(stiffness) * (np.sqrt(1.0 - sine**2) + 1j * sine))


def _magnitude(stiffness: Complex) -> Complex:
    """K' where |K| was stated."""
    return np.asarray(stiffness * np.abs(stiffness) / stiffness.real)


def _storage(stiffness: Complex) -> Complex:
    """|K| where K' was stated, beside the right K''."""
    storage = np.sqrt(np.maximum(stiffness.real**2 - stiffness.imag**2, 0.0))
    return np.asarray(storage + 1j * stiffness.imag)


def _turned(stiffness: Complex) -> Complex:
    """The same |K|, and the phase in radians where it was read in degrees."""
    return np.asarray(np.abs(stiffness) * np.exp(1j * _RADIAN * np.angle(stiffness)))


def _complement(stiffness: Complex) -> Complex:
    """The same |K|, and 90 deg less the phase."""
    return np.asarray(1j * np.conj(stiffness))


#: Every mistake by name, the most frequent first; of two that explain tests alike the first leads.
MISTAKES: dict[str, Mistake] = {
    mistake.name: mistake
    for mistake in (
        Mistake(
            name="peak_to_peak",
            sentence="the amplitudes of {files} are peak-to-peak",
            equation="X = stated/2",
            line='amplitude = "peak-to-peak"',
            displacement=0.5,
        ),
        Mistake(
            name="zero_to_peak",
            sentence="the amplitudes of {files} are zero-to-peak, not peak-to-peak as stated",
            equation="X = 2 stated",
            line='take out amplitude = "peak-to-peak", or what says so in the header',
            displacement=2.0,
        ),
        Mistake(
            name="other_direction",
            sentence="{files} was tested in the other direction, axial for radial or the reverse",
            equation="axial for radial",
            line='direction = "{direction}"',
            kinds=("sweep", "loop"),
            swaps=True,
        ),
        Mistake(
            name="sixty_times_faster",
            sentence="{files} ran 60 times faster than stated",
            equation="t = stated/60",
            line="write the rate or frequency per second where it is stated per minute, or seconds for minutes in the "
            "header of the time",
            kinds=("loop",),
            time=1.0 / 60.0,
        ),
        Mistake(
            name="sixty_times_slower",
            sentence="{files} ran 60 times slower than stated",
            equation="t = 60 stated",
            line='write the rate per minute where it is stated per second, or units = {{ time = "min" }}',
            kinds=("loop",),
            time=60.0,
        ),
        Mistake(
            name="ten_times_faster",
            sentence="{files} ran 10 times faster than stated",
            equation="t = stated/10",
            line="write ten times the rate or frequency, or a tenth of the times in the file",
            kinds=("loop",),
            time=0.1,
        ),
        Mistake(
            name="ten_times_slower",
            sentence="{files} ran 10 times slower than stated",
            equation="t = 10 stated",
            line="write a tenth of the rate or frequency, or ten times the times in the file",
            kinds=("loop",),
            time=10.0,
        ),
        Mistake(
            name="milliseconds",
            sentence="the times of {files} are milliseconds, not seconds",
            equation="t = stated/1000",
            line='units = {{ time = "ms" }}, and the same in the header if that states a unit',
            kinds=("loop",),
            time=1e-3,
        ),
        Mistake(
            name="kilogram_force",
            sentence="the forces of {files} are kgf, not N",
            equation="F = 9.81 stated",
            line='units = {{ force = "kgf" }}, and the same in the header if that states a unit',
            sweep_line='units = {{ stiffness = "kgf/mm" }}, and the same in the header if that states a unit',
            kinds=("sweep", "loop"),
            motion=TRANSLATION,
            force=_KILOGRAM_FORCE,
        ),
        Mistake(
            name="twice_in_newton",
            sentence="the forces of {files} were multiplied by 9.81 once too often",
            equation="F = stated/9.81",
            line="divide the forces of the file by 9.80665",
            kinds=("sweep", "loop"),
            motion=TRANSLATION,
            force=1.0 / _KILOGRAM_FORCE,
        ),
        Mistake(
            name="pound_force",
            sentence="the forces of {files} are lbf, not N",
            equation="F = 4.45 stated",
            line='units = {{ force = "lbf" }}, and the same in the header if that states a unit',
            kinds=("loop",),
            motion=TRANSLATION,
            force=_POUND_FORCE,
        ),
        Mistake(
            name="pound_per_inch",
            sentence="the stiffness of {files} is in lbf/in, not N/mm",
            equation="K = 0.175 stated",
            line='units = {{ stiffness = "lbf/in" }}, and the same in the header if that states a unit',
            motion=TRANSLATION,
            force=_POUND_FORCE / _INCH,
        ),
        Mistake(
            name="inch",
            sentence="the displacements of {files} are inches, not mm",
            equation="X = 25.4 stated",
            line='units = {{ displacement = "inch" }}, and the same in the header if that states a unit',
            sweep_line='units = {{ amplitude = "inch" }}, and the same in the header if that states a unit',
            kinds=("sweep", "loop"),
            motion=TRANSLATION,
            displacement=_INCH,
        ),
        Mistake(
            name="radians",
            sentence="the rotations of {files} are radians, not degrees",
            equation="X = 57.3 stated",
            line='units = {{ displacement = "rad" }}, and the same in the header if that states a unit',
            sweep_line='units = {{ amplitude = "rad" }}, and the same in the header if that states a unit',
            kinds=("sweep", "loop"),
            motion=ROTATION,
            displacement=_RADIAN,
        ),
        Mistake(
            name="degrees",
            sentence="the rotations of {files} are degrees, not radians",
            equation="X = stated/57.3",
            line='units = {{ displacement = "deg" }}, and the same in the header if that states a unit',
            sweep_line='units = {{ amplitude = "deg" }}, and the same in the header if that states a unit',
            kinds=("sweep", "loop"),
            motion=ROTATION,
            displacement=1.0 / _RADIAN,
        ),
        Mistake(
            name="per_degree",
            sentence="the stiffness of {files} is per degree, not per radian",
            equation="K = 57.3 stated",
            line='units = {{ stiffness = "N m/deg" }}, and the same in the header if that states a unit',
            motion=ROTATION,
            force=_RADIAN,
        ),
        Mistake(
            name="per_radian",
            sentence="the stiffness of {files} is per radian, not per degree",
            equation="K = stated/57.3",
            line='units = {{ stiffness = "N m/rad" }}, and the same in the header if that states a unit',
            motion=ROTATION,
            force=1.0 / _RADIAN,
        ),
        Mistake(
            name="phase_in_radians",
            sentence="the phases of {files} are radians, not degrees",
            equation="phase = 57.3 stated",
            line='units = {{ phase = "rad" }}, and the same in the header if that states a unit',
            stiffness=_turned,
            doubt=_little_loss,
        ),
        Mistake(
            name="complement",
            sentence="the phases of {files} are 90 deg less the loss angle",
            equation="phase = 90 deg - stated",
            line="write 90 deg less the angle into the column of the phase",
            stiffness=_complement,
            doubt=_much_loss,
        ),
        Mistake(
            name="loss_in_per_cent",
            sentence="the loss factors of {files} are per cent, not ratios",
            equation="K''/K' = stated/100",
            line='units = {{ loss_factor = "%" }}, and the same in the header if that states a unit',
            stiffness=partial(_times_loss, 0.01),
            doubt=_much_loss,
        ),
        Mistake(
            name="loss_as_ratio",
            sentence="the loss factors of {files} are ratios, not per cent",
            equation="K''/K' = 100 stated",
            line='units = {{ loss_factor = "1" }}, and [-] in the header if that states a unit',
            stiffness=partial(_times_loss, 100.0),
            doubt=_little_loss,
        ),
        Mistake(
            name="sin_delta",
            sentence="the loss factors of {files} are K''/|K| (sin delta), not K''/K' (tan delta)",
            equation="K''/|K| = stated",
            line="write tan delta into the column of the loss factor: s/sqrt(1 - s^2) for each s",
            stiffness=_sine,
        ),
        Mistake(
            name="storage_for_magnitude",
            sentence="the stiffness of {files} is K', not |K|",
            equation="K' = stated",
            line="write |K| = K' sqrt(1 + loss factor^2) into the column of the stiffness, or name the columns of "
            'storage and loss stiffness in columns = {{ storage_stiffness = "...", loss_stiffness = "..." }}',
            stiffness=_magnitude,
        ),
        Mistake(
            name="magnitude_for_storage",
            sentence="the storage stiffness of {files} is |K|, not K'",
            equation="|K| = stated",
            line="write K' = sqrt(|K|^2 - K''^2) into the column of the storage stiffness",
            stiffness=_storage,
        ),
        Mistake(
            name="diameters",
            sentence="the radii in [bushing] are diameters",
            equation="a, b = stated/2",
            line="[bushing]: half of what stands at inner_radius and at outer_radius",
            kinds=(),
            displacement=0.5,
        ),
        Mistake(
            name="radii_halved",
            sentence="the radii in [bushing] were halved as if they were diameters",
            equation="a, b = 2 stated",
            line="[bushing]: twice what stands at inner_radius and at outer_radius",
            kinds=(),
            displacement=2.0,
        ),
    )
}


def labelled(name: str, test: str | None) -> str:
    """A mistake with its test, as options take it; None for one that is made in no test."""
    return name if test is None else f"{name}{SEPARATOR}{test}"


def mistake_named(name: str) -> Mistake | None:
    """The mistake of a name such as peak_to_peak, or peak_to_peak:sweep_axial with its test; None where none is."""
    return MISTAKES.get(name.partition(SEPARATOR)[0])


def candidate_named(name: str) -> Effect:
    """The effect of the library, or the mistake, of that name; a mistake may have its test behind a colon.

    Raises:
        ModelError: there is none; the nearest name is suggested.
    """
    mistake = mistake_named(name)
    if mistake is None and SEPARATOR in name:
        expected = f"MISTAKE{SEPARATOR}TEST with one of {', '.join(MISTAKES)}"
        raise ModelError("unknown mistake", found=name, expected=expected)
    return mistake or effect_named(name)
