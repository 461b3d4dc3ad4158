"""Recordings of MATLAB, TDMS, MDF, LabVIEW, Parquet and Arrow, as groups of channels.

Each reader takes the bytes of a file and its path, imports its library when it is called, and yields groups. The unit
of a channel is "" if the file does not state it.
"""

import io
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise, takewhile
from pathlib import Path
from typing import Any

import numpy as np

from bushfit import units
from bushfit.reading.files import to_utf8
from bushfit.reading.source import Channel, Group

#: Largest number of values in a file; chosen: ten million rows of twenty channels and more, 2 GiB.
_MOST_VALUES = 1 << 28
#: Largest number of header lines of a LabVIEW measurement file; chosen: files have some twenty.
_LVM_HEAD = 40
_LVM_END = "***End_of_Header***"


def matlab(data: bytes, _: Path) -> Iterator[Group]:
    """Read the vectors and matrices of a MATLAB file as channels.

    Yields:
        A group for the variables of the file, and one for each struct.
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
    """Convert a variable of a MATLAB 7.3 file (HDF5) to the form that scipy returns for older files.

    Returns:
        A dict for a struct, a list of dicts for an array of structs, a text, or an array; None for an empty array or
        an object of a class, such as a table.
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
    _refuse_too_many(node.size)
    values = node[()]
    if "MATLAB_object_decode" in node.attrs or "MATLAB_empty" in node.attrs:
        return None
    if node.attrs.get("MATLAB_class") == b"char":
        return "".join(map(chr, values.T.ravel()))
    if values.dtype == object:
        return [_from_hdf5(node.file[reference]) for reference in values.ravel()]
    return np.squeeze((values["real"] + 1j * values["imag"] if values.dtype.names else values).T)


def _refuse_too_many(values: int) -> None:
    """Raise a ValueError if a compressed file would unpack to more values than any recording has."""
    if values > _MOST_VALUES:
        raise ValueError(f"the file unpacks to {values} values, of which at most {_MOST_VALUES} are read")


def _in_struct(path: str, content: Mapping[str, Any]) -> Iterator[Group]:
    """Yield the vectors and matrix columns of a struct as a group of channels, then the groups of structs inside it.

    Args:
        path: name of the struct, which names the group.
        content: variables of the struct by name.
    """
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
    """Read the channels of a TDMS file; the x axis of a waveform is time, unless the file states another unit.

    Yields:
        Each group of the file.
    """
    from nptdms import TdmsFile

    file = TdmsFile.read(io.BytesIO(data))
    if file.file_status.incomplete_final_segment:
        raise ValueError("the last segment of the file is not complete")
    for group in file.groups():
        channels = []
        for channel in group.channels():
            properties, values, over = channel.properties, channel[:], None
            if step := properties.get("wf_increment"):
                unit = properties.get("wf_xunit_string") or "s"
                bases = {"Hz": "frequency", "s": "time"}
                name = next((name for si, name in bases.items() if units.is_compatible(unit, si)), "x")
                over = Channel(name, properties.get("wf_start_offset", 0.0) + step * np.arange(len(values)), unit)
            unit = properties.get("unit_string") or properties.get("NI_UnitDescription", "")
            channels.append(Channel(channel.name, values, unit, over))
        yield group.name, channels, [*file.properties.items(), *group.properties.items()]


def mdf(data: bytes, _: Path) -> Iterator[Group]:
    """Read the channels of an MDF file; the base of each channel is the master channel of its group, such as time.

    Yields:
        Each group of the file.
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
        One group with all columns.
    """
    import pyarrow as pa

    if data.startswith(b"PAR1"):
        from pyarrow.parquet import ParquetFile

        file = ParquetFile(pa.BufferReader(data))
        _refuse_too_many(file.metadata.num_rows * file.metadata.num_columns)
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


def labview(data: bytes, file: Path) -> Iterator[Group]:
    """Read the channels of a LabVIEW measurement file, with their time or other x axis as base.

    Yields:
        A group for each segment.
    """
    lines = to_utf8(data, file)[0].decode().splitlines()
    head = dict(line.split(None, 1) for line in lines[:_LVM_HEAD] if len(line.split(None, 1)) == 2)
    mark = "," if head.get("Separator", "Tab").strip() == "Comma" else "\t"
    point = head.get("Decimal_Separator", ".").strip()
    ends = [number for number, line in enumerate(lines) if line.startswith(_LVM_END)]
    for segment, (start, end) in enumerate(pairwise([*ends, len(lines) + _LVM_HEAD]), start=1):
        names, *rows = [line.split(mark) for line in lines[start + 1 : end] if line.strip()] or [[""]]
        if "X_Value" not in names:
            continue  # the header of the file, not of a segment
        above = {cells[0]: cells[1:] for line in lines[:start] if (cells := line.split(mark))}
        rows = list(takewhile(lambda cells: cells[0] != "Channels", rows))
        numbers = [[float(cell.replace(point, ".") or "nan") for cell in row[: len(names)]] for row in rows if row]
        width = min(len(row) for row in numbers)
        columns, channels, over = np.array([row[:width] for row in numbers]).T, [], None
        step, first = (float(above[key][0].replace(point, ".")) for key in ("Delta_X", "X0"))
        counted = first + step * np.arange(len(numbers))
        units_of, dimension = iter(above.get("Y_Unit_Label", ())), above.get("X_Dimension", ["Time"])[0]
        for name, values in zip(names, columns, strict=False):
            if name == "X_Value":
                is_time = dimension.strip() in ("Time", "")
                over = Channel(
                    "time" if is_time else dimension,
                    counted if np.isnan(values).all() else values,
                    "s" if is_time else "",
                )
            elif name != "Comment":
                channels.append(Channel(name, values, next(units_of, "").strip(), over))
        yield f"segment {segment}" if len(ends) > 2 else "", channels, ()
