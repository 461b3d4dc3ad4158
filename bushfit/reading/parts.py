"""The parts of a file that may hold a table each: sheets of a workbook, or groups of channels of a recording."""

from collections.abc import Callable, Sequence
from pathlib import Path

from bushfit.errors import MeasurementError, did_you_mean
from bushfit.reading.files import view_bytes
from bushfit.reading.instruments import format_of, read_groups, word_for_part
from bushfit.reading.source import Sheet
from bushfit.reading.workbook import is_workbook, read_sheets

#: Parts that an error lists at most; chosen: a line or two.
_MOST_LISTED = 12
#: What to do about a test whose channels lie in several groups.
_ONE_GROUP = "a test needs its channels in one group, at one rate and of one length: resample those that differ"


def parts_of(file: Path) -> Sequence[Sheet]:
    """The visible sheets of a workbook, or the groups of a recording; none where the file is a text.

    Raises:
        MeasurementError: a workbook or recording that cannot be read.
    """
    return _read(view_bytes(file, MeasurementError), file)[1]


def open_part(data: bytes, file: Path, name: str | None, is_usable: Callable[[Sheet], bool]) -> Sheet | None:
    """The part of a file that holds the table: the one that is stated by its name, or else the only usable one.

    None where the file is a text.

    Raises:
        MeasurementError: a workbook or recording that cannot be read, or that has no such or no single usable part.
    """
    names, found = _read(data, file, name)
    if not names:
        if name:
            expected = "a workbook, or a file with groups of channels"
            raise MeasurementError("this is no workbook", file=file, found=f'sheet = "{name}"', expected=expected)
        return None
    kind = word_for_part(file)
    if name is not None:
        if own := [part for part in found if part.sheet == name]:
            return own[0]
        raise MeasurementError(
            f"there is no such {kind}",
            file=file,
            found=f'"{name}"',
            expected=_listed(names),
            hint=did_you_mean(name, names),
        )
    usable = [part for part in found if is_usable(part)] if len(found) > 1 else found
    if len(usable) == 1:
        return usable[0]
    raise MeasurementError(
        f"more than one {kind} holds such a table" if usable else f"no {kind} holds such a table",
        file=file,
        found=_listed([part.sheet for part in usable or found]),
        expected="one",
        hint=_ONE_GROUP if kind == "group" and not usable else 'choose it in the campaign: sheet = "..."',
    )


def _read(data: bytes, file: Path, name: str | None = None) -> tuple[Sequence[str], Sequence[Sheet]]:
    """The names of all parts of a file, and the part of a name, or else all; none of a text."""
    if own := format_of(data, file):
        groups = read_groups(data, file, own)
        if isinstance(groups, MeasurementError):
            raise groups
        return [group.sheet for group in groups], groups
    return read_sheets(data, file, name) if is_workbook(data) else ((), ())


def _listed(names: Sequence[str]) -> str:
    return ", ".join(f'"{name}"' for name in names[:_MOST_LISTED]) + (", ..." if len(names) > _MOST_LISTED else "")
