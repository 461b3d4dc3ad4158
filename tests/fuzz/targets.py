"""What the fuzzer calls: bytes as a file of the user's. Nothing but a BushfitError of a few lines may come of them."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from bushfit.campaign.campaign import load_campaign
from bushfit.errors import BushfitError
from bushfit.geometry import Direction
from bushfit.model.file import load_result, to_document
from bushfit.reading.loops import read_loop
from bushfit.reading.sweeps import read_sweep

CORPUS = Path(__file__).with_name("corpus")
_LONGEST_ERROR = 5000


def readers(folder: Path, data: bytes) -> None:
    """A measured table, as a loop and as a sweep."""
    file = folder / "table.csv"
    file.write_bytes(data)
    for read in (read_loop, read_sweep):
        with clear_errors():
            read(file, Direction.AXIAL)


def campaign(folder: Path, data: bytes) -> None:
    file = folder / "campaign.toml"
    file.write_bytes(data)
    with clear_errors():
        load_campaign(file)


def model(folder: Path, data: bytes) -> None:
    file = folder / "model.json"
    file.write_bytes(data)
    with clear_errors():
        to_document(load_result(file))


@contextmanager
def clear_errors() -> Iterator[None]:
    try:
        yield
    except BushfitError as error:
        if len(str(error)) > _LONGEST_ERROR:
            raise ValueError("an error that nobody reads to its end") from error


TARGETS: dict[str, Callable[[Path, bytes], None]] = {"readers": readers, "campaign": campaign, "model": model}


def ready(name: str) -> Callable[[bytes], None]:
    """A target in a folder of its own, with the tables that the campaigns of the corpus name."""
    folder = Path(tempfile.mkdtemp(prefix="fuzz-"))
    for table in ("loop.csv", "sweep.csv"):
        shutil.copy(CORPUS / "readers" / table, folder)
    return partial(TARGETS[name], folder)
