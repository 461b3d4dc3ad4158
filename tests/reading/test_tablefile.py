"""Tables in every form: what the reader takes back, and what a spreadsheet sees, which runs nothing of it."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import numpy as np
import pandas as pd
import pytest

from bushfit.errors import OutputError
from bushfit.geometry import Direction
from bushfit.reading.loops import read_loop
from bushfit.reading.measurement import Loop, Sweep
from bushfit.reading.rawtable import raw_loop_table, raw_sweep_table
from bushfit.reading.sweeps import read_sweep
from bushfit.reading.tablefile import Form, defused, ending, to_bytes, to_csv

FORMS: tuple[Form, ...] = get_args(Form)
PHASE = np.linspace(0.0, 12.0, 50)
TABLE = pd.DataFrame(
    {"x [mm], low": [1.0 / 3.0, np.nan, -1e-12], "n": [1, 2, 3], "=text": ["=1+1", "a; b, c", "Prüfling"]}
)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("direction", list(Direction))
def test_tests_are_read_back(form: Form, direction: Direction, tmp_path: Path) -> None:
    loop = Loop("loop", direction, PHASE, 1e-3 * np.sin(PHASE), 50.0 * np.sin(PHASE + 0.2))
    frequency, repeat = np.tile([5.0, 15.0, 25.0], 2), np.repeat([2, 7], 3)
    sweep = Sweep("s", direction, frequency, np.full(6, 2e-4), 5e5 * np.exp(0.1j) * (1.0 + frequency / 100.0), repeat)
    files = [tmp_path / f"{name}.{ending(form)}" for name in ("loop", "sweep")]
    for file, table in zip(files, (raw_loop_table(loop), raw_sweep_table(sweep)), strict=True):
        file.write_bytes(to_bytes(file.stem, table, form))
    found, swept = read_loop(files[0], direction), read_sweep(files[1], direction)
    for column in ("time", "displacement", "force"):
        written = getattr(loop, column)
        np.testing.assert_allclose(getattr(found, column), written, rtol=1e-6, atol=1e-9 * np.abs(written).max())
    assert np.array_equal(swept.frequency, frequency)
    assert np.array_equal(swept.repeat, repeat)
    np.testing.assert_allclose(swept.amplitude, sweep.amplitude, rtol=1e-6)
    np.testing.assert_allclose(swept.stiffness, sweep.stiffness, rtol=1e-6)


def test_cells_of_a_text_have_seven_digits_and_nothing_stands_for_nothing() -> None:
    table = pd.DataFrame({"x [mm]": [1.0 / 3.0, np.nan], "n": [-3, 4], "=run": ["\r=1+1", 'a "b", c']})
    assert to_csv(table) == b'x [mm],n,\'=run\n0.3333333,-3,\' =1+1\n,4,"a ""b"", c"\n'
    commas = to_bytes("t", TABLE, "decimal-comma")
    assert commas.startswith(b"\xef\xbb\xbfx [mm], low;n;'=text\n0,3333333;1;'=1+1\n;2;\"a; b, c\"\n-1e-12;3;Pr")


RUN = ["=1+1", "+cmd", "-2+3", "@SUM(A1)", "\t=1", "  =1", '=HYPERLINK("http://x")', "\uff1d1", '"=1', "%0A=1", "|x"]
STAY = ["loop_axial_1", "0.1 mm", "a=b", "A-4", "", "'quoted'", "Prüfling 3"]


def test_a_text_that_a_spreadsheet_would_run_is_quoted_and_every_text_is_one_line() -> None:
    assert [defused(text) for text in RUN] == [f"'{text}" for text in RUN]
    assert [defused(text) for text in STAY] == STAY
    assert (defused("a\r\nb"), defused("a\r\n=1")) == ("a b", "a =1")


def test_what_a_sheet_does_not_hold_is_refused_and_not_cut(tmp_path: Path) -> None:
    wide = pd.DataFrame(np.ones((1, 16_385)), columns=[f"c{n}" for n in range(16_385)])
    assert to_bytes("t", wide, "csv")
    with pytest.raises(OutputError, match="too large for a sheet"):
        to_bytes("t", wide, "xlsx")
    assert to_bytes("t", wide, "csv")
