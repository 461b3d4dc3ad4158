"""Recordings of instruments and programs, told by their content, as groups of channels of one length."""

import gc
import io
import logging
import re
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bushfit.errors import MeasurementError
from bushfit.reading import recordings
from bushfit.reading.headers import Vocabulary
from bushfit.reading.layout import Layout, Line
from bushfit.reading.recordings import Channel, Group
from bushfit.reading.source import Channels
from bushfit.reading.words import LOOP_COLUMNS, SWEEP_COLUMNS

#: The names that a base of recording goes by.
_BASES = Vocabulary({"time": LOOP_COLUMNS["time"], "frequency": SWEEP_COLUMNS["frequency"]}, {})


class Format(NamedTuple):
    """A format of recordings: its name, endings and pattern of the start of files, what reads them, and a hint."""

    name: str
    endings: tuple[str, ...]
    sign: bytes
    read: Callable[[bytes, Path], Iterator[Group]]
    hint: str


#: What may be done about files without channels.
_HINT = "export it again, with its channels"
_MATLAB_HINT = 'save vectors, or structs of them, with -v7; a table by way of table2struct(T, "ToScalar", true)'
_UFF_HINT = "export records or frequency responses as dataset 58; of data at nodes (55) only the latter are read"
#: The formats of recordings.
_FORMATS = (
    Format("MATLAB", (".mat",), rb"MATLAB (?:5\.0|7\.3) MAT-file", recordings.matlab, _MATLAB_HINT),
    Format("TDMS", (".tdms",), rb"TDSm", recordings.tdms, _HINT),
    Format("UFF", (".uff", ".unv"), rb" {4}-1 *\r?\n +\d+", recordings.uff, _UFF_HINT),
    Format("MDF", (".mf4", ".mdf"), rb"MDF     |UnFinMF ", recordings.mdf, _HINT),
    Format("Parquet or Arrow", (".parquet", ".feather", ".arrow"), rb"PAR1|ARROW1", recordings.arrow, _HINT),
)
#: Endings of the files of recordings.
RECORDINGS = tuple(ending for one in _FORMATS for ending in one.endings)


def word_for_part(file: Path) -> str:
    """What a part of a file is called that may hold a table: the group of a recording, the sheet of a workbook."""
    return "group" if file.suffix.lower() in RECORDINGS else "sheet"


def format_of(data: bytes, file: Path) -> Format | None:
    """The format of a recording by its first bytes; None where it is a text or a workbook.

    Raises:
        MeasurementError: the ending of the file is that of a recording, and its content is not.
    """
    own = next((one for one in _FORMATS if re.match(one.sign, data)), None)
    said = next((one for one in _FORMATS if file.suffix.lower() in one.endings), None)
    if said and not own:
        raise MeasurementError(
            f"this is no {said.name} file",
            file=file,
            found=f"first bytes {data[:16]!r}",
            expected=f"a {said.name} file, as its ending {file.suffix} says",
            hint="export it again, or give it the ending of what it is, such as .csv",
        )
    return own


@lru_cache(maxsize=1)
def read_groups(data: bytes, file: Path, own: Format) -> tuple[Channels, ...] | MeasurementError:
    """The groups of channels of one length in a recording, each with a name of its own if there are several.

    Or else the error: no channels, a library that is not installed or cannot read it. The last answer is kept, because
    to look at a file takes several passes.
    """
    with _silenced():
        try:
            found = [part for group in own.read(data, file) for part in _of_one_length(*group, own)]
            problem, said = "holds no channels", {"expected": "numbers", "hint": own.hint}
        except ImportError as error:
            found, problem = [], "takes a package that is not installed"
            said = {"found": f"no package {error.name}", "hint": 'pip install "bushfit[instruments]"'}
        except Exception as error:  # libraries raise any kind for broken files, struct.error and KeyError among them
            found, problem = [], "cannot be read"
            said = {"found": str(error) or type(error).__name__, "hint": "it may be cut short: copy or export it again"}
        if not found:
            gc.collect()  # finalizers of what was half read run here, where they print nothing
            return MeasurementError(f"the {own.name} file {problem}", file=file, **said)
    titles = [part.sheet or ("top level" if len(found) > 1 else "") for part in found]
    counts = [titles[: index + 1].count(title) for index, title in enumerate(titles)]
    titles = [f"{title} ({count})" if count > 1 else title for title, count in zip(titles, counts, strict=True)]
    return tuple(replace(part, sheet=title) for part, title in zip(found, titles, strict=True))


@contextmanager
def _silenced() -> Iterator[None]:
    """Libraries neither warn, log nor print within, nor their finalizers: what cannot be read is an error."""
    before, hook = logging.root.manager.disable, sys.unraisablehook
    logging.disable(logging.CRITICAL)
    sys.unraisablehook = lambda _: None
    try:
        with warnings.catch_warnings(), redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(before)
        sys.unraisablehook = hook


def _of_one_length(
    name: str, channels: Sequence[Channel], said: Sequence[tuple[Any, ...]], own: Format
) -> Iterator[Channels]:
    """The channels of a group that belong together: of one length, over one base, which goes before them.

    Those without a base belong to all bases of their length. A base that is among them by its name is left out.
    """
    lengths: dict[int, dict[bytes, list[Channel]]] = {}
    for channel in channels:
        if len(channel.values) > 1:
            base = b"" if channel.over is None else channel.over.values.tobytes()
            lengths.setdefault(len(channel.values), {}).setdefault(base, []).append(channel)
    tables: list[list[Channel]] = []
    for bases in lengths.values():
        free = bases.pop(b"", [])
        tables += [alike + free for alike in bases.values()] or [free]
    labels = [tuple(map(str, label)) for label in said]
    for table in tables:
        over = table[0].over
        several = sum(np.iscomplexobj(one.values) for one in table) > 1
        if over and over.name not in _BASES.roles([one.name for one in table]):
            table.insert(0, over)
        plain = [part for one in table for part in _plain(one, several)]
        if plain:
            names, arrays, stated, _ = zip(*plain, strict=True)
            title = f"{name}, {len(arrays[0])} rows".strip(", ") if len(tables) > 1 else name
            header = [f"{text} [{unit}]" if unit else text for text, unit in zip(names, stated, strict=True)]
            above = [Line(number, content) for number, content in enumerate([*labels, header], start=-len(labels))]
            layout = Layout("", names, 0, stated, None, numbered=True)
            numeric = frozenset(index for index, values in enumerate(arrays) if values.dtype == float)
            yield Channels(title, (), layout=layout, numeric=numeric, arrays=arrays, above=above, format=own.name)


def _plain(channel: Channel, several: bool) -> Iterator[Channel]:
    """A channel as floats or texts: a complex one as magnitude and phase, named if `several` are, times in seconds."""
    values = channel.values
    if values.dtype.kind == "c":
        yield channel._replace(values=np.abs(values))
        yield Channel(f"{channel.name} phase" if several else "phase", np.angle(values), "rad")
    elif values.dtype.kind in "mM":
        start = values[0] if values.dtype.kind == "M" else np.timedelta64(0)
        yield channel._replace(values=(values - start) / np.timedelta64(1, "s"), unit="s")
    elif values.dtype.kind in "biuf":
        yield channel._replace(values=values.astype(float))
    elif values.dtype.kind in "UO":
        yield channel._replace(values=np.array(["" if cell is None else str(cell) for cell in values], dtype=object))
