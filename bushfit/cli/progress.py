"""Progress on the terminal: what is being done, how much of it is, how fast, and how long the rest will take."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer
from time import monotonic
from typing import TYPE_CHECKING, Any

from bushfit.progress import heard_by

if TYPE_CHECKING:
    from rich.console import Console

#: Seconds after which long work shows how far it is.
_PATIENCE = 2.0


def _told(done: int, total: int, seconds: float) -> str:
    """How many are done, of how many, how fast, and the seconds that are left."""
    if not done:
        return f"0 of {total}"
    pace = f"{done / seconds:.3g} a second" if done >= seconds else f"{seconds / done:.2g} s each"
    return f"{done} of {total}, {pace}, {seconds / done * (total - done):.0f} s left"


@contextmanager
def shown_on(console: Console) -> Iterator[None]:
    """A line for each kind of work within, from two seconds on; on a terminal alone, and not with --quiet."""
    if console.quiet or not (console.is_interactive and console.file.isatty()):
        yield
        return
    from rich.progress import BarColumn, Progress, TextColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(20),
        TextColumn("{task.fields[told]} [red]{task.fields[remark]}"),
    )
    bar = Progress(*columns, console=console, transient=True, redirect_stdout=False)
    lines, patient = dict[str, tuple[float, Any]](), True

    def listen(what: str, done: int | None, total: int, remark: str) -> None:
        if done is None:
            bar.remove_task(lines.pop(what)[1])
        else:
            if what not in lines:
                lines[what] = monotonic(), bar.add_task(what, total=total, told="", remark="")
            begun, line = lines[what]
            bar.update(line, completed=done, told=_told(done, total, monotonic() - begun), remark=remark)
        show()

    def show() -> None:
        """What is printed between two kinds of work stands on a line of its own."""
        if lines and not patient:
            bar.start()
        elif bar.live.is_started:
            bar.stop()

    def run_out() -> None:
        nonlocal patient
        patient = False
        show()

    timer = Timer(_PATIENCE, run_out)
    timer.start()
    try:
        with heard_by(listen):
            yield
    finally:
        timer.cancel()
        timer.join()
        bar.stop()
