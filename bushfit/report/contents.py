"""What a result holds before it is files, and how its reader wants the files written."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from bushfit.report.folder import to_json

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Kinds:
    """The names, without endings, of the documents, tables and pictures that a result will hold."""

    documents: tuple[str, ...] = ()
    tables: tuple[str, ...] = ()
    pictures: tuple[str, ...] = ()

    def __add__(self, other: Kinds) -> Kinds:
        return Kinds(self.documents + other.documents, self.tables + other.tables, self.pictures + other.pictures)

    @classmethod
    def shown(cls, names: Iterable[str]) -> Kinds:
        """A table and a picture of each name."""
        both = tuple(names)
        return cls(tables=both, pictures=both)


@dataclass(frozen=True, eq=False)
class Contents:
    """Documents, tables and pictures by their names without endings; tables and pictures are made when asked for."""

    documents: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    tables: Mapping[str, Callable[[], pd.DataFrame]] = field(default_factory=dict)
    pictures: Mapping[str, Callable[[], Figure]] = field(default_factory=dict)

    def __or__(self, other: Contents) -> Contents:
        return Contents(
            {**self.documents, **other.documents},
            {**self.tables, **other.tables},
            {**self.pictures, **other.pictures},
        )

    @property
    def kinds(self) -> Kinds:
        """The names of all that it holds."""
        return Kinds(tuple(self.documents), tuple(self.tables), tuple(self.pictures))


@dataclass(frozen=True)
class Formats:
    """How results are written: whether with tables, and with pictures."""

    tables: bool = True
    pictures: bool = True

    def names(self, kinds: Kinds) -> list[str]:
        """The files of what has these names: documents first, then each table beside its picture."""
        return [*(f"{name}.json" for name in kinds.documents), *(".".join(each) for each in self._shown(kinds))]

    def files(self, contents: Contents) -> dict[str, bytes]:
        """The bytes of each file of a result, by its name."""
        files = {f"{name}.json": to_json(document) for name, document in contents.documents.items()}
        for name, ending in self._shown(contents.kinds):
            made = _table(contents.tables[name]) if ending == "csv" else _picture(contents.pictures[name])
            files[f"{name}.{ending}"] = made
        return files

    def _shown(self, kinds: Kinds) -> list[tuple[str, str]]:
        """The name and the ending of each table and picture that is written."""
        wanted = {"csv": kinds.tables if self.tables else (), "png": kinds.pictures if self.pictures else ()}
        names = dict.fromkeys((*kinds.tables, *kinds.pictures))
        return [(name, ending) for name in names for ending, those in wanted.items() if name in those]


def _table(make: Callable[[], pd.DataFrame]) -> bytes:
    from bushfit.reading.csvfile import to_csv

    return to_csv(make())


def _picture(make: Callable[[], Figure]) -> bytes:
    from bushfit.report.plots import to_png

    return to_png(make())
