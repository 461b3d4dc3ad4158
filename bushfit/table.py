"""A CSV table with named columns and units: its header understood, its numbers in SI, its errors with their line."""

from __future__ import annotations

import csv
import hashlib
import io
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bushfit import units
from bushfit.errors import MeasurementError, UnitError
from bushfit.files import read_utf8
from bushfit.measurement import Floats

_DELIMITERS = (";", "\t", ",")
_LONGEST_FOUND = 200
_LONGEST_HEADER = 100_000
#: In SI; far beyond every rig, and its square is still a number.
_LARGEST = 1e100
_EXPECTED_HEADER = 'a header row such as "time [s],displacement [mm],force [N]"'


@dataclass(frozen=True)
class Column:
    """A column of the file: the role it plays, its header, its place, its unit as stated, and that unit in SI."""

    role: str
    header: str
    index: int
    unit: str | None
    scale: float = 1.0


@dataclass(frozen=True)
class Table:
    """An opened table. `headers` are its header cells in order, `roles` the columns that were recognised."""

    file: Path
    data: bytes
    delimiter: str
    headers: tuple[str, ...]
    header_line: int
    lines_before_data: int
    roles: Mapping[str, Column]

    @classmethod
    def open(
        cls,
        file: Path,
        names: Mapping[str, Sequence[str]],
        columns: Mapping[str, str] | None = None,
        stated_units: Mapping[str, str] | None = None,
    ) -> Table:
        """Read a file and understand its header.

        Args:
            file: comma, semicolon or tab CSV in UTF-8; blank lines and lines with # may lead it; a row of units may
                follow the header.
            names: for each role the headers it goes by; case, spaces, "-" and "_" do not count.
            columns: header of a role that goes by another name.
            stated_units: units that the file does not carry.

        Raises:
            MeasurementError: no such file, no text, no header, or a header that does not settle which column is which.
            UnitError: two different units for one column.
        """
        data = read_utf8(file, MeasurementError)
        lines = enumerate(_text(data), start=1)
        filled = ((number, line) for number, line in lines if line.strip(" \t\r\n,;") and not line.startswith("#"))
        header_line, header = next(filled, (1, ""))
        delimiter = max(_DELIMITERS, key=lambda mark: len(_cells(header, mark)))
        headers = tuple(cell.strip() for cell in _cells(header, delimiter))
        table = cls(file, data, delimiter, headers, header_line, header_line, {})
        table._check_header()

        next_line, row = next(filled, (header_line, ""))
        second = [cell.strip() for cell in _cells(row, delimiter)]
        # a ratio may have the unit "1"
        if len(second) == len(headers) and not any(units.is_number(cell) and cell != "1" for cell in second):
            table, units_row = replace(table, lines_before_data=next_line), second
        else:
            units_row = [""] * len(headers)
        return replace(table, roles=table._recognise(names, columns or {}, stated_units or {}, units_row))

    @property
    def sha256(self) -> str:
        return hashlib.sha256(self.data).hexdigest()

    def column(self, role: str, expected: str) -> Column:
        """The column of a role, with its unit resolved against the SI unit `expected`; a ratio needs no unit.

        Raises:
            MeasurementError: no such column.
            UnitError: no unit, an unknown one, or one of another dimension.
        """
        if role not in self.roles:
            raise self.missing(role, expected)
        column = self.roles[role]
        if column.unit is None and expected != "1":
            example = units.example(expected)
            raise UnitError(
                f"the {_label(role)} has no unit",
                file=self.file,
                place=self._place(self.header_line, column),
                found=f'"{column.header}"',
                expected=units.describe(expected),
                hint=f'write "{column.header} [{example}]" in the header, '
                f'or units = {{ {role} = "{example}" }} in the campaign',
            )
        try:
            return replace(column, scale=units.factor(column.unit or "1", expected))
        except UnitError as error:
            error.file, error.place = self.file, self._place(self.header_line, column)
            raise

    def read(self, wanted: Mapping[str, Column], *, fewest_rows: int) -> dict[str, Floats]:
        """The numbers of the wanted columns in SI, each (n,).

        Raises:
            MeasurementError: a row of another length, a cell that is no finite number, or too few rows.
        """
        import pandas as pd

        numeric = {column.index for column in wanted.values()}
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", pd.errors.ParserWarning)
                frame = pd.read_csv(
                    io.BytesIO(self.data),
                    sep=self.delimiter,
                    header=None,
                    names=list(range(len(self.headers))),
                    index_col=False,
                    skiprows=self.lines_before_data,
                    dtype={index: np.float64 if index in numeric else str for index in range(len(self.headers))},
                    na_filter=False,
                )
        except pd.errors.EmptyDataError:
            frame = pd.DataFrame({index: np.empty(0) for index in numeric})
        except (ValueError, pd.errors.ParserWarning) as error:
            raise self._unreadable(wanted, str(error)) from error
        if len(frame) < fewest_rows:
            raise self.error("too few rows", found=f"{len(frame)}", expected=f"at least {fewest_rows}")
        with np.errstate(over="ignore"):
            values = {role: frame[column.index].to_numpy() * column.scale for role, column in wanted.items()}
        if not all(series.min() >= -_LARGEST and series.max() <= _LARGEST for series in values.values()):
            raise self._unreadable(wanted, "a number that is not finite")
        return values

    def refuse(
        self, bad: NDArray[np.bool_], column: Column, problem: str, expected: str, hint: str | None = None
    ) -> None:
        """Raise for the first row that is marked in `bad`, (n,), naming its line and cell.

        Raises:
            MeasurementError: a row is marked.
        """
        if bad.any():
            line, cells = next(islice(self._rows(), int(np.argmax(bad)), None))
            found = f'"{cells[column.index].strip()}"'
            raise self.error(problem, line=line, column=column, found=found, expected=expected, hint=hint)

    def agrees(self, role: str, expected: str) -> bool:
        """Whether the column of a role is there and states a unit of the dimension of `expected`."""
        column = self.roles.get(role)
        return column is not None and column.unit is not None and units.agrees(column.unit, expected)

    def missing(self, role: str, expected: str, hint: str | None = None) -> MeasurementError:
        """The error for a role without a column, whose SI unit would be `expected`."""
        return self.error(
            f"there is no column for the {_label(role)}",
            line=self.header_line,
            found=", ".join(self.headers),
            expected=f'a header such as "{_label(role)} [{units.example(expected)}]"',
            hint=f'name the column in the campaign: columns = {{ {role} = "..." }}' + (f", {hint}" if hint else ""),
        )

    def error(
        self,
        problem: str,
        *,
        line: int | None = None,
        column: Column | None = None,
        found: str | None = None,
        expected: str | None = None,
        hint: str | None = None,
    ) -> MeasurementError:
        """An error in this table, at a line (from 1) and column where they are known."""
        found = found if found is None or len(found) <= _LONGEST_FOUND else found[:_LONGEST_FOUND] + "..."
        place = self._place(line, column)
        return MeasurementError(problem, file=self.file, place=place, found=found, expected=expected, hint=hint)

    def _place(self, line: int | None, column: Column | None) -> str | None:
        parts = [f"line {line}" if line else None, f'column "{column.header}"' if column else None]
        return ", ".join(part for part in parts if part) or None

    def _check_header(self) -> None:
        if len(self.headers) < 2:
            raise self.error(
                "there is only one column",
                line=self.header_line,
                found=self.headers[0] if self.headers else "nothing",
                expected=f"{_EXPECTED_HEADER}, separated by comma, semicolon or tab",
            )
        if all(units.is_number(cell) for cell in self.headers):
            raise self.error(
                "there is no header", line=self.header_line, found=", ".join(self.headers), expected=_EXPECTED_HEADER
            )

    def _recognise(
        self,
        names: Mapping[str, Sequence[str]],
        columns: Mapping[str, str],
        stated_units: Mapping[str, str],
        units_row: Sequence[str],
    ) -> dict[str, Column]:
        roles = {}
        for role, usual in names.items():
            known = {_plain(name) for name in ([columns[role]] if role in columns else usual)}
            hits = [(index, *match) for index, header in enumerate(self.headers) if (match := _match(header, known))]
            if len(hits) > 1:
                raise self.error(
                    f"more than one column could be the {_label(role)}",
                    line=self.header_line,
                    found=", ".join(self.headers[hit[0]] for hit in hits),
                    expected="one",
                    hint=f'choose it in the campaign: columns = {{ {role} = "{self.headers[hits[0][0]]}" }}',
                )
            if not hits and role in columns:
                near = get_close_matches(columns[role], self.headers, n=1, cutoff=0.4)
                raise self.error(
                    f'there is no column "{columns[role]}"',
                    line=self.header_line,
                    found=", ".join(self.headers),
                    expected=f"the column that the campaign names for the {_label(role)}",
                    hint=f'did you mean "{near[0]}"?' if near else None,
                )
            for index, header_unit in hits:
                stated = {unit.strip() for unit in (header_unit, units_row[index], stated_units.get(role)) if unit}
                column = Column(role, self.headers[index], index, next(iter(stated), None))
                if len(stated) > 1:
                    raise UnitError(
                        f"two units for the {_label(role)}",
                        file=self.file,
                        place=self._place(self.header_line, column),
                        found=" and ".join(sorted(stated)),
                        expected="one unit, from the header, the units row or the campaign",
                    )
                roles[role] = column
        return roles

    def _rows(self) -> Iterator[tuple[int, list[str]]]:
        """Line number (from 1) and cells of each row of data, in the order in which pandas counts rows."""
        skipped = self.lines_before_data
        reader = csv.reader(islice(_text(self.data), skipped, None), delimiter=self.delimiter)
        for cells in reader:
            if len(cells) > 1 or any(cell.strip() for cell in cells):
                yield skipped + reader.line_num, cells

    def _unreadable(self, wanted: Mapping[str, Column], reason: str) -> MeasurementError:
        """The error for the first row that cannot be read; `reason` serves where none is found."""
        try:
            for line, cells in self._rows():
                if len(cells) != len(self.headers):
                    return self.error(
                        "the row does not match the header",
                        line=line,
                        found=f"{len(cells)} cell" + "s" * (len(cells) != 1),
                        expected=f"{len(self.headers)} cells",
                        hint="write numbers with a decimal point, without thousands separators"
                        if len(cells) > len(self.headers)
                        else None,
                    )
                for column in wanted.values():
                    cell = cells[column.index].strip()
                    if not (units.is_number(cell) and abs(float(cell) * column.scale) <= _LARGEST):
                        return self.error(
                            "this is no finite number" if cell else "the cell is empty",
                            line=line,
                            column=column,
                            found=f'"{cell}"',
                            expected="a number such as 12.5",
                            hint="write numbers with a decimal point" if re.search(r"\d,\d", cell) else None,
                        )
        except csv.Error as error:
            reason = str(error)
        return self.error("the table cannot be read", found=reason.strip())


def _text(data: bytes) -> io.TextIOWrapper:
    return io.TextIOWrapper(io.BytesIO(data), encoding="utf-8-sig", newline="")


def _cells(line: str, delimiter: str) -> list[str]:
    return next(csv.reader([line[:_LONGEST_HEADER]], delimiter=delimiter), [])


def _label(role: str) -> str:
    return role.replace("_", " ")


def _plain(name: str) -> str:
    """A column name without case, and with "_" and "-" as spaces."""
    return re.sub(r"[\s_-]+", " ", name).strip().casefold()


def _match(header: str, known: set[str]) -> tuple[str | None] | None:
    """The unit in a header, in a tuple, if the header bears one of the known names ("force [N]", "force_N")."""
    name, unit = units.split_header(header)
    if _plain(header) in known or _plain(name) in known:
        return (unit,)
    for cut in (position for position, mark in enumerate(name) if mark == "_"):
        suffix = name[cut + 1 :].replace("_", " ")
        if _plain(name[:cut]) in known and units.is_unit(suffix):
            return (suffix,)
    return None
