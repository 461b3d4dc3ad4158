"""Folders compared, and what tests of `batch` ask of one."""

from __future__ import annotations

import csv
import sys
from pathlib import Path

PATTERN = "bushings/*/bushing.toml"


def tree(folder: Path) -> dict[str, bytes]:
    """All files below a folder, but for the records of what a command wrote and of the time that a row took."""
    records = ("row.json", ".bushfit.json")
    files = (path for path in sorted(folder.rglob("*")) if path.is_file() and path.name not in records)
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def stamps(folder: Path) -> dict[str, tuple[int, int]]:
    """What tells a file that was written again."""
    return {str(f): (f.stat().st_ino, f.stat().st_mtime_ns) for f in folder.rglob("*") if f.is_file()}


def rows(folder: Path) -> list[dict[str, str]]:
    with (folder / "batch.csv").open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def command(folder: Path, *options: str) -> list[str]:
    return [
        str(Path(sys.executable).with_name("bushfit")),
        "batch",
        "many.csv",
        "-o",
        str(folder),
        "--no-plots",
        *options,
    ]
