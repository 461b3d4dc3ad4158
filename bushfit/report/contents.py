"""What a result holds before it is files, and how its reader wants the files written."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Literal

from bushfit.reading.tablefile import Form, ending, to_bytes
from bushfit.report.folder import to_json

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

#: Formats of a picture.
Picture = Literal["png", "svg", "pdf"]


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
    """How results are written: whether with tables, and with pictures, and each of these in which forms."""

    tables: bool = True
    pictures: bool = True
    table_form: Form = "csv"
    picture_forms: tuple[Picture, ...] = ("png",)

    def table(self, name: str) -> str:
        """The file of a table of this name."""
        return f"{name}.{ending(self.table_form)}"

    def names(self, kinds: Kinds) -> list[str]:
        """The files of what has these names: documents first, then each table beside its pictures."""
        return [*(f"{name}.json" for name in kinds.documents), *(".".join(each) for each in self._shown(kinds))]

    def files(self, contents: Contents) -> dict[str, bytes]:
        """The bytes of each file of a result, by its name.

        Raises:
            OutputError: a table that is too large for its form.
        """
        files = {f"{name}.json": to_json(document) for name, document in contents.documents.items()}
        drawn = lru_cache(1)(lambda name: contents.pictures[name]())  # once for all forms, which follow each other
        for name, form in self._shown(contents.kinds):
            if form in self.picture_forms:
                files[f"{name}.{form}"] = _picture(drawn(name), form)
            else:
                files[f"{name}.{form}"] = to_bytes(name, contents.tables[name](), self.table_form)
        return files

    def _shown(self, kinds: Kinds) -> list[tuple[str, str]]:
        """The name and the ending of each table and picture that is written."""
        wanted = {ending(self.table_form): kinds.tables} if self.tables else {}
        wanted |= dict.fromkeys(self.picture_forms if self.pictures else (), kinds.pictures)
        names = dict.fromkeys((*kinds.tables, *kinds.pictures))
        return [(name, form) for name in names for form, those in wanted.items() if name in those]


def _picture(figure: Figure, form: str) -> bytes:
    from bushfit.report.plots import to_image

    return to_image(figure, form)
