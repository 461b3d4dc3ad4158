"""Coverage-guided fuzzing: `python -m tests.fuzz --seconds 60 [--target readers|campaign|model|...] [--keep]`.

Needs the dependency group `fuzz`. Starts from the corpus beside this file; what crashes, takes ten seconds of
processor time, hangs for five minutes or takes more than 2 GiB is left in the working folder as crash-*, timeout-* or
oom-*, and the exit status is 1. With --keep the inputs that reach new code are added to the corpus, and listed: name
each after what it shows.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
TARGETS = ("readers", "campaign", "plan", "model", "workbook", "report")
LIMITS = ("-max_len=4096", "-timeout=300", "-rss_limit_mb=2048")


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--seconds", type=int, default=60, help="for each target")
    parser.add_argument("--target", choices=TARGETS, action="append")
    parser.add_argument("--keep", action="store_true", help="add what reaches new code to the corpus, to be named")
    options = parser.parse_args()
    failed = []
    for target in options.target or TARGETS:
        corpus = HERE / "corpus" / target
        corpus.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory() as found:
            time = f"-max_total_time={options.seconds}"
            if fuzz(target, found, str(corpus), time, "-print_final_stats=1", *LIMITS):
                failed.append(target)
            if options.keep:
                known = set(corpus.iterdir())
                fuzz(target, "-merge=1", str(corpus), found, *LIMITS)
                for added in sorted(set(corpus.iterdir()) - known):
                    print(f"to be named after what it shows: {added}")
    print(f"failed: {', '.join(failed)}" if failed else "no crash, no hang, no blow-up of memory")
    return int(bool(failed))


def fuzz(target: str, *arguments: str) -> int:
    """libFuzzer in a process of its own, because it ends the process that it runs in."""
    return subprocess.run(
        [sys.executable, "-W", "error", str(HERE / "run.py"), target, *arguments], check=False
    ).returncode


if __name__ == "__main__":
    sys.exit(main())
