"""What the commands on raw files share: what a file does not say itself, stated by options."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from bushfit.geometry import Direction
    from bushfit.measurement import Loop

F = TypeVar("F", bound=Callable[..., Any])


@dataclass(frozen=True)
class FileSettings:
    """Direction, headers and units that options state for every file."""

    direction: Direction | None
    columns: Mapping[str, str]
    units: Mapping[str, str]
    force_sign: int

    def direction_of(self, files: Sequence[Path]) -> Direction:
        """The direction of raw histories: as stated, else as every file's name or columns say.

        Raises:
            MeasurementError: nothing says it, or the files differ.
        """
        from bushfit.directions import direction_of_file
        from bushfit.errors import MeasurementError
        from bushfit.headers import LOOP_COLUMNS
        from bushfit.table import Table

        if self.direction:
            return self.direction
        found = {}
        for file in files:
            table = Table.open(file, LOOP_COLUMNS, self.columns, self.units)
            direction = direction_of_file(file, table.headers, turns=table.agrees("displacement", "rad"))
            if direction is None:
                raise direction_error(file)
            found[direction] = file
        if len(found) > 1:
            raise MeasurementError(
                "the files are of several directions",
                found=", ".join(f"{file.name} ({direction})" for direction, file in found.items()),
                expected="histories of one direction",
                hint="reduce each direction by itself, or state --direction",
            )
        return next(iter(found))

    def read_histories(self, files: Sequence[Path], direction: Direction) -> list[Loop]:
        """The raw histories of some files, named by their stems, or by their paths where stems agree."""
        from bushfit.reading import read_loop

        stems = [file.stem for file in files]
        return [
            read_loop(
                file,
                direction,
                name=stem if stems.count(stem) == 1 else str(file),
                listed_as=file,
                columns=self.columns,
                units=self.units,
                force_sign=-1 if self.force_sign < 0 else 1,
            )
            for file, stem in zip(files, stems, strict=True)
        ]


def direction_error(file: Path) -> Exception:
    from bushfit.errors import MeasurementError

    return MeasurementError(
        "nothing says in which direction this was tested",
        file=file,
        found="neither its name nor its columns say axial, radial or torsion",
        expected="a direction",
        hint="state it: --direction axial (or radial, torsion)",
    )


def file_options(function: F) -> F:
    """--direction, --column, --unit, --force-sign, gathered into one `settings` argument."""

    @click.option("--direction", type=click.Choice(["axial", "radial", "torsion"]), help="[from the file's name]")
    @click.option("--column", "columns", multiple=True, metavar="ROLE=HEADER", help='Such as "force=Kraft (Zelle 2)".')
    @click.option("--unit", "units", multiple=True, metavar="ROLE=UNIT", help='Such as "force=kN".')
    @click.option(
        "--force-sign", type=click.Choice(["1", "-1"]), default="1", help="-1: the load cell counts the other way."
    )
    @wraps(function)
    def wrapped(*args: Any, **kwargs: Any) -> Any:
        from bushfit.geometry import Direction

        direction = kwargs.pop("direction")
        settings = FileSettings(
            Direction(direction) if direction else None,
            _pairs(kwargs.pop("columns"), "--column", "force=Kraft"),
            _pairs(kwargs.pop("units"), "--unit", "force=kN"),
            int(kwargs.pop("force_sign")),
        )
        return function(*args, settings=settings, **kwargs)

    return wrapped  # type: ignore[return-value]


def _pairs(texts: Sequence[str], option: str, example: str) -> dict[str, str]:
    from bushfit.errors import MeasurementError
    from bushfit.headers import LOOP_COLUMNS, SWEEP_COLUMNS

    known = list(dict.fromkeys([*LOOP_COLUMNS, *SWEEP_COLUMNS]))
    pairs = {}
    for text in texts:
        role, equals, value = text.partition("=")
        role = role.strip().replace(" ", "_").replace("-", "_")
        if not (equals and value.strip() and role in known):
            raise MeasurementError(
                "not a column's role with a value",
                place=option,
                found=f'"{text}"',
                expected=f'such as "{example}"; roles: {", ".join(known)}',
            )
        pairs[role] = value.strip()
    return pairs
