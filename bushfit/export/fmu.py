"""FMU: FMI 2.0 for co-simulation, displacement in and force out, for the system on which it is written.

The library is compiled when the FMU is written and contains the values of the model, so that a running FMU reads no
file. The compiler is zig, from the package `ziglang`. The sources need no C library.

Source: Functional Mock-up Interface for Model Exchange and Co-Simulation, version 2.0.4.
"""

import hashlib
import importlib.util
import io
import os
import platform
import re
import subprocess
import sys
import tempfile
import uuid
import zipfile
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from xml.etree import ElementTree as ET

from bushfit.errors import OutputError
from bushfit.export.contract import Exported, ExportRequest
from bushfit.export.in_time import FIELDS, TABLES, UNIT_FIELDS, TimeModel, time_model
from bushfit.geometry import Unit
from bushfit.reading.tablefile import folder_name
from bushfit.version import __version__

#: Folder of the library in an FMU, its suffix, and the system in the compiler's target, by `sys.platform`.
_SYSTEMS = {
    "linux": ("linux64", ".so", "linux-none"),
    "win32": ("win64", ".dll", "windows-gnu"),
    "darwin": ("darwin64", ".dylib", "macos"),
}
#: Names of processors in the compiler's target.
_PROCESSORS = {"amd64": "x86_64", "arm64": "aarch64"}
#: Options of the compiler; without contraction all processors round alike.
_OPTIONS = (
    *("-shared", "-O2", "-std=c99", "-fPIC", "-fvisibility=hidden", "-ffp-contract=off", "-s"),
    *("-ffreestanding", "-nostdlib", "-DFREESTANDING", "-Wall", "-Wextra", "-Werror"),
)
#: Sources that all FMUs share.
_SHARED = ("fmu.c", "bushing.c", "bushing.h", "fmi2.h")
#: Exponents of SI base units, by unit with integer exponents.
_BASE_UNITS: Mapping[str, Mapping[str, int]] = TABLES["units"]
#: Characters that XML does not allow.
_NO_XML = re.compile("[\x00-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")
#: Number of constants (0 and 1) before the values of the model in the C sources.
_OFFSET = 2


def export(request: ExportRequest) -> Exported:
    """Write a model as an FMU with one input and one output per direction or specimen.

    Args:
        request: model, predictions and settings.

    Returns:
        File with the FMU, sentences on properties that the FMU cannot represent, and the Maxwell arms in it.

    Raises:
        ModelError: an effect has no law in the time domain.
        OutputError: the compiler is missing or failed.
    """
    model = time_model(request)
    safe_name = re.sub(r"[^A-Za-z0-9]+", "_", folder_name(request.result.name))
    name = f"bushfit_{safe_name[:40].strip('_').lower()}"
    sources = {file: _source(file) for file in _SHARED}
    sources |= {"model.c": model_source(model).encode()}
    without_guid = [model_description(request, model, name, ""), model_header(model, "").encode()]
    digest = hashlib.sha256(b"".join([*sources.values(), *without_guid])).digest()
    guid = f"{{{uuid.UUID(bytes=digest[:16])}}}"
    sources |= {"model.h": model_header(model, guid).encode()}
    path, library = compile_library(sources, name)
    content = {
        "modelDescription.xml": model_description(request, model, name, guid),
        path: library,
        **{f"sources/{file}": source for file, source in sources.items()},
    }
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for file, data in content.items():  # without dates, so that equal contents give equal bytes
            archive.writestr(zipfile.ZipInfo(file), data, zipfile.ZIP_DEFLATED)
    return Exported({f"{name}.fmu": buffer.getvalue()}, model.omissions, model.arms)


def compile_library(sources: Mapping[str, bytes], name: str) -> tuple[str, bytes]:
    """Compile the shared library of an FMU for this system.

    Args:
        sources: C sources and headers by file name.
        name: name of the library without suffix.

    Returns:
        Path of the library in the FMU, and its content.

    Raises:
        OutputError: there is no compiler, it does not know this system, or it failed.
    """
    if importlib.util.find_spec("ziglang") is None:
        raise OutputError(
            "there is no compiler for the FMU",
            found="no package ziglang",
            expected="the compiler of the package ziglang",
            hint='pip install "bushfit[fmu]"',
        )
    if sys.platform not in _SYSTEMS:
        raise OutputError("no FMU for this system", found=sys.platform, expected="one of " + ", ".join(_SYSTEMS))
    system, suffix, target = _SYSTEMS[sys.platform]
    machine = platform.machine().lower()
    target = f"{_PROCESSORS.get(machine, machine)}-{target}"
    # the compiler looks for its caches below the home folder, which a service or a container may lack
    cache = Path(tempfile.gettempdir()) / f"bushfit-compiler-{os.getuid() if hasattr(os, 'getuid') else 'cache'}"
    caches = {"ZIG_GLOBAL_CACHE_DIR": str(cache), "ZIG_LOCAL_CACHE_DIR": str(cache)}
    with tempfile.TemporaryDirectory() as folder:
        for file, content in sources.items():
            (Path(folder) / file).write_bytes(content)
        units = [file for file in sources if file.endswith(".c")]
        command = [sys.executable, "-m", "ziglang", "cc", "-target", target, *_OPTIONS, *units, "-o", f"{name}{suffix}"]
        done = subprocess.run(
            command,
            cwd=folder,
            env={**os.environ, **caches},
            capture_output=True,
            text=True,
            timeout=300.0,
            check=False,
        )
        if done.returncode:
            message = (done.stderr or done.stdout).strip()
            raise OutputError("the compiler of the FMU failed", place=target, found=message)
        return f"binaries/{system}/{name}{suffix}", (Path(folder) / f"{name}{suffix}").read_bytes()


def model_header(model: TimeModel, guid: str) -> str:
    """Write the C header of an FMU, with the lengths of the lists and the GUID.

    Returns:
        Content of model.h.
    """
    sizes = {
        "VALUES": _OFFSET + len(model.values),
        "CONSTANTS": _OFFSET + sum(not value.settable for value in model.values),
        "DIRECTIONS": len(model.places),
        "PARTS": max(1, len(model.arms)),
        "ARMS": max(1, len(model.arm_rows)),
    }
    listed = ", ".join(f"{name} = {size}" for name, size in sizes.items())
    return f'#define GUID "{guid}"\nenum {{ {listed} }};\n'


def model_source(model: TimeModel) -> str:
    """Write the C source with the values, directions and Maxwell arms of a model.

    Returns:
        Content of model.c.
    """
    values, reference = model.values, {value.name: index for index, value in enumerate(model.values, start=_OFFSET)}
    lists = {
        "start": [0.0, 1.0, *(value.value for value in values)],
        "least": [0.0, 1.0, *(value.bounds[0] for value in values)],
        "most": [0.0, 1.0, *(value.bounds[1] for value in values)],
    }
    lines = ['#include "bushing.h"', ""]
    for name, numbers in lists.items():
        lines += [f"const double {name}[VALUES] = {{", f"    {', '.join(f'{number!r}' for number in numbers)}", "};"]
    lines.append("const Direction directions[DIRECTIONS] = {")
    all_fields = [field for effect_fields in FIELDS.values() for field in effect_fields]
    for fields, lever in zip(model.fields, model.levers, strict=True):
        neutral = {field: int(field in UNIT_FIELDS) for field in all_fields if field not in fields}
        indices = {**neutral, **{field: reference[name] for field, name in fields.items()}}
        listed = ", ".join(f".{field} = {index}" for field, index in indices.items())
        lines.append(f"    {{{listed}, .lever = {lever!r}}},")
    lines += ["};", "const Arm arms[ARMS] = {"]
    rows = model.arm_rows or ((0, 0.0, 1.0),)
    lines += [f"    {{{part}, {share!r}, {time!r}}}," for part, share, time in rows]
    return "\n".join([*lines, "};", ""])


def model_description(request: ExportRequest, model: TimeModel, name: str, guid: str) -> bytes:
    """Write modelDescription.xml, the description of the variables of an FMU.

    Args:
        request: model, predictions and settings.
        model: time-domain model with the values of the FMU.
        name: model identifier, which is the name of the library.
        guid: identifier that has to be equal in the description and the library.

    Returns:
        Content of the XML file in UTF-8.
    """
    about = f"Rubber bushing, displacement in and force out, of {request.source.file} (SHA-256 {request.source.sha256})"
    about = "; ".join([about, *map(": ".join, request.remarks(model.omissions))])
    root = ET.fromstring(_source("modelDescription.xml"))
    root.attrib |= {"modelName": _xml_text(request.result.name), "guid": guid, "description": _xml_text(about)}
    root.set("generationTool", f"bushfit {__version__}")
    simulation, definitions, _, variables, structure = root
    simulation.set("modelIdentifier", name)
    displays = {  # of displacements and forces by SI unit, where the two differ
        unit: display
        for place in model.places
        for unit, display in zip(
            (place.motion.displacement_unit, place.motion.force_unit), place.display[:2], strict=True
        )
        if unit != "1" and display.factor != 1.0
    }
    add_variables(variables, model, displays)
    for unit in sorted({real.attrib["unit"] for real in variables.iter("Real") if "unit" in real.attrib}):
        definition = ET.SubElement(definitions, "Unit", {"name": unit})
        if unit in _BASE_UNITS:
            ET.SubElement(definition, "BaseUnit", {base: str(power) for base, power in _BASE_UNITS[unit].items()})
        if unit in displays:
            display = {"name": displays[unit].name, "factor": repr(displays[unit].factor)}
            ET.SubElement(definition, "DisplayUnit", display)
    for index, variable in enumerate(variables, start=1):
        for unknowns in structure if variable.attrib["causality"] == "output" else ():
            ET.SubElement(unknowns, "Unknown", {"index": str(index)})
    ET.indent(root)
    return ET.tostring(root, encoding="utf-8", xml_declaration=True)


def add_variables(variables: ET.Element, model: TimeModel, displays: Mapping[str, Unit]) -> None:
    """Add the scalar variables of an FMU to its description: displacement and force of each place, then the values.

    Args:
        variables: XML element `ModelVariables`.
        model: time-domain model.
        displays: display units by SI unit.
    """
    count, rows = _OFFSET + len(model.values), list[tuple[str, int, dict[str, str], str, dict[str, str]]]()
    for index, place in enumerate(model.places, start=count):
        units = place.motion.displacement_unit, place.motion.force_unit
        length, newton = ({"displayUnit": displays[unit].name} if unit in displays else {} for unit in units)
        displacement, force = (f"{word}.{place}" for word in place.motion.words[:2])
        attributes = {"causality": "input", "variability": "continuous"}
        rows.append((displacement, index, attributes, units[0], {**length, "start": "0"}))
        attributes = {"causality": "output", "variability": "continuous", "initial": "calculated"}
        rows.append((force, index + len(model.places), attributes, units[1], newton))
    for reference, value in enumerate(model.values, start=_OFFSET):
        attributes = {"description": _xml_text(value.meaning), "causality": "local", "variability": "constant"}
        real = {"start": repr(value.value)}
        if value.settable:
            attributes |= {"causality": "parameter", "variability": "tunable"}
            real = {"min": repr(value.bounds[0]), "max": repr(value.bounds[1]), **real}
        rows.append((value.name, reference, {**attributes, "initial": "exact"}, value.unit, real))
    for name, reference, attributes, unit, real in rows:
        names = {"name": _xml_text(name), "valueReference": str(reference)}
        variable = ET.SubElement(variables, "ScalarVariable", {**names, **attributes})
        ET.SubElement(variable, "Real", {**({} if unit in ("", "1") else {"unit": unit}), **real})


def _source(file: str) -> bytes:
    """Content of a C source, or of the skeleton of the XML description, that all FMUs share, from the package."""
    return (files("bushfit.export") / "c" / file).read_bytes()


def _xml_text(text: str) -> str:
    """Replace characters that XML does not allow by underscores."""
    return _NO_XML.sub("_", text)
