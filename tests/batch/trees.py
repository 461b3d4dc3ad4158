"""Folders compared."""

from __future__ import annotations

from pathlib import Path


def tree(folder: Path) -> dict[str, bytes]:
    """All files below a folder, but for the records of what a command wrote and of the time that a row took."""
    records = ("row.json", ".bushfit.json")
    files = (path for path in sorted(folder.rglob("*")) if path.is_file() and path.name not in records)
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def stamps(folder: Path) -> dict[str, tuple[int, int]]:
    """What tells a file that was written again."""
    return {str(f): (f.stat().st_ino, f.stat().st_mtime_ns) for f in folder.rglob("*") if f.is_file()}
