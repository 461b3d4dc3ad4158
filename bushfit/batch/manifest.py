"""Manifests: TOML, CSV, or a pattern -> rows, each with its name, its folder and its settings."""

from __future__ import annotations

import csv
import glob
import io
import os
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cache, partial
from itertools import chain, count
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BeforeValidator, ConfigDict, Field

from bushfit.batch.quantities import At, Point
from bushfit.campaign.toml import read_toml
from bushfit.effects import Effect, get_effect
from bushfit.effects.mistakes import get_candidate
from bushfit.errors import CampaignError
from bushfit.reading.files import read_utf8
from bushfit.reading.tablefile import folder_name
from bushfit.validation import Share, Text, converter, unknown_key, validate_tables

Command = Literal["run", "fit", "diagnose", "predict"]

#: The way on from test files.
_OF_TESTS = "bushfit init FILE... makes a campaign of test files"
#: What is done to a campaign where nothing is said.
_DEFAULT: tuple[Command, ...] = ("fit",)
#: Which commands look at a setting.
_READERS: dict[str, tuple[Command, ...]] = {
    **dict.fromkeys(("directions", "effects"), ("fit",)),
    **dict.fromkeys(("adopt", "without", "max_effects", "tolerance"), ("diagnose",)),
    "model": ("diagnose", "predict"),
}
#: What makes a path a pattern.
_PATTERN = re.compile(r"[*?\[]")


def _known(named: Callable[[str], Effect], raw: object, _: object) -> object:
    """A name of an effect, or of a mistake in the record, that `named` knows."""
    if isinstance(raw, str):
        named(raw)
    return raw


def _words(raw: object) -> object:
    """A list, from a cell as from TOML: "fit; predict"."""
    return tuple(word for word in re.split(r"[;,\s]+", raw) if word) if isinstance(raw, str) else raw


Words = BeforeValidator(_words)
Effects = Annotated[tuple[Annotated[str, converter(partial(_known, get_effect))], ...], Words]
Candidates = Annotated[tuple[Annotated[str, converter(partial(_known, get_candidate))], ...], Words]


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What to do with a campaign; None where a row leaves it to the manifest, and the manifest to the default.

    Args:
        commands: run alone, or any of fit, diagnose, predict [fit].
        directions, effects: of fit, as `bushfit fit --direction --effect`.
        adopt, without, max_effects, tolerance: of diagnose, as its options.
        model: a model file to predict from, or for diagnose to start from.
    """

    commands: Annotated[tuple[Command, ...], Words, Field(min_length=1)] | None = None
    directions: Annotated[tuple[Text, ...], Words] | None = None
    effects: Effects | None = None
    adopt: Candidates | None = None
    without: Candidates | None = None
    max_effects: Annotated[int, Field(ge=0, le=5)] | None = None
    tolerance: Share | None = None
    model: Text | None = None

    def over(self, other: Settings) -> Settings:
        """These, and where they say nothing the other's."""
        return replace(other, **{key: value for key, value in vars(self).items() if value is not None})

    @property
    def settings(self) -> Settings:
        """The settings alone of a row or of a manifest."""
        return Settings(**{each.name: getattr(self, each.name) for each in fields(Settings)})

    @property
    def predicted(self) -> bool:
        """Whether the row is predicted, of which the tables are always written."""
        return not {"run", "predict"}.isdisjoint(self.commands or ())

    @property
    def diagnosed(self) -> bool:
        """Whether a row with these ends in a verdict."""
        return not {"run", "diagnose"}.isdisjoint(self.commands or ())


@dataclass(frozen=True, kw_only=True)
class Entry(Settings):
    """[[bushings]], or a line of a CSV manifest.

    Args:
        campaign: a campaign file or a pattern of such, relative to the manifest.
        name: of the bushing; that of the file unless stated.
        subgroup: bushings made together, such as a shift or a cavity: control charts are then of mean and range.
    """

    campaign: Text
    name: Text | None = None
    subgroup: Text | None = None


@dataclass(frozen=True, kw_only=True)
class ManifestFile(Settings):
    """A whole TOML manifest, with settings for every row that has none of its own.

    Args:
        bushings: the rows.
        at: operating points at which stiffness and loss factor are wanted.
    """

    __pydantic_config__ = ConfigDict(extra="forbid")

    bushings: Annotated[tuple[Entry, ...], Field(min_length=1)]
    at: tuple[At, ...] = ()


@dataclass(frozen=True)
class Row:
    """One bushing of a batch: its name, the folder of its results, its campaign as listed and as found, what to do, and
    what it was made together with."""

    name: str
    folder: str
    listed: str
    campaign: str
    settings: Settings
    subgroup: str | None = None


@dataclass(frozen=True, eq=False)
class Manifest:
    """All rows, in order, and the points that the manifest asks for."""

    stem: str
    rows: Sequence[Row]
    points: tuple[Point, ...] = ()


def read_manifest(source: str, given: Settings, *more: str) -> Manifest:
    """The rows of a manifest or a pattern, or of campaigns listed one by one.

    Args:
        source: a TOML or CSV file, or a pattern such as "bushings/*/campaign.toml".
        given: settings for rows that have none of their own; they win over those at the manifest's top.
        more: where a shell has put matches for a pattern, the other campaign files.

    Raises:
        CampaignError: no such file, no match, or keys and values that are not understood.
    """
    path, points = Path(source), tuple[Point, ...]()
    stem, base, entries = path.stem, path.parent, list[Entry]()
    if strange := [name for name in (source, *more) if more and Path(name).suffix.lower() != ".toml"]:
        expected = "one manifest, or campaign files alone"
        raise CampaignError("this is no campaign", file=strange[0], expected=expected, hint=_OF_TESTS)
    if more or (_PATTERN.search(source) and not path.exists()):
        stem, base, entries = "batch", Path(), [Entry(campaign=name) for name in (source, *more)]
    elif path.suffix.lower() == ".toml":
        content = _toml(path)
        given, points, entries = given.over(content.settings), content.at, list(content.bushings)
    elif path.suffix.lower() in (".csv", ".tsv", ".txt"):
        entries = list(_csv_entries(path))
    else:
        raise CampaignError(
            "this is no manifest",
            file=path,
            expected='a .toml or .csv file, or a pattern in quotes such as "bushings/*/campaign.toml"',
            hint=f'"{path}/*/campaign.toml" in quotes' if path.is_dir() else _OF_TESTS,
        )
    found = entries if more else list(_expanded(entries, base, source))
    return Manifest(stem, _rows(found, base, given, source), points)


def _toml(path: Path) -> ManifestFile:
    """The content of a TOML manifest; a campaign in its place is a batch of one."""
    try:
        return read_toml(path, ManifestFile, what="a manifest", largest=200_000_000)  # bytes: some million rows
    except CampaignError as error:
        if error.found not in ('"bushing"', '"specimens"'):
            raise
        return ManifestFile(bushings=(Entry(campaign=path.name),))


def _csv_entries(path: Path) -> Iterator[Entry]:
    """The lines of a CSV manifest; a header names the columns."""
    text = read_utf8(path, CampaignError).decode("utf-8-sig")
    delimiter = max(",;\t", key=text.lstrip().partition("\n")[0].count)
    lines = _csv_lines(path, text, delimiter)
    header = next((cells for _, line in lines if any(cells := [cell.strip() for cell in line])), [])
    known = [each.name for each in fields(Entry)]
    for column in header:
        if column not in known:
            error = unknown_key(column, known)
            error.file, error.place, error.hint = path, "header", error.hint or _OF_TESTS
            raise error
        if header.count(column) > 1:
            raise CampaignError(
                f'two columns are called "{column}"', file=path, place="header", expected="each column once"
            )
    for place, cells in lines:
        filled = {key: cell.strip() for key, cell in zip(header, cells, strict=False) if cell.strip()}
        if not filled:
            continue
        if len(cells) > len(header):
            raise CampaignError(
                "more cells than columns", file=path, place=place, found=str(len(cells)), expected=str(len(header))
            )
        yield validate_tables(filled, path, Entry, place=place)


def _csv_lines(path: Path, text: str, delimiter: str) -> Iterator[tuple[str, list[str]]]:
    """Place and cells of each line; raise a CampaignError where a quote swallows the lines after it."""
    reader, line = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, strict=True), 0
    try:
        for cells in reader:
            if reader.line_num > line + 1:
                raise csv.Error("a quoted cell goes on in the next line")
            line += 1
            yield f"line {line}", cells
    except csv.Error as error:
        raise CampaignError(
            "a quote is not closed",
            file=path,
            place=f"line {line + 1}",
            found=str(error),
            expected="one line for each bushing, and quotes in pairs",
            hint="a quote that belongs to a name is written twice, in a cell in quotes",
        ) from None


def _expanded(entries: Iterable[Entry], base: Path, source: str) -> Iterator[Entry]:
    """Entries with their patterns replaced by what they match, sorted."""
    for entry in entries:
        if not _PATTERN.search(entry.campaign) or (base / entry.campaign).exists():
            yield entry
            continue
        found = sorted(glob.glob(entry.campaign, root_dir=base, recursive=True))  # noqa: PTH207 - Path.glob refuses ".."
        if not found or entry.name:
            problem = "a pattern cannot have a name" if found else "the pattern matches no file"
            expected = "campaign files, counted from the folder of the manifest"
            raise CampaignError(problem, file=source, place="campaign", found=entry.campaign, expected=expected)
        yield from (replace(entry, campaign=match) for match in found)


def _rows(entries: Sequence[Entry], base: Path, given: Settings, source: str) -> list[Row]:
    """Entries with names and folders of their own.

    A bushing is called as the row says, else as its file; files of the same name, as their folders. Folders are the
    names made safe, numbered where they are equal, upper and lower case being one.
    """
    if not entries:
        raise CampaignError("the manifest has no rows", file=source, expected="a campaign on each line")
    _check_used(given, {entry.commands or given.commands or _DEFAULT for entry in entries}, source)
    stems = Counter(Path(entry.campaign).stem for entry in entries)
    taken: set[str] = set()
    merged = cache(lambda settings: _complete(settings, given, base, source))
    rows = []
    for entry in entries:
        path = Path(entry.campaign)
        shared = stems[path.stem] > 1 and path.parent.name not in ("", "..")
        name = entry.name or (path.parent.name if shared else path.stem)
        first = folder_name(name)
        numbered = (f"{first} {number}" for number in count(2))
        folder = next(folder for folder in chain([first], numbered) if folder.casefold() not in taken)
        taken.add(folder.casefold())
        try:
            settings = merged(entry.settings)
        except CampaignError as error:
            error.place = f"{entry.campaign}, {error.place}"
            raise
        rows.append(Row(name, folder, entry.campaign, os.path.abspath(base / path), settings, entry.subgroup))  # noqa: PTH100 - links stay as named
    return rows


def _check_used(settings: Settings, rows: Collection[tuple[Command, ...]], source: str) -> None:
    """Refuse a setting that none of the rows, by their commands, looks at."""
    for name, readers in _READERS.items():
        if getattr(settings, name) is not None and not any(_reads(commands, name) for commands in rows):
            way = "" if ("run",) in rows else f"--command {readers[0]} too, or "
            raise CampaignError(
                "this setting does nothing here",
                file=source,
                place=name,
                found=f"commands {', '.join(sorted({command for commands in rows for command in commands}))}",
                expected=f"it goes with {' or '.join(readers)}",
                hint=f"{way}leave {name} out",
            )


def _reads(commands: tuple[Command, ...], name: str) -> bool:
    if name == "model" and "fit" in commands:  # predict goes on from what fit finds
        return "diagnose" in commands
    return not set(commands).isdisjoint(_READERS[name])


def _complete(own: Settings, given: Settings, base: Path, source: str) -> Settings:
    """A row's settings with every default filled in, checked against each other."""
    settings = own.over(given)
    commands = settings.commands or _DEFAULT
    if "run" in commands and set(commands) != {"run"}:
        raise CampaignError(
            "run is the whole chain and does the others too",
            file=source,
            place="commands",
            found=", ".join(commands),
            expected='commands = ["run"], or any of fit, diagnose, predict without it',
            hint="--command run alone" if own.commands is None else None,
        )
    _check_used(own, [commands], source)
    if commands == ("predict",) and not settings.model:
        raise CampaignError(
            "predict has no model to predict from",
            file=source,
            place="commands",
            expected='commands = ["fit", "predict"], or model = "model.json"',
        )
    model = os.path.abspath(base / settings.model) if settings.model else None  # noqa: PTH100
    return replace(settings, commands=commands, model=model)
