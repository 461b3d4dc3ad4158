"""Recordings of instruments and programs (MATLAB, TDMS, UFF, MDF, Parquet and Arrow), as groups of channels.

Their content tells them. Each reader is loaded, with its library, when a file needs it. None makes up a unit: it is ""
where a file states none.
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

#: Values of a file that are read at most; chosen: ten million rows of twenty channels and more, 2 GiB.
_MOST_VALUES = 1 << 28
#: Quantities of UFF by their number, with the SI unit, and the factor of dataset 164 to divide values by.
_UFF_QUANTITIES = {
    **{8: ("displacement", "m", "length"), 9: ("force", "N", "force"), 13: ("force", "N", "force")},
    **{17: ("time", "s", ""), 18: ("frequency", "Hz", "")},
}
#: What begins and ends a dataset of UFF.
_UFF_MARK = b"    -1"
#: ID line 5 of data at nodes: reference, its direction, numerator, denominator.
_UFF_CODES = re.compile(r"(\s*-?\d+){4}\s*")
#: The direction of UFF from which on a displacement is a rotation, and a force a moment.
_UFF_ROTATIONS = 4
#: The names that a base of recording goes by.
_BASES = Vocabulary({"time": LOOP_COLUMNS["time"], "frequency": SWEEP_COLUMNS["frequency"]}, {})
#: Channels that have no complex values.
_REAL = Vocabulary(
    {"time": LOOP_COLUMNS["time"], **{role: SWEEP_COLUMNS[role] for role in ("frequency", "amplitude")}}, {}
)
#: What may be done about files without channels.
_HINT = "export it again, with its channels"
_MATLAB_HINT = 'save vectors, or structs of them, with -v7; a table by way of table2struct(T, "ToScalar", true)'
_UFF_HINT = "export records or frequency responses as dataset 58; of data at nodes (55) only the latter are read"


def matlab(data: bytes, _: Path) -> Iterator[Group]:
    """The vectors of a MATLAB file, and of each struct in it."""
    if data.startswith(b"MATLAB 7.3"):
        import h5py

        with h5py.File(io.BytesIO(data)) as content:
            yield from _in_struct("", _from_hdf5(content))
    else:
        from scipy.io import loadmat

        stream: Any = io.BytesIO(data)
        yield from _in_struct("", loadmat(stream, simplify_cells=True))


def _from_hdf5(node: Any) -> Any:
    """A variable of MATLAB in HDF5 as scipy gives it: a dict, a list of them, a text, or an array with its axes turned.

    None where it is an object of a class, such as a table.
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
    """Refuse a file that unpacks to more values than a recording has: some kilobytes may hold terabytes of them."""
    if values > _MOST_VALUES:
        raise ValueError(f"it unpacks to {values} values, of which at most {_MOST_VALUES} are read")


def _in_struct(path: str, content: Mapping[str, Any]) -> Iterator[Group]:
    """The vectors and the columns of matrices in a struct, and those of the structs in it."""
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
    """The channels of each group of a TDMS file; a waveform is recorded over time, unless it states another unit."""
    from nptdms import TdmsFile

    file = TdmsFile.read(io.BytesIO(data))
    if file.file_status.incomplete_final_segment:
        raise ValueError("its last segment is not complete")
    for group in file.groups():
        channels = []
        for channel in group.channels():
            said, values, over = channel.properties, channel[:], None
            if step := said.get("wf_increment"):
                unit = said.get("wf_xunit_string") or "s"
                name = (
                    "frequency"
                    if units.is_compatible(unit, "Hz")
                    else "time"
                    if units.is_compatible(unit, "s")
                    else "x"
                )
                over = Channel(name, said.get("wf_start_offset", 0.0) + step * np.arange(len(values)), unit)
            channels.append(Channel(channel.name, values, said.get("unit_string", ""), over))
        yield group.name, channels, [*file.properties.items(), *group.properties.items()]


def mdf(data: bytes, _: Path) -> Iterator[Group]:
    """The channels of each group of an MDF file, over its master channel."""
    from asammdf import MDF

    with MDF(io.BytesIO(data)) as file:
        groups: Sequence[Any] = file.groups
        for index, group in enumerate(groups):
            master, said = file.masters_db.get(index), group.channel_group
            over = None if master is None else group.channels[master]
            is_time = getattr(over, "sync_type", 1) == 1  # older files have no other
            name, unit = ("time", "s") if over is None or is_time else (over.name, over.unit)
            signals = file.select([(None, index, number) for number in range(len(group.channels)) if number != master])
            bases = [over and Channel(name, one.timestamps, unit) for one in signals]
            channels = [Channel(one.name, one.samples, one.unit, own) for one, own in zip(signals, bases, strict=True)]
            yield getattr(said, "acq_name", "") or said.comment or f"group {index + 1}", channels, ()


def arrow(data: bytes, _: Path) -> Iterator[Group]:
    """The columns of a Parquet or Arrow file, with the units that metadata of its fields state."""
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
        said = field.metadata or {}
        unit = (said.get(b"unit") or said.get(b"units") or b"").decode()
        column = frame.iloc[:, index]
        plain = column.dt.tz_localize(None) if getattr(column.dtype, "tz", None) else column
        channels.append(Channel(field.name, plain.to_numpy(), unit))
    yield "", channels, ()


def uff(data: bytes, file: Path) -> Iterator[Group]:
    """The records of a UFF file together, and each of its complex functions of a frequency by itself.

    Data at nodes (dataset 55) are taken where the file holds no functions (dataset 58).
    """
    import pyuff

    if not data.rstrip().endswith(_UFF_MARK):
        raise ValueError("its last dataset has no end")
    book = pyuff.UFF(str(file))
    kinds = list(book.get_set_types())
    kept = 58 if 58 in kinds else 55
    sets = [book.read_sets(number) for number, kind in enumerate(kinds) if kind in (kept, 164)]
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
    """Frequency responses at nodes, of which each dataset 55 holds one frequency, as functions of dataset 58.

    ID line 5 says what a value is over what, as of I-DEAS Test: reference, its direction, numerator, denominator.
    """
    runs: dict[tuple[Any, ...], list[Mapping[str, Any]]] = {}
    for one in steps:
        if one["analysis_type"] == 5 and np.iscomplexobj(one["r1"]):
            said = [int(word) for word in one["id5"].split()] if _UFF_CODES.fullmatch(one["id5"]) else [0, 0, 0, 0]
            runs.setdefault((one["load_case"], one["id1"], *said), []).append(one)
    labels = dict.fromkeys((f"{axis}_axis_units_lab" for axis in ("abscissa", "ordinate", "orddenom")), "NONE")
    for (_, title, _, direction, upper, lower), run in runs.items():
        of_all = {"abscissa_spec_data_type": 18, "ordinate_spec_data_type": upper, "orddenom_spec_data_type": lower}
        of_all |= labels | {"x": np.array([one["freq"] for one in run]), "ref_dir": direction}
        for node, (axis, name) in product(run[0]["node_nums"], enumerate("XYZ", start=1)):
            values = [dict(zip(one["node_nums"], one[f"r{axis}"], strict=True)).get(node, 0.0) for one in run]
            if any(values):
                own = {"id1": f"{title}, node {node} {name}", "rsp_node": node, "rsp_dir": axis}
                yield {**run[0], **of_all, **own, "data": np.array(values), "ordinate_axis_lab": "NONE"}


def _uff_text(function: Mapping[str, Any], key: str) -> str:
    """A text of a UFF function; "" where it says nothing."""
    text = " ".join(str(function[key]).split())
    return "" if text == "NONE" else text


def _uff_axis(
    function: Mapping[str, Any], axis: str, values: NDArray[Any], direction: int, factors: Mapping[str, Any]
) -> Channel:
    """An axis of a UFF function with the name of its quantity, in the unit of its label or of dataset 164."""
    name, si, factor = _UFF_QUANTITIES.get(function[f"{axis}_spec_data_type"], ("", "", ""))
    if label := _uff_text(function, f"{axis}_axis_units_lab"):
        return Channel(name, values, label)
    if abs(direction) >= _UFF_ROTATIONS or (factor and not factors):
        return Channel(name, values)
    return Channel(name, values / factors.get(factor, 1.0), si)


class Format(NamedTuple):
    """A format of recordings: its name, endings and pattern of the start of files, what reads them, and a hint."""

    name: str
    endings: tuple[str, ...]
    sign: bytes
    read: Callable[[bytes, Path], Iterator[Group]]
    hint: str


#: The formats of recordings.
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
    """What a part of a file is called that may hold a table: the group of a recording, the sheet of a workbook."""
    return "group" if file.suffix.lower() in RECORDINGS else "sheet"


def format_of(data: bytes, file: Path) -> Format | None:
    """The format of a recording by its first bytes; None where it is a text or a workbook.

    Raises:
        MeasurementError: the ending of the file is that of a recording, and its content is not.
    """
    own = next((one for one in _FORMATS if re.match(one.sign, data)), None)
    said = next((one for one in _FORMATS if file.suffix.lower() in one.endings), None)
    if said and not own and said.read is not labview:  # LabVIEW also writes plain tables under this ending
        raise MeasurementError(
            f"this is no {said.name} file",
            file=file,
            found="the first bytes of another file",
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
        except MeasurementError as error:
            error.file = file
            return error
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
        _refuse_complex(table)
        several = sum(np.iscomplexobj(one.values) and bool(np.any(one.values.imag)) for one in table) > 1
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


def _plain(channel: Channel, several: bool) -> Iterator[Channel]:
    """A channel as floats or texts: a complex one as magnitude and phase, named if `several` are, times in seconds."""
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
