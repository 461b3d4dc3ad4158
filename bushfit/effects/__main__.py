"""`python -m bushfit.effects`: write the tables in this folder's README.md anew, from the records of the library."""

from __future__ import annotations

from pathlib import Path

from bushfit.effects import LIBRARY, Effect, qualified
from bushfit.effects.mistakes import MISTAKES

#: The page, and the comments between which its tables stand.
PAGE = Path(__file__).with_name("README.md")
BEGIN = "<!-- from the records: begin -->\n"
END = "<!-- from the records: end -->\n"


def renewed(page: str) -> str:
    """The text of the page with its tables made from the records, and all else as it was."""
    before, rest = page.split(BEGIN)
    _, after = rest.split(END)
    tables = (effects_table(), sources_table(), mistakes_table())
    return before + BEGIN + "\n" + "\n".join(tables) + "\n" + END + after


def effects_table() -> str:
    """Every effect: what it is, what it does to a sine, and its parameters."""
    head = "| name | level | kind | what it is | first harmonic | parameters |\n|---|---|---|---|---|---|\n"
    return head + "".join(
        f"| {_link(effect)} | {effect.level} | {type(effect).__name__.lower()} | {effect.sentence} "
        f"| `{effect.equation}` | {_parameters(effect)} |\n"
        for effect in LIBRARY.values()
    )


def sources_table() -> str:
    """Every effect: where its law comes from, and the test that would prove it."""
    head = "| name | source | cheapest test that would prove it |\n|---|---|---|\n"
    return head + "".join(
        f"| {_link(effect)} | {effect.source} | {effect.confirmed_by} |\n" for effect in LIBRARY.values()
    )


def mistakes_table() -> str:
    """Every mistake in the record: what would be so, the true value by the one stated, and where it can be made."""
    head = "| mistake | what would be so | true value | in |\n|---|---|---|---|\n"
    return head + "".join(
        f"| `{mistake.name}` | {mistake.sentence.format(files='FILE')} | `{mistake.equation}` "
        f"| {' or '.join(mistake.kinds) or '[bushing]'} |\n"
        for mistake in MISTAKES.values()
    )


def _link(effect: Effect) -> str:
    return f"[`{effect.name}`]({effect.name.partition('.')[0]}.py)"


def _parameters(effect: Effect) -> str:
    return "; ".join(
        f"`{qualified(effect, parameter)}` [{'-' if parameter.unit == '1' else parameter.unit}] {parameter.meaning}"
        for parameter in effect.parameters
    )


if __name__ == "__main__":
    PAGE.write_text(renewed(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
