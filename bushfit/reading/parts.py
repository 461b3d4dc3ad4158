"""Parts of a file that can contain a table: the text, worksheets of a workbook, or groups of recorded channels."""

import re
from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from bushfit.errors import MeasurementError, did_you_mean
from bushfit.reading.files import join_quoted, sha256, to_utf8, unpack_gzip, view_bytes
from bushfit.reading.headers import ERRORS, WORDS
from bushfit.reading.instruments import format_of, read_parts, word_for_part
from bushfit.reading.layout import FileFormat
from bushfit.reading.source import RowSource, Sheet, Text

#: Texts without a table of a test: pattern, description and next step; and the number of bytes that are searched.
_NO_TABLES = [(re.compile(pattern, re.IGNORECASE), *texts) for pattern, *texts in WORDS["no_tables"].values()]
_FIRST_BYTES = 2000
#: Largest number of parts that an error lists; chosen: a line or two.
_MOST_LISTED = 12
#: Largest number of characters that an error quotes.
_LONGEST_QUOTE = 40
_ONE_GROUP = "put all channels of a test into one group, and resample channels of another rate or length"


@dataclass(frozen=True, eq=False)
class OpenedFile:
    """Content of a test file.

    Args:
        file: path of the file.
        checksum: SHA-256 of the file, which may still be running in a thread.
        stated: format of the file as the user states it.
        parts: text, sheets or groups of channels that can contain the table.
        located: tables that were located already, by the columns and units that the user states.
    """

    file: Path
    checksum: Future[str]
    stated: FileFormat
    parts: Sequence[RowSource]
    located: dict[object, Any] = field(default_factory=dict)

    def join_sheets(self) -> "OpenedFile":
        """Return the workbook as one sheet, with the rows of each sheet below its name, as blocks of one table."""
        content = [row for part in self.parts if isinstance(part, Sheet) for row in ([part.sheet], *part.content)]
        return replace(self, parts=[Sheet("", content)], located={})

    def part_error(self, usable: Sequence[RowSource]) -> MeasurementError:
        """Return the error for a file in which no part, or more than one (`usable`), can contain the table."""
        kind = word_for_part(self.file)
        return MeasurementError(
            f"more than one {kind} holds such a table" if usable else f"no {kind} holds such a table",
            file=self.file,
            found=_quoted_names([part.sheet or "" for part in usable or self.parts]),
            expected="one",
            hint=_ONE_GROUP if kind == "group" and not usable else 'choose it in the campaign: sheet = "..."',
        )


def open_file(file: Path, file_format: FileFormat) -> OpenedFile:
    """Read a text in any encoding, a workbook or a recording; `file_format.sheet` selects one of its parts.

    Returns:
        Content of the file, with all visible parts or the selected one.

    Raises:
        MeasurementError: the file cannot be read, or has no part with this name.
    """
    packed, name = view_bytes(file, MeasurementError), file_format.sheet
    checksum, data = sha256(packed), unpack_gzip(packed, file)
    recording = format_of(data)
    parts = read_parts(data, file, recording) if recording else ()
    if not parts and name:
        raise MeasurementError(**ERRORS["not_a_workbook"], file=file, found=f'sheet = "{name}"')
    if not parts:
        text, encoding = to_utf8(data, file, file_format.encoding)
        head = text[:_FIRST_BYTES].decode("utf-8", "replace")
        for pattern, kind, advice in _NO_TABLES:
            if match := pattern.search(head):
                found = " ".join(match[0].split())[-_LONGEST_QUOTE:]
                raise MeasurementError(f"this is {kind}", file=file, found=found, expected="a table", hint=advice)
        return OpenedFile(file, checksum, file_format, [Text(join_quoted(text), encoding)])
    chosen = [part for part in parts if (part.is_visible if name is None else part.sheet == name)]
    if not chosen:
        problem, names = f"there is no such {word_for_part(file)}", [part.sheet for part in parts]
        hint = did_you_mean(name or "", names)
        raise MeasurementError(problem, file=file, found=f'"{name}"', expected=_quoted_names(names), hint=hint)
    return OpenedFile(file, checksum, file_format, chosen)


def _quoted_names(names: Sequence[str]) -> str:
    """List at most twelve names as text, in quotation marks and separated by commas."""
    return ", ".join(f'"{name}"' for name in names[:_MOST_LISTED]) + (", ..." if len(names) > _MOST_LISTED else "")
