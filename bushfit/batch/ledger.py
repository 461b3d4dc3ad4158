"""What is kept of a row: a folder with its result files and row.json, the record of what was found.

The folder is bushings/<row>/ below that of the batch. A record lists the hashes of the row's inputs and of its files,
so that a later run can tell whether they still hold.

Notes:
    A folder is written staged and renamed: a process that is killed leaves a whole one or none. What a crash of the
    machine leaves torn is found by its hash, so that no write has to wait for the disk.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
import sys
import uuid
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

from bushfit.batch.document import Record
from bushfit.batch.manifest import Row
from bushfit.batch.quantities import Point
from bushfit.errors import OutputError
from bushfit.report.results import Formats
from bushfit.version import __version__

#: Layout of a record; records of another are done again.
SCHEMA: Literal["bushfit/row/2"] = "bushfit/row/2"
#: File of a row's record, in the row's folder.
RECORD = "row.json"
#: Folder of the rows' folders, in that of the batch.
ROWS = "bushings"
#: Folder in which results are made ready, in that of the batch; gone when the batch ends.
STAGE = ".aside"


def key(row: Row, points: tuple[Point, ...], formats: Formats) -> str:
    """Hash of a row's settings, of what is asked of it, and of the version that answers."""
    asked = {
        "settings": asdict(row.settings),
        "points": [str(point) for point in points],
        "tables": formats.tables,
        "table_form": formats.table_form if formats.tables or row.settings.predicted else None,
        "pictures": formats.picture_forms if formats.pictures else (),
    }
    return hashlib.sha256(json.dumps([__version__, SCHEMA, asked], sort_keys=True).encode()).hexdigest()


def valid_record(output: Path, row: Row, wanted: str) -> Record | None:
    """The record of a row that was done before with the same inputs and settings, all its files whole; else None."""
    folder, campaign = output / ROWS / row.folder, Path(row.campaign)
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError, AttributeError):  # torn: as good as absent
        record: Record = json.loads((folder / RECORD).read_bytes())
        if record["key"] != wanted or record["status"] != "done":
            return None
        for files, at in ((record["inputs"], campaign.parent), (record["files"], folder)):
            if any(digest((at / name).read_bytes()) != sha for name, sha in files.items()):
                return None
        return record
    return None


def digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def keep(output: Path, row: Row, files: Mapping[str, bytes], record: Record) -> None:
    """Put a row's files and its record in place, and what stood there away.

    Raises:
        OSError: the disk is full, or does not let itself be written.
    """
    folder, staged = output / ROWS / row.folder, output / STAGE / uuid.uuid4().hex
    staged.mkdir()
    try:
        for name, content in files.items():
            (staged / name).write_bytes(content)
        (staged / RECORD).write_bytes(to_bytes(record))
        while True:
            try:
                staged.rename(folder)
                break
            except OSError:
                if not folder.exists():
                    raise
                gone = output / STAGE / uuid.uuid4().hex
                with contextlib.suppress(FileNotFoundError):  # a twin on a worker given up for lost may be as fast
                    folder.rename(gone)
                shutil.rmtree(gone, ignore_errors=True)
    finally:
        shutil.rmtree(staged, ignore_errors=True)


def to_bytes(record: Record) -> bytes:
    """A record as its file has it, on one line."""
    return json.dumps(record, allow_nan=False, ensure_ascii=False, separators=(",", ":")).encode() + b"\n"


def left_over(output: Path, rows: Iterable[Row]) -> list[Path]:
    """Folders of rows of an earlier batch, in order, that are none of these."""
    ours = {row.folder for row in rows}
    return sorted(record.parent for record in (output / ROWS).glob(f"*/{RECORD}") if record.parent.name not in ours)


@contextlib.contextmanager
def held(output: Path) -> Iterator[None]:
    """Hold the batch's folder against other batches; what a killed run left half written is cleared away.

    Raises:
        OutputError: another batch is at work there.
    """
    os.makedirs(output / ROWS, exist_ok=True)  # noqa: PTH103
    try:
        claimed = claim(output / ROWS, wait=False)
    except BlockingIOError:
        raise OutputError(
            "another batch is at work there", file=output, hint="wait for its end, or name another folder with -o"
        ) from None
    try:
        shutil.rmtree(output / STAGE, ignore_errors=True)
        os.makedirs(output / STAGE, exist_ok=True)  # noqa: PTH103
        yield
    finally:
        shutil.rmtree(output / STAGE, ignore_errors=True)
        claimed.close()


def claim(folder: Path, *, wait: bool = True) -> Claim:
    """Mark a folder as in use, for other runs to see, until the claim is closed or this process ends.

    Raises:
        BlockingIOError: another holds it, and `wait` is False.
    """
    if sys.platform == "win32":
        return Claim(None)
    import fcntl

    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except OSError:
        return Claim(None)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except OSError as error:
        os.close(descriptor)
        if isinstance(error, BlockingIOError):
            raise
        return Claim(None)
    return Claim(descriptor)


@dataclass(frozen=True)
class Claim:
    """A folder marked as in use: the open folder that holds the lock, None where there are no locks."""

    descriptor: int | None

    def close(self) -> None:
        """End the claim."""
        if self.descriptor is not None:
            os.close(self.descriptor)
