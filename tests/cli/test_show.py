"""Tables on a terminal."""

from __future__ import annotations

from io import StringIO

import pytest
from rich.console import Console

from bushfit.cli.common import Options
from bushfit.cli.show import new_table, tell_tests
from bushfit.model.result import Misfit


def test_long_names_wrap_and_lose_no_letter() -> None:
    table = new_table("t", "test", "place", "points", "NRMSE", names=2)
    table.add_row("tf_015p 18.4 degC", "DMA, second specimen", "14", "7.7")
    console = Console(file=StringIO(), width=40)
    console.print(table)
    text = console.file.getvalue()  # type: ignore[attr-defined]
    assert "…" not in text
    assert all(word in text for word in ("tf_015p", "degC", "second", "specimen", "points", "NRMSE", "7.7"))


@pytest.mark.parametrize(("count", "said"), [(9, "and 1 more test, which is"), (10, "and 2 more tests, which are")])
def test_tests_left_out_are_counted(count: int, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    tests = [Misfit(f"t{n}", "axial", True, None, None, None, 5, 0.01, 1.0, 0.0) for n in range(count)]
    tell_tests(Options(None, False, False, False, False, False), tests, [])
    assert said in capsys.readouterr().err
