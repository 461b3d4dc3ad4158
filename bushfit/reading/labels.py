"""Columns that say which test a row belongs to: its direction, its part, its run, or something not understood."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bushfit.reading.columns import Columns
from bushfit.reading.headers import Vocabulary
from bushfit.reading.measurement import Floats
from bushfit.reading.names import named_direction
from bushfit.reading.runs import rows_alike
from bushfit.reading.words import SWEEP_COLUMNS, WORDS

#: What a column may say of the test of a row, by the key that states it; a run has none.
_VOCABULARY = Vocabulary(
    {
        "direction": WORDS["rows"]["direction"],
        "specimen_number": WORDS["above"]["specimen_number"],
        "run": SWEEP_COLUMNS["repeat"],
    },
    {},
)
#: Rows of a value in the mean, at least, where a column parts tests; chosen: a column that counts its rows parts none.
_FEWEST_ROWS = 3
#: Rows that tell whether a column may part tests; chosen: a long record is not read for a column that counts its rows.
_FIRST_ROWS = 1000
#: Values that are told one by one; chosen: they make a sentence.
_MOST_LISTED = 4


class Rows(NamedTuple):
    """The rows of a file that make a test: those of a direction and a specimen number, and with texts in columns.

    Args:
        direction, specimen_number: of all rows where no column tells them.
        texts: by the headers of their columns.
        shared: whether other tests name the file, too: then a column has to tell them apart.
    """

    direction: str | None = None
    specimen_number: str | None = None
    texts: Mapping[str, str] = {}
    shared: bool = False


class Label(NamedTuple):
    """The column, from 0, that says which test a row belongs to, and its text in each row, (n,)."""

    index: int
    texts: Sequence[str]

    @property
    def values(self) -> list[str]:
        """Each text once, in order."""
        return list(dict.fromkeys(self.texts))

    @staticmethod
    def has(text: str, own: str) -> bool:
        """Whether a row with its own text has the one that is stated; upper and lower case are one."""
        return own.casefold() == text.strip(" #").casefold()

    def rows(self, text: str) -> NDArray[np.bool_]:
        """Whether each row has a text, (n,)."""
        return np.array([self.has(text, own) for own in self.texts])


def labels(table: Columns) -> dict[str, Label]:
    """The columns that tell direction, specimen_number and run of each row, by these keys, as far as there are such.

    Directions are called by their names here; a column that names none is of something else.
    """
    taken = {column.index for column in table.roles.values()}
    found: dict[str, Label] = {}
    for index, header in enumerate(() if table.layout.written else table.headers):
        heading = _VOCABULARY.heading(header)
        if heading is None or index in taken or heading.role in found or not _may_part(table.texts(index, _FIRST_ROWS)):
            continue
        texts = table.texts(index)
        if heading.role == "direction":
            known = {text: named_direction([text], short=True) for text in set(texts)}
            if not any(known.values()):
                continue
            texts = [str(known[text] or text) for text in texts]
        found[heading.role] = Label(index, texts)
    return found


def not_understood(table: Columns, rows: NDArray[np.intp] | None = None, *settled: Floats) -> Iterator[str]:
    """A sentence for each column that may part tests, and of which nothing says what it means.

    Of a sweep, `settled` are frequency and level of its `rows`, (n,): a number that goes with them is measured, and a
    text that goes with one of them names it. Of a loop, numbers are channels.
    """
    taken = {column.index for column in table.roles.values()}
    taken |= {label.index for key, label in labels(table).items() if key != "direction" or len(label.values) == 1}
    for index, header in enumerate(() if table.layout.written else table.headers):
        is_number = table.holds_numbers(index)
        if index in taken or (is_number and not settled) or not _may_part(table.texts(index, _FIRST_ROWS)):
            continue
        texts = table.texts(index)
        values, place, counts = np.unique(
            texts if rows is None else np.array(texts)[rows], return_inverse=True, return_counts=True
        )
        goes_with = [settled] if is_number else [(one,) for one in settled]
        if (
            values.size > 1
            and counts.min() >= (_FEWEST_ROWS if is_number else 1)
            and not any(all(np.ptp(place[alike]) == 0 for alike in rows_alike(*keys)) for keys in goes_with)
        ):
            listed = ", ".join([*values[:_MOST_LISTED], *["..."] * (values.size > _MOST_LISTED)])
            name = f'"{header}"' if header else f"column {index + 1}"
            way = f'rows = {{ "{header}" = "{values[0]}" }} in the campaign takes those alone' if header else "name it"
            yield (
                f"{name} varies from row to row ({listed}) and is not "
                f"understood: all rows count as one test; {way}"
            )


def _may_part(texts: Sequence[str]) -> bool:
    """Whether texts of rows may part tests: each has some rows in the mean."""
    return _FEWEST_ROWS * len(set(texts)) <= len(texts)
