"""C sources to shared libraries of Linux, Windows and macOS, all on one machine.

The compiler is zig's, from the package `ziglang`. The sources need no C library, so that nothing of the target system
has to be there, and the libraries depend on nothing.
"""

import importlib.util
import struct
import subprocess
import sys
import tempfile
from collections.abc import Collection, Mapping
from pathlib import Path

from bushfit.errors import OutputError

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
