"""`bushfit fit`: loops and sweeps -> all parameters together."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path

import click

from bushfit.cli.common import (
    Options,
    campaign_argument,
    loss_option,
    max_nrmse_option,
    perform,
    shared_options,
    tell_fit,
)


@click.command("fit")
@campaign_argument
@click.option(
    "--direction",
    "directions",
    type=click.Choice(["axial", "radial", "torsion"]),
    multiple=True,
    help="Tests to fit; may be given again [axial, as in the paper; of loops, or of sweeps, all where none is axial].",
)
@click.option(
    "--effect",
    "effects",
    multiple=True,
    metavar="NAME",
    help="Add an effect to the paper's three, such as inertia; may be given again. A wrong NAME lists them all.",
)
@click.option("--profile", is_flag=True, help="Add 95 % intervals by profile likelihood (some seconds).")
@loss_option
@max_nrmse_option
@shared_options
def command(
    campaign: Path,
    directions: tuple[str, ...],
    effects: tuple[str, ...],
    profile: bool,
    loss: str | None,
    max_nrmse: float | None,
    options: Options,
) -> None:
    """Fit all five parameters to the loops and sweeps of CAMPAIGN together.

    Writes model.json, and the tables and plots of both: loops.csv, loops.png, sweeps.csv, sweeps.png. Tests in
    directions that were not fitted are shown as predictions.

    --profile moves each parameter until the fit of all others is worse than chance allows: slower than the interval
    from the standard error, and right where that is not, as where a parameter is hardly determined.
    """
    from bushfit.geometry import Direction
    from bushfit.jobs.fits import Fit

    chosen = tuple(Direction(direction) for direction in directions)
    with _progress(options) if profile else nullcontext() as advance:
        perform(options, campaign, Fit(chosen, effects, advance), tell_fit, max_nrmse, loss)


@contextmanager
def _progress(options: Options) -> Iterator[Callable[[str, int], None]]:
    """Which parameter's profile is done: a bar on a terminal, a line each elsewhere."""
    from rich.progress import Progress

    console = options.console
    if not console.is_terminal:
        yield lambda name, left: console.print(f"profile of {name}: done, {left} to go", markup=False)
        return
    with Progress(console=console, transient=True) as bar:
        task = bar.add_task("profiles", total=None)

        def advance(name: str, left: int) -> None:
            done = bar.tasks[0].completed + 1
            bar.update(task, completed=done, total=done + left, description=f"profile of {name}: done")
            if not left:
                bar.stop()

        yield advance
