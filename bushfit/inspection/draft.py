"""Campaign text from files that were looked at."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from bushfit.inspection.record import Inspected

_PLURAL = {"loop": "loops", "sweep": "sweeps"}


def campaign_text(bushing: Mapping[str, str], files: Sequence[Inspected], folder: Path) -> str:
    """A whole campaign file.

    Args:
        bushing: keys of [bushing], quantities as texts.
        files: loops and sweeps, each with a direction.
        folder: where the campaign will lie; its files are named from there.
    """
    head = ["[bushing]", *(f"{key} = {toml_value(value)}" for key, value in bushing.items())]
    order = [seen for kind in _PLURAL for seen in files if seen.kind == kind]
    return "\n".join([*head, "", *(file_text(seen, folder) for seen in order)])


def pasted_text(files: Sequence[Inspected]) -> str:
    """Tables to paste into a campaign in whatever folder: files are named from the root."""
    head = "# files by their full path, which holds in any folder; bushfit init writes them as seen from the campaign\n"
    return head * any(seen.kind in _PLURAL for seen in files) + "\n".join(file_text(seen) for seen in files)


def file_text(seen: Inspected, folder: Path | None = None) -> str:
    """The table of one file in a campaign; of a raw history, what to do first.

    Args:
        seen: the file.
        folder: where the campaign lies; without it the file is named by its full path.
    """
    name = _named(seen.file, folder)
    direction = f'"{seen.direction}"' if seen.direction else '"..."  # axial or radial: the file does not say'
    if seen.kind == "history":
        stated = f" --direction {seen.direction}" if seen.direction else " --direction ..."
        return f"# {name} is a raw history: bushfit reduce {_quoted(name)}{stated} makes a sweep of it\n"
    lines = [f"[[{_PLURAL[seen.kind]}]]", f"file = {toml_value(name)}", f"direction = {direction}"]
    lines += [f"{key} = {toml_value(value)}" for key, value in seen.entry.items()]
    return "\n".join(lines) + "\n"


def _named(file: Path, folder: Path | None) -> str:
    """The file as seen from a folder, with forward slashes; its full path where there is no way between them."""
    if folder is not None:
        with suppress(ValueError):  # another drive
            return Path(os.path.relpath(file, folder)).as_posix()
    return file.resolve().as_posix()


def _quoted(name: str) -> str:
    return f'"{name}"' if " " in name else name


def toml_value(value: Any) -> str:
    """A value as TOML writes it."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {toml_value(entry)}" for key, entry in value.items()) + " }"
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return '"' + "".join(c if c >= " " and c != "\x7f" else f"\\u{ord(c):04x}" for c in escaped) + '"'
    return str(value)
