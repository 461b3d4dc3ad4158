"""Mutations of files and options: `python -m tests.fuzz [COMMAND...] [--cases 2000] [--first 0] [--seconds 240]`."""

import argparse
import sys
import tempfile
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[1] / name) for name in ("fuzz", "cli", ".")]
from mutations import LINES, faults  # noqa: E402


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("command", nargs="*", default=[*LINES])
    parser.add_argument("--cases", type=int, default=2000, help="of each command")
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--seconds", type=float, default=240.0, help="for each command")
    asked, wrong = parser.parse_args(), 0
    for command in asked.command:
        with tempfile.TemporaryDirectory() as folder:
            count, found = faults(
                command, range(asked.first, asked.first + asked.cases), Path(folder) / "work", asked.seconds
            )
        print(f"{command}: {count} cases, {len(found)} faults", *found, sep="\n", flush=True)
        wrong += len(found)
    return min(wrong, 1)


if __name__ == "__main__":
    sys.exit(main())
