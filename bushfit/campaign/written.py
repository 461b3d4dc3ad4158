"""Tables of a campaign file as text: what was tested, and its tests."""

from __future__ import annotations

import json
from collections.abc import Iterable

from bushfit.geometry import Bushing, Place, Specimen


def body_lines(bushing: Bushing | None, specimens: Iterable[Specimen]) -> list[str]:
    """The lines of [bushing] and [[specimens]]."""
    lines = []
    if bushing:
        lines += ["[bushing]", f"name = {quoted(bushing.name)}"]
        lines += [f"{key} = {_mm(getattr(bushing, key))}" for key in ("inner_radius", "outer_radius", "length")]
        lines += [f'shape = "{bushing.shape}"'] if bushing.shape != "paper" else []
    for specimen in specimens:
        lines += ["", "[[specimens]]", f"name = {quoted(specimen.name)}", f'kind = "{specimen.kind}"']
        if specimen.strain != "engineering":
            lines.append(f'strain = "{specimen.strain}"')
        if specimen.area and specimen.thickness:
            lines += [f'area = "{specimen.area * 1e6:.6g} mm^2"', f"thickness = {_mm(specimen.thickness)}"]
            lines.append(f"elements = {specimen.elements}")
    return lines


def table_lines(kind: str, file: str, place: Place) -> list[str]:
    """The lines of one of [[loops]] or [[sweeps]], with the file and what was tested."""
    tested = f"specimen = {quoted(place.name)}" if isinstance(place, Specimen) else f'direction = "{place}"'
    return ["", f"[[{kind}]]", f"file = {quoted(file)}", tested]


def quoted(text: str) -> str:
    """A text as TOML writes it, without control characters."""
    return json.dumps(text, ensure_ascii=False)


def _mm(length: float) -> str:
    return f'"{length * 1e3:.6g} mm"'
