"""Tables on a terminal."""

from __future__ import annotations

from io import StringIO

from rich.console import Console

from bushfit.cli.show import new_table


def test_long_names_wrap_and_lose_no_letter() -> None:
    table = new_table("t", "test", "place", "points", "NRMSE", names=2)
    table.add_row("tf_015p 18.4 degC", "DMA, second specimen", "14", "7.7")
    console = Console(file=StringIO(), width=40)
    console.print(table)
    text = console.file.getvalue()  # type: ignore[attr-defined]
    assert "…" not in text
    assert all(word in text for word in ("tf_015p", "degC", "second", "specimen", "points", "NRMSE", "7.7"))
