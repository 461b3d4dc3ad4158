"""Read a manifest (a TOML or CSV file, or a pattern) as rows, each with a name, a folder and settings."""

from __future__ import annotations

import csv
import glob
import os
import re
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache, partial
from itertools import chain
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, ConfigDict, Field

from bushfit.campaign.toml import parse_toml
from bushfit.effects import Effect, get_effect
from bushfit.effects.mistakes import get_candidate
from bushfit.errors import CampaignError, error_location
from bushfit.geometry.point import Point, PointText
from bushfit.reading.files import read_utf8
from bushfit.reading.tablefile import folder_name
from bushfit.validation import Frequency, Share, Text, converter, unknown_key, validate_tables

Command = Literal["run", "fit", "diagnose", "predict", "respond"]

#: Largest TOML manifest [bytes]: some million rows.
_LARGEST_MANIFEST = 200_000_000
_INIT_HINT = "bushfit init FILE... writes a campaign from test files"
_DEFAULT_COMMANDS: tuple[Command, ...] = ("fit",)
#: Commands that use a setting.
_COMMANDS_USING: dict[str, tuple[Command, ...]] = {
    **dict.fromkeys(("directions", "effects"), ("fit",)),
    **dict.fromkeys(("adopt", "without", "max_effects", "tolerance"), ("diagnose",)),
    "model": ("diagnose", "predict", "respond"),
    **dict.fromkeys(("history", "lowpass"), ("respond",)),
}
#: Characters that make a path a pattern.
_PATTERN = re.compile(r"[*?\[]")


def _check_name(lookup: Callable[[str], Effect], raw: object, _: object) -> object:
    """Validator for pydantic: check the name of an effect, for which `lookup` raises an error if it is unknown."""
    if isinstance(raw, str):
        lookup(raw)
    return raw


#: Words as a list, or as the text of a CSV cell, such as "fit; predict".
Words = BeforeValidator(lambda raw: tuple(re.findall(r"[^;,\s]+", raw)) if isinstance(raw, str) else raw)
Effects = Annotated[tuple[Annotated[str, converter(partial(_check_name, get_effect))], ...], Words]
Candidates = Annotated[tuple[Annotated[str, converter(partial(_check_name, get_candidate))], ...], Words]


@dataclass(frozen=True, kw_only=True)
class RowSettings:
    """Settings of one part (a row of the batch), or of a whole manifest; None if not stated.

    If a row does not state a setting, the setting of the manifest applies, or else the default.

    Args:
        commands: run alone, or any of fit, diagnose, predict and respond; default fit.
        directions, effects: settings of fit, as `bushfit fit --direction --effect`.
        adopt, without, max_effects, tolerance: settings of diagnose, as its options.
        model: model file from which predict and respond predict, or from which diagnose starts.
        history: displacement history for respond, as `bushfit respond`.
        lowpass: cut-off frequency of a low-pass filter for the history [Hz], as `bushfit respond --lowpass`.
    """

    commands: Annotated[tuple[Command, ...], Words, Field(min_length=1)] | None = None
    directions: Annotated[tuple[Text, ...], Words] | None = None
    effects: Effects | None = None
    adopt: Candidates | None = None
    without: Candidates | None = None
    max_effects: Annotated[int, Field(ge=0, le=5)] | None = None
    tolerance: Share | None = None
    model: Text | None = None
    history: Text | None = None
    lowpass: Frequency | None = None

    def with_defaults(self, defaults: RowSettings) -> RowSettings:
        """Copy of these settings in which `defaults` replaces each None; keys of a subclass are dropped."""
        names = [setting.name for setting in fields(RowSettings)]
        chosen = {name: getattr(defaults if getattr(self, name) is None else self, name) for name in names}
        return RowSettings(**chosen)

    @property
    def diagnoses(self) -> bool:
        """True if the commands include a diagnosis."""
        return not {"run", "diagnose"}.isdisjoint(self.commands or ())


@dataclass(frozen=True, kw_only=True)
class Entry(RowSettings):
    """[[bushings]]: one or several parts in a TOML manifest, or a line of a CSV manifest.

    Args:
        campaign: campaign file, or a pattern of campaign files, relative to the manifest.
        name: name of the part; default the name of the file.
        subgroup: group of parts made together, such as a shift or a cavity; a column of the table.
    """

    campaign: Text
    name: Text | None = None
    subgroup: Text | None = None


@dataclass(frozen=True, kw_only=True)
class ManifestFile(RowSettings):
    """A TOML manifest; its settings apply to rows that do not state their own.

    Args:
        name: name of the batch; default the name of the file.
        bushings: rows of the batch.
        at: operating points at which stiffness and loss factor are tabulated.
    """

    __pydantic_config__ = ConfigDict(extra="forbid")

    name: Text | None = None
    bushings: Annotated[tuple[Entry, ...], Field(min_length=1)]
    at: tuple[PointText, ...] = ()


@dataclass(frozen=True)
class Row:
    """One part of a batch.

    Args:
        name: name of the part.
        folder: name of the folder of its results.
        listed: campaign file as written in the manifest.
        campaign: absolute path of the campaign file.
        settings: complete settings, with all defaults.
        subgroup: group of parts made together; None if not stated.
    """

    name: str
    folder: str
    listed: str
    campaign: str
    settings: RowSettings
    subgroup: str | None = None


@dataclass(frozen=True, eq=False)
class Manifest:
    """Batch as read from a manifest: title, rows in order, and operating points for stiffness and loss factor."""

    title: str
    rows: Sequence[Row]
    points: tuple[Point, ...] = ()


def read_manifest(source: str, settings: RowSettings, *more: str) -> Manifest:
    """Read a manifest, or make one from a pattern or from a list of campaign files.

    Args:
        source: TOML or CSV manifest, or a pattern such as "bushings/*/campaign.toml".
        settings: settings of the command line; they replace the settings at the top of the manifest.
        more: further campaign files, if the shell has expanded a pattern.

    Returns:
        Manifest whose rows have complete settings, in order.

    Raises:
        CampaignError: a missing file, a pattern without a match, no rows, or invalid keys or values.
    """
    path, points = Path(source), tuple[Point, ...]()
    title, base, entries = path.stem, path.parent, list[Entry]()
    if strange := [name for name in (source, *more) if more and Path(name).suffix.lower() != ".toml"]:
        expected = "one manifest, or campaign files alone"
        raise CampaignError("this is not a campaign", file=strange[0], expected=expected, hint=_INIT_HINT)
    if more or (_PATTERN.search(source) and not os.path.exists(path)):  # noqa: PTH110
        title, base, entries = "batch", Path(), [Entry(campaign=name) for name in (source, *more)]
    elif path.suffix.lower() == ".toml":
        tables = parse_toml(path, "a manifest", _LARGEST_MANIFEST)
        bushings = tables.get("bushings")
        tubes = bushings if isinstance(bushings, list) else []
        has_sizes = any(isinstance(tube, dict) and "length" in tube for tube in tubes)
        if has_sizes or not tables.keys().isdisjoint(("bushing", "specimens")):  # a campaign: a batch of one
            tables = {"bushings": [{"campaign": path.name}]}
        content = validate_tables(tables, path, ManifestFile)
        settings, title, points = settings.with_defaults(content), content.name or title, content.at
        entries = list(content.bushings)
    elif path.suffix.lower() in (".csv", ".tsv", ".txt"):
        entries = read_csv_entries(path)
    else:
        expected = 'a .toml or .csv file, or a pattern in quotes such as "bushings/*/campaign.toml"'
        hint = f'"{path}/*/campaign.toml" in quotes' if os.path.isdir(path) else _INIT_HINT  # noqa: PTH112
        raise CampaignError("this is not a manifest", file=path, expected=expected, hint=hint)
    listed = entries if more else [entry for one in entries for entry in expand_pattern(one, base, source)]
    if not listed:
        raise CampaignError("the manifest has no rows", file=source, expected="a campaign on each line")
    return Manifest(title, make_rows(listed, base, settings, source), points)


def read_csv_entries(path: Path) -> list[Entry]:
    """Read the entries of a CSV manifest.

    Returns:
        One entry for each line below the header; the header names the keys.

    Raises:
        CampaignError: unknown or repeated columns, a quote that is not closed, or invalid values.
    """
    text = read_utf8(path, CampaignError).decode("utf-8-sig")
    delimiter = max(",;\t", key=text.lstrip().partition("\n")[0].count)
    filled, entries = list[tuple[int, list[str]]](), list[Entry]()
    for number, line in enumerate(text.splitlines(), start=1):
        try:
            cells = [cell.strip() for row in csv.reader([line], delimiter=delimiter, strict=True) for cell in row]
        except csv.Error as error:
            raise CampaignError(
                "a quote is not closed",
                file=path,
                place=f"line {number}",
                found=str(error),
                expected="one line for each bushing, and quotes in pairs",
                hint='for a name with a quote, write the quote twice and put the cell in quotes: "Rear ""soft"""',
            ) from None
        if any(cells):
            filled.append((number, cells))
    header, keys = filled[0][1] if filled else [], [key.name for key in fields(Entry)]
    if unknown := [column for column in header if column not in keys]:
        with error_location(path, "header"):
            raise unknown_key(unknown[0], keys, _INIT_HINT)
    if repeated := [column for column in header if header.count(column) > 1]:
        problem = f'two columns are called "{repeated[0]}"'
        raise CampaignError(problem, file=path, place="header", expected="each column once")
    for number, cells in filled[1:]:
        place, counts = f"line {number}", {"found": str(len(cells)), "expected": str(len(header))}
        if len(cells) > len(header):
            raise CampaignError("more cells than columns", file=path, place=place, **counts)
        settings = {key: cell for key, cell in zip(header, cells, strict=False) if cell}
        entries.append(validate_tables(settings, path, Entry, place=place))
    return entries


def expand_pattern(entry: Entry, base: Path, source: str) -> list[Entry]:
    """Replace an entry whose campaign is a pattern by one entry for each matching file.

    Args:
        entry: entry of the manifest.
        base: folder that the campaign path is relative to.
        source: manifest, for error messages.

    Returns:
        Entries sorted by file name, then entries for folders that cannot be read; the entry itself if its campaign is
        a file.

    Raises:
        CampaignError: no file matches, or a pattern has a name.
    """
    if not _PATTERN.search(entry.campaign) or os.path.exists(base / entry.campaign):  # noqa: PTH110
        return [entry]
    matches = sorted(glob.glob(entry.campaign, root_dir=base, recursive=True))  # noqa: PTH207 - Path.glob refuses ".."
    parts = Path(entry.campaign).parts
    for depth in range(1, len(parts)):  # a locked folder matches nothing: it becomes a row that fails
        for folder in glob.glob(os.path.join(*parts[:depth]), root_dir=base):  # noqa: PTH118, PTH207
            if os.path.isdir(base / folder) and not os.access(base / folder, os.R_OK | os.X_OK):  # noqa: PTH112
                matches.append(os.path.join(folder, *parts[depth:]))  # noqa: PTH118
    if not matches or entry.name:
        problem = "a pattern cannot have a name" if matches else "the pattern matches no file"
        expected = "campaign files, counted from the folder of the manifest"
        raise CampaignError(problem, file=source, place="campaign", found=entry.campaign, expected=expected)
    return [replace(entry, campaign=match) for match in matches]


def make_rows(entries: Sequence[Entry], base: Path, settings: RowSettings, source: str) -> list[Row]:
    """Make the rows of a batch: give each entry a name, a folder and complete settings.

    The name of a part is the name in the entry, or else the stem of its file, or the name of the file's folder if
    several files have the same stem. The folder is the name with characters that are valid on every system, and with a
    number if another row has the same folder regardless of case.

    Args:
        entries: entries of the manifest, without patterns.
        base: folder that campaign paths are relative to.
        settings: settings for entries that do not state their own.
        source: manifest, for error messages.

    Returns:
        Rows in the order of the entries; rows of equal settings share one object.

    Raises:
        CampaignError: settings that contradict each other, or that no command uses.
    """
    commands = {entry.commands or settings.commands or _DEFAULT_COMMANDS for entry in entries}
    refuse_unused_settings(settings, commands, source)
    stems = Counter(Path(entry.campaign).stem for entry in entries)
    used_folders, namesakes, rows = set[str](), Counter[str](), list[Row]()
    for entry in entries:
        path = Path(entry.campaign)
        is_shared = stems[path.stem] > 1 and path.parent.name not in ("", "..")
        name = entry.name or (path.parent.name if is_shared else path.stem)
        folder = plain = folder_name(name)
        while folder.casefold() in used_folders:
            namesakes[plain] += 1
            folder = f"{plain} {namesakes[plain] + 1}"
        used_folders.add(folder.casefold())
        try:
            completed = complete_settings(entry.with_defaults(RowSettings()), settings, base, source)
        except CampaignError as error:
            error.place = f"{entry.campaign}, {error.place}"
            raise
        campaign = os.path.abspath(base / path)  # noqa: PTH100 - links stay as named
        rows.append(Row(name, folder, entry.campaign, campaign, completed, entry.subgroup))
    return rows


def refuse_unused_settings(
    settings: RowSettings, commands_of_rows: Collection[tuple[Command, ...]], source: str
) -> None:
    """Refuse a setting that no command of the rows uses.

    Args:
        settings: settings that apply to all these rows.
        commands_of_rows: commands of each row.
        source: manifest, for error messages.

    Raises:
        CampaignError: a setting that no command of these rows uses.
    """
    for name, users in _COMMANDS_USING.items():
        # after a fit, predict and respond use the fitted model
        after_fit = ("diagnose",) if name == "model" else users
        is_used = any({*commands} & {*(after_fit if "fit" in commands else users)} for commands in commands_of_rows)
        if getattr(settings, name) is not None and not is_used:
            another = "" if ("run",) in commands_of_rows else f"--command {users[0]} too, or "
            raise CampaignError(
                "this setting has no effect here",
                file=source,
                place=name,
                found="commands " + ", ".join(sorted({*chain(*commands_of_rows)})),
                expected=f"a setting of {' or '.join(users)}",
                hint=f"{another}leave {name} out",
            )


@lru_cache(maxsize=64)
def complete_settings(row_settings: RowSettings, defaults: RowSettings, base: Path, source: str) -> RowSettings:
    """Fill in every default of a row's settings, and check them against each other.

    Args:
        row_settings: settings that the row states.
        defaults: settings of the manifest and the command line.
        base: folder that the path of the model file is relative to.
        source: manifest, for error messages.

    Returns:
        Complete settings, with the absolute path of the model file.

    Raises:
        CampaignError: settings that contradict each other, or that no command of the row uses.
    """
    settings = row_settings.with_defaults(defaults)
    commands = settings.commands or _DEFAULT_COMMANDS
    if "run" in commands and set(commands) != {"run"}:
        raise CampaignError(
            "run includes the other commands",
            file=source,
            place="commands",
            found=", ".join(commands),
            expected='commands = ["run"], or any of fit, diagnose, predict, respond without it',
            hint="--command run alone" if row_settings.commands is None else None,
        )
    refuse_unused_settings(row_settings, [commands], source)
    if {*commands} <= {"predict", "respond"} and not settings.model:
        expected = f'commands = ["fit", "{commands[0]}"], or model = "model.json"'
        raise CampaignError(f"{commands[0]} has no model", file=source, place="commands", expected=expected)
    if "respond" in commands and not settings.history:
        expected = 'history = "road.csv"'
        raise CampaignError("respond has no displacement history", file=source, place="history", expected=expected)
    files = {"model": settings.model, "history": settings.history}
    paths: dict[str, Any] = {name: os.path.abspath(base / path) for name, path in files.items() if path}  # noqa: PTH100
    return replace(settings, commands=commands, **paths)
