"""One run of libFuzzer on one target: `run.py TARGET ARGUMENT...`."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

import atheris

sys.path.insert(0, str(Path(__file__).parents[1]))  # what the tests share
with atheris.instrument_imports(include=["bushfit", "tomllib"]):
    from targets import ready

if __name__ == "__main__":
    again = shlex.join([sys.executable, *sys.argv[:2]])  # libFuzzer calls itself by this where it merges
    atheris.Setup([again, *sys.argv[2:]], ready(sys.argv[1]))
    atheris.Fuzz()
