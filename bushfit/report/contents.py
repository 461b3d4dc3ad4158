"""What a result holds before it is files, and how its reader wants the files written."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any, Literal

from bushfit.progress import track
from bushfit.reading.tablefile import Form, ending, to_bytes
from bushfit.report import plots
from bushfit.report.folder import to_json

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

#: JSON documents by name.
Documents = Mapping[str, Mapping[str, Any]]
#: Tables by name.
Tables = Mapping[str, "pd.DataFrame"]
#: What makes the text of a page of documents and tables.
Page = Callable[[Documents, Tables], str]
#: Formats of a picture.
Picture = Literal["png", "svg", "pdf"]


@dataclass(frozen=True)
class Kinds:
    """The names, without endings, of the documents, tables, pictures and pages that a result will hold."""

    documents: tuple[str, ...] = ()
    tables: tuple[str, ...] = ()
    pictures: tuple[str, ...] = ()
    pages: tuple[str, ...] = ()

    def __add__(self, other: Kinds) -> Kinds:
        return Kinds(*(getattr(self, each.name) + getattr(other, each.name) for each in fields(Kinds)))

    @classmethod
    def shown(cls, names: Iterable[str]) -> Kinds:
        """A table and a picture of each name."""
        both = tuple(names)
        return cls(tables=both, pictures=both)


@dataclass(frozen=True, eq=False)
class Contents:
    """Documents, tables, pictures and pages by their names without endings; all but documents are made when asked for.

    A page is made of the documents and tables, and of nothing else: those that were read back give the same.
    """

    documents: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    tables: Mapping[str, Callable[[], pd.DataFrame]] = field(default_factory=dict)
    pictures: Mapping[str, Callable[[], Figure]] = field(default_factory=dict)
    pages: Mapping[str, Page] = field(default_factory=dict)

    def __or__(self, other: Contents) -> Contents:
        return Contents(*({**getattr(self, each.name), **getattr(other, each.name)} for each in fields(Contents)))

    @classmethod
    def shown(cls, name: str, table: Callable[[], pd.DataFrame], picture: Callable[[], Figure]) -> Contents:
        """A table and a picture of one name."""
        return cls(tables={name: table}, pictures={name: picture})

    def paged(self, **pages: Page) -> Contents:
        """The same with pages of what it holds, by their names."""
        return replace(self, pages={**self.pages, **pages})

    @property
    def kinds(self) -> Kinds:
        """The names of all that it holds."""
        return Kinds(*(tuple(getattr(self, each.name)) for each in fields(Kinds)))


@dataclass(frozen=True)
class Formats:
    """How results are written: whether with tables, pictures and pages, and the first two in which forms."""

    tables: bool = True
    pictures: bool = True
    pages: bool = True
    table_form: Form = "csv"
    picture_forms: tuple[Picture, ...] = ("png",)

    def table(self, name: str) -> str:
        """The file of a table of this name."""
        return f"{name}.{ending(self.table_form)}"

    def names(self, kinds: Kinds) -> list[str]:
        """The files of what has these names: documents first, then each table beside its pictures, then pages."""
        pages = [f"{name}.html" for name in kinds.pages if self.pages]
        return [*(f"{name}.json" for name in kinds.documents), *(".".join(each) for each in self._shown(kinds)), *pages]

    def files(self, contents: Contents) -> dict[str, bytes]:
        """The bytes of each file of a result, by its name.

        Raises:
            OutputError: a table that is too large for its form.
        """
        files = {f"{name}.json": to_json(document) for name, document in contents.documents.items()}
        tables = {name: cache(make) for name, make in contents.tables.items()}
        drawn = lru_cache(1)(lambda name: contents.pictures[name]())  # once for all forms, which follow each other
        for name, form in track("files made", self._shown(contents.kinds)):
            if form in self.picture_forms:
                files[f"{name}.{form}"] = plots.style.to_image(drawn(name), form)
            else:
                files[f"{name}.{form}"] = to_bytes(name, tables[name](), self.table_form)
        return files | (pages_of(replace(contents, tables=tables)) if self.pages else {})

    def _shown(self, kinds: Kinds) -> list[tuple[str, str]]:
        """The name and the ending of each table and picture that is written."""
        wanted = {ending(self.table_form): kinds.tables} if self.tables else {}
        wanted |= dict.fromkeys(self.picture_forms if self.pictures else (), kinds.pictures)
        names = dict.fromkeys((*kinds.tables, *kinds.pictures))
        return [(name, form) for name in names for form, those in wanted.items() if name in those]


def pages_of(contents: Contents) -> dict[str, bytes]:
    """The bytes of the pages of a result alone, by the names of their files."""
    tables = {name: make() for name, make in contents.tables.items()} if contents.pages else {}
    made = {name: page(contents.documents, tables) for name, page in contents.pages.items()}
    return {f"{name}.html": text.encode() for name, text in made.items()}
