"""One run of libFuzzer on one target: `run.py TARGET ARGUMENT...`."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Callable
from pathlib import Path

import atheris

sys.path.insert(0, str(Path(__file__).parents[1]))  # what the tests share
with atheris.instrument_imports(include=["bushfit", "tomllib"]):
    from targets import ready

#: Processor time that an input may take, with its processes [s]; libFuzzer's own limit counts what others take, too.
MOST_SECONDS = 10.0


def bounded(run: Callable[[bytes], None]) -> Callable[[bytes], None]:
    """The same, with a fault where an input takes too long."""

    def one(data: bytes) -> None:
        begun = sum(os.times()[:4])
        run(data)
        if (spent := sum(os.times()[:4]) - begun) > MOST_SECONDS:
            raise TimeoutError(f"{spent:.1f} s of processor time")

    return one


if __name__ == "__main__":
    again = shlex.join([sys.executable, *sys.argv[:2]])  # libFuzzer calls itself by this where it merges
    atheris.Setup([again, *sys.argv[2:]], bounded(ready(sys.argv[1])))
    atheris.Fuzz()
