"""LabVIEW measurement files (.lvm)."""

from collections.abc import Iterator
from itertools import pairwise, takewhile
from pathlib import Path

import numpy as np

from bushfit.reading.files import to_utf8
from bushfit.reading.source import Channel, Group

#: Lines of the header of a LabVIEW measurement file; chosen: it has some twenty.
_LVM_HEAD = 40
_LVM_END = "***End_of_Header***"


def labview(data: bytes, file: Path) -> Iterator[Group]:
    """Read the channels of a LabVIEW measurement file (.lvm) over their time.

    Args:
        data: bytes of the file.
        file: path, for errors.

    Yields:
        A group of channels for each segment.
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
