"""Recordings of instruments and programs (MATLAB, TDMS, UFF, MDF, Parquet and Arrow), as groups of channels.

The first bytes of a file determine its format. Each reader imports its library when a file needs it. A unit that the
file does not state is "".
"""

import gc
import io
import logging
import re
import sys
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import replace
from functools import lru_cache
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bushfit import units
from bushfit.errors import MeasurementError
from bushfit.reading.headers import LOOP_COLUMNS, SWEEP_COLUMNS, Vocabulary
from bushfit.reading.labview import labview
from bushfit.reading.layout import Layout, Line
from bushfit.reading.source import Channel, Channels, Group

#: Values of the largest file; chosen: ten million rows of twenty channels and more, 2 GiB.
_MOST_VALUES = 1 << 28
#: Quantities of UFF by number, with their SI unit and the factor of dataset 164 that values are divided by.
_UFF_QUANTITIES = {
    **{8: ("displacement", "m", "length"), 9: ("force", "N", "force"), 13: ("force", "N", "force")},
    **{17: ("time", "s", ""), 18: ("frequency", "Hz", "")},
}
#: First and last line of a dataset of UFF.
_UFF_MARK = b"    -1"
#: ID line 5 of data at nodes: reference, its direction, numerator, denominator.
_UFF_CODES = re.compile(r"(\s*-?\d+){4}\s*")
#: First direction of UFF in which a displacement is a rotation, and a force a moment.
_UFF_ROTATIONS = 4
#: Names of the base of a recording.
_BASES = Vocabulary({"time": LOOP_COLUMNS["time"], "frequency": SWEEP_COLUMNS["frequency"]}, {})
#: Channels that have no complex values.
_REAL = Vocabulary(
    {"time": LOOP_COLUMNS["time"], **{role: SWEEP_COLUMNS[role] for role in ("frequency", "amplitude")}}, {}
)
#: Next step for files without channels.
_HINT = "export it again, with its channels"
_MATLAB_HINT = 'save vectors, or structs of them, with -v7; a table by way of table2struct(T, "ToScalar", true)'
_UFF_HINT = "export records or frequency responses as dataset 58; of data at nodes (55) only the latter are read"


def matlab(data: bytes, _: Path) -> Iterator[Group]:
    """Read the vectors of a MATLAB file, with a group for each struct.

    Yields:
        Groups of channels.
    """
    if data.startswith(b"MATLAB 7.3"):
        import h5py

        with h5py.File(io.BytesIO(data)) as content:
            yield from _in_struct("", _from_hdf5(content))
    else:
        from scipy.io import loadmat

        stream: Any = io.BytesIO(data)
        yield from _in_struct("", loadmat(stream, simplify_cells=True))


def _from_hdf5(node: Any) -> Any:
    """Variable of MATLAB in HDF5 as scipy returns it: a dict, a list of dicts, a text, or an array.

    None for an object of a class, such as a table.
    """
    if getattr(node, "external", None) or getattr(node, "is_virtual", False):
        raise ValueError("its data are in other files")
    if hasattr(node, "items"):
        if any(type(node.get(name, getlink=True)).__name__ == "ExternalLink" for name in node):
            raise ValueError("its data are in other files")
        fields = {name: _from_hdf5(child) for name, child in node.items() if not name.startswith("#")}
        if fields and all(isinstance(values, list) for values in fields.values()):  # an array of structs
            return [dict(zip(fields, one, strict=True)) for one in zip(*fields.values(), strict=True)]
        return fields
    _bound(node.size)
    values = node[()]
    if "MATLAB_object_decode" in node.attrs or "MATLAB_empty" in node.attrs:
        return None
    if node.attrs.get("MATLAB_class") == b"char":
        return "".join(map(chr, values.T.ravel()))
    if values.dtype == object:
        return [_from_hdf5(node.file[reference]) for reference in values.ravel()]
    return np.squeeze((values["real"] + 1j * values["imag"] if values.dtype.names else values).T)


def _bound(values: int) -> None:
    """Refuse a file that unpacks to more values than a recording has."""
    if values > _MOST_VALUES:
        raise ValueError(f"it unpacks to {values} values, of which at most {_MOST_VALUES} are read")


def _in_struct(path: str, content: Mapping[str, Any]) -> Iterator[Group]:
    """Groups of the vectors and columns of matrices in a struct, and in the structs inside it."""
    channels: list[Channel] = []
    labels: list[tuple[str, str]] = []
    inner: dict[str, Mapping[str, Any]] = {}
    for name, value in content.items():
        place = f"{path}.{name}" if path else name
        if name.startswith("__"):
            continue
        if isinstance(value, Mapping):
            inner[place] = value
        elif isinstance(value, list):
            inner |= {f"{place}({n})": one for n, one in enumerate(value, start=1) if isinstance(one, Mapping)}
        elif isinstance(value, np.ndarray) and value.ndim == 1:
            channels.append(Channel(name, value))
        elif isinstance(value, np.ndarray) and value.ndim == 2:
            channels.extend(Channel(f"{name}(:,{n})", column) for n, column in enumerate(value.T, start=1))
        elif isinstance(value, str):
            labels.append((name, value))
    yield path, channels, labels
    for place, struct in inner.items():
        yield from _in_struct(place, struct)


def tdms(data: bytes, _: Path) -> Iterator[Group]:
    """Read the channels of a TDMS file; a waveform is recorded over time, unless it states another unit.

    Yields:
        Groups of channels.
    """
    from nptdms import TdmsFile

    file = TdmsFile.read(io.BytesIO(data))
    if file.file_status.incomplete_final_segment:
        raise ValueError("its last segment is not complete")
    for group in file.groups():
        channels = []
        for channel in group.channels():
            properties, values, over = channel.properties, channel[:], None
            if step := properties.get("wf_increment"):
                unit = properties.get("wf_xunit_string") or "s"
                bases = {"Hz": "frequency", "s": "time"}
                name = next((name for si, name in bases.items() if units.is_compatible(unit, si)), "x")
                over = Channel(name, properties.get("wf_start_offset", 0.0) + step * np.arange(len(values)), unit)
            channels.append(Channel(channel.name, values, properties.get("unit_string", ""), over))
        yield group.name, channels, [*file.properties.items(), *group.properties.items()]


def mdf(data: bytes, _: Path) -> Iterator[Group]:
    """Read the channels of an MDF file over their master channels.

    Yields:
        Groups of channels.
    """
    from asammdf import MDF

    with MDF(io.BytesIO(data)) as file:
        groups: Sequence[Any] = file.groups
        for index, group in enumerate(groups):
            master, comments = file.masters_db.get(index), group.channel_group
            over = None if master is None else group.channels[master]
            is_time = getattr(over, "sync_type", 1) == 1  # older files have no other
            name, unit = ("time", "s") if over is None or is_time else (over.name, over.unit)
            signals = file.select([(None, index, number) for number in range(len(group.channels)) if number != master])
            channels = [Channel(s.name, s.samples, s.unit, over and Channel(name, s.timestamps, unit)) for s in signals]
            yield getattr(comments, "acq_name", "") or comments.comment or f"group {index + 1}", channels, ()


def arrow(data: bytes, _: Path) -> Iterator[Group]:
    """Read the columns of a Parquet or Arrow file, with units from the metadata of its fields.

    Yields:
        One group of channels.
    """
    import pyarrow as pa

    if data.startswith(b"PAR1"):
        from pyarrow.parquet import ParquetFile

        file = ParquetFile(pa.BufferReader(data))
        _bound(file.metadata.num_rows * file.metadata.num_columns)
        table = file.read()
    else:
        table = pa.ipc.open_file(pa.BufferReader(data)).read_all()
    frame = table.to_pandas(ignore_metadata=True)
    channels = []
    for index, field in enumerate(table.schema):
        metadata = field.metadata or {}
        unit = (metadata.get(b"unit") or metadata.get(b"units") or b"").decode()
        column = frame.iloc[:, index]
        plain = column.dt.tz_localize(None) if getattr(column.dtype, "tz", None) else column
        channels.append(Channel(field.name, plain.to_numpy(), unit))
    yield "", channels, ()


def uff(data: bytes, file: Path) -> Iterator[Group]:
    """Read a UFF file: functions (dataset 58), or if there are none, data at nodes (dataset 55).

    Yields:
        A group for each complex function of frequency, and one for all records over time.
    """
    import pyuff

    if not data.rstrip().endswith(_UFF_MARK):
        raise ValueError("its last dataset has no end")
    book = pyuff.UFF(str(file))
    kinds = list(book.get_set_types())
    read_kind = 58 if 58 in kinds else 55
    sets = [book.read_sets(number) for number, kind in enumerate(kinds) if kind in (read_kind, 164)]
    factors: Mapping[str, Any] = next((one for one in sets if one["type"] == 164), {})
    functions = [one for one in sets if one["type"] == 58] or [*_at_nodes(one for one in sets if one["type"] == 55)]
    quantities = Counter(one["ordinate_spec_data_type"] for one in functions)
    records: list[Channel] = []
    for number, one in enumerate(functions, start=1):
        title = _uff_text(one, "id1") or f"function {number}"
        over = _uff_axis(one, "abscissa", one["x"], 0, factors)
        upper = _uff_axis(one, "ordinate", one["data"], one["rsp_dir"], factors)
        name, values, unit, _ = upper._replace(name=upper.name or _uff_text(one, "ordinate_axis_lab") or title)
        if not np.iscomplexobj(values):
            several = upper.name and quantities[one["ordinate_spec_data_type"]] > 1
            records.append(Channel(f"{name} ({title}: {one['rsp_node']})" if several else name, values, unit, over))
            continue
        lower = _uff_axis(one, "orddenom", np.ones(1), one["ref_dir"], factors)
        if lower.name:
            is_stiffness = (name, lower.name) == ("force", "displacement")
            name = "dynamic stiffness" if is_stiffness else f"{name} over {lower.name}"
        if "/" not in unit or _uff_text(one, "orddenom_axis_units_lab"):  # else the unit is that of the ratio
            values, unit = values / lower.values, f"{unit}/{lower.unit}" if unit and lower.unit else ""
        yield title, [Channel(name, values, unit, over)], [(one[f"id{line}"],) for line in range(1, 6)]
    yield "", records, ()


def _at_nodes(steps: Iterable[Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    """Frequency responses at nodes, with one dataset 55 for each frequency, as functions of dataset 58.

    ID line 5 states reference, its direction, numerator and denominator, as in I-DEAS Test.
    """
    runs: dict[tuple[Any, ...], list[Mapping[str, Any]]] = {}
    for one in steps:
        if one["analysis_type"] == 5 and np.iscomplexobj(one["r1"]):
            codes = [int(word) for word in one["id5"].split()] if _UFF_CODES.fullmatch(one["id5"]) else [0, 0, 0, 0]
            runs.setdefault((one["load_case"], one["id1"], *codes), []).append(one)
    labels = dict.fromkeys((f"{axis}_axis_units_lab" for axis in ("abscissa", "ordinate", "orddenom")), "NONE")
    for (_, title, _, direction, upper, lower), run in runs.items():
        of_all = {"abscissa_spec_data_type": 18, "ordinate_spec_data_type": upper, "orddenom_spec_data_type": lower}
        of_all |= labels | {"x": np.array([one["freq"] for one in run]), "ref_dir": direction}
        for node, (axis, name) in product(run[0]["node_nums"], enumerate("XYZ", start=1)):
            values = [dict(zip(one["node_nums"], one[f"r{axis}"], strict=True)).get(node, 0.0) for one in run]
            if any(values):
                identity = {"id1": f"{title}, node {node} {name}", "rsp_node": node, "rsp_dir": axis}
                yield {**run[0], **of_all, **identity, "data": np.array(values), "ordinate_axis_lab": "NONE"}


def _uff_text(function: Mapping[str, Any], key: str) -> str:
    """Text of a UFF function; "" if it is NONE."""
    text = " ".join(str(function[key]).split())
    return "" if text == "NONE" else text


def _uff_axis(
    function: Mapping[str, Any], axis: str, values: NDArray[Any], direction: int, factors: Mapping[str, Any]
) -> Channel:
    """Axis of a UFF function with the name of its quantity, in the unit of its label or of dataset 164."""
    name, si, factor = _UFF_QUANTITIES.get(function[f"{axis}_spec_data_type"], ("", "", ""))
    if label := _uff_text(function, f"{axis}_axis_units_lab"):
        return Channel(name, values, label)
    if abs(direction) >= _UFF_ROTATIONS or (factor and not factors):
        return Channel(name, values)
    return Channel(name, values / factors.get(factor, 1.0), si)


class Format(NamedTuple):
    """Format of recordings.

    Args:
        name: of the format.
        endings: of files.
        sign: pattern of the first bytes.
        read: function that returns the groups of channels.
        hint: next step for a file without channels.
    """

    name: str
    endings: tuple[str, ...]
    sign: bytes
    read: Callable[[bytes, Path], Iterator[Group]]
    hint: str


#: Formats of recordings.
_FORMATS = (
    Format("MATLAB", (".mat",), rb"MATLAB (?:5\.0|7\.3) MAT-file", matlab, _MATLAB_HINT),
    Format("TDMS", (".tdms",), rb"TDSm", tdms, _HINT),
    Format("UFF", (".uff", ".unv"), rb" {4}-1 *\r?\n +\d+", uff, _UFF_HINT),
    Format("MDF", (".mf4", ".mdf"), rb"MDF     |UnFinMF ", mdf, _HINT),
    Format("LabVIEW", (".lvm",), rb"LabVIEW Measurement", labview, _HINT),
    Format("Parquet or Arrow", (".parquet", ".feather", ".arrow"), rb"PAR1|ARROW1", arrow, _HINT),
)
#: Endings of the files of recordings.
RECORDINGS = tuple(ending for one in _FORMATS for ending in one.endings)


def word_for_part(file: Path) -> str:
    """Word for a part of a file: "group" of a recording, or "sheet" of a workbook."""
    return "group" if file.suffix.lower() in RECORDINGS else "sheet"


def format_of(data: bytes, file: Path) -> Format | None:
    """Determine the format of a recording by its first bytes.

    Args:
        data: bytes of the file.
        file: path.

    Returns:
        Format; None for a text or a workbook.

    Raises:
        MeasurementError: the ending of the file is that of a recording, and its content is not.
    """
    by_content = next((recording for recording in _FORMATS if re.match(recording.sign, data)), None)
    by_ending = next((recording for recording in _FORMATS if file.suffix.lower() in recording.endings), None)
    if (
        by_ending and not by_content and by_ending.read is not labview
    ):  # LabVIEW also writes plain tables under this ending
        raise MeasurementError(
            f"this is no {by_ending.name} file",
            file=file,
            found="the first bytes of another file",
            expected=f"a {by_ending.name} file, as its ending {file.suffix} says",
            hint="export it again, or give it the ending of what it is, such as .csv",
        )
    return by_content


@lru_cache(maxsize=1)
def read_groups(data: bytes, file: Path, recording: Format) -> tuple[Channels, ...] | MeasurementError:
    """Read the groups of channels in a recording; the last result is cached, because an inspection reads several times.

    Args:
        data: bytes of the file.
        file: path.
        recording: its format.

    Returns:
        Channels of one length in each group, with unique titles if there are several; or the error if there are no
        channels, a library is not installed, or it cannot read the file.
    """
    with _silenced():
        try:
            groups = [part for group in recording.read(data, file) for part in _split_by_length(*group, recording)]
            problem, details = "holds no channels", {"expected": "numbers", "hint": recording.hint}
        except MeasurementError as error:
            error.file = file
            return error
        except ImportError as error:
            groups, problem = [], "takes a package that is not installed"
            details = {"found": f"no package {error.name}", "hint": 'pip install "bushfit[instruments]"'}
        except Exception as error:  # libraries raise any kind for broken files, struct.error and KeyError among them
            groups, problem = [], "cannot be read"
            details = {
                "found": str(error) or type(error).__name__,
                "hint": "it may be cut short: copy or export it again",
            }
        if not groups:
            gc.collect()  # finalizers of unfinished readers run here, where they print nothing
            return MeasurementError(f"the {recording.name} file {problem}", file=file, **details)
    titles = [part.sheet or ("top level" if len(groups) > 1 else "") for part in groups]
    counts = [titles[: index + 1].count(title) for index, title in enumerate(titles)]
    titles = [f"{title} ({count})" if count > 1 else title for title, count in zip(titles, counts, strict=True)]
    return tuple(replace(part, sheet=title) for part, title in zip(groups, titles, strict=True))


@contextmanager
def _silenced() -> Iterator[None]:
    """Context in which libraries and their finalizers neither warn, log nor print."""
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
    """Channels of a group with one length and one base, which is the first channel unless another has its role.

    Channels without a base belong to all bases of their length.
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
        _refuse_complex(table)
        several = sum(np.iscomplexobj(one.values) and bool(np.any(one.values.imag)) for one in table) > 1
        if over and over.name not in _BASES.roles([one.name for one in table]):
            table.insert(0, over)
        if columns := [column for channel in table for column in _real_channels(channel, several)]:
            names, arrays, unit_texts, _ = zip(*columns, strict=True)
            title = f"{name}, {len(arrays[0])} rows".strip(", ") if len(tables) > 1 else name
            header = [f"{text} [{unit}]" if unit else text for text, unit in zip(names, unit_texts, strict=True)]
            above = [Line(number, content) for number, content in enumerate([*labels, header], start=-len(labels))]
            layout = Layout("", names, 0, unit_texts, None, numbered=True)
            numeric = frozenset(index for index, values in enumerate(arrays) if values.dtype == float)
            yield Channels(title, (), layout=layout, numeric=numeric, arrays=arrays, above=above, format=recording.name)


def _refuse_complex(channels: Sequence[Channel]) -> None:
    """Refuse complex values that have no meaning: a time, a frequency, an amplitude, or anything recorded over time.

    Raises:
        MeasurementError: there is such a channel.
    """
    roles = {channel.name: heading.role for channel in channels if (heading := _REAL.heading(channel.name))}
    for channel in channels:
        is_real = channel.name in roles or "time" in roles.values()
        if is_real and np.iscomplexobj(channel.values) and np.any(channel.values.imag):
            raise MeasurementError(
                f'the channel "{channel.name}" holds complex numbers',
                found=f"{channel.values[np.argmax(channel.values.imag != 0.0)]:.6g} among them",
                expected="real numbers",
                hint="export its real part, or leave the channel out",
            )


def _real_channels(channel: Channel, several: bool) -> Iterator[Channel]:
    """Channel as floats or texts, with dates in seconds; a complex one as magnitude and phase, named if `several`."""
    values = channel.values
    if values.dtype.kind == "c" and not np.any(values.imag):
        values = values.real
        channel = channel._replace(values=values)
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
