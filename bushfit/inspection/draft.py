"""The text of a campaign for files that were inspected."""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import chain, count
from pathlib import Path
from typing import Any

from bushfit.campaign.toml import specimen_lines, toml_value
from bushfit.errors import CampaignError
from bushfit.geometry import Specimen
from bushfit.inspection.record import Inspected
from bushfit.reading.tablefile import folder_name

#: For each kind of test the array of tables that lists it in a campaign.
_TABLES = {"loop": "loops", "sweep": "sweeps"}


def campaign_text(name: str, bushing: Mapping[str, str] | None, files: Sequence[Inspected], folder: Path) -> str:
    """The text of a whole campaign file.

    The name is that of the bushing, too, of which `bushing` has the other keys, quantities as texts; None where
    specimens alone were tested. Loops and sweeps are named from the folder where the campaign will lie.
    """
    head = _key_lines({"name": name, **(bushing or {})})
    order = [seen for kind in _TABLES for seen in files if seen.kind == kind]
    tables = [*_specimens(files), *(file_text(seen, folder) for seen in order)]
    return "\n".join([*(["[bushing]"] if bushing else []), *head, "", *tables])


def campaigns_of_parts(
    name: str, bushing: Mapping[str, str] | None, files: Sequence[Inspected], folder: Path, listed_in: str
) -> dict[str, str]:
    """The text of a campaign of each part whose number a column tells, and of the manifest of them, by their files.

    Raises:
        CampaignError: a file of which nothing tells the part.
    """
    of_parts: list[Any] = [seen.entry.get("specimen_number") for seen in files]
    if None in of_parts:
        raise CampaignError(
            "nothing says of which part this is",
            file=files[of_parts.index(None)].file,
            found=f"parts {', '.join(dict.fromkeys(filter(None, of_parts)))} in others",
            expected="a column for the part in every file, or the tests of one part",
            hint="--specimen-number takes the tests of one part, and counts for files without such a column",
        )
    texts = {listed_in: f"# a campaign of each part: bushfit batch {listed_in}\n"}
    for number, part in enumerate(dict.fromkeys(of_parts), start=1):
        file = f"{folder_name(part)}.toml"
        file = f"{number}_{file}" if file.casefold() in map(str.casefold, texts) else file
        tests = [seen for own, seen in zip(of_parts, files, strict=True) if own == part]
        texts[file] = campaign_text(f"{name} {part}", bushing, tests, folder)
        entry = _key_lines({"campaign": file, "name": f"{name} {part}"})
        texts[listed_in] += "\n".join(["", "[[bushings]]", *entry, ""])
    return texts


def with_specimens_named(files: Sequence[Inspected]) -> list[Inspected]:
    """Files that were inspected, with specimens that differ under names that differ: coupon, coupon_2 and so on."""
    named: dict[Specimen, Specimen] = {}
    for body in (seen.direction for seen in files):
        if isinstance(body, Specimen) and body not in named:
            taken = {other.name for other in named.values()}
            names = chain([body.name], (f"{body.name}_{number}" for number in count(2)))
            named[body] = replace(body, name=next(name for name in names if name not in taken))
    return [
        replace(seen, direction=body, entry={**seen.entry, "specimen": body.name})
        if isinstance(seen.direction, Specimen) and (body := named[seen.direction])
        else seen
        for seen in files
    ]


def _specimens(files: Sequence[Inspected]) -> Iterator[str]:
    for body in dict.fromkeys(seen.direction for seen in files if isinstance(seen.direction, Specimen)):
        yield "\n".join([*specimen_lines(body), ""])


def _key_lines(keys: Mapping[str, Any]) -> Iterator[str]:
    """Keys and their values, a line each."""
    return (f"{key} = {toml_value(value)}" for key, value in keys.items())


def pasted_text(files: Sequence[Inspected]) -> str:
    """Tables to paste into a campaign in any folder: files are named by their full path."""
    head = "# files by their full path, which holds in any folder; bushfit init writes them as seen from the campaign\n"
    tables = [*_specimens(files), *(file_text(seen) for seen in files)]
    return head * any(seen.kind in _TABLES for seen in files) + "\n".join(tables)


def file_text(seen: Inspected, folder: Path | None = None) -> str:
    """The table of one file in a campaign that lies in a folder; for a raw history, a comment on what to do first.

    Without a folder the file is named by its full path.
    """
    name = seen.file.resolve().as_posix()
    with suppress(ValueError):  # another drive, where no path leads
        name = Path(os.path.relpath(seen.file, folder)).as_posix() if folder else name
    direction = f'"{seen.direction}"' if seen.direction else '"..."  # axial or radial: the file does not say'
    if seen.kind == "history":
        word = f'"{name}"' if " " in name else name
        stated = seen.direction or "..."
        return f"# {name} is a raw history: bushfit reduce {word} --direction {stated} makes a sweep of it\n"
    lines = [f"[[{_TABLES[seen.kind]}]]", f"file = {toml_value(name)}"]
    lines += [] if isinstance(seen.direction, Specimen) else [f"direction = {direction}"]
    return "\n".join([*lines, *_key_lines(seen.entry), ""])
