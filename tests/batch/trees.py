"""Folders compared, and what tests of `batch` ask of one."""

import csv
import sys
import time
from pathlib import Path
from subprocess import Popen

PATTERN = "bushings/*/bushing.toml"


def tree(folder: Path) -> dict[str, bytes]:
    """All files below a folder, but for the records of what a command wrote and of the time that a row took."""
    records = ("row.json", ".bushfit.sha256")
    files = (path for path in sorted(folder.rglob("*")) if path.is_file() and path.name not in records)
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def stamps(folder: Path) -> dict[str, tuple[int, int]]:
    """What tells a file that was written again."""
    return {str(f): (f.stat().st_ino, f.stat().st_mtime_ns) for f in folder.rglob("*") if f.is_file()}


def rows(folder: Path) -> list[dict[str, str]]:
    with (folder / "batch.csv").open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def command(folder: str, *options: str) -> list[str]:
    """The rows of many.csv into a folder."""
    program = str(Path(sys.executable).with_name("bushfit"))
    return [program, "batch", "many.csv", "-o", folder, "--no-plots", *options]


def list_many(shop: Path, count: int) -> None:
    """Write a manifest of so many rows, of five campaigns in turn."""
    (shop / "many.csv").write_text("campaign\n" + "".join(f"bushings/b{n % 5}/bushing.toml\n" for n in range(count)))


def kept(folder: Path) -> int:
    """How many rows are on the disk."""
    return sum(1 for _ in folder.glob("bushings/*/row.json"))


def wait_for(running: Popen[bytes], folder: Path, count: int) -> None:
    """Wait until so many rows of a running batch are on the disk."""
    while running.poll() is None and kept(folder) < count:
        time.sleep(0.002)
