"""Score card of rubber that does not follow the package's laws: `python -m tests.scorecard rubber --help`."""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import click
import numpy as np
import pandas as pd
from click.testing import CliRunner
from held_back_rubbers import HELD_BACK_RUBBERS
from rubber_campaign import (
    BUSHING,
    CORRECT_NAMES,
    FAULTS,
    LOOP_FREQUENCY,
    LOOP_SAMPLES,
    Fault,
    RubberCampaign,
    simulate_campaign,
    write_campaign,
)
from rubber_in_time import Array
from scipy.optimize import least_squares
from scipy.stats import binomtest
from time_rig import AXIAL, DIRECTIONS, Rubber, Tests, respond
from working_rubbers import WORKING_RUBBERS

from bushfit.cli import cli

SETS = {"working": WORKING_RUBBERS, "held_back": HELD_BACK_RUBBERS}
#: Points per loop that count in the misfit.
_LOOP_POINTS = 40
#: Levels of effects that do not belong to the rubber.
_OUTSIDE_THE_RUBBER = ("component", "instrument", "record")
#: Verdicts that keep every name, and the size of a set of names up to which a correct one counts.
_KEEPING, _LARGEST_SET = ("named", "partly"), 4
#: Start of the search for the least misfit: mu [Pa], m [Pa s^alpha], alpha, sigma_fmax [Pa], eps_half.
_START = np.log([8e5, 2.5e5, 0.2, 2e4, 2e-2])
#: Gap on held-out data, in units of the noise, above which "named" is wrong.
_GAP_LIMIT = 1.5


@dataclass(frozen=True)
class RubberOutcome:
    """Results of `fit`, `predict` and `diagnose` on one campaign.

    Args:
        rubber, fault, seed: of the campaign.
        misfit: root mean square relative misfit of the fitted parameters.
        least_misfit: the least that five parameters reach on the same tests.
        covered: shares of stiffness magnitudes and loss factors of the truth inside the bands of `predict`.
        half_width: median half width of the bands of the stiffness magnitude, relative.
        verdict: of `diagnose`; "" if it was not run.
        gap: on held-out data after the diagnosis, in units of the noise; None if nothing was held out.
        fault_found: True if a correct name of the fault is kept or in a set of at most four.
        wrong_names: names of rig or component that are kept and not correct.
        seconds: processor time of `fit` and of `diagnose`.
        error: message of a command that failed, or "".
    """

    rubber: str
    fault: Fault
    seed: int
    misfit: float = np.nan
    least_misfit: float = np.nan
    covered: float = np.nan
    half_width: float = np.nan
    verdict: str = ""
    gap: float | None = None
    fault_found: bool = False
    wrong_names: tuple[str, ...] = ()
    seconds: tuple[float, float] = (0.0, 0.0)
    error: str = ""


def relative_residuals(campaign: RubberCampaign) -> Callable[[Array], Array]:
    """Misfit of the paper's model, as a function of its parameters, to the axial tests: those that `fit` fits.

    Returns:
        Function of the logarithms of mu, m, alpha, sigma_fmax and eps_half: relative residuals, real and imaginary of
        every sweep point, and of forty points of the last cycle of every loop relative to half its force range.

    Notes:
        The model is that of time_rig, which is independent of the package.
    """
    sweep = campaign.sweeps[AXIAL]
    measured = sweep[:, 2] + 1j * sweep[:, 3]
    points, index = np.unique(sweep[:, :2], axis=0, return_inverse=True)
    loops = [(LOOP_FREQUENCY, amplitude) for _, amplitude in campaign.loops]
    frequency, amplitude = np.vstack([points, loops]).T
    zeros = np.zeros(frequency.size, int)
    is_loop = np.arange(frequency.size) >= len(points)
    tests = Tests(BUSHING, frequency, amplitude, zeros + DIRECTIONS.index(AXIAL), zeros, zeros + 1, is_loop)
    phase = np.arange(_LOOP_POINTS) / _LOOP_POINTS
    cycle = np.arange(LOOP_SAMPLES) / LOOP_SAMPLES
    forces = np.array([np.interp(phase, cycle, record[-LOOP_SAMPLES:, 2]) for record, _ in campaign.loops])
    ranges = 0.5 * np.ptp(forces, axis=1, keepdims=True)

    def residuals(logarithms: Array) -> Array:
        response = respond(tests, Rubber(*np.exp(logarithms)))
        of_sweep = (response.stiffness[~is_loop][index] - measured) / np.abs(measured)
        samples = np.arange(response.force.shape[1]) / response.force.shape[1]
        # the rig moves as -cos(2 pi phase), the recorded loop as sin(2 pi phase)
        model = [np.interp(phase + 0.25, samples, force, period=1.0) for force in response.force[is_loop]]
        return np.concatenate([of_sweep.real, of_sweep.imag, ((np.array(model) - forces) / ranges).ravel()])

    return residuals


def least_misfit(residuals: Callable[[Array], Array], fitted: Array) -> float:
    """Root mean square of the residuals at their minimum, searched from a fixed start and from the fitted values."""
    bounds = np.log([[1e3, 1e2, 0.02, 1e1, 1e-5], [1e8, 1e8, 1.0, 1e7, 10.0]])
    starts = (_START, np.clip(fitted, bounds[0] + 1e-6, bounds[1] - 1e-6))
    costs = [least_squares(residuals, start, bounds=bounds, x_scale=0.1, max_nfev=60).fun for start in starts]
    return min(root_mean_square(cost) for cost in costs)


def root_mean_square(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def run_command(*arguments: object) -> None:
    """Run a command of the package.

    Raises:
        RuntimeError: it ended with an error; the message is what it printed.
    """
    result = CliRunner().invoke(cli, [*map(str, arguments), "--quiet", "--no-plots"])
    if result.exit_code == 2 or (result.exception and not isinstance(result.exception, SystemExit)):
        raise RuntimeError(f"{arguments[0]}: {result.exception!r} {result.stderr}".strip())


def evaluate(campaign: RubberCampaign, seed: int, *, diagnose: bool = True) -> RubberOutcome:
    """Write a campaign, run the commands on it and compare the results with the truth."""
    identity: dict[str, Any] = {"rubber": campaign.rubber, "fault": campaign.fault, "seed": seed}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_campaign(campaign, folder)
        try:
            started = time.process_time()
            run_command("fit", folder / "bushing.toml", "-o", folder / "fit")
            fit_seconds = time.process_time() - started
            result = _evaluate_fit(campaign, folder)
            started = time.process_time()
            if diagnose:
                run_command("diagnose", folder / "bushing.toml", "-o", folder / "diagnosis", "--no-report")
                document = json.loads((folder / "diagnosis/diagnosis.json").read_text(encoding="utf-8"))
                result |= judge(campaign.fault, document)
            return RubberOutcome(**identity, **result, seconds=(fit_seconds, time.process_time() - started))
        except RuntimeError as error:
            return RubberOutcome(**identity, error=str(error))


def _evaluate_fit(campaign: RubberCampaign, folder: Path) -> dict[str, Any]:
    """Misfit of the fitted parameters, and coverage by the bands of `predict`."""
    parameters = json.loads((folder / "fit/model.json").read_text(encoding="utf-8"))["parameters"]
    fitted = np.log([parameters[name]["value"] for name in ("mu", "m", "alpha", "sigma_fmax", "eps_half")])
    residuals = relative_residuals(campaign)
    inside, half_widths = [], []
    for direction, truth in campaign.truth.items():
        grids = []
        for column, unit, factor in ((0, "Hz", 1.0), (1, "mm", 1e3)):
            values = ", ".join(f"{factor * value:.10g}" for value in np.unique(truth[:, column]))
            grids.append(f"{values} {unit}")
        options = ("--direction", direction, "--frequencies", grids[0], "--amplitudes", grids[1])
        run_command("predict", folder / "fit/model.json", *options, "-o", folder / direction)
        table = pd.read_csv(folder / direction / f"{direction}.csv")
        real, imaginary = truth[:, 2], truth[:, 3]
        true_values = {"stiffness [N/mm]": 1e-3 * np.hypot(real, imaginary), "loss factor [-]": imaginary / real}
        for quantity, values in true_values.items():
            low, high = (table[f"{quantity}, {end}"].to_numpy() for end in ("low", "high"))
            inside.append((low <= values) & (values <= high))
            if quantity.startswith("stiffness"):
                half_widths.append(0.5 * (high - low) / values)
    return {
        "misfit": root_mean_square(residuals(fitted)),
        "least_misfit": least_misfit(residuals, fitted),
        "covered": float(np.mean(np.concatenate(inside))),
        "half_width": float(np.median(np.concatenate(half_widths))),
    }


def judge(fault: Fault, diagnosis: Mapping[str, Any]) -> dict[str, Any]:
    """Verdict, held-out gap and names of a diagnosis.json, compared with the fault of the rig."""
    verdict, found, wrong = str(diagnosis["verdict"]), False, []
    for effect in diagnosis["effects"]:
        alternatives = effect.get("alternatives", ())
        kept = verdict in _KEEPING or (verdict == "ambiguous" and not alternatives)
        names = (effect["name"], *effect.get("twins", ()))
        if is_correct(fault, names):
            found = True
        elif kept and effect["level"] in _OUTSIDE_THE_RUBBER:
            wrong.append(effect["name"])
        elif not kept and len(alternatives) < _LARGEST_SET and is_correct(fault, alternatives):
            found = True
    held_out = diagnosis["gap"]["heldout"] or {"after": None}
    return {"verdict": verdict, "gap": held_out["after"], "fault_found": found, "wrong_names": tuple(wrong)}


def is_correct(fault: Fault, names: Sequence[str]) -> bool:
    """Whether one of the names, or a part of a combination, describes the fault; its direction does not matter."""
    parts = [part.strip() for name in names for part in name.split(" + ")]
    return any(part.partition(".")[0] in CORRECT_NAMES[fault] for part in parts)


def campaigns(chosen: str, seed: int, with_faults: bool) -> Iterator[tuple[str, Fault, int]]:
    """Rubber, fault and seed of one campaign after another; all rubbers, and all faults, occur equally often."""
    random = np.random.default_rng([seed, list(SETS).index(chosen), with_faults])
    faults = FAULTS[1:] if with_faults else FAULTS[:1]
    while True:
        for rubber in SETS[chosen]:
            for fault in faults:
                yield rubber, fault, int(random.integers(2**31))


def _evaluate_task(task: tuple[str, Fault, int], diagnose: bool) -> RubberOutcome:
    return evaluate(simulate_campaign(*task), task[2], diagnose=diagnose)


def format_table(outcomes: Sequence[RubberOutcome]) -> str:
    """Rows of the card as Markdown: measure, result, number of campaigns."""
    usable = [outcome for outcome in outcomes if not outcome.error]
    clean, faulty = ([o for o in usable if bool(o.fault) is fault] for fault in (False, True))
    diagnosed = [outcome for outcome in usable if outcome.verdict]
    rows: list[tuple[str, str, int]] = [("no result", str(len(outcomes) - len(usable)), len(outcomes))]
    if clean:
        ratios = [outcome.misfit / outcome.least_misfit for outcome in clean]
        widths = [outcome.half_width / outcome.misfit for outcome in clean]
        rows += [
            (
                "misfit over the least of five parameters, median / worst",
                f"{np.median(ratios):.2f} / {max(ratios):.2f}",
                len(clean),
            ),
            ("  above 1.3", str(sum(ratio > 1.3 for ratio in ratios)), len(clean)),
            ("truth inside the bands of `predict`", f"{100 * np.mean([o.covered for o in clean]):.1f} %", len(clean)),
            ("median half width of the bands over the misfit", f"{np.median(widths):.2f}", len(clean)),
        ]
    named_badly = [o.verdict == "named" and (o.gap or 0.0) > _GAP_LIMIT for o in diagnosed]
    shares = (
        ("rig faults found, or in a set of at most four", [o.fault_found for o in faulty if o.verdict]),
        ("wrong name of rig or component kept", [bool(o.wrong_names) for o in diagnosed]),
        (f"verdict named, held-out gap above {_GAP_LIMIT:g}", named_badly),
    )
    rows += [(name, _format_share(hits), len(hits)) for name, hits in shares if hits]
    seconds = np.array([outcome.seconds for outcome in usable])
    if len(usable):
        median, longest = np.median(seconds, axis=0), seconds.max(axis=0)
        times = ", ".join(f"{m:.1f} / {most:.1f} s" for m, most in zip(median, longest, strict=True))
        rows.append(("processor time of fit, of diagnose: median / longest", times, len(usable)))
    return "\n".join(f"| {name} | {figure} | {count} |" for name, figure, count in rows)


def _format_share(hits: Sequence[bool]) -> str:
    """Count and percentage with the exact 95 % interval (Clopper and Pearson 1934)."""
    ends = binomtest(sum(hits), len(hits)).proportion_ci()
    return f"{sum(hits)} = {100 * np.mean(hits):.0f} % ({100 * ends.low:.0f} to {100 * ends.high:.0f})"


def format_outcome(outcome: RubberOutcome) -> str:
    """One campaign in a line."""
    start = f"{outcome.seed:10d} {outcome.rubber:28s} {outcome.fault:13s}"
    if outcome.error:
        return f"{start} {outcome.error}"
    ratio = outcome.misfit / outcome.least_misfit
    fit = f"misfit {100 * outcome.misfit:5.2f} % ({ratio:.2f} x least) covered {100 * outcome.covered:5.1f} %"
    gap = "" if outcome.gap is None else f" gap {outcome.gap:.2f}"
    return f"{start} {fit} {outcome.verdict}{gap} {'found' * outcome.fault_found} {' '.join(outcome.wrong_names)}"


@click.command("rubber")
@click.option("--seed", type=int, default=1, show_default=True, help="Of everything random.")
@click.option("--campaigns", "count", type=click.IntRange(0), default=45, show_default=True, help="Without rig faults.")
@click.option("--faulty", type=click.IntRange(0), default=40, show_default=True, help="Campaigns with rig faults.")
@click.option("--set", "chosen", type=click.Choice(list(SETS)), default="working", show_default=True)
@click.option("--jobs", type=click.IntRange(1), default=1, show_default=True, help="Cores.")
@click.option("--fit-only", is_flag=True, help="Do not run diagnose.")
@click.option("--lines", is_flag=True, help="Print a line per campaign (not for the set that is held back).")
def rubber_command(seed: int, count: int, faulty: int, chosen: str, jobs: int, fit_only: bool, lines: bool) -> None:
    """Fit and diagnose simulated rubber of other laws, and print how close the results are to the truth.

    Ten materials from the literature are computed in the time domain, by code that is independent of the package. Five
    of them are held back.
    """
    tasks = [*islice(campaigns(chosen, seed, False), count), *islice(campaigns(chosen, seed, True), faulty)]
    outcomes = []
    with ProcessPoolExecutor(jobs) as pool:
        for outcome in pool.map(partial(_evaluate_task, diagnose=not fit_only), tasks):
            outcomes.append(outcome)
            if lines and chosen != "held_back":
                click.echo(format_outcome(outcome))
    click.echo(format_table(outcomes))
