"""`bushfit fit-static`, `fit-dynamic` and `fit`: loops, sweeps, or both together -> parameters."""

from contextlib import nullcontext
from pathlib import Path

import click

from bushfit.cli.common import Task, open_model, progress, with_task
from bushfit.cli.options import FILE, command_called, place_option
from bushfit.cli.show import tell_fit


@command_called("fit-static", "configs/cmp_15961.toml")
@click.option("--dynamic", type=FILE, help="Hold the springpot at m and alpha of this dynamic.json or model.json.")
@with_task()
def static(dynamic: Path | None, task: Task) -> None:
    """Fit mu, sigma_fmax and eps_half to the hysteresis loops of CAMPAIGN, the springpot held.

    m and alpha come from --dynamic, or from [fit] of the campaign where it gives both. Where they are not known
    yet the springpot is left out, and a warning says what this does to the result.

    Writes static.json, loops.csv and loops.png.
    """
    from bushfit.jobs.fits import FitStatic

    task.perform(FitStatic(open_model(dynamic) if dynamic else None), tell_fit)


@command_called("fit-dynamic", "configs/cmp_15961.toml")
@click.option(
    "--static",
    type=FILE,
    help="Hold mu, sigma_fmax and eps_half at those of this static.json [fitted to the loops on the spot].",
)
@with_task()
def dynamic(static: Path | None, task: Task) -> None:
    """Fit m and alpha to the smallest-amplitude sweep of CAMPAIGN, the other three held.

    They are held at --static, and their errors are carried over. Without it the loops of CAMPAIGN are fitted first,
    as fit-static does. [fit] dynamic_amplitudes in the campaign chooses other sweep amplitudes.

    Writes dynamic.json, which `bushfit predict` takes as it is, sweeps.csv and sweeps.png.
    """
    from bushfit.jobs.fits import FitDynamic

    task.perform(FitDynamic(open_model(static) if static else None), tell_fit)


@command_called("fit", "configs/arm_bushing.toml --direction axial --direction radial --profile")
@place_option(
    "Tests to fit: axial, radial or torsion, or a specimen's name; may be given again [axial, as in the paper, and all "
    "specimens; of loops, or of sweeps, all where none is axial]."
)
@click.option(
    "--effect",
    "effects",
    multiple=True,
    metavar="NAME",
    help="Add an effect to the paper's three and to those of [fit] effects, such as inertia; may be given again. A "
    "wrong NAME lists them all.",
)
@click.option("--profile", is_flag=True, help="Add 95 % intervals by profile likelihood (some seconds).")
@with_task()
def fit(directions: tuple[str, ...], effects: tuple[str, ...], profile: bool, task: Task) -> None:
    """Fit all five parameters to the loops and sweeps of CAMPAIGN together.

    Writes model.json, and the tables and plots of both: loops.csv, loops.png, sweeps.csv, sweeps.png. Tests in
    directions that were not fitted are shown as predictions.

    Where [fit] of the campaign holds all five (vary = false) nothing is fitted, and it is said how well the values
    given meet the tests.

    --profile moves each parameter until the fit of all others is worse than chance allows: slower than the interval
    from the standard error, and right where that is not, as where a parameter is hardly determined.
    """
    from bushfit.jobs.fits import Fit

    with progress(task.options, "profile of") if profile else nullcontext() as advance:
        task.perform(Fit(directions, effects, advance), tell_fit)
