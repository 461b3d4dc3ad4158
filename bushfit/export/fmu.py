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
from pathlib import Path

from bushfit.errors import OutputError
from bushfit.export.contract import ExportedFiles, ExportRequest
from bushfit.export.in_time import FIELDS, TABLES, UNIT_FIELDS, TimeModel, time_model
from bushfit.geometry import Unit
from bushfit.reading.tablefile import folder_name
from bushfit.templates import render_template
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
#: Folder of the sources; sources that all FMUs share; and files that are made from templates for each FMU.
_FOLDER = Path(__file__).with_name("c")
_SHARED = ("fmu.c", "bushing.c", "bushing.h", "fmi2.h")
_DESCRIPTION = "modelDescription.xml"
_WRITTEN = ("model.c", "model.h", _DESCRIPTION)
#: Exponents of SI base units, by unit with integer exponents.
_BASE_UNITS: Mapping[str, Mapping[str, int]] = TABLES["units"]
#: Characters that XML does not allow.
_NO_XML = re.compile("[\x00-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")
#: Number of constants (0 and 1) before the values of the model in the C sources.
_OFFSET = 2


def export(request: ExportRequest) -> ExportedFiles:
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
    shared = {file: (_FOLDER / file).read_bytes() for file in _SHARED}
    digest = hashlib.sha256(b"".join([*shared.values(), *model_files(request, model, name, "").values()])).digest()
    written = model_files(request, model, name, f"{{{uuid.UUID(bytes=digest[:16])}}}")
    description = written.pop(_DESCRIPTION)
    sources = shared | written
    path, library = compile_library(sources, name)
    content = {_DESCRIPTION: description, path: library, **{f"sources/{file}": text for file, text in sources.items()}}
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for file, data in content.items():  # without dates, so that equal contents give equal bytes
            archive.writestr(zipfile.ZipInfo(file), data, zipfile.ZIP_DEFLATED)
    return ExportedFiles({f"{name}.fmu": buffer.getvalue()}, model.omissions, model.arms)


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
    environment = {**os.environ, "ZIG_GLOBAL_CACHE_DIR": str(cache), "ZIG_LOCAL_CACHE_DIR": str(cache)}
    with tempfile.TemporaryDirectory() as folder:
        for file, content in sources.items():
            (Path(folder) / file).write_bytes(content)
        units = [file for file in sources if file.endswith(".c")]
        command = [sys.executable, "-m", "ziglang", "cc", "-target", target, *_OPTIONS, *units, "-o", f"{name}{suffix}"]
        done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300.0)
        if done.returncode:
            message = (done.stderr or done.stdout).strip()
            raise OutputError("the compiler of the FMU failed", place=target, found=message)
        return f"binaries/{system}/{name}{suffix}", (Path(folder) / f"{name}{suffix}").read_bytes()


def model_files(request: ExportRequest, model: TimeModel, name: str, guid: str) -> dict[str, bytes]:
    """Write the files of an FMU that depend on the model: C source and header, and the description of its variables.

    Args:
        request: model, predictions and settings.
        model: time-domain model with the values of the FMU.
        name: model identifier, which is the name of the library.
        guid: identifier that has to be equal in the description and the library.

    Returns:
        Contents by file name.
    """
    about = f"Rubber bushing, displacement in and force out, of {request.source.file} (SHA-256 {request.source.sha256})"
    displays: dict[str, Unit] = {}
    for place in model.places:
        length, force, _ = place.display
        displays |= {place.motion.displacement_unit: length, place.motion.force_unit: force}
    units = {*displays, *(value.unit for value in model.values)} - {"", "1"}
    reference = {value.name: index for index, value in enumerate(model.values, start=_OFFSET)}
    neutral = {field: int(field in UNIT_FIELDS) for fields in FIELDS.values() for field in fields}
    context = {
        "request": request,
        "model": model,
        "name": name,
        "guid": guid,
        "about": "; ".join([about, *map(": ".join, request.remarks(model.omissions))]),
        "version": __version__,
        "displays": {unit: displays[unit] for unit in units & displays.keys() if displays[unit].factor != 1.0},
        "units": sorted(units),
        "base_units": _BASE_UNITS,
        "offset": _OFFSET,
        "directions": [neutral | {field: reference[key] for field, key in fields.items()} for fields in model.fields],
        # characters that XML does not allow become underscores; numbers and XML remain unchanged
        "finalize": lambda value: _NO_XML.sub("_", value) if type(value) is str else value,
    }
    return {file: render_template(_FOLDER / f"{file}.jinja", **context).encode() for file in _WRITTEN}
