"""Simulated campaigns with known truths, and scores of tools on them: `python -m tests.scorecard --help`."""

import os
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices, and times that mean one processor

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parent))  # as pytest does
    from benchmark import benchmark
    from rubber_card import rubber_command
    from sessions import sessions_command

    benchmark.add_command(rubber_command)
    benchmark.add_command(sessions_command)
    benchmark()
