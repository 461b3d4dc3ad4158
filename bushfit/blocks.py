"""Long arrays in blocks that stay in a core's cache, on all cores."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

_Answer = TypeVar("_Answer")
#: Numbers of a block.
BLOCK = 1 << 18


def by_blocks(work: Callable[[slice], _Answer], size: int, block: int = BLOCK) -> list[_Answer]:
    """What `work` makes of each block of a long array, in order.

    NumPy lets other threads run while it works on a block. The blocks, and so the numbers, are the same on any number
    of cores.

    Args:
        work: called with the entries of a block, in any thread.
        size: entries of the array.
        block: entries of a block.
    """
    blocks = [slice(start, min(start + block, size)) for start in range(0, size, block)]
    if len(blocks) < 2:
        return [work(entries) for entries in blocks]
    with ThreadPoolExecutor(os.cpu_count()) as threads:
        return list(threads.map(work, blocks))
