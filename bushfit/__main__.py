"""The command `bushfit`, and `python -m bushfit`: nothing slow is imported before an early Ctrl-C is taken care of.

Warnings of Python and its packages are hidden unless Python was started with -W.
"""

import _thread
import gc
import sys
import time
import warnings

#: Number of new objects before the first garbage collection. Imports create as many objects without reference cycles;
#: with Python's default of 700, garbage collection takes a fifth of the import time.
_OBJECTS = 50_000


def repeat_interrupt(unraisable: "sys.UnraisableHookArgs") -> None:
    """Repeat a Ctrl-C that Python ignores, because it came during a callback of an import; a `sys.unraisablehook`."""
    if issubclass(unraisable.exc_type, KeyboardInterrupt):
        _thread.start_new_thread(_interrupt_soon, ())
    else:
        sys.__unraisablehook__(unraisable)


def _interrupt_soon() -> None:
    """Interrupt the main thread once the callback has ended."""
    time.sleep(0.01)
    _thread.interrupt_main()


def main() -> None:
    """Run the command line; Ctrl-C, or a request to end, prints one line and exits with status 2."""
    if not sys.warnoptions:
        warnings.simplefilter("ignore")  # they are for programmers, who ask for them: python -W default -m bushfit
    gc.set_threshold(_OBJECTS)
    sys.unraisablehook = repeat_interrupt
    try:
        import signal  # slow to import

        signal.signal(signal.SIGTERM, signal.default_int_handler)  # temporary files are removed, as after Ctrl-C
        from bushfit.cli import main as command

        command()
    except KeyboardInterrupt:
        sys.stderr.write("bushfit: aborted\n")
        sys.exit(2)


if __name__ == "__main__":
    main()
