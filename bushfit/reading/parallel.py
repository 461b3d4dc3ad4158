"""Work on long arrays, chunk by chunk on all cores; a chunk stays in a core's cache."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

_Answer = TypeVar("_Answer")
#: Entries of a chunk: 2 MiB of float64, which a core's cache holds.
CHUNK = 1 << 18


def by_chunks(work: Callable[[slice], _Answer], size: int, chunk: int = CHUNK) -> list[_Answer]:
    """What `work` makes of each chunk of a long array, in order.

    NumPy lets other threads run while it works on a chunk. The chunks of an array of `size` entries, and so the
    numbers, are the same on any number of cores.
    """
    chunks = [slice(start, min(start + chunk, size)) for start in range(0, size, chunk)]
    if len(chunks) < 2:
        return [work(entries) for entries in chunks]
    with ThreadPoolExecutor(os.cpu_count()) as threads:
        return list(threads.map(work, chunks))
