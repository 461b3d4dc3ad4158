"""The command `bushfit`, and `python -m bushfit`: nothing slow is imported before an early Ctrl-C is taken care of.

Warnings of Python and its packages are shown to nobody who did not ask for them.
"""

import gc
import sys
import warnings

#: Objects made before the first search for unused rings of them; importing makes as many without a ring, and Python's
#: own 700 take it a fifth of its time.
_OBJECTS = 50_000


def main() -> None:
    """Entry point of the command line; stopped by Ctrl-C, it says so in a line."""
    if not sys.warnoptions:
        warnings.simplefilter("ignore")  # they are for programmers, who ask for them: python -W default -m bushfit
    gc.set_threshold(_OBJECTS)
    try:
        from bushfit.cli import main as command

        command()
    except KeyboardInterrupt:
        sys.stderr.write("bushfit: aborted\n")
        sys.exit(2)


if __name__ == "__main__":
    main()
