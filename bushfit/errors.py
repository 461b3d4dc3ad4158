"""Errors that a user can correct: each message states location, value found, value expected and next step."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from functools import partial
from pathlib import Path

#: Maximum length of a quoted value in a message [characters].
_LONGEST_QUOTE = 300
#: Control characters, line separators, marks that reverse the direction of text, and single surrogates.
CONTROL = re.compile("[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
#: Characters of a path that a shell would interpret.
_SHELL_CHARACTERS = re.compile(r"[^\w./\\:~+,@%=-]")


class BushfitError(Exception):
    """An error that the user can correct; the command line prints it and exits with status 2.

    Args:
        problem: the problem in one clause.
        file: file that contains the problem.
        place: line, row, column or key in the file.
        found: value in the file.
        expected: value or kind of value that is valid.
        hint: next step for the user.
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
        location = ", ".join(part for part in (str(self.file) if self.file else None, self.place) if part)
        head = f"{location}: {self.problem}" if location else self.problem
        lines = (("", head), ("  found: ", self.found), ("  expected: ", self.expected), ("  try: ", self.hint))
        return "\n".join(label + printable(text) for label, text in lines if text)

    def __reduce__(self) -> tuple[object, ...]:
        """Return a constructor call for pickle, because the processes of a batch pass errors to one another."""
        state = {key: getattr(self, key) for key in ("file", "place", "found", "expected", "hint")}
        return partial(type(self), self.problem, **state), ()


@contextmanager
def error_location(
    file: Path | None = None, place: str | None = None, hint: str | None = None, *, default_place: str | None = None
) -> Iterator[None]:
    """Context that adds a file, a place and a next step to errors raised inside it.

    Args:
        file: replaces the file of the error, unless None.
        place: replaces the place of the error, unless None.
        hint: next step for errors without one.
        default_place: place for errors without one.
    """
    try:
        yield
    except BushfitError as error:
        error.file, error.hint = file or error.file, error.hint or hint
        error.place = place or error.place or default_place
        raise


def did_you_mean(name: str, candidates: Collection[str], *, similarity: float = 0.6) -> str | None:
    """Return a hint that suggests the known name most similar to a mistyped one.

    Args:
        name: unknown name.
        candidates: known names.
        similarity: minimum ratio of `difflib.SequenceMatcher`, between 0 and 1.

    Returns:
        Text such as 'did you mean "axial"?', or None if no candidate is similar enough.
    """
    near = get_close_matches(name, [candidate for candidate in candidates if candidate != name], n=1, cutoff=similarity)
    return f'did you mean "{near[0]}"?' if near else None


def printable(text: str, *, lines: bool = False) -> str:
    """Replace the control characters of a text by escape sequences.

    Every text from a measurement or campaign file passes through this function before it is printed or put on a page.

    Args:
        text: any text.
        lines: True to keep line breaks.
    """
    if lines:
        return "\n".join(map(printable, text.split("\n")))
    return CONTROL.sub(lambda character: character[0].encode("unicode_escape").decode(), text)


class UnitError(BushfitError):
    """A quantity without a unit, with an unknown unit or with a unit of another dimension."""


class CampaignError(BushfitError):
    """A campaign file that cannot be used."""


class MeasurementError(BushfitError):
    """A measured table that cannot be used."""


class NoTestError(MeasurementError):
    """A table that contains neither a loop nor a sweep."""


class ResonanceTestError(NoTestError):
    """A resonance test, which `bushfit reduce` converts to a sweep."""


class NoColumnError(MeasurementError):
    """A table that lacks the column header that the user stated."""


class ModelError(BushfitError):
    """A model file, or a set of effects and values, that cannot be used."""


class FitError(BushfitError):
    """Measurements that do not determine the requested fit."""


class OutputError(BushfitError):
    """A result that cannot be written or must not be overwritten."""


class BatchError(BushfitError):
    """A batch that cannot continue: no workers, another version on the workers, or no connection to the cluster."""


def unknown_name(
    problem: str, name: str, names: Collection[str], kind: type[BushfitError] = BushfitError, place: str | None = None
) -> BushfitError:
    """Make the error for an unknown name; its hint suggests the most similar known name.

    Args:
        problem: the problem in one clause, without the name.
        name: unknown name.
        names: known names.
        kind: class of the error.
        place: location of the name, such as the option that states it.
    """
    expected = f"one of {', '.join(names)}"
    return kind(problem, place=place, found=name, expected=expected, hint=did_you_mean(name, names))


def quote_path(path: Path | str) -> str:
    """Format a path, or another word, for a terminal: in quotes if it has characters that a shell would interpret."""
    return f'"{path}"' if _SHELL_CHARACTERS.search(str(path)) else str(path)
