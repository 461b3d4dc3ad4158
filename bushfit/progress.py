"""How far long work is: counted where it is done, told to whoever listens, such as the command line."""

from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

_Item = TypeVar("_Item")
#: Told what is being done, how many of it are done (None at its end), of how many, and a remark.
Listener = Callable[[str, int | None, int, str], None]
_LISTENER = ContextVar[Listener]("_LISTENER", default=lambda *_: None)


@contextmanager
def report_progress_to(listener: Listener) -> Iterator[None]:
    """All work within is told to the listener."""
    token = _LISTENER.set(listener)
    try:
        yield
    finally:
        _LISTENER.reset(token)


def track(what: str, items: Iterable[_Item], total: int = 0, remark: Callable[[], str] = str) -> Iterator[_Item]:
    """The items one by one, each counted when its work is done: of so many, where they have no length themselves."""
    listener, total = _LISTENER.get(), len(items) if isinstance(items, Collection) else total
    listener(what, 0, total, "")
    try:
        for done, item in enumerate(items, start=1):
            yield item
            listener(what, done, total, remark())
    finally:
        listener(what, None, total, "")
