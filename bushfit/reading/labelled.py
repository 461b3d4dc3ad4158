"""Columns that assign rows to tests: direction, part and run."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from bushfit.reading.cells import Cells
from bushfit.reading.headers import ROW_COLUMNS, Vocabulary
from bushfit.reading.measurement import Floats
from bushfit.reading.names import named_direction
from bushfit.reading.runs import rows_alike

#: Rows per value in the mean of a column that assigns rows to tests; chosen: a column that counts its rows has one.
_FEWEST_ROWS = 3
#: Rows that are examined first; chosen: a long record need not be read whole.
_FIRST = 1000
#: Meaning of columns that assign rows to tests.
_LABELS = Vocabulary(ROW_COLUMNS, {})


class Rows(NamedTuple):
    """Selection of the rows of a file that make a test.

    Args:
        direction: in the column that states directions, if there is one.
        specimen_number: in the column that states it, if there is one.
        texts: text in other columns, by header.
        shared: True if the file is listed more than once, so that a column has to select the rows.
    """

    direction: str | None = None
    specimen_number: str | None = None
    texts: Mapping[str, str] = {}
    shared: bool = False


def same_text(text: str, reference: str) -> bool:
    """Return True if two texts of a column are equal but for case and number signs: 17 and #17."""
    return text.strip(" #").casefold() == reference.strip(" #").casefold()


@dataclass(frozen=True, eq=False)
class LabelledCells(Cells):
    """Cells of a table whose columns may assign the rows to several tests."""

    @cached_property
    def row_labels(self) -> Mapping[str, tuple[int, Sequence[str]]]:
        """Index and texts, (n,), of the columns that state direction, specimen_number and run, by these keys."""
        labels: dict[str, tuple[int, Sequence[str]]] = {}
        for index, header in enumerate(self.headers):
            heading = _LABELS.heading(header) if header else None
            if heading is None or heading.role in labels or (header == "block" and "displacement" not in self.roles):
                continue
            if texts := self._texts_of_tests(index):
                if heading.role == "direction":
                    directions = {text: named_direction([text], short=True) for text in set(texts)}
                    texts = [str(directions[text] or text) for text in texts] if any(directions.values()) else []
                labels |= {heading.role: (index, texts)} if texts else {}
        return labels

    def taking(self, wanted: Rows) -> Self:
        """Select the rows of one test.

        Args:
            wanted: texts in the columns that assign rows to tests.

        Returns:
            The table of these rows.

        Raises:
            MeasurementError: there is no such row or column, the rows belong to several parts, or no column selects
                the tests of a shared file.
        """
        wanted_texts = {"direction": wanted.direction, "specimen_number": wanted.specimen_number}
        chosen = [
            (*self.row_labels[key], text) for key, text in wanted_texts.items() if text and key in self.row_labels
        ]
        for header, text in wanted.texts.items():
            if header not in self.headers:
                raise self.header_error(f'there is no column "{header}"', expected="headers, as keys of rows")
            chosen.append((self.headers.index(header), self.texts(self.headers.index(header)), text))
        if wanted.shared and not chosen:
            expected = "each file once, or a column that selects the rows of each test"
            raise self.header_error("a file is listed twice", expected=expected)
        column, parts = self.row_labels.get("specimen_number", (0, ()))
        total = len(parts or (chosen[0][1] if chosen else ()))
        selected = [n for n in range(total) if all(same_text(texts[n], text) for _, texts, text in chosen)]
        several = len({parts[n] for n in selected}) > 1 if parts else False
        if several or (chosen and not selected):
            conflicts = [(column, parts, "one part")] if several else chosen
            raise self.header_error(
                "this file contains tests of several parts" if several else "no row is of this test",
                found="; ".join(
                    f'{", ".join(dict.fromkeys(texts))} in column "{self.headers[index]}"'
                    for index, texts, _ in conflicts
                ),
                expected=" and ".join(text for *_, text in conflicts),
                hint='state one of them, as specimen_number = "..."; bushfit init lists all tests of a file',
            )
        if not chosen or len(selected) == total:
            return self
        positions = [n for n, (*_, fault) in enumerate(self._all_rows()) if fault is None]
        return replace(self, selected=frozenset(positions[n] for n in selected))

    def not_understood(self, selection: NDArray[np.intp] | None = None, *settled: Floats) -> Iterator[str]:
        """Sentences on columns that may separate tests and have no known meaning, and on rows left out.

        Args:
            selection: rows of a sweep, (n,); None for all.
            settled: frequency and level of these rows, (n,). A number that depends on both is a measured one; a text
                that depends on one is its name. The numbers of a loop are channels.

        Yields:
            One sentence for each such column, and one for the rows left out.
        """
        understood = {column.index for column in self.roles.values()}
        understood |= {
            index for key, (index, texts) in self.row_labels.items() if key != "direction" or len({*texts}) == 1
        }
        understood |= {index for index, header in enumerate(self.headers) if header == "block"}
        for index in (index for index in range(len(self.headers)) if index not in understood):
            is_number, header = self.holds_numbers(index), self.headers[index]
            if (is_number and not settled) or not (texts := self._texts_of_tests(index)):
                continue
            if len(set(texts)) == 1:
                continue
            chosen = np.array(texts)[slice(None) if selection is None else selection]
            values, number, counts = np.unique(chosen, return_inverse=True, return_counts=True)
            depends_on = [settled] if is_number else [(quantity,) for quantity in settled]
            explained = any(all(np.ptp(number[rows]) == 0 for rows in rows_alike(*keys)) for keys in depends_on)
            if values.size > 1 and not explained and not (is_number and counts.min() < _FEWEST_ROWS):
                listed = ", ".join(values[:4]) + ", ..." * (values.size > 4)
                yield (
                    f'"{header}" (column {index + 1}) varies from row to row ({listed}) and is not understood: all '
                    f'rows count as one test; rows = {{ "{header}" = "{values[0]}" }} in the campaign selects '
                    "those alone"
                )

    def _texts_of_tests(self, index: int) -> list[str]:
        """Texts of a column without a role if it may separate tests; else an empty list."""
        if self.layout.written or not self.headers[index] or index in {column.index for column in self.roles.values()}:
            return []
        first = self.texts(index, _FIRST)
        return self.texts(index) if any(first) and _FEWEST_ROWS * len(set(first)) <= len(first) else []
