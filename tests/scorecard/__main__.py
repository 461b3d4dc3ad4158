"""Score cards of the package on simulated campaigns: `python -m tests.scorecard --help`."""

import os
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices, and times that mean one processor

from bushfit.cli import main

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parent))  # as pytest does
    from benchmark import benchmark
    from cards.command import command
    from rubber_card import rubber_command

    if sys.argv[1:2] == ["rubber"]:
        del sys.argv[1]
        main(rubber_command)
    elif sys.argv[1:2] and sys.argv[1] in benchmark.commands:
        benchmark()
    else:
        main(command)
