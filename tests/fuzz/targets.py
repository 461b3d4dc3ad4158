"""Bytes as a file of the user's for the functions behind the commands: at worst they raise a short BushfitError."""

import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import bombs

from bushfit.campaign.campaign import load_campaign
from bushfit.commands.compare import compare, compared_result
from bushfit.commands.predict import predict
from bushfit.errors import BushfitError
from bushfit.geometry import Direction, Specimen
from bushfit.inspection.gathering import gather
from bushfit.model.file import load_result, to_document
from bushfit.reading.headers import RESONANCE_COLUMNS
from bushfit.reading.loops import read_loop
from bushfit.reading.resonance import read_resonance
from bushfit.reading.stated import LoopFile, SweepFile
from bushfit.reading.sweeps import read_sweep
from bushfit.reading.table import Table
from bushfit.report.page import folder_pages
from bushfit.report.results import Formats, encode_all, to_json

CORPUS = Path(__file__).with_name("corpus")
#: The files of a folder of results, by their names.
RESULTS = {
    file.name.encode(): file
    for file in (Path(__file__).parents[2] / "data/reports/mystery_mount").iterdir()
    if file.suffix in (".json", ".csv")
}
#: Texts that cells of a workbook may name.
TEXTS = (
    b"<sst><si><t>time [s]</t></si><si><t>displacement [mm]</t></si><si><t>force [N]</t></si><si><t>1,5</t></si></sst>"
)
_LONGEST_ERROR = 5000


def readers(folder: Path, data: bytes) -> None:
    """A measured table, as a loop, a sweep and a resonance test, and as `inspect` takes it: of a coupon, too."""
    file = folder / "table.csv"
    file.write_bytes(data)
    for place in (Direction.AXIAL, Specimen("DMA", "modulus")):
        with clear_errors():
            read_loop(file, place, LoopFile(file=file.name))
        with clear_errors():
            read_sweep(file, place, SweepFile(file=file.name))
    with clear_errors():
        read_resonance(Table.open(file, RESONANCE_COLUMNS), Direction.AXIAL, 1.0)
    look_into(file)


def look_into(file: Path) -> None:
    """A file as `inspect` takes it."""
    with clear_errors():
        for source in gather([file], {})[0]:
            source.inspect()


def campaign(folder: Path, data: bytes) -> None:
    file = folder / "campaign.toml"
    file.write_bytes(data)
    with clear_errors():
        load_campaign(file)


def model(folder: Path, data: bytes) -> None:
    file = folder / "model.json"
    file.write_bytes(data)
    with clear_errors():
        result = load_result(file)
        to_json(to_document(result))
        predict(result)


def workbook(folder: Path, data: bytes) -> None:
    """The rows of a sheet, and those of another after a line of `=`, in a workbook that is whole otherwise."""
    file = folder / "table.xlsx"
    file.write_bytes(bombs.workbook(data.split(b"\n====\n"), texts=TEXTS))
    with clear_errors():
        read_sweep(file, Direction.AXIAL, SweepFile(file=file.name))
    look_into(file)


def report(folder: Path, data: bytes) -> None:
    """A folder of results of which one file, named on the first line, is the rest; its page, and it beside another."""
    name, _, content = data.partition(b"\n")
    file = folder / (name.decode("ascii", "ignore") if name in RESULTS else "model.json")
    kept = file.read_bytes()
    file.write_bytes(content)
    try:
        with clear_errors():
            encode_all(folder_pages(folder), Formats())
        if file.suffix == ".json":
            with clear_errors():
                result = load_result(folder / "model.json")
                compare(*(compared_result(result, name) for name in ("one", "other")))
    finally:
        file.write_bytes(kept)


@contextmanager
def clear_errors() -> Iterator[None]:
    try:
        yield
    except BushfitError as error:
        if len(str(error)) > _LONGEST_ERROR:
            raise ValueError("an error that nobody reads to its end") from error


TARGETS: dict[str, Callable[[Path, bytes], None]] = {
    "readers": readers,
    "campaign": campaign,
    "model": model,
    "workbook": workbook,
    "report": report,
}


def ready(name: str) -> Callable[[bytes], None]:
    """A target in a folder of its own, with the tables that the campaigns of the corpus name."""
    folder = Path(tempfile.mkdtemp(prefix="fuzz-"))
    for file in (*(CORPUS / "readers" / table for table in ("loop.csv", "sweep.csv")), *RESULTS.values()):
        shutil.copy(file, folder)
    return partial(TARGETS[name], folder)
