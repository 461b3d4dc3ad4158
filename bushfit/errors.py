"""The error tree: every message says where, what was found, what was expected, and the next step."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from functools import partial
from pathlib import Path

#: Characters of a quoted value at most: four lines of a terminal.
_LONGEST_QUOTE = 300
#: Characters that could steer a terminal or break a line, marks that turn the order of what follows around, and halves
#: of surrogate pairs.
CONTROL = re.compile("[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
#: Characters of a path for which a shell wants quotes.
_TAKEN_APART = re.compile(r"[^\w./\\:~+,@%=-]")


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
        head = f"{where}: {self.problem}" if where else self.problem
        lines = (("", head), ("  found: ", self.found), ("  expected: ", self.expected), ("  try: ", self.hint))
        return "\n".join(label + printable(text) for label, text in lines if text)

    def __reduce__(self) -> tuple[object, ...]:
        """The error from its parts, for pickle: errors travel between the processes of a batch."""
        state = {key: getattr(self, key) for key in ("file", "place", "found", "expected", "hint")}
        return partial(type(self), self.problem, **state), ()


@contextmanager
def error_location(file: Path | None = None, place: str | None = None) -> Iterator[None]:
    """Names file and place, as far as they are given, in an error that is raised within by what does not know them."""
    try:
        yield
    except BushfitError as error:
        error.file, error.place = file or error.file, place or error.place
        raise


def did_you_mean(name: str, known: Collection[str], *, likeness: float = 0.6) -> str | None:
    """A hint at the known name that is most like another; None where none is, on difflib's scale from 0 to 1."""
    near = get_close_matches(name, known, n=1, cutoff=likeness)
    return f'did you mean "{near[0]}"?' if near else None


def printable(text: str, *, lines: bool = False) -> str:
    """A text in one line, or in its `lines`, with control characters written as escapes.

    All that stands in files of others goes through this on its way to people, so that no file can steer the terminal
    that shows it, or make a table, a picture or a page show what it does not say.
    """
    if lines:
        return "\n".join(map(printable, text.split("\n")))
    return CONTROL.sub(lambda character: character[0].encode("unicode_escape").decode(), text)


class UnitError(BushfitError):
    """A quantity without a unit, with an unknown unit, or with a unit of another dimension."""


class CampaignError(BushfitError):
    """A campaign file that cannot be used."""


class MeasurementError(BushfitError):
    """A measured table that cannot be used."""


class NoTestError(MeasurementError):
    """A table that holds no test."""


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


def quote_path(path: Path) -> str:
    """A path as it is typed into a terminal: in quotes where it holds what a shell would take apart."""
    return f'"{path}"' if _TAKEN_APART.search(str(path)) else str(path)
