"""Folder of a row: its result files and `row.json`, whose hashes show whether the files are still valid.

Notes:
    `row.json` is written last. If a process is killed, or a crash of the machine damages a file, `row.json` is missing
    or a hash does not match, and the row is evaluated again.
"""

import contextlib
import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path

from bushfit.batch.document import RowFile
from bushfit.batch.manifest import Row
from bushfit.errors import BushfitError, OutputError
from bushfit.reading.files import view_bytes
from bushfit.validation import to_json_data, validate_tables

#: Name of the record in the folder of a row.
ROW_FILE = "row.json"
#: Name of the folder in the batch folder that contains the folders of the rows.
ROWS_FOLDER = "bushings"


def load_row(output: Path, row: Row, key: str) -> RowFile | None:
    """Load the results of a part from an earlier run, if they are still valid.

    Args:
        output: results folder of the batch.
        row: row of the batch (one part).
        key: hash of everything except the input files that the results depend on.

    Returns:
        The results; None if settings or inputs have changed, or a file is damaged or missing.
    """
    folder, campaign_folder = output / ROWS_FOLDER / row.folder, Path(row.campaign).parent
    with contextlib.suppress(OSError, ValueError, BushfitError):
        record = validate_tables(json.loads((folder / ROW_FILE).read_bytes()), None, RowFile)
        if record.key == key and record.status == "done":
            files = {campaign_folder / name: sha for name, sha in record.inputs.items()}
            files |= {folder / name: sha for name, sha in record.files.items()}
            if all(digest(view_bytes(file, BushfitError)) == sha for file, sha in files.items()):
                return record
    return None


def save_row(output: Path, row: Row, files: Mapping[str, bytes], record: RowFile) -> None:
    """Write the result files of a part and its record, row.json, and remove those of an earlier run.

    Args:
        output: results folder of the batch.
        row: row of the batch (one part).
        files: contents of the result files by name.
        record: results of the part, for row.json.

    Raises:
        OSError: the disk is full or cannot be written.
    """
    folder = output / ROWS_FOLDER / row.folder
    document = json.dumps(to_json_data(record, RowFile), separators=(",", ":")).encode() + b"\n"
    folder.mkdir(exist_ok=True)
    for earlier in filter(Path.is_file, folder.iterdir()):
        earlier.unlink(missing_ok=True)  # a worker that was given up for lost may write the same row
    for name, content in {**files, ROW_FILE: document}.items():
        (folder / name).write_bytes(content)


def digest(data: bytes) -> str:
    """SHA-256 of data, in hexadecimal digits."""
    return hashlib.sha256(data).hexdigest()


@contextlib.contextmanager
def batch_folder(output: Path) -> Iterator[None]:
    """Reserve the results folder for one batch.

    Returns:
        Context in which the folder is locked, if the file system has locks.

    Raises:
        OutputError: another batch is running in this folder.
    """
    rows = output / ROWS_FOLDER
    rows.mkdir(parents=True, exist_ok=True)
    if os.name != "posix":
        yield
        return
    import fcntl

    descriptor = os.open(rows, os.O_RDONLY)  # the lock ends with it, or with this process
    try:
        with contextlib.suppress(OSError):  # a file system without locks
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                hint = "wait for its end, or name another folder with -o"
                raise OutputError("another batch is running in this folder", file=output, hint=hint) from None
        yield
    finally:
        os.close(descriptor)
