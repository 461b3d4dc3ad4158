"""Roles of columns: their names and SI units by the motion of a test, and pairs that give a complex stiffness."""

from collections.abc import Mapping, Sequence

from bushfit.geometry import STRAINING, Direction, Motion
from bushfit.reading.headers import SWEEP_COLUMNS, WORDS

#: Names of columns in a test of strain and modulus, by role; they replace those of loops and sweeps.
_STRAINING = {role: names for role, names in WORDS["straining"].items() if role != "amplitude_of"} | {
    "amplitude": [
        *SWEEP_COLUMNS["amplitude"],
        *(
            form.format(name)
            for name in WORDS["straining"]["displacement"]
            for form in WORDS["straining"]["amplitude_of"]
        ),
        *WORDS["straining"]["amplitude"],
    ]
}
#: Roles whose names depend on the motion: displacement or strain, force or stress, stiffness or modulus.
OF_MOTION = (*_STRAINING, "amplitude_reached", "force_amplitude", "damping_coefficient")
#: Pairs of columns that determine a complex stiffness and must agree, in order of preference.
AGREEING_PAIRS = (
    *(("stiffness", "loss_factor"), ("stiffness", "phase"), ("storage_stiffness", "loss_stiffness")),
    *(("storage_stiffness", "loss_factor"), ("storage_stiffness", "phase")),
)
#: All pairs of columns that determine a complex stiffness, in order of preference.
PAIRS = (
    *AGREEING_PAIRS,
    *(("stiffness", "loss_stiffness"), ("storage_stiffness", "damping_coefficient")),
    *(("stiffness", "damping_coefficient"), ("stiffness", "damping_ratio"), ("storage_stiffness", "damping_ratio")),
    *(("storage_compliance", "loss_compliance"), ("compliance", "phase"), ("compliance", "loss_factor")),
    *(("force_amplitude", "phase"), ("force_amplitude", "loss_factor"), ("force_amplitude", "damping_ratio")),
)
#: SI units of the roles that do not depend on the motion; other roles are ratios.
_UNITS = {"time": "s", "frequency": "Hz", "temperature": "K"}
#: Roles by the attribute of a motion that is their SI unit.
_UNITS_OF_MOTION = {
    **dict.fromkeys(("displacement", "amplitude", "amplitude_reached", *Direction), "displacement_unit"),
    **dict.fromkeys(("force", "force_amplitude"), "force_unit"),
    **dict.fromkeys(("stiffness", "storage_stiffness", "loss_stiffness"), "stiffness_unit"),
}


def of_motion(names: Mapping[str, Sequence[str]], motion: Motion) -> dict[str, Sequence[str]]:
    """Adapt column names to a kind of motion: in a test of strain, for example, G' names a modulus, not a stiffness.

    Args:
        names: usual column names, by role such as "stiffness".
        motion: kind of motion: translation, rotation or strain.

    Returns:
        Column names by role.
    """
    return {role: _STRAINING.get(role, usual) if motion is STRAINING else usual for role, usual in names.items()}


def si_unit(role: str, motion: Motion) -> str:
    """Return the SI unit of a role such as "force" in a test of a kind of motion; "1" for a ratio."""
    if role in _UNITS_OF_MOTION:
        return str(getattr(motion, _UNITS_OF_MOTION[role]))
    if role == "damping_coefficient":
        return "Pa*s" if motion is STRAINING else motion.stiffness_unit.replace("/", "*s/", 1)
    if role.endswith("compliance"):
        return {"N/m": "m/N", "Pa": "1/Pa"}.get(motion.stiffness_unit, "rad/N/m")
    if role.endswith("phase"):
        return "rad"
    return "m/s^2" if role.startswith(("base_", "mass_")) else _UNITS.get(role, "1")
