"""A loop and a sweep as texts, with one line exchanged where a test asks for it, and the readers of both."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bushfit.errors import BushfitError
from bushfit.geometry import Direction
from bushfit.reading.loops import read_loop
from bushfit.reading.measurement import Loop, Sweep
from bushfit.reading.stated import LoopFile, SweepFile
from bushfit.reading.sweeps import read_sweep

TIME = np.arange(40) * 0.1
LOOP_ROWS = [f"{t:.1f},{np.sin(3 * t):.4f},{100 * np.sin(3 * t + 0.1):.3f}" for t in TIME]
LOOP_HEADER = "time [s],displacement [mm],force [N]"
LOOP = "\n".join([LOOP_HEADER, *LOOP_ROWS]) + "\n"
SWEEP_HEADER = "frequency [Hz],amplitude [mm],stiffness [N/mm],loss factor [-]"
SWEEP_ROWS = [f"{f},{a},{500 + f},0.1" for a in (0.1, 0.2) for f in (5, 15, 25, 35)]
SWEEP = "\n".join([SWEEP_HEADER, *SWEEP_ROWS]) + "\n"


def loop_from(text: str | bytes, folder: Path, **options: Any) -> Loop:
    file = folder / "loop.csv"
    file.write_bytes(text.encode() if isinstance(text, str) else text)
    return read_loop(file, options.pop("direction", Direction.AXIAL), LoopFile(file=file.name, **options))


def sweep_from(text: str, folder: Path, **options: Any) -> Sweep:
    file = folder / "sweep.csv"
    file.write_text(text)
    direction, held = options.pop("direction", Direction.AXIAL), options.pop("at_amplitude", None)
    return read_sweep(file, direction, SweepFile(file=file.name, **options), at_amplitude=held)


@contextmanager
def refused(*words: str) -> Iterator[None]:
    """One of bushfit's errors, with all these words in it."""
    with pytest.raises(BushfitError) as caught:
        yield
    assert all(word in str(caught.value) for word in words), str(caught.value)


def with_line(text: str, number: int, line: str) -> str:
    lines = text.splitlines()
    lines[number - 1] = line
    return "\n".join(lines)
