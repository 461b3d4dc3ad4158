"""Command line: one file for each command, which parses the options, calls one function and prints the result."""

import contextlib
import errno
import importlib
import io
import os
import re
import sys
from collections.abc import Callable
from typing import Any, TextIO

import click

from bushfit.errors import BushfitError, OutputError, did_you_mean, printable
from bushfit.version import __version__

#: Commands by heading of `bushfit --help`. The command "fit-static" is `static` in the module fit, any other is
#: `command` in the module of its name, which is imported when the command is called.
_GROUPS = {
    "From tests to a result": ("run", "diagnose", "predict", "respond", "compare", "report", "batch"),
    "Test files": ("inspect", "init", "reduce"),
    "Single fits": ("fit", "fit-static", "fit-dynamic"),
    "To learn bushfit": ("example", "manual"),
    "Plans, simulations and exports": ("plan", "simulate", "export", "schema"),
}
_COMMANDS = [name for commands in _GROUPS.values() for name in commands]
#: Number of characters of the longest command name.
_LONGEST = max(map(len, _COMMANDS))

#: Environment variables that limit linear algebra to one thread, so that rounding does not depend on the machine.
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
#: Longest path that a message quotes, in characters.
_LONGEST_PATH = 300
#: Maximum width of help texts, in characters.
_HELP_WIDTH = 110

#: Backend of matplotlib: writes figures to files. Set explicitly, because notebooks set backends that may be missing.
_BACKEND = "agg"


class _Commands(click.Group):
    """Command group that imports the module of a command when the command is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of all commands, in the order of the help."""
        return _COMMANDS

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import the command with this name; raise a UsageError with a similar name for an unknown one."""
        if cmd_name not in _COMMANDS:
            words = (f"No such command '{cmd_name}'", did_you_mean(cmd_name, _COMMANDS))
            raise click.UsageError("; ".join(filter(None, words)), ctx)
        module, _, step = cmd_name.partition("-")
        return getattr(importlib.import_module(f"bushfit.cli.{module}"), step or "command")

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the commands with the first sentences of their helps under the headings of the help."""
        for heading, names in _GROUPS.items():
            commands = [self.get_command(ctx, name) for name in names]
            helps = [command.get_short_help_str(_HELP_WIDTH) if command else "" for command in commands]
            with formatter.section(heading):
                formatter.write_dl([(name.ljust(_LONGEST), text) for name, text in zip(names, helps, strict=True)])


@click.group(
    "bushfit", cls=_Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": _HELP_WIDTH}
)
@click.version_option(__version__, "-V", "--version", prog_name="bushfit")
def cli() -> None:
    """Fit the stiffness and loss of rubber bushings over frequency and amplitude.

    A CAMPAIGN is a text file (TOML) that describes a bushing and lists its hysteresis loops and stepped-sine sweeps.
    Make a campaign from test files, and evaluate it:

    \b
        bushfit init FILES
        bushfit run CAMPAIGN.toml

    `run` prints the verdict on the model and writes parameters, stiffness tables, plots and a report to
    results/<campaign name>. Other commands on a campaign or model write to a folder in it, such as results/<campaign
    name>/predict. `bushfit COMMAND -h` explains one command.

    Exit status: 0 done; 1 done, but a stated limit is missed; 2 wrong usage or unusable input.
    """


def main(command: click.Command = cli) -> None:
    """Run the command line and exit; errors that the user can correct are printed, with exit status 2.

    Args:
        command: click command to run, by default the group of all commands.
    """
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    os.environ["MPLBACKEND"] = _BACKEND
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(encoding="utf-8", newline="\n")  # whatever the code page: programs read it
    heard, read = _Stream(sys.stderr, is_needed=False), _Stream(sys.stdout, is_needed=True)
    with contextlib.redirect_stderr(heard), contextlib.redirect_stdout(read):
        try:
            status = command.main(sys.argv[1:] or ["--help"], prog_name=command.name, standalone_mode=False)
            if read.fault != os.strerror(errno.EPIPE):  # a reader such as `head` need not read to the end
                read.flush()
        except (Exception, KeyboardInterrupt) as error:
            sys.stderr.write(f"bushfit: {_message(error)}\n")
            status = 2
        sys.exit(status or 0)


def _message(error: BaseException) -> str:
    """Message for an error that ended a command, with the place, what was found and the next step."""
    if isinstance(error, click.exceptions.Abort | KeyboardInterrupt):
        return "aborted"
    if isinstance(error, click.ClickException):
        context = error.ctx if isinstance(error, click.UsageError) else None
        text = " ".join(error.format_message().split())
        if isinstance(error, click.NoSuchOption) and context and not error.possibilities:
            names = [name for parameter in context.command.params for name in parameter.opts]
            similar = [name for name in names if name.startswith(f"-{error.option_name}")]  # --direction for -d
            text += f" Did you mean {' or '.join(map(repr, similar))}?" if similar else ""
        if wrong := re.search(r"'([^']*)' is not one of (.*)\.$", text):
            near = did_you_mean(wrong[1], re.findall(r"'([^']*)'", wrong[2]))
            text = f"{text[:-1]}; {near}" if near else text
        return printable(f"error: {text}  (see {context.command_path if context else 'bushfit'} -h)")
    if isinstance(error, BushfitError):
        return f"error: {error}"
    if isinstance(error, MemoryError):
        return "error: out of memory"
    if isinstance(error, OSError):  # of a path that was typed or that a file names
        path = printable(str(error.filename or ""))[:_LONGEST_PATH]
        return f"error: {f'{path}: ' if path else ''}this cannot be opened\n  found: {error.strerror}"
    if os.environ.get("BUSHFIT_TRACEBACK"):  # a fault of bushfit, not of its user
        raise error
    return (
        f"an internal error of bushfit: {type(error).__name__}: {printable(str(error))}\n"
        "  try: set BUSHFIT_TRACEBACK=1, run again, and report what it prints"
    )


class _Stream:
    """Wrapper of standard output or standard error that handles closed pipes and full disks.

    If writing fails, a stream that `is_needed` (for results) raises an OutputError; a stream for messages drops the
    text.

    Attributes:
        fault: reason why writing failed; None if it did not fail.
    """

    def __init__(self, stream: TextIO | None, *, is_needed: bool) -> None:
        self._stream, self._is_needed = stream, is_needed
        self.fault = None if stream else "it is closed"

    def write(self, text: str) -> int:
        """Write a text to standard output or error; return the number of characters written."""
        return self._attempt(lambda stream: stream.write(text))

    def flush(self) -> None:
        """Write the buffered text to standard output or error."""
        if self._stream:
            self._attempt(lambda stream: stream.flush())

    def __getattr__(self, name: str) -> Any:
        """Return the attribute of standard output or error that this wrapper does not define, such as `isatty`."""
        return getattr(self._stream, name)

    def _attempt(self, work: Callable[[TextIO], int | None]) -> int:
        """Call a function that writes to the stream; return its result, or 0 if the stream cannot be written."""
        if self._stream and not self.fault:
            try:
                return work(self._stream) or 0
            except OSError as error:
                self.fault = error.strerror or str(error)
                nowhere = os.open(os.devnull, os.O_WRONLY)
                os.dup2(nowhere, self._stream.fileno())  # or Python tries again in the end
                os.close(nowhere)
        if self._is_needed:
            raise OutputError(f"standard output cannot be written: {self.fault}")
        return 0
