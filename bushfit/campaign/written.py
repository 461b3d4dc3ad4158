"""Tables of a campaign file as text: what was tested, and its tests."""

from collections.abc import Iterable, Mapping
from typing import Any

from bushfit.geometry import Bushing, Place, Specimen
from bushfit.units import CELSIUS


def body_lines(bushing: Bushing | None, specimens: Iterable[Specimen]) -> list[str]:
    """The lines of [bushing] and [[specimens]]."""
    lines = []
    if bushing:
        lines += ["[bushing]", f"name = {toml_value(bushing.name)}"]
        lines += [
            f'{key} = "{getattr(bushing, key) * 1e3:.6g} mm"' for key in ("inner_radius", "outer_radius", "length")
        ]
        lines += [f'shape = "{bushing.shape}"'] if bushing.shape != "paper" else []
    for specimen in specimens:
        lines += ["", *specimen_lines(specimen)]
    return lines


def specimen_lines(specimen: Specimen) -> list[str]:
    """The lines of one of [[specimens]]."""
    lines = ["[[specimens]]", f"name = {toml_value(specimen.name)}", f'kind = "{specimen.kind}"']
    if specimen.strain != "engineering":
        lines.append(f'strain = "{specimen.strain}"')
    if specimen.area and specimen.thickness:
        lines += [f'area = "{specimen.area * 1e6:.12g} mm^2"', f'thickness = "{specimen.thickness * 1e3:.12g} mm"']
        lines.append(f"elements = {specimen.elements}")
    return lines


def table_lines(kind: str, file: str, place: Place, temperature: Any = None) -> list[str]:
    """The lines of one of [[loops]] or [[sweeps]]: the file, what was tested, and at what temperature [K], if one."""
    warm = [] if temperature is None else [f'temperature = "{temperature - CELSIUS:.6g} degC"']
    return ["", f"[[{kind}]]", f"file = {toml_value(file)}", place_line(place), *warm]


def place_line(place: Place) -> str:
    """The line that says what a test is made on."""
    return f"specimen = {toml_value(place.name)}" if isinstance(place, Specimen) else f'direction = "{place}"'


def toml_value(value: Any) -> str:
    """A value as TOML writes it."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {toml_value(entry)}" for key, entry in value.items()) + " }"
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return '"' + "".join(c if c >= " " and c != "\x7f" else f"\\u{ord(c):04x}" for c in escaped) + '"'
    return str(value)
