"""Recordings of instruments and programs, as groups of channels; and workbooks.

The first bytes of a file determine its format.
"""

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
from bushfit.reading.formats import read_arrow, read_json, read_matlab, read_mdf, read_tdms
from bushfit.reading.headers import ERRORS, HINTS, LOOP_COLUMNS, SWEEP_COLUMNS, Vocabulary
from bushfit.reading.layout import Layout
from bushfit.reading.lines import Line
from bushfit.reading.source import Channel, Channels, Group, Sheet
from bushfit.reading.uff import read_uff
from bushfit.reading.workbook import read_workbook

#: Names of channels whose values cannot be complex.
_REAL = Vocabulary({"time": LOOP_COLUMNS["time"], **{role: SWEEP_COLUMNS[role] for role in ("frequency", "amplitude")}})


class Format(NamedTuple):
    """File format of recordings.

    Args:
        name: name of the format, such as "TDMS"; "" for a workbook.
        endings: file name endings, such as ".tdms".
        sign: regular expression that matches the first bytes of a file in this format.
        read: function that takes bytes and path of a file and yields its groups of channels, or its sheets.
        hint: next step to suggest for a file without channels.
        again: next step to suggest for a damaged file.
    """

    name: str
    endings: tuple[str, ...]
    sign: bytes
    read: Callable[[bytes, Path], Iterator[Group | Sheet]]
    hint: str = "export the file again, with its channels"
    again: str = "the file may be incomplete: copy or export it again"


#: Supported formats of recordings.
_FORMATS = (
    Format("MATLAB", (".mat",), rb"MATLAB (?:5\.0|7\.3) MAT-file", read_matlab, HINTS["matlab"]),
    Format("HDF5", (".h5", ".hdf5"), rb"\x89HDF", read_matlab),
    Format("JSON", (".ndjson", ".jsonl"), rb"(?:\xef\xbb\xbf)?\s*(?:\[\s*)*\{\s*\"", read_json),
    Format("TDMS", (".tdms",), rb"TDSm", read_tdms),
    Format("UFF", (".uff", ".unv"), rb" {4}-1 *\r?\n +\d+", read_uff, HINTS["uff"]),
    Format("MDF", (".mf4", ".mdf"), rb"MDF     |UnFinMF ", read_mdf),
    Format("Parquet or Arrow", (".parquet", ".feather", ".arrow"), rb"PAR1|ARROW1", read_arrow),
    Format("", (), rb"PK\x03\x04|\xd0\xcf\x11\xe0", read_workbook, again="save it again as xlsx, or as CSV"),
)
#: File name endings of recordings.
RECORDINGS = tuple(ending for one in _FORMATS for ending in one.endings)


def word_for_part(file: Path) -> str:
    """Word for a part of a file in messages: "group" for a recording, "sheet" for a workbook."""
    return "group" if file.suffix.lower() in (".json", *RECORDINGS) else "sheet"


def format_of(data: bytes) -> Format | None:
    """Return the format of a recording or workbook, identified by its first bytes; None for a text."""
    return next((recording for recording in _FORMATS if re.match(recording.sign, data)), None)


@lru_cache(maxsize=1)
def read_parts(data: bytes, file: Path, recording: Format) -> tuple[Sheet, ...]:
    """Read the groups of channels in a recording, or the sheets of a workbook.

    The last result is cached, because an inspection reads a file several times.

    Args:
        data: bytes of the file.
        file: path of the file.
        recording: format of the file.

    Returns:
        Groups of channels of equal length, with unique titles if there are several; or sheets.

    Raises:
        MeasurementError: the file cannot be read, or has no channels of numbers.
    """
    parts, details = list[Sheet](), dict[str, str]()
    kind = f"{recording.name} file" if recording.name else "workbook"
    with _silence_libraries():
        try:
            for part in recording.read(data, file):
                parts += [part] if isinstance(part, Sheet) else _split_by_length(*part, recording)
            problem, details = "holds no channels", {"expected": "numbers", "hint": recording.hint}
        except MeasurementError as error:
            error.file = file
            raise
        except ImportError as error:
            problem, details = "needs a package that is not installed", {"found": f"no package {error.name}"}
            details["hint"] = 'pip install "bushfit[instruments]"'
        except Exception as error:  # libraries raise any kind for broken files, struct.error and KeyError among them
            problem, details = "cannot be read", {"found": str(error) or type(error).__name__}
            details["hint"] = recording.again
            parts = []
        if not parts:
            gc.collect()  # finalizers of unfinished readers run here, where they print nothing
            raise MeasurementError(f"the {kind} {problem}", file=file, **details)
    titles = [part.sheet or ("top level" if len(parts) > 1 else "") for part in parts]
    counts = [titles[: index + 1].count(title) for index, title in enumerate(titles)]
    titles = [f"{title} ({count})" if count > 1 else title for title, count in zip(titles, counts, strict=True)]
    return tuple(replace(part, sheet=title) for part, title in zip(parts, titles, strict=True))


@contextmanager
def _silence_libraries() -> Iterator[None]:
    """Context manager that suppresses warnings, logging and printing of libraries and their finalizers."""
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


def _split_by_length(
    name: str, channels: Sequence[Channel], properties: Sequence[tuple[Any, ...]], recording: Format
) -> Iterator[Channels]:
    """Split a group into tables of channels with equal length and the same base channel, such as time.

    The base becomes the first column, unless the group has a channel of its name. Channels without a base are added to
    all tables of their length.

    Args:
        name: name of the group.
        channels: channels of the group.
        properties: properties of the recording, as lines above each table.
        recording: file format.
    """
    lengths: dict[int, dict[bytes, list[Channel]]] = {}
    for channel in channels:
        if len(channel.values) > 1:
            base = b"" if channel.over is None else channel.over.values.tobytes()
            lengths.setdefault(len(channel.values), {}).setdefault(base, []).append(channel)
    tables: list[list[Channel]] = []
    for bases in lengths.values():
        free = bases.pop(b"", [])
        tables += [based + free for based in bases.values()] or [free]
    labels = [tuple(map(str, label)) for label in properties]
    for table in tables:
        over = table[0].over
        is_record = "time" in _REAL.roles([channel.name for channel in table])
        several = sum(np.iscomplexobj(one.values) and bool(np.any(one.values.imag)) for one in table) > 1
        if over and over.name not in _REAL.roles([one.name for one in table]):
            table.insert(0, over)
        if columns := [column for channel in table for column in _real_channels(channel, several, is_record)]:
            names, arrays, unit_texts, _ = zip(*columns, strict=True)
            title = f"{name}, {len(arrays[0])} rows".strip(", ") if len(tables) > 1 else name
            header = [f"{text} [{unit}]" if unit else text for text, unit in zip(names, unit_texts, strict=True)]
            above = [Line(number, content) for number, content in enumerate([*labels, header], start=-len(labels))]
            layout = Layout("", names, 0, unit_texts, None, numbered=True)
            numeric = frozenset(index for index, values in enumerate(arrays) if values.dtype == float)
            yield Channels(title, (), layout=layout, numeric=numeric, arrays=arrays, above=above, format=recording.name)


def _real_channels(channel: Channel, several: bool, is_record: bool) -> Iterator[Channel]:
    """Convert a channel to real channels: dates to seconds, complex values to magnitude and phase.

    Args:
        channel: channel to convert.
        several: True if the file has several complex channels; a phase is then named after its channel.
        is_record: True if the channels are recorded over time, so that complex values have no meaning.

    Yields:
        The channel with floats, seconds or texts; for complex values, its magnitude and then its phase [rad].

    Raises:
        MeasurementError: a record, a time, a frequency or an amplitude is complex.
    """
    values = channel.values
    if values.dtype.kind == "c" and not np.any(values.imag):
        values = values.real
    if values.dtype.kind == "c" and (is_record or _REAL.heading(channel.name)):
        raise MeasurementError(
            f'the channel "{channel.name}" holds complex numbers',
            found=f"{values[np.argmax(values.imag != 0.0)]:.6g}",
            **ERRORS["complex_channel"],
        )
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
