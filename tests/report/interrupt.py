"""Writes results again and again, each time stopped at another system call: `interrupt.py FOLDER WHERE HOW`.

WHERE: `new`, a folder that does not exist yet; `exchanged`, one that holds other results; `inside`, the same where the
process stands in it, so that it cannot be exchanged. HOW: `killed`, or `full`, an error as of a full disk. Prints what
was found as JSON: per state of the folder how often, and the number of system calls.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import sys
from collections import Counter
from pathlib import Path
from typing import Any

from bushfit.errors import OutputError
from bushfit.report import folder as output

OLD = {name: b"old " + name.encode() for name in ("axial.csv", "model.json", "radial.csv")}
NEW = {name: b"new " + name.encode() for name in OLD}
OTHERS = {"notes.txt": b"of the user", "pictures/one.png": b"of the user too"}
#: Exit status of a run that wrote its files.
WRITTEN = 0
#: Exit status of a run that was refused.
REFUSED = 3


def prepare(folder: Path, where: str) -> None:
    os.chdir("/")
    shutil.rmtree(folder.parent, ignore_errors=True)
    folder.parent.mkdir()
    if where != "new":
        (folder / "pictures").mkdir(parents=True)
        for name, content in (OLD | OTHERS).items():
            (folder / name).write_bytes(content)
    if where == "inside":
        os.chdir(folder)


def interrupted(folder: Path, count: int, how: str) -> int:
    """Write with a fault at that system call, in a process of its own; its exit status."""
    child = os.fork()
    if not child:
        left = [count]

        def fault(event: str = "", arguments: Any = ()) -> None:
            if not event.startswith(("open", "os.", "shutil.", "fcntl.", "tempfile.", "ctypes.")):
                return
            left[0] -= 1
            if left[0] == -1 and how == "killed":
                os.kill(os.getpid(), signal.SIGKILL)
            elif left[0] == -1:
                raise OSError(28, "No space left on device")

        for name in ("exchange", "flush"):  # the C library's own, which Python does not announce
            setattr(output, name, announced(getattr(output, name), fault))
        sys.addaudithook(fault)
        try:
            output.write_files(folder, NEW, force=True)
        except OutputError:
            os._exit(REFUSED)
        os._exit(WRITTEN if left[0] >= 0 else WRITTEN + 1)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def announced(call: Any, fault: Any) -> Any:
    def wrapped(*arguments: Any) -> None:
        fault("os.")
        call(*arguments)

    return wrapped


def contents(folder: Path) -> dict[str, bytes]:
    files = [path for path in folder.rglob("*") if path.is_file() and path.relative_to(folder).parts[0][0] != "."]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def state(folder: Path, where: str) -> str:
    others = {} if where == "new" else OTHERS
    found = contents(folder)
    if not found and where == "new":
        return "absent"
    for name, known in (("old", OLD), ("new", NEW)):
        if found == known | others:
            return name
    return f"mixed: {found}"


def main(folder: Path, where: str, how: str) -> None:
    seen: Counter[str] = Counter()
    for count in range(1000):
        prepare(folder, where)
        status = interrupted(folder, count, how)
        found = state(folder, where)
        if where == "inside" and found.startswith("mixed"):
            found = "decided"
        output._clear_abandoned.cache_clear()
        if found == "decided":  # the next run that writes there, be it another file, ends what was decided
            output.write_files(folder, {"else.json": b""}, force=True)
            (folder / "else.json").unlink()
            assert state(folder, where) == "new", contents(folder)
        seen[f"{found}, exit status {status}"] += 1
        output.write_files(folder, NEW, force=True)
        assert state(folder, where) == "new", (count, contents(folder))
        hidden = [path.name for path in (*folder.parent.iterdir(), *folder.iterdir()) if path.name.startswith(".")]
        assert not hidden, (count, hidden)
        if status == WRITTEN:
            break
    print(json.dumps({"calls": count, "seen": seen}))


if __name__ == "__main__":
    main(Path(sys.argv[1]), *sys.argv[2:])
