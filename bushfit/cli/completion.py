"""What the Tab key offers where an option takes a name: of places, effects, mistakes in a test, files' schemas.

What a campaign or model on the line names is offered, too. While somebody types, no file is an error.
"""

import json
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import click

#: In which a bushing is tested: geometry, which has them, is slow to import.
DIRECTIONS = ("axial", "radial", "torsion")
#: What click asks for the words at the cursor.
Offer = Callable[[click.Context, click.Parameter, str], list[str]]
_READ: dict[str, Callable[[str], Any]] = {".toml": tomllib.loads, ".json": json.loads}


def _named(ctx: click.Context, tables: str, key: str) -> Iterator[str]:
    """What the campaigns and models that are typed already have under a key of such tables, as far as they do."""
    values = [path for value in ctx.params.values() for path in (value if isinstance(value, tuple) else [value])]
    typed = {Path(path) for path in (*values, *ctx.args) if isinstance(path, str | Path)}
    for path in (path for path in typed if path.suffix in _READ):
        with suppress(OSError, ValueError):
            document = _READ[path.suffix](path.read_text(encoding="utf-8"))
            listed = document.get(tables) if isinstance(document, dict) else None
            entries = listed if isinstance(listed, list) else []
            yield from (str(entry[key]) for entry in entries if isinstance(entry, dict) and key in entry)


def _offered(known: Callable[[click.Context], Iterable[str]], between: str = "") -> Offer:
    """Offers what is known, of a list with certain signs `between` its names for the last."""

    def offer(ctx: click.Context, _: click.Parameter, incomplete: str) -> list[str]:
        typed = re.match(f"(?:.*[{between}])?", incomplete) if between else None
        before = typed[0] if typed else ""
        return [before + name for name in known(ctx) if name.startswith(incomplete[len(before) :])]

    return offer


def _places(ctx: click.Context) -> Iterator[str]:
    yield from DIRECTIONS
    yield from _named(ctx, "specimens", "name")


def _effects(_: click.Context) -> list[str]:
    from bushfit.effects import BASE, LIBRARY

    return [name for name in LIBRARY if name not in BASE]


def _explanations(ctx: click.Context) -> Iterator[str]:
    """Effects, and mistakes with the test that they may have been made in."""
    from bushfit.effects.mistakes import MISTAKES, labelled

    yield from _effects(ctx)
    for name, mistake in MISTAKES.items():
        yield from (
            labelled(name, Path(file).stem) for kind in mistake.kinds for file in _named(ctx, f"{kind}s", "file")
        )


def _schemas(_: click.Context) -> Iterable[str]:
    from bushfit.schemas import DESCRIBED

    return DESCRIBED


places, effects, explanations, schemas = map(_offered, (_places, _effects, _explanations, _schemas))
#: Several effects, between commas and plus signs.
effect_lists = _offered(_effects, ",+")
