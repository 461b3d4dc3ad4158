"""Accuracy class of a rig: size of the errors shared by a whole test, as stated in [rig] or assumed."""

import numpy as np

from bushfit.campaign.schema import RigSettings

#: Class of a rig without stated class: relative gain error and phase error [rad]; chosen: that of most rigs.
ASSUMED = (5e-3, float(np.radians(0.25)))
#: Expected errors that all runs of a level share, which repeats cannot reveal, if [rig] states no class: 0.58 times the
#: class, the root mean square of the sizes within the class by their prior weights (`LEVELS` of the diagnosis).
UNSTATED_LEVEL = (0.58 * ASSUMED[0], 0.58 * ASSUMED[1])
#: Largest error, in units of the rig's class, that is attributed to the rig; chosen: as for outliers of normal errors.
_MOST_CLASSES = 3.0


def class_errors(rig: RigSettings, unstated: tuple[float, float] = ASSUMED) -> tuple[float, float]:
    """Standard deviations of a rig's errors of gain (relative) and phase [rad], as stated in [rig], else `unstated`."""
    gain, phase = (default if one is None else one for one, default in zip(rig.stiffness_errors, unstated, strict=True))
    return gain, phase


def largest_error(rig: RigSettings) -> tuple[float, float]:
    """Largest standard deviations of gain and phase [rad] errors of a test that the accuracy of the rig explains."""
    gain, phase = class_errors(rig)
    return _MOST_CLASSES * gain, _MOST_CLASSES * phase


def format_class_errors(error: tuple[float, float]) -> str:
    """Format a relative gain error and a phase error [rad] as text, such as "0.5 % gain and 0.25 deg phase"."""
    texts = f"{100.0 * error[0]:.2g} % gain", f"{np.degrees(error[1]):.2g} deg phase"
    return " and ".join(text for text, size in zip(texts, error, strict=True) if size or not any(error))


def describe_class(rig: RigSettings) -> str:
    """Format the gain and phase error of a rig as text, and state which of them is assumed."""
    unstated = [name for name, error in zip(("gain", "phase"), rig.stiffness_errors, strict=True) if error is None]
    origin = f"{' and '.join(unstated)} assumed" if unstated else "stated in [rig]"
    return f"{format_class_errors(class_errors(rig))} ({'both assumed' if len(unstated) > 1 else origin})"
