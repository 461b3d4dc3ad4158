"""The words that columns go by in test files, from words.toml."""

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path

from bushfit.geometry import STRAINING, Motion

#: The words of words.toml, by table and key.
WORDS: Mapping[str, Mapping[str, Sequence[str]]] = tomllib.loads(
    Path(__file__).with_name("words.toml").read_text(encoding="utf-8")
)
#: For each column of a loop, the headers it goes by.
LOOP_COLUMNS = WORDS["loop"]
#: For each column of a sweep, the headers it goes by.
SWEEP_COLUMNS = WORDS["sweep"]
#: For each column that says which test a row belongs to, by key, the headers it goes by.
ROW_COLUMNS = {**WORDS["rows"], "specimen_number": WORDS["above"]["specimen_number"], "run": SWEEP_COLUMNS["repeat"]}


def _made_of(body: str, quantity: str) -> list[str]:
    """Every name of a quantity, such as "acceleration", before and after every name of a body, such as "base"."""
    parts = WORDS["resonance_parts"]
    return [way for name in parts[body] for word in parts[quantity] for way in (f"{name} {word}", word + name)]


#: For each column of a resonance test (a mass on a mount on a shaker), the headers it goes by.
RESONANCE_COLUMNS: Mapping[str, Sequence[str]] = {
    "frequency": SWEEP_COLUMNS["frequency"],
    **{f"{body}_{word}": _made_of(body, word) for word in ("acceleration", "phase") for body in ("base", "mass")},
    **WORDS["resonance"],
    **{
        f"{body}_{part}": [
            f"{name} {word}" for name in _made_of(body, "acceleration") for word in WORDS["resonance_parts"][part]
        ]
        for body in ("base", "mass")
        for part in ("real", "imaginary")
    },
}
#: For each column of a test of strain and modulus, the headers it goes by in place of those above.
_STRAINING = {role: names for role, names in WORDS["straining"].items() if role != "amplitude_of"} | {
    "amplitude": [
        *SWEEP_COLUMNS["amplitude"],
        *(
            way.format(strain)
            for strain in WORDS["straining"]["displacement"]
            for way in WORDS["straining"]["amplitude_of"]
        ),
        *WORDS["straining"]["amplitude"],
    ]
}
#: The columns of which the headers depend on the motion: those of what moves and of what resists it.
OF_MOTION = (*_STRAINING, "amplitude_reached")


def of_motion(names: Mapping[str, Sequence[str]], motion: Motion) -> dict[str, Sequence[str]]:
    """The headers that columns go by in a test of one kind of motion: G' names a modulus, and no stiffness."""
    return {role: _STRAINING.get(role, usual) if motion is STRAINING else usual for role, usual in names.items()}
