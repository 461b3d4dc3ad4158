"""How far long work is: counted where it is done, told to whoever listens, such as the command line."""

from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

_Item = TypeVar("_Item")
#: Told what is being done, how many of it are done (None at its end), of how many (None: not known), and a remark.
Listener = Callable[[str, int | None, int | None, str], None]
_LISTENER = ContextVar[Listener]("_LISTENER", default=lambda *_: None)


@contextmanager
def heard_by(listener: Listener) -> Iterator[None]:
    """All work within is told to the listener."""
    token = _LISTENER.set(listener)
    try:
        yield
    finally:
        _LISTENER.reset(token)


@contextmanager
def counted(what: str, total: int | None = None) -> Iterator[Callable[[str], None]]:
    """Work of one kind, such as "runs simulated", of so many parts; to be called, with a remark, after each of them."""
    listener, done = _LISTENER.get(), 0

    def advance(remark: str = "") -> None:
        nonlocal done
        done += 1
        listener(what, done, total, remark)

    listener(what, 0, total, "")
    try:
        yield advance
    finally:
        listener(what, None, total, "")


def counting(what: str, items: Collection[_Item]) -> Iterator[_Item]:
    """The items one by one, each counted when its work is done."""
    with counted(what, len(items)) as advance:
        for item in items:
            yield item
            advance("")
