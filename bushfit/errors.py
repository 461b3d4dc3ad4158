"""The error tree: every message says where, what was found, what was expected, and the next step."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

#: Characters of a quoted value at most: four lines of a terminal.
_LONGEST_QUOTE = 300
#: Characters that could steer a terminal or break a line, and halves of surrogate pairs.
_CONTROL = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]")


class BushfitError(Exception):
    """Something the user can put right; the command line prints it and exits with status 2.

    Args:
        problem: what is wrong, in one clause.
        file: the file it is in.
        place: the line, row, column or key in that file.
        found: what stands there.
        expected: what should stand there.
        hint: the next step.
    """

    def __init__(
        self,
        problem: str,
        *,
        file: str | Path | None = None,
        place: str | None = None,
        found: str | None = None,
        expected: str | None = None,
        hint: str | None = None,
    ) -> None:
        self.problem = problem
        self.file = None if file is None else Path(file)
        self.place = place
        self.found = found if found is None or len(found) <= _LONGEST_QUOTE else f"{found[:_LONGEST_QUOTE]} ..."
        self.expected = expected
        self.hint = hint
        super().__init__(str(self))

    def __str__(self) -> str:
        where = ", ".join(part for part in (str(self.file) if self.file else None, self.place) if part)
        lines = [_printable(f"{where}: {self.problem}" if where else self.problem)]
        for label, value in (("found", self.found), ("expected", self.expected), ("try", self.hint)):
            if value:
                lines.append(f"  {label}: {_printable(value)}")
        return "\n".join(lines)

    def __reduce__(self) -> tuple[object, ...]:
        state = {key: getattr(self, key) for key in ("file", "place", "found", "expected", "hint")}
        return _rebuild, (type(self), self.problem, state)


@contextmanager
def naming(file: Path | None) -> Iterator[None]:
    """Names the file in an error that is raised within, by what knows its content but not where it stands."""
    try:
        yield
    except BushfitError as error:
        error.file = file
        raise


def _printable(text: str) -> str:
    """A text with its control characters written as escapes, so that no file can steer the terminal that shows it."""
    return _CONTROL.sub(lambda character: character[0].encode("unicode_escape").decode(), text)


def _rebuild(kind: type[BushfitError], problem: str, state: dict[str, str | None]) -> BushfitError:
    """An error from its parts, for pickle: errors travel between the processes of a batch."""
    return kind(problem, **state)


class UnitError(BushfitError):
    """A quantity without a unit, with an unknown unit, or with a unit of another dimension."""


class CampaignError(BushfitError):
    """A campaign file that cannot be used."""


class MeasurementError(BushfitError):
    """A measured table that cannot be used."""


class NoColumnError(MeasurementError):
    """A table without the header that a column was named by."""


class ModelError(BushfitError):
    """A model file, or a set of effects and values, that cannot be used."""


class FitError(BushfitError):
    """Measurements that cannot support the fit that was asked for."""


class OutputError(BushfitError):
    """A result that cannot be written, or must not be overwritten."""


class BatchError(BushfitError):
    """A batch that cannot go on: no workers, another version on them, or a cluster that is gone."""
