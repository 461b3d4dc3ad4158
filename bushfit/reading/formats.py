"""Recordings of MATLAB, HDF5, JSON, TDMS, MDF, Parquet and Arrow, as groups of channels.

Each reader takes the bytes of a file and its path, imports its library when it is called, and yields groups. The unit
of a channel is "" if the file does not state it.
"""

import io
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bushfit import units
from bushfit.reading.source import Channel, Group

#: Largest number of values in a file; chosen: ten million rows of twenty channels and more, 2 GiB.
_MOST_VALUES = 1 << 28


def read_matlab(data: bytes, _: Path) -> Iterator[Group]:
    """Read the vectors and matrices of a MATLAB or HDF5 file as channels.

    Yields:
        Title, channels and properties (name, value) of the variables of the file, then of each struct.
    """
    if data.startswith((b"MATLAB 7.3", b"\x89HDF")):
        import h5py

        with h5py.File(io.BytesIO(data)) as content:
            yield from _in_struct("", _from_hdf5(content))
    else:
        from scipy.io import loadmat

        stream: Any = io.BytesIO(data)
        yield from _in_struct("", loadmat(stream, simplify_cells=True))


def _from_hdf5(node: Any) -> Any:
    """Convert a variable of an HDF5 file, such as MATLAB 7.3 writes, to the form that scipy returns for older files.

    Returns:
        A dict for a struct or for an array with a unit, a list of dicts for an array of structs, a text, or an array;
        None for an empty array or an object of a class, such as a table.
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
    array = np.squeeze((values["real"] + 1j * values["imag"] if values.dtype.names else values).T)
    unit = node.attrs.get("unit", node.attrs.get("units"))
    return array if unit is None else {"Data": array, "Name": node.name.rpartition("/")[2], "Unit": unit}


def read_json(data: bytes, _: Path) -> Iterator[Group]:
    """Read the objects of a JSON file, or of a text with one object on each line, as channels.

    An object may have a list for each channel; a list of objects has a row for each object. An object "units" states
    the units of channels by their names.

    Yields:
        Title, channels and properties (name, value) of the file, then of each object.
    """
    text = data.decode("utf-8-sig")
    try:
        content = json.loads(text)
    except json.JSONDecodeError:
        content = [json.loads(line) for line in text.splitlines() if line.strip(" ,")]
    yield from _in_struct("", _from_json({"": content}))


def _from_json(node: Any) -> Any:
    """Convert a value of a JSON file to the form that scipy returns for MATLAB: dicts, lists of dicts, and arrays."""
    if isinstance(node, dict):
        fields = {name: _from_json(value) for name, value in node.items()}
        return {name: _as_channel(name, value) if isinstance(value, dict) else value for name, value in fields.items()}
    if not isinstance(node, list) or not all(isinstance(one, dict) for one in node):
        return np.array(node) if isinstance(node, list) else node
    if any(isinstance(value, list) for one in node for value in one.values()):
        return [_from_json(one) for one in node]
    rows = list(map(_flat, node))
    names = dict.fromkeys(name for one in rows for name in one)  # a row for each object
    return {name: np.array([one.get(name, np.nan) for one in rows]) for name in names}


def _as_channel(name: str, fields: dict[str, Any]) -> dict[str, Any]:
    """Form of a channel that an object with a unit and one list stands for; other objects are unchanged."""
    arrays = [value for value in fields.values() if isinstance(value, np.ndarray)]
    is_channel = len(arrays) == 1 and "unit" in fields
    return {"Data": arrays[0], "Name": name, "Unit": fields["unit"]} if is_channel else fields


def _flat(row: dict[str, Any]) -> dict[str, Any]:
    """Object of a row whose values are no objects: {"K": {"value": 600, "unit": "N/mm"}} becomes {"K [N/mm]": 600}."""
    flat = dict[str, Any]()
    for name, value in row.items():
        if isinstance(value, dict) and {*value} == {"value", "unit"}:
            flat[f"{name} [{value['unit']}]"] = value["value"]
        else:
            flat |= _flat(value) if isinstance(value, dict) else {name: value}
    return flat


def _refuse_too_many(values: int) -> None:
    """Raise a ValueError if a compressed file would unpack to more values than any recording has."""
    if values > _MOST_VALUES:
        raise ValueError(f"the file unpacks to {values} values, of which at most {_MOST_VALUES} are read")


def _in_struct(
    path: str, content: Mapping[str, Any], unit_of: Mapping[str, str] = MappingProxyType({})
) -> Iterator[Group]:
    """Yield the vectors and matrix columns of a struct as a group of channels, then the groups of structs inside it.

    Scalars and texts of the struct are its properties. Cells with as many texts as a matrix has columns name the
    columns. If a vector has a value for each column of the matrices, such as an amplitude, each column is a group.

    Args:
        path: name of the struct, which names the group.
        content: variables of the struct by name.
        unit_of: units of channels, by name, that a struct "units" around it states.
    """
    unit_of = content["units"] if isinstance(content.get("units"), Mapping) else unit_of
    fields = {name: value for name, value in content.items() if not name.startswith("__")}
    for name in [f"{name.removesuffix('_Data')}_Header" for name in fields if name.endswith("_Data")]:
        if isinstance(header := fields.pop(name, None), Mapping):  # of a channel, as catman writes it
            fields[name] = {**header, "Data": fields.pop(name.replace("_Header", "_Data"))}
    arrays = {name: value for name, value in fields.items() if isinstance(value, np.ndarray)}
    texts = [value for value in arrays.values() if value.dtype.kind in "UO" and value.ndim > 0]
    names_by_width = {rows.shape[-1]: _column_names(np.atleast_2d(rows)) for rows in texts}
    matrices = {name: value for name, value in arrays.items() if value.ndim == 2 and value.dtype.kind not in "UO"}
    shapes = {value.shape for value in matrices.values()}
    rows, columns = shapes.pop() if len(shapes) == 1 else (0, 0)
    of_rows = {
        n: one for n, one in arrays.items() if one.ndim == 1 and (one.dtype.kind not in "UO" or one.size != columns)
    }
    channels = [Channel(*one, str(unit_of.get(one[0], ""))) for one in of_rows.items()]
    levels = [one for one in channels if one.values.dtype.kind in "fiu" and len(one.values) == columns != rows]
    labels = [(name, str(value)) for name, value in fields.items() if isinstance(value, str | float | np.number | int)]
    inner = dict[str, Mapping[str, Any]]()
    for name, value in fields.items():
        place = f"{path}.{name}" if path else name
        structs = [one for one in (value if isinstance(value, list) else [value]) if isinstance(one, Mapping)]
        named = [(one, label) for one in structs if "Data" in one and (label := one.get("Name", one.get("SignalName")))]
        numbers = {key: [one.get(key) for one in structs] for key in structs[0]} if len(structs) > 1 else {}
        numbers = {key: column for key, column in numbers.items() if all(isinstance(x, float | int) for x in column)}
        if isinstance(value, Mapping) and {"x_values", "y_values"} <= value.keys():
            channels.append(_waveform(name, value))
        elif named:
            channels += [Channel(str(label), np.asarray(one["Data"]), str(one.get("Unit", ""))) for one, label in named]
        elif isinstance(value, Mapping):
            inner[place] = value
        elif structs and len(numbers) == len(structs[0]):  # a struct for each row
            inner[place] = {key: np.array(column, dtype=float) for key, column in numbers.items()}
        else:
            inner |= {f"{place}({n})": one for n, one in enumerate(structs, start=1)}
    if len(levels) == 1:
        remaining = [one for one in channels if one is not levels[0]]
        for n, level in enumerate(levels[0].values):
            of_level = [Channel(name, value[:, n]) for name, value in matrices.items()]
            title = f"{path} {levels[0].name} = {level:g}".strip()
            yield title, remaining + of_level, [*labels, (levels[0].name, f"{level:g}")]
    else:
        for name, value in matrices.items():
            usual = [f"{name}(:,{n})" for n in range(1, value.shape[1] + 1)]
            names = names_by_width.get(value.shape[1], usual)
            channels += [Channel(*column) for column in zip(names, value.T, strict=True)]
        yield path, channels, labels
    for place, struct in inner.items():
        yield from _in_struct(place, struct, unit_of)


def _column_names(rows: NDArray[Any]) -> list[str]:
    """Names of columns from the last row of texts, (rows, columns), or the last two if the last one has units alone."""
    last = [str(cell) for cell in rows[-1]]
    if len(rows) < 2 or not all(map(units.is_unit, last)):
        return last
    return [f"{name} [{unit}]" for name, unit in zip(rows[-2], last, strict=True)]


def _waveform(name: str, content: Mapping[str, Any]) -> Channel:
    """Convert a function of Simcenter Testlab to a channel with its x axis as base.

    Args:
        name: name of its struct, used if the function has no name.
        content: fields of its struct: x_values and y_values, with their quantities, and function_record.
    """
    x, y = content["x_values"], content["y_values"]
    unit, x_unit = (str(axis.get("quantity", {}).get("label", "")) for axis in (y, x))
    values = np.asarray(y["values"])
    over = _even_base(x.get("start_value", 0.0), x.get("increment", 1.0), len(values), x_unit)
    return Channel(str(content.get("function_record", {}).get("name", "") or name), values, unit, over)


def _even_base(start: float, step: float, count: int, unit: str) -> Channel:
    """Base channel with `count` even steps from `start`, both in `unit`: a time, a frequency, or another axis, "x"."""
    bases = {"Hz": "frequency", "s": "time"}
    name = next((name for si, name in bases.items() if units.is_compatible(unit, si)), "x")
    return Channel(name, start + step * np.arange(count), unit)


def read_tdms(data: bytes, _: Path) -> Iterator[Group]:
    """Read the channels of a TDMS file; the x axis of a waveform is time, unless the file states another unit.

    Yields:
        Title, channels and properties (name, value) of each group of the file.
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
                over = _even_base(properties.get("wf_start_offset", 0.0), step, len(values), unit)
            unit = properties.get("unit_string") or properties.get("NI_UnitDescription", "")
            channels.append(Channel(channel.name, values, unit, over))
        yield group.name, channels, [*file.properties.items(), *group.properties.items()]


def read_mdf(data: bytes, _: Path) -> Iterator[Group]:
    """Read the channels of an MDF file; the base of each channel is the master channel of its group, such as time.

    Yields:
        Title and channels of each group of the file, without properties.
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


def read_arrow(data: bytes, _: Path) -> Iterator[Group]:
    """Read the columns of a Parquet or Arrow file, with units from the metadata of its fields.

    Yields:
        One group without title and properties, with all columns as channels.
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
