"""Texts of solver decks: comments that no foreign text breaks out of, and the heading that every deck has."""

import re
import textwrap
from collections.abc import Iterable

from bushfit.export.contract import Order
from bushfit.export.levels import Table
from bushfit.units import number
from bushfit.version import __version__

#: Characters of a comment's line at most, its mark included: those of a card.
_WIDTH = 80
#: Characters that ASCII has no sign for, or that end a line.
_UNPRINTABLE = re.compile(r"[^\x20-\x7e]")


def commented(mark: str, lines: Iterable[str]) -> list[str]:
    """Comments in ASCII, each after its mark and a blank; what is too long goes on below, behind a bar.

    Line ends and other signs are written as escapes, so that no text begins a line of its own.
    """
    found = []
    for line in lines:
        plain = _UNPRINTABLE.sub(lambda sign: ascii(sign[0])[1:-1], line)
        found += textwrap.wrap(plain, _WIDTH, initial_indent=f"{mark} ", subsequent_indent=f"{mark} | ") or [mark]
    return found


def heading(order: Order, units: str, losses: Iterable[str]) -> list[str]:
    """What every deck says of itself: bushing, model and hash, units, axes, what it leaves out, and warnings."""
    bushing, source = order.result.model.bushing, order.source
    sizes = (bushing.inner_radius, bushing.outer_radius, bushing.length) if bushing else ()
    return [
        f"written by bushfit {__version__}",
        f"bushing: {order.result.name}",
        f"inner radius, outer radius, length: {', '.join(number(1e3 * size, 6) for size in sizes)} mm",
        f"model: {source.file}",
        f"sha256: {source.sha256}",
        f"units: {units}",
        "axes: z along the bushing (axial 3, torsion 6), x and y across (radial 1, 2)",
        *map(": ".join, order.said(losses)),
    ]


def stated(level: Iterable[Table]) -> str:
    """The amplitudes of a level in words: "axial at 0.2 mm, torsion at 1 deg"."""
    displayed = [(table, table.direction.display.displacement) for table in level]
    return ", ".join(
        f"{table.direction} at {number(table.amplitude * factor, 6)} {unit}" for table, (unit, factor) in displayed
    )


def to_bytes(lines: Iterable[str]) -> bytes:
    """The bytes of a deck; a sign beyond ASCII in it is a fault."""
    return ("\n".join(lines) + "\n").encode("ascii")
