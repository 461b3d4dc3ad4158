"""Progress of long computations: reported where the work is done, shown by the command line."""

from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

Item = TypeVar("Item")
#: Function of the description, the number of finished items (None at the end), their total number, and a remark.
Listener = Callable[[str, int | None, int, str], None]
_LISTENER = ContextVar[Listener]("_LISTENER", default=lambda *_: None)


@contextmanager
def report_progress_to(listener: Listener) -> Iterator[None]:
    """Context in which `track` reports progress to a function.

    Args:
        listener: function that is called with the description of the work, the number of finished items (None at the
            end), their total number (0 if unknown), and a remark.
    """
    token = _LISTENER.set(listener)
    try:
        yield
    finally:
        _LISTENER.reset(token)


def track(description: str, items: Iterable[Item], total: int = 0, remark: Callable[[], str] = str) -> Iterator[Item]:
    """Iterate over items and report the progress to the listener.

    Args:
        description: name of the work, such as "loops simulated".
        items: items to iterate over.
        total: number of items if they have no length, such as a generator.
        remark: function that is called after each item and returns a short text about the state of the work.

    Yields:
        The items; an item is finished when the next one is requested.
    """
    listener, total = _LISTENER.get(), len(items) if isinstance(items, Collection) else total
    listener(description, 0, total, "")
    try:
        for finished, item in enumerate(items, start=1):
            yield item
            listener(description, finished, total, remark())
    finally:
        listener(description, None, total, "")
