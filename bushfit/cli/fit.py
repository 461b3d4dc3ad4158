"""`bushfit fit-static`, `fit-dynamic` and `fit`: loops, sweeps, or both together -> parameters."""

from pathlib import Path

from bushfit.cli.common import Task, open_model, with_task
from bushfit.cli.options import command_called, effect_option, file_option, flag, place_option, under
from bushfit.cli.show import tell_fit


@command_called("fit-static", "configs/cmp_15961.toml")
@under("How it is fitted", file_option("--dynamic", "Hold m and alpha at those of this dynamic.json."))
@with_task()
def static(dynamic: Path | None, task: Task) -> None:
    """Fit mu, sigma_fmax and eps_half to the hysteresis loops of CAMPAIGN, at given m and alpha.

    These come from --dynamic, or from [fit] of the campaign. Where they are not known yet the part of the model that
    depends on frequency (the springpot) is left out, and a warning says what this does to the result.

    Writes static.json, loops.csv and loops.png.
    """
    from bushfit.jobs.fits import FitStatic

    task.perform(FitStatic(open_model(dynamic) if dynamic else None), tell_fit)


@command_called("fit-dynamic", "configs/cmp_15961.toml")
@under(
    "How it is fitted",
    file_option(
        "--static", "Hold mu, sigma_fmax and eps_half at those of this static.json [the loops are fitted first]."
    ),
)
@with_task()
def dynamic(static: Path | None, task: Task) -> None:
    """Fit m and alpha to the smallest-amplitude sweep of CAMPAIGN, at given mu, sigma_fmax and eps_half.

    These come from --static, and their errors are carried over; without it the loops of CAMPAIGN are fitted first.
    [fit] dynamic_amplitudes in the campaign chooses other sweep amplitudes.

    Writes dynamic.json, a model that bushfit predict takes, sweeps.csv and sweeps.png.
    """
    from bushfit.jobs.fits import FitDynamic

    task.perform(FitDynamic(open_model(static) if static else None), tell_fit)


@command_called("fit", "configs/arm_bushing.toml --direction axial --direction radial --profile")
@under(
    "What is fitted",
    place_option(
        "Tests in this direction (axial, radial, torsion) or of this specimen; may be given again [axial, and all "
        "specimens]."
    ),
    effect_option("Add an effect to the model, such as inertia; may be given again. A wrong NAME lists all."),
    flag("--profile", "Add 95 % intervals by profile likelihood (some seconds)."),
)
@with_task()
def fit(directions: tuple[str, ...], effects: tuple[str, ...], profile: bool, task: Task) -> None:
    """Fit all five parameters to the loops and sweeps of CAMPAIGN together.

    This is the fit to use: bushfit predict takes its model. Without axial loops, or axial sweeps, it takes those of all
    directions. Tests that were not fitted are shown as predictions. Where [fit] of the campaign holds all five
    (vary = false) nothing is fitted, and it is said how well the values given meet the tests. --profile is right also
    where a parameter is hardly determined and the interval from the standard error is not.

    Writes model.json, and of loops and sweeps a table and a plot each.
    """
    from bushfit.jobs.fits import Fit

    task.perform(Fit(directions, effects, profile), tell_fit)
