"""Long arrays in chunks that stay in a core's cache, on all cores."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

_Answer = TypeVar("_Answer")
#: Numbers of a chunk.
CHUNK = 1 << 18


def by_chunks(work: Callable[[slice], _Answer], size: int, chunk: int = CHUNK) -> list[_Answer]:
    """What `work` makes of each chunk of a long array, in order.

    NumPy lets other threads run while it works on a chunk. The chunks, and so the numbers, are the same on any number
    of cores.

    Args:
        work: called with the entries of a chunk, in any thread.
        size: entries of the array.
        chunk: entries of a chunk.
    """
    chunks = [slice(start, min(start + chunk, size)) for start in range(0, size, chunk)]
    if len(chunks) < 2:
        return [work(entries) for entries in chunks]
    with ThreadPoolExecutor(os.cpu_count()) as threads:
        return list(threads.map(work, chunks))
