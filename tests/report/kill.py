"""Runs `bushfit` again and again, each run killed at a random time: `kill.py TIMES FOLDER OTHERWISE ARGUMENT...`.

OTHERWISE are the options, parted by |, with which results are replaced.

Each run is a process of its own, forked after the imports. Every other one replaces the results of an earlier run with
--force; half of them are killed at any time, half after they have begun to write. Prints as JSON how often the folder
then was whole, of which run, or absent.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import random
import shutil
import signal
import sys
import time
from collections import Counter
from pathlib import Path

from bushfit.cli import main
from bushfit.report import folder as output


def start(arguments: list[str]) -> int:
    child = os.fork()
    if not child:
        output._clear_abandoned.cache_clear()  # as in a process that begins
        os._exit(call(arguments))
    return child


def call(arguments: list[str]) -> int:
    sys.argv = ["bushfit", *arguments]
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        try:
            main()
        except SystemExit as left:
            return int(left.code or 0)
    return 0


def wait_for_writing(child: int, folder: Path, before: set[Path]) -> None:
    while not any(path.name.startswith(".bushfit-") for path in set(folder.iterdir()) - before):
        if os.waitid(os.P_PID, child, os.WEXITED | os.WNOWAIT | os.WNOHANG):
            return


def digest(folder: Path) -> str:
    """Which set of results a folder holds."""
    if not folder.exists():
        return "absent"
    files = {path.name: path.read_bytes() for path in sorted(folder.glob("[!.]*"))}
    assert files.pop("notes.txt", b"mine") == b"mine"
    return hashlib.sha256(repr(files).encode()).hexdigest()


def run(times: int, folder: Path, otherwise: list[str], arguments: list[str]) -> None:
    call([*arguments, "-o", str(folder)])  # imports what it needs
    shutil.rmtree(folder)
    known, lasts = {"absent": "absent"}, []
    for name, more in (("first", []), ("first", []), ("second", otherwise)):
        begun = time.perf_counter()
        status = os.waitstatus_to_exitcode(os.waitpid(start([*arguments, *more, "-o", str(folder)]), 0)[1])
        lasts.append(time.perf_counter() - begun)
        assert status == 0
        known[digest(folder)] = name
        shutil.rmtree(folder)
    assert len(known) == 3
    seen: Counter[str] = Counter()
    random.seed(1)
    for number in range(times):
        shutil.rmtree(folder, ignore_errors=True)
        more = []
        if number % 2:
            assert os.waitpid(start([*arguments, "-o", str(folder)]), 0)[1] == 0
            (folder / "notes.txt").write_bytes(b"mine")
            more = [*otherwise, "--force"]
        before = set(folder.parent.iterdir())
        child = start([*arguments, *more, "-o", str(folder)])
        if number % 4 < 2:
            time.sleep(min(lasts) * random.random())
        else:
            wait_for_writing(child, folder.parent, before)
            time.sleep(0.01 * random.random())
        os.kill(child, signal.SIGKILL)
        ended = "ended" if os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0 else "killed"
        what = "replacing" if number % 2 else "new"
        seen[f"{what}, {ended}: {known.get(digest(folder), 'mixed')}"] += 1
    shutil.rmtree(folder, ignore_errors=True)
    assert os.waitpid(start([*arguments, "-o", str(folder)]), 0)[1] == 0
    hidden = [path.name for path in folder.parent.iterdir() if path.name.startswith(".")]
    assert not hidden, f"left behind: {hidden}"
    print(json.dumps(seen))


if __name__ == "__main__":
    run(int(sys.argv[1]), Path(sys.argv[2]), sys.argv[3].split("|"), sys.argv[4:])
