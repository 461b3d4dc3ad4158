"""Warnings for users, whose kind determines their importance and their consequence for the use of the numbers."""

import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from itertools import chain, repeat
from pathlib import Path

from typing_extensions import TypedDict

_TABLES: dict[str, dict[str, list[str]]] = tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8"))
#: Rank (0 for the most important) and consequence of each kind of warning.
KINDS = {
    kind: (rank, consequence)
    for rank, table in enumerate(_TABLES.values())
    for consequence, kinds in table.items()
    for kind in kinds
}
#: Consequence of warnings that have no special one.
GENERAL = KINDS["other"][1]


@dataclass(frozen=True)
class Caveat:
    """Warning for users.

    Args:
        kind: kind of the warning, as in `caveat.toml`.
        text: whole sentence, without a full stop.
        subject: beginning of the sentence if it names what the warning is about, such as a test or a direction.
    """

    kind: str
    text: str
    subject: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"caveat.toml has no kind of warning {self.kind!r}")

    def __str__(self) -> str:
        return self.text

    @property
    def rank(self) -> int:
        """Importance for the use of the numbers: 0 is the most important."""
        return KINDS[self.kind][0]

    @property
    def consequence(self) -> str:
        """Sentence on the consequence for the use of the numbers."""
        return KINDS[self.kind][1]

    def about(self, subject: object) -> "Caveat":
        """Return the warning with the sentence "subject: text"."""
        return replace(self, text=f"{subject}: {self.text}", subject=str(subject))


def join_names(names: Iterable[object], word: str = "and") -> str:
    """Join names for a sentence, as in "a, b and c", with the given word before the last.

    >>> join_names(["mu", "m", "alpha"], "or")
    'mu, m or alpha'
    """
    words = [*map(str, names)]
    return f" {word} ".join(filter(None, (", ".join(words[:-1]), *words[-1:])))


class WarningEntries(TypedDict):
    """Warnings as entries of a JSON document.

    Args:
        warnings: sentence of each warning.
        warning_kinds: kind of each warning, as in bushfit/caveat.toml.
    """

    warnings: list[str]
    warning_kinds: list[str]


def to_entries(warnings: Iterable[Caveat]) -> WarningEntries:
    """Convert warnings to entries of a JSON document."""
    listed = list(warnings)
    return {"warnings": [one.text for one in listed], "warning_kinds": [one.kind for one in listed]}


def to_caveats(sentences: Iterable[str], kinds: Iterable[str]) -> list[Caveat]:
    """Convert the warnings of a JSON file, as sentences and kinds; unknown and missing kinds become "other"."""
    accepted = (kind if kind in KINDS else "other" for kind in kinds)
    return [Caveat(kind, sentence) for sentence, kind in zip(sentences, chain(accepted, repeat("other")), strict=False)]
