"""Progress on the terminal: what is being done, how much of it is, how fast, and how long the rest will take."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer
from typing import TYPE_CHECKING

from bushfit.progress import heard_by

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Task, TaskID

#: Seconds after which long work shows how far it is.
_PATIENCE = 2.0


def _told(task: Task) -> str:
    """How many are done, of how many, how fast, and the seconds that are left, as far as these are known."""
    speed, left = task.speed or 0.0, task.time_remaining
    count = f"{task.completed:.0f}" + (f" of {task.total:.0f}" if task.total else "")
    pace = f"{speed:.3g} a second" if speed >= 1.0 else f"{1.0 / speed:.2g} s each" if speed else ""
    return ", ".join(filter(None, (count, pace, f"{left:.0f} s left" if left else "")))


@contextmanager
def shown_on(console: Console) -> Iterator[None]:
    """A line for each kind of work within, from two seconds on; on a terminal alone, and not with --quiet."""
    if console.quiet or not (console.is_interactive and console.file.isatty()):
        yield
        return
    from rich.progress import BarColumn, Progress, ProgressColumn, TextColumn
    from rich.text import Text

    class Told(ProgressColumn):
        def render(self, task: Task) -> Text:
            return Text(_told(task))

    columns = TextColumn("{task.description}"), BarColumn(), Told(), TextColumn("{task.fields[remark]}", style="red")
    bar = Progress(*columns, console=console, transient=True, redirect_stdout=False)
    lines, patient = dict[str, "TaskID"](), True

    def listen(what: str, done: int | None, total: int | None, remark: str) -> None:
        if done is None:
            bar.remove_task(lines.pop(what))
        else:
            if what not in lines:
                lines[what] = bar.add_task(what, total=total, remark="")
            bar.update(lines[what], completed=done, remark=remark)
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
