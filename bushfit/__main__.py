"""The command `bushfit`, and `python -m bushfit`: nothing slow is imported before an early Ctrl-C is taken care of.

Warnings of Python and its packages are hidden unless Python was started with -W.
"""

import gc
import sys
import warnings

#: Number of new objects before the first garbage collection. Imports create as many objects without reference cycles;
#: with Python's default of 700, garbage collection takes a fifth of the import time.
_OBJECTS = 50_000


def main() -> None:
    """Run the command line; Ctrl-C prints one line and exits with status 2."""
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
