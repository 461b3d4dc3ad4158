"""Universal files (UFF): functions of dataset 58, or data at nodes of dataset 55, as groups of channels."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bushfit.reading.source import Channel, Group

#: Quantities by their number in UFF: name, SI unit, and key of the factor in dataset 164 that converts to SI.
_QUANTITIES = {
    **{8: ("displacement", "m", "length"), 9: ("force", "N", "force"), 13: ("force", "N", "force")},
    **{17: ("time", "s", ""), 18: ("frequency", "Hz", "")},
}
#: Line that ends a dataset.
_MARK = b"    -1"
#: ID line 5 of data at nodes: reference, its direction, numerator, denominator.
_CODES = re.compile(r"(\s*-?\d+){4}\s*")
#: Smallest number of a direction in which a displacement is a rotation and a force is a moment.
_ROTATIONS = 4


def read_uff(data: bytes, file: Path) -> Iterator[Group]:
    """Read the functions of a universal file (dataset 58) or, if it has none, its data at nodes (dataset 55).

    Yields:
        A group for each complex function, such as a frequency response, and one for all real functions, such as
        records over time.
    """
    import pyuff

    if not data.rstrip().endswith(_MARK):
        raise ValueError("the last dataset of the file has no end")
    book = pyuff.UFF(str(file))
    kinds = list(book.get_set_types())
    read_kind = 58 if 58 in kinds else 55
    sets = [book.read_sets(number) for number, kind in enumerate(kinds) if kind in (read_kind, 164)]
    factors: Mapping[str, Any] = next((one for one in sets if one["type"] == 164), {})
    functions = [one for one in sets if one["type"] == 58] or [*_at_nodes(one for one in sets if one["type"] == 55)]
    quantities = Counter(one["ordinate_spec_data_type"] for one in functions)
    records: list[Channel] = []
    for number, one in enumerate(functions, start=1):
        title = _text(one, "id1") or f"function {number}"
        over = _axis(one, "abscissa", one["x"], 0, factors)
        upper = _axis(one, "ordinate", one["data"], one["rsp_dir"], factors)
        name, values, unit, _ = upper._replace(name=upper.name or _text(one, "ordinate_axis_lab") or title)
        if not np.iscomplexobj(values):
            several = upper.name and quantities[one["ordinate_spec_data_type"]] > 1
            records.append(Channel(f"{name} ({title}: {one['rsp_node']})" if several else name, values, unit, over))
            continue
        lower = _axis(one, "orddenom", np.ones(1), one["ref_dir"], factors)
        if lower.name:
            is_stiffness = (name, lower.name) == ("force", "displacement")
            name = "dynamic stiffness" if is_stiffness else f"{name} over {lower.name}"
        if "/" not in unit or _text(one, "orddenom_axis_units_lab"):  # else the unit is that of the ratio
            values, unit = values / lower.values, f"{unit}/{lower.unit}" if unit and lower.unit else ""
        yield title, [Channel(name, values, unit, over)], [(one[f"id{line}"],) for line in range(1, 6)]
    yield "", records, ()


def _at_nodes(steps: Iterable[Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    """Convert frequency responses at nodes, one dataset 55 per frequency, to functions as in dataset 58.

    ID line 5 contains reference node, its direction, and quantity of numerator and denominator, as in I-DEAS Test.
    """
    runs: dict[tuple[Any, ...], list[Mapping[str, Any]]] = {}
    for one in steps:
        if one["analysis_type"] == 5 and np.iscomplexobj(one["r1"]):
            codes = [int(word) for word in one["id5"].split()] if _CODES.fullmatch(one["id5"]) else [0, 0, 0, 0]
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


def _text(function: Mapping[str, Any], key: str) -> str:
    """Text of a field of a universal-file function; "" if the file has NONE."""
    text = " ".join(str(function[key]).split())
    return "" if text == "NONE" else text


def _axis(
    function: Mapping[str, Any], axis: str, values: NDArray[Any], direction: int, factors: Mapping[str, Any]
) -> Channel:
    """Values of an axis of a function as a channel, in the unit of its label or in SI by the factors of dataset 164.

    Args:
        function: function of the universal file (dataset 58).
        axis: prefix of the keys of the axis.
        values: values along the axis, (n,).
        direction: number of the degree of freedom; without a label, the channel of a rotation has no unit.
        factors: factors from SI by kind of unit, from dataset 164; empty without one.
    """
    name, si, factor = _QUANTITIES.get(function[f"{axis}_spec_data_type"], ("", "", ""))
    if label := _text(function, f"{axis}_axis_units_lab"):
        return Channel(name, values, label)
    if abs(direction) >= _ROTATIONS or (factor and not factors):
        return Channel(name, values)
    return Channel(name, values / factors.get(factor, 1.0), si)
