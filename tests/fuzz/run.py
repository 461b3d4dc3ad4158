"""One run of libFuzzer on one target: `run.py TARGET ARGUMENT...`."""

from __future__ import annotations

import sys

import atheris

with atheris.instrument_imports(include=["bushfit", "tomllib"]):
    from targets import ready

if __name__ == "__main__":
    atheris.Setup([sys.argv[0], *sys.argv[2:]], ready(sys.argv[1]))
    atheris.Fuzz()
