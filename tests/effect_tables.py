"""`python tests/effect_tables.py`: write the tables of the page on effects anew, from the library's records."""

from collections.abc import Iterable, Iterator
from pathlib import Path

import bushfit
from bushfit.effects import LIBRARY, Effect, get_effect, qualified_name
from bushfit.effects.mistakes import MISTAKES

#: The page, and the comments between which its tables stand.
PAGE = Path(bushfit.__file__).with_name("manual") / "effects.md"
BEGIN = "<!-- from the records: begin -->\n"
END = "<!-- from the records: end -->\n"


def renewed(page: str) -> str:
    """The text of the page with its tables made from the records, and all else as it was."""
    before, rest = page.split(BEGIN)
    _, after = rest.split(END)
    return before + BEGIN + "\n" + "\n".join(_tables()) + "\n" + END + after


def _tables() -> Iterator[str]:
    """Effects; twins; mistakes in the record."""
    library = LIBRARY.values()
    twinned = [effect for effect in library if effect.twins]
    yield _table(
        ("name", "level", "kind", "what it is", "first harmonic", "parameters"),
        ((_link(e), e.level, type(e).__name__.lower(), e.sentence, f"`{e.equation}`", _parameters(e)) for e in library),
    )
    yield _table(
        ("reported effect", "twins, which no test of the bushing can distinguish from it"),
        ((f"`{e.name}`", ", ".join(f"`{twin}` ({get_effect(twin).level})" for twin in e.twins)) for e in twinned),
    )
    yield _table(
        ("mistake", "what is true", "true value", "tests"),
        (
            (
                f"`{m.name}`",
                "wrong prefix" if m.scales else m.sentence.format(files="FILE", factor="FACTOR"),
                f"`{m.equation}`",
                "both" if len(m.kinds) > 1 else "".join(m.kinds) or "[bushing]",
            )
            for m in MISTAKES.values()
        ),
    )


def _table(head: tuple[str, ...], rows: Iterable[tuple[object, ...]]) -> str:
    first, *others = (f"| {' | '.join(map(str, line))} |\n" for line in (head, *rows))
    return "".join([first, "|---" * len(head), "|\n", *others])


def _link(effect: Effect) -> str:
    file = f"{effect.name.partition('.')[0]}.py"
    place = file if (PAGE.parents[1] / "effects" / file).exists() else "library.toml"
    return f"[`{effect.name}`](../effects/{place})"


def _parameters(effect: Effect) -> str:
    units = {"1": "-"}
    return "; ".join(
        f"`{qualified_name(effect, each)}` [{units.get(each.unit, each.unit)}] {each.meaning}"
        for each in effect.parameters
    )


if __name__ == "__main__":
    PAGE.write_text(renewed(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
