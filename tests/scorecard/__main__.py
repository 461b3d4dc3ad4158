"""How often is diagnose right? Judged on hidden campaigns: `python -m tests.scorecard --help`."""

import sys
from pathlib import Path

from bushfit.cli import main

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parent))  # as the tests have it
    from cards.command import command

    main(command)
