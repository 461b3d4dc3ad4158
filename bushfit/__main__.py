"""The command `bushfit`, and `python -m bushfit`: nothing slow is imported before an early Ctrl-C is taken care of."""

import sys


def main() -> None:
    """Entry point of the command line; stopped by Ctrl-C, it says so in a line."""
    try:
        from bushfit.cli import main as command

        command()
    except KeyboardInterrupt:
        sys.stderr.write("bushfit: aborted\n")
        sys.exit(2)


if __name__ == "__main__":
    main()
