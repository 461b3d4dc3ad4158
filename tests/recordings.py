"""Tests as instruments record them, made by the libraries of their formats from tables as rigs write them."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.feather
import pyarrow.parquet
import pyuff
from asammdf import MDF, Signal
from nptdms import ChannelObject, RootObject, TdmsWriter
from scipy.io import savemat

#: Numbers of UFF for quantities by their names.
UFF = {"time": 17, "frequency": 18, "displacement": 8, "force": 9}


def channels(table: pd.DataFrame) -> Iterator[tuple[str, str, Any]]:
    """Name, unit and values of each column under a header such as "force [N]"."""
    for header, column in table.items():
        name, _, unit = str(header).rstrip("]").partition(" [")
        yield name, unit, column.to_numpy(dtype=float)


def symbols(table: pd.DataFrame) -> dict[str, Any]:
    """Values by names that MATLAB takes, with their units: force_N, stiffness_N_mm."""
    return {
        f"{name.replace(' ', '_')}_{unit.replace('/', '_per_')}".rstrip("_-"): values
        for name, unit, values in channels(table)
    }


def mat(table: pd.DataFrame, file: Path) -> None:
    savemat(file, {"run1": symbols(table), "operator": "AB"}, oned_as="column")


def mat73(table: pd.DataFrame, file: Path) -> None:
    """As MATLAB writes -v7.3: HDF5 behind 512 bytes that tell so, matrices with their axes turned."""
    with h5py.File(file, "w", userblock_size=512) as book:
        for name, values in symbols(table).items():
            book.create_dataset(f"run1/{name}", data=values[None, :]).attrs["MATLAB_class"] = np.bytes_("double")
        text = book.create_dataset("operator", data=np.array([[ord("A")], [ord("B")]], dtype="u2"))
        text.attrs["MATLAB_class"] = np.bytes_("char")
    with file.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def tdms(table: pd.DataFrame, file: Path, said_of_all: dict[str, str] | None = None) -> None:
    """A loop as waveforms, without a channel for the time; a sweep as plain channels."""
    columns = list(channels(table))
    said: dict[str, Any] = {}
    if columns[0][0] == "time":
        said = {"wf_increment": float(columns[0][2][1]), "wf_start_offset": 0.0}
        columns = columns[1:]
    with TdmsWriter(file) as writer:
        writer.write_segment(
            [RootObject(said_of_all)]
            + [ChannelObject("Run 1", name, values, {"unit_string": unit, **said}) for name, unit, values in columns]
        )


def mf4(table: pd.DataFrame, file: Path) -> None:
    columns = list(channels(table))
    base = columns.pop(0)[2] if columns[0][0] == "time" else np.arange(len(table)) / 10.0
    with MDF(version="4.10") as book:
        book.append([Signal(values, base, unit=unit, name=name) for name, unit, values in columns], acq_name="Run 1")
        book.save(file, overwrite=True)


def uff(table: pd.DataFrame, file: Path, **said: Any) -> None:
    """Records over time, each a dataset 58 with the unit in its label."""
    (_, unit, time), *others = channels(table)
    sets = [function(values, time, ("time", unit), (name, own), **said) for name, own, values in others]
    pyuff.UFF(str(file)).write_sets(sets, mode="overwrite")


def function(
    values: Any,
    over: Any,
    base: tuple[str, str],
    upper: tuple[str, str],
    lower: tuple[str, str] = ("", "NONE"),
    **said: Any,
) -> dict[str, Any]:
    """A dataset 58 of values over a base, evenly spaced or not, whose quantities have these names and units."""
    made = pyuff.prepare_58(
        func_type=4 if np.iscomplexobj(values) else 1,
        data=values,
        x=over,
        num_pts=len(over),
        ord_data_type=6 if np.iscomplexobj(values) else 4,
        abscissa_spacing=int(np.iscomplexobj(values) is False),
        abscissa_min=float(over[0]),
        abscissa_inc=float(over[1] - over[0]),
        abscissa_spec_data_type=UFF[base[0]],
        abscissa_axis_units_lab=base[1],
        ordinate_spec_data_type=UFF[upper[0]],
        ordinate_axis_units_lab=upper[1],
        orddenom_spec_data_type=UFF.get(lower[0], 0),
        orddenom_axis_units_lab=lower[1],
        rsp_dir=3,
        ref_dir=3,
        rsp_node=1,
        ref_node=2,
        rsp_ent_name="TOP",
        ref_ent_name="BASE",
    )
    return made | said


def at_nodes(response: Any, frequency: Any, title: str, upper: str, lower: str) -> Iterator[dict[str, Any]]:
    """Datasets 55 of a ratio along z at node 7, one of each frequency, as I-DEAS Test names it in ID line 5."""
    codes = "".join(f"{code:10}" for code in (2, 3, UFF[upper], UFF[lower]))
    said = {"type": 55, "analysis_type": 5, "data_ch": 2, "spec_data_type": UFF[upper], "load_case": 1}
    for number, (value, at) in enumerate(zip(response, frequency, strict=True), start=1):
        values = {"node_nums": [7], "r1": np.zeros(1, complex), "r2": np.zeros(1, complex), "r3": np.array([value])}
        yield {**said, **values, "freq_step_n": number, "freq": at, "id1": title, "id5": codes}


def parquet(table: pd.DataFrame, file: Path) -> None:
    pa.parquet.write_table(arrow(table), file)


def feather(table: pd.DataFrame, file: Path) -> None:
    pa.feather.write_feather(arrow(table), file)


def arrow(table: pd.DataFrame) -> pa.Table:
    """Units as metadata of the fields."""
    fields = [(pa.field(name, pa.float64(), metadata={"unit": unit}), values) for name, unit, values in channels(table)]
    return pa.table([values for _, values in fields], schema=pa.schema([field for field, _ in fields]))


#: What writes a table as a file of each ending; of UFF only loops.
WRITERS: dict[str, Callable[[pd.DataFrame, Path], None]] = {
    "mat": mat, "v73.mat": mat73, "tdms": tdms, "mf4": mf4, "uff": uff, "parquet": parquet, "feather": feather,
}  # fmt: skip
