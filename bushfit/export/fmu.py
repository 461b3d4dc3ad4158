"""An FMU: FMI 2.0 for co-simulation, displacement in and force out, with the libraries for three systems.

The libraries are compiled when the export is made, not when the package is built: the model's numbers are compiled in,
so that an FMU reads no file while it runs, and who writes none needs no compiler. The compiler is zig's, from the
package `ziglang`, which makes libraries for Linux, Windows and macOS on any of them. The sources need no C library, so
that nothing of the target system has to be there, and the libraries depend on nothing.
"""

import hashlib
import importlib.util
import io
import re
import struct
import subprocess
import sys
import tempfile
import uuid
import zipfile
from collections.abc import Collection, Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from xml.etree import ElementTree as ET

from bushfit.errors import OutputError
from bushfit.export.contract import Exported, Order
from bushfit.export.in_time import FIELDS, ONE, TABLES, InTime, in_time
from bushfit.geometry import Place, Unit
from bushfit.reading.tablefile import folder_name
from bushfit.version import __version__

#: Folder of an FMU, ending of the library, and zig's names of the machines in it, by the system's name.
SYSTEMS = {
    "linux": ("linux64", ".so", ("x86_64-linux-none",)),
    "windows": ("win64", ".dll", ("x86_64-windows-gnu",)),
    "macos": ("darwin64", ".dylib", ("x86_64-macos", "aarch64-macos")),
}
#: Options of the compiler; without contraction all machines round alike.
_OPTIONS = (
    *("-shared", "-O2", "-std=c99", "-fPIC", "-fvisibility=hidden", "-ffp-contract=off", "-s"),
    *("-ffreestanding", "-nostdlib", "-DFREESTANDING", "-Wall", "-Wextra", "-Werror"),
)
#: Machine in a file with a library for each of several, as macOS has them, and its variant: x86-64 and arm64.
_MACHINES = {"x86_64-macos": (0x01000007, 3), "aarch64-macos": (0x0100000C, 0)}
#: Libraries in it begin at multiples of 2 to this power [bytes].
_ALIGNED = 14
#: The sources that all FMUs share.
_SHARED = ("fmu.c", "bushing.c", "bushing.h", "fmi2.h")
#: Exponents of SI base units of the units that have whole ones; others are known by name alone.
_BASE: Mapping[str, Mapping[str, int]] = TABLES["units"]
#: What XML cannot hold.
_NO_XML = re.compile("[\x00-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")
#: Values 0 and 1 stand first on the list of the C sources.
_FIRST = 2


def libraries(sources: Mapping[str, bytes], name: str, systems: Collection[str] = tuple(SYSTEMS)) -> dict[str, bytes]:
    """The shared library of each system, by its path in an FMU: `linux64/<name>.so` and so on.

    Raises:
        OutputError: there is no compiler, or it failed.
    """
    if importlib.util.find_spec("ziglang") is None:
        raise OutputError(
            "there is no compiler for the FMU",
            found="no package ziglang",
            expected="the compiler that makes libraries for Linux, Windows and macOS on any of them",
            hint='pip install "bushfit[fmu]"',
        )
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for file, content in sources.items():
            (Path(folder) / file).write_bytes(content)
        files = [file for file in sources if file.endswith(".c")]
        for system in systems:
            where, ending, targets = SYSTEMS[system]
            parts = {target: _compiled(Path(folder), files, target) for target in targets}
            found[f"{where}/{name}{ending}"] = _joined(parts) if len(parts) > 1 else parts[targets[0]]
    return found


def _compiled(folder: Path, files: Collection[str], target: str) -> bytes:
    """The library of one machine."""
    made = folder / target
    command = [sys.executable, "-m", "ziglang", "cc", "-target", target, *_OPTIONS, *files, "-o", made.name]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300.0, check=False)
    if done.returncode:
        raise OutputError("the compiler of the FMU failed", place=target, found=(done.stderr or done.stdout).strip())
    return made.read_bytes()


def _joined(parts: Mapping[str, bytes]) -> bytes:
    """One file for several machines, in the format of macOS (mach-o/fat.h: big-endian words)."""
    step = 1 << _ALIGNED
    head, body, begin = struct.pack(">II", 0xCAFEBABE, len(parts)), b"", step
    for target, content in parts.items():
        head += struct.pack(">IIIII", *_MACHINES[target], begin, len(content), _ALIGNED)
        body += content + bytes(-len(content) % step)
        begin = step + len(body)
    return head + bytes(step - len(head)) + body


def export(order: Order, systems: Collection[str] = tuple(SYSTEMS)) -> Exported:
    """The FMU of an order, with one input and one output a place.

    Raises:
        ModelError: the model cannot run in time.
        OutputError: there is no compiler.
    """
    found = in_time(order)
    safe = re.sub(r"[^A-Za-z0-9]+", "_", folder_name(order.result.name))
    name = f"bushfit_{safe[:40].strip('_').lower()}"
    sources = {file: (files("bushfit.export") / "c" / file).read_bytes() for file in _SHARED}
    sources |= {"model.c": model_c(found).encode()}
    plain = description(order, found, name, "")
    digest = hashlib.sha256(b"".join([*sources.values(), plain, model_h(found, "").encode()])).digest()
    guid = f"{{{uuid.UUID(bytes=digest[:16])}}}"
    sources |= {"model.h": model_h(found, guid).encode()}
    content = {
        "modelDescription.xml": description(order, found, name, guid),
        **{f"binaries/{path}": library for path, library in libraries(sources, name, systems).items()},
        **{f"sources/{file}": source for file, source in sources.items()},
    }
    return Exported({f"{name}.fmu": _archive(content)}, found.losses, found.arms)


def model_h(found: InTime, guid: str) -> str:
    """Sizes of the lists, and what an importer knows the FMU by."""
    sizes = {
        "VALUES": _FIRST + len(found.values),
        "CONSTANTS": _FIRST + sum(not value.settable for value in found.values),
        "DIRECTIONS": len(found.places),
        "PARTS": max(1, len(found.parts)),
        "ARMS": max(1, len(found.arm_rows)),
    }
    listed = ", ".join(f"{name} = {size}" for name, size in sizes.items())
    return f'#define GUID "{guid}"\nenum {{ {listed} }};\n'


def model_c(found: InTime) -> str:
    """The lists themselves."""
    values, reference = found.values, {value.name: at for at, value in enumerate(found.values, start=_FIRST)}
    lists = {
        "start": [0.0, 1.0, *(value.value for value in values)],
        "least": [0.0, 1.0, *(value.bounds[0] for value in values)],
        "most": [0.0, 1.0, *(value.bounds[1] for value in values)],
    }
    lines = ['#include "bushing.h"', ""]
    for name, numbers in lists.items():
        lines += [f"const double {name}[VALUES] = {{", f"    {', '.join(f'{x!r}' for x in numbers)}", "};"]
    lines.append("const Direction directions[DIRECTIONS] = {")
    known = [field for own in FIELDS.values() for field in own]
    for own, lever in zip(found.fields, found.levers, strict=True):
        neutrals = {field: int(field in ONE) for field in known if field not in own}
        set_ = {**neutrals, **{field: reference[name] for field, name in own.items()}}
        listed = ", ".join(f".{field} = {place}" for field, place in set_.items())
        lines.append(f"    {{{listed}, .lever = {lever!r}}},")
    lines += ["};", "const Arm arms[ARMS] = {"]
    arms = found.arm_rows or ((0, 0.0, 1.0),)
    lines += [f"    {{{part}, {share!r}, {time!r}}}," for part, share, time in arms]
    return "\n".join([*lines, "};", ""])


def description(order: Order, found: InTime, name: str, guid: str) -> bytes:
    """modelDescription.xml: what an importer is told."""
    about = f"Rubber bushing, displacement in and force out, of {order.source.file} (SHA-256 {order.source.sha256})"
    about = "; ".join([about, *map(": ".join, order.remarks(found.losses))])
    root = ET.Element("fmiModelDescription", {
        "fmiVersion": "2.0", "modelName": _text(order.result.name), "guid": guid, "description": _text(about),
        "generationTool": f"bushfit {__version__}", "variableNamingConvention": "flat", "numberOfEventIndicators": "0",
    })  # fmt: skip
    simulation = ET.SubElement(root, "CoSimulation", {
        "modelIdentifier": name, "canHandleVariableCommunicationStepSize": "true", "canInterpolateInputs": "true",
        "canGetAndSetFMUstate": "true", "canSerializeFMUstate": "true",
    })  # fmt: skip
    compiled = ET.SubElement(simulation, "SourceFiles")
    for file in (*(file for file in _SHARED if file.endswith(".c")), "model.c"):
        ET.SubElement(compiled, "File", {"name": file})
    variables = _variables(found)
    _units(ET.SubElement(root, "UnitDefinitions"), found, {str(each["unit"]) for _, each in variables})
    ET.SubElement(root, "DefaultExperiment", {"startTime": "0", "stopTime": "1", "stepSize": "0.001"})
    listed = ET.SubElement(root, "ModelVariables")
    for variable, real in variables:
        scalar = ET.SubElement(listed, "ScalarVariable", variable)
        ET.SubElement(scalar, "Real", {key: value for key, value in real.items() if value})
    structure = ET.SubElement(root, "ModelStructure")
    outputs = [k for k, (variable, _) in enumerate(variables, start=1) if variable["causality"] == "output"]
    for kind in ("Outputs", "InitialUnknowns"):
        unknown = ET.SubElement(structure, kind)
        for k in outputs:
            ET.SubElement(unknown, "Unknown", {"index": str(k)})
    ET.indent(root)
    return ET.tostring(root, encoding="utf-8", xml_declaration=True)


def _variables(found: InTime) -> list[tuple[dict[str, str], dict[str, str]]]:
    """The attributes of each scalar variable, and of its real value: inputs, outputs, then the values."""
    count, displays, listed = _FIRST + len(found.values), _displays(found.places), []
    for place in found.places:
        moved, resisted, _ = place.motion.words
        kinds: tuple[tuple[str, str, str, dict[str, str], dict[str, str]], ...] = (
            (moved, "input", place.motion.displacement_unit, {"start": "0"}, {}),
            (resisted, "output", place.motion.force_unit, {}, {"initial": "calculated"}),
        )
        for which, (word, causality, unit, start, initial) in enumerate(kinds):
            reference = count + which * len(found.places) + found.places.index(place)
            variable = {"name": _text(f"{word}.{place}"), "valueReference": str(reference), "causality": causality}
            shown = displays[unit].name if unit in displays else ""
            real = {"unit": "" if unit == "1" else unit, "displayUnit": shown, **start}
            listed.append(({**variable, "variability": "continuous", **initial}, real))
    for reference, value in enumerate(found.values, start=_FIRST):
        kind = {"causality": "parameter", "variability": "tunable"} if value.settable else {
            "causality": "local", "variability": "constant",
        }  # fmt: skip
        variable = {"name": _text(value.name), "valueReference": str(reference), "description": _text(value.meaning)}
        limits = dict(zip(("min", "max"), map(repr, value.bounds), strict=True)) if value.settable else {}
        unit = "" if value.unit == "1" else value.unit
        listed.append(({**variable, **kind, "initial": "exact"}, {"unit": unit, **limits, "start": repr(value.value)}))
    return listed


def _units(definitions: ET.Element, found: InTime, used: Collection[str]) -> None:
    """Every unit that is used, as far as it has whole exponents in SI base units, and what engineers read it in."""
    displays = _displays(found.places)
    for name in sorted(filter(None, used)):
        unit = ET.SubElement(definitions, "Unit", {"name": name})
        if name in _BASE:
            ET.SubElement(unit, "BaseUnit", {base: str(power) for base, power in _BASE[name].items()})
        if name in displays:
            ET.SubElement(unit, "DisplayUnit", {"name": displays[name].name, "factor": repr(displays[name].factor)})


def _displays(places: Sequence[Place]) -> dict[str, Unit]:
    """The units in which engineers read motion and force, by those that the FMU has, where these differ."""
    both = [((p.motion.displacement_unit, p.motion.force_unit), p.display[:2]) for p in places]
    shown = {unit: display for units, displays in both for unit, display in zip(units, displays, strict=True)}
    return {unit: display for unit, display in shown.items() if unit != "1" and display.factor != 1.0}


def _text(text: str) -> str:
    """A text without what XML cannot hold."""
    return _NO_XML.sub("_", text)


def _archive(content: Mapping[str, bytes]) -> bytes:
    """A zip archive of the same bytes for the same content: its entries have no date."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in content.items():
            archive.writestr(zipfile.ZipInfo(name), data, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()
