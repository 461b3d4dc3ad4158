"""Fits to rubber that does not follow the package's laws: `python -m tests.scorecard rubber --help`."""

import json
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from itertools import cycle, islice
from pathlib import Path

import click
import numpy as np
import pandas as pd
from click.testing import CliRunner
from lab_campaign import campaign, draw
from other_rubbers import HELD_BACK_RUBBERS, WORKING_RUBBERS
from scipy.optimize import least_squares
from time_rig import DIRECTIONS, SAMPLES, Array, Rubber, Tests, respond

from bushfit.campaign.campaign import Campaign, load_campaign
from bushfit.cli import cli

SETS = {"used in development": WORKING_RUBBERS, "not used": HELD_BACK_RUBBERS}
#: The five parameters, and bounds of their logarithms.
FIVE = ("mu", "m", "alpha", "sigma_fmax", "eps_half")
BOUNDS = np.log([[1e3, 1e2, 0.02, 1e1, 1e-5], [1e8, 1e8, 1.0, 1e7, 10.0]])


def run_command(*arguments: object) -> None:
    """Run a command of the package, which must succeed."""
    result = CliRunner().invoke(cli, [*map(str, arguments), "--quiet", "--no-plots"])
    assert result.exit_code != 2, result.stderr
    assert not result.exception or isinstance(result.exception, SystemExit), result.exception


def chosen(tests: Tests, rows: Array) -> Tests:
    """Some of the tests."""
    names = ("frequency", "amplitude", "direction", "level", "repeat", "loop")
    return replace(tests, **{name: getattr(tests, name)[rows] for name in names})


def relative_residuals(tests: Tests, measured: Campaign) -> Callable[[Array], Array]:
    """Misfit of the paper's model, that of time_rig, as a function of the logarithms of its parameters.

    Args:
        tests: of one direction.
        measured: the same tests as they were read.

    Returns:
        Function of (5,): real and imaginary part of every sweep point relative to |K|, and 32 points of the last
        cycle of every loop relative to half the range of its force.
    """
    stiffness = np.concatenate([sweep.stiffness for sweep in measured.sweeps])
    forces = np.array([loop.force[-SAMPLES::8] for loop in measured.loops]).reshape(-1, SAMPLES // 8)
    ranges = 0.5 * np.ptp(forces, axis=1, keepdims=True)

    def residuals(logarithms: Array) -> Array:
        model = respond(tests, Rubber(*np.exp(logarithms)))
        sweeps = (model.stiffness[~tests.loop] - stiffness) / np.abs(stiffness)
        loops = (model.force[tests.loop, ::8] - forces) / ranges
        return np.concatenate([sweeps.real, sweeps.imag, loops.ravel()])

    return residuals


def evaluate(task: tuple[str, int]) -> tuple[float, float, float, float]:
    """Run `fit` and `predict` on a campaign of a law and a seed.

    Returns:
        Root mean square misfit of the fitted parameters to the tests, the least that five parameters reach,
        share of true stiffness magnitudes and loss factors inside the bands of `predict`, and median half width of the
        bands of the stiffness magnitude, relative.
    """
    law, seed = task
    _, paper, bench = draw("", seed, law)
    tests, inside, half_widths = bench.tests, [], []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        campaign("", 0.0, seed, folder, law=law)
        run_command("fit", folder / "bushing.toml", "-o", folder / "fit")
        parameters = json.loads((folder / "fit/model.json").read_text(encoding="utf-8"))["parameters"]
        measured = load_campaign(folder / "bushing.toml")
        one_direction = replace(measured, sweeps=measured.sweeps[:1])
        residuals = relative_residuals(
            chosen(tests, np.flatnonzero(tests.direction == tests.direction.min())), one_direction
        )
        for number in np.unique(tests.direction):
            sweeps = chosen(tests, np.flatnonzero(~tests.loop & (tests.direction == number)))
            frequencies, amplitudes = (
                np.array([float(f"{value:.3g}") for value in np.geomspace(values.min(), values.max(), count)])
                for values, count in ((sweeps.frequency, 8), (1e3 * sweeps.amplitude, 5))
            )
            options = ["--direction", DIRECTIONS[number]]
            for option, values, unit in (("frequencies", frequencies, "Hz"), ("amplitudes", amplitudes, "mm")):
                options += [f"--{option}", ", ".join(f"{value:g}" for value in values) + f" {unit}"]
            run_command("predict", folder / "fit/model.json", *options, "-o", folder / DIRECTIONS[number])
            table = pd.read_csv(folder / DIRECTIONS[number] / f"{DIRECTIONS[number]}.csv")
            frequency, amplitude = (table[column].to_numpy() for column in ("frequency [Hz]", "amplitude [mm]"))
            zeros = np.zeros(frequency.size, int)
            grid = Tests(tests.bushing, frequency, 1e-3 * amplitude, zeros + number, zeros, zeros + 1, zeros > 0)
            k = respond(grid, bench.rubber).stiffness
            for quantity, true in (("stiffness [N/mm]", 1e-3 * np.abs(k)), ("loss factor [-]", k.imag / k.real)):
                low, high = (table[f"{quantity}, {end}"].to_numpy() for end in ("low", "high"))
                inside.append((low <= true) & (true <= high))
                if quantity.startswith("stiffness"):
                    half_widths.append(0.5 * (high - low) / true)
    fitted = np.log([parameters[name]["value"] for name in FIVE])
    starts = np.log([getattr(paper, name) for name in FIVE]), np.clip(fitted, BOUNDS[0] + 1e-6, BOUNDS[1] - 1e-6)
    best = min(
        (least_squares(residuals, start, bounds=BOUNDS, x_scale=0.1, max_nfev=60) for start in starts),
        key=lambda solution: solution.cost,
    )
    misfit, least = (float(np.sqrt(np.mean(values**2))) for values in (residuals(fitted), best.fun))
    return misfit, least, float(np.mean(np.concatenate(inside))), float(np.median(np.concatenate(half_widths)))


def tasks(laws: Iterator[str] | dict[str, object], seed: int) -> Iterator[tuple[str, int]]:
    """Laws in turn, each with a seed."""
    random = np.random.default_rng(seed)
    return ((law, int(random.integers(2**31))) for law in cycle(laws))


@click.command("rubber")
@click.option("--seed", type=int, default=1, show_default=True, help="Of everything random.")
@click.option("--campaigns", type=click.IntRange(1), default=45, show_default=True, help="Of each set of rubbers.")
@click.option("--jobs", type=click.IntRange(1), default=1, show_default=True, help="Cores.")
def rubber_command(seed: int, campaigns: int, jobs: int) -> None:
    """Fit simulated rubber of ten laws from the literature, and print how close the results are to the truth."""
    for name, laws in SETS.items():
        with ProcessPoolExecutor(jobs) as pool:
            results = np.array([*pool.map(evaluate, islice(tasks(laws, seed), campaigns))])
        misfit, least, covered, half_width = results.T
        ratio = misfit / least
        click.echo(f"{name}, {campaigns} campaigns")
        click.echo(f"  misfit over the least of five parameters: {np.median(ratio):.2f}, worst {ratio.max():.2f}")
        click.echo(f"  above 1.3: {np.sum(ratio > 1.3)}")
        click.echo(f"  truth inside the bands of `predict`: {100 * covered.mean():.1f} %")
        click.echo(f"  median half width over the misfit: {np.median(half_width / misfit):.2f}")
