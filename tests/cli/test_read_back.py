"""Every model that a command writes is read back: by predict, plan, report, compare, diagnose --model and export."""

import json
import shlex
from collections.abc import Callable
from functools import cache
from itertools import cycle
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commandline import call, typing
from jsonschema import Draft202012Validator
from shell import document as read
from virtual_rig import LOOP, MOUNT, SWEEP, SWEEPS, rig

from bushfit.commands.schema import schema
from bushfit.model.file import load_result, to_document

SPECIMENS = """
specimens = [
  { name = "Dumbbell", kind = "modulus" },
  { name = "Quad", kind = "shear", area = "500 mm^2", thickness = "6 mm", elements = 4 },
]
"""
RIG = rig("0.4 %", 'displacement_noise = "0.05 %"')
COLOURED = rig("0.4 %", 'displacement_noise = "0.05 %"', 'force_correlation = "90 %"')
SHAKEN = """
[[simulate.resonances]]
direction = "axial"
mass = "3 kg"
base_acceleration = "4 m/s^2"
frequencies = {}
"""
LOOPS = LOOP.format("axial", "0.5 mm", "0.1 Hz") + LOOP.format("axial", "1 mm", "0.1 Hz")
COUPONS = SWEEP.format("specimen", "Dumbbell", '["0.5 %", "1 %", "4 %"]') + SWEEP.format(
    "specimen", "Quad", '["0.05 mm", "0.2 mm"]'
)
ONE_FREQUENCY = """
[[simulate.sweeps]]
direction = "axial"
amplitudes = ["0.05 mm", "0.1 mm", "0.2 mm", "0.5 mm", "1 mm"]
frequencies = ["15 Hz"]
stepped = "amplitude"
"""
RISING = json.dumps([f"{frequency} Hz" for frequency in range(10, 250, 8)])

#: What is tested, by the shape of the campaign, and what is hidden in it.
SHAPES: dict[str, tuple[str, ...]] = {
    "coloured loops": (MOUNT + COLOURED + LOOPS + SWEEPS["axial"],),
    "one loop in torsion": (MOUNT + RIG + LOOP.format("torsion", "2 deg", "0.1 Hz"),),
    "amplitudes at one frequency": (MOUNT + RIG + ONE_FREQUENCY,),
    "coupons alone": ('name = "Sheet"\n' + SPECIMENS + RIG + COUPONS,),
    "coupons beside a bushing": (SPECIMENS + MOUNT + RIG + LOOPS + SWEEPS["axial"] + COUPONS,),
    "all directions": (MOUNT + RIG + LOOPS + "".join(SWEEPS.values()),),
    "a resonance": (MOUNT + RIG + LOOPS + SHAKEN.format(RISING),),
    "described": (MOUNT + RIG + LOOPS + SWEEPS["axial"] + SWEEPS["radial"],),
}
#: Commands that write a model, and its name in their folder.
WRITERS = {
    "fit-static": "static", "fit-dynamic": "dynamic", "fit": "model", "fit --profile": "model",
    "fit --effect inertia": "model", "diagnose": "model", "run": "model", "batch": "model",
}  # fmt: skip
#: Formats of export for a bushing, and for specimens alone.
FORMATS = ("nastran", "nastran --dialect optistruct", "abaqus", "adams", "csv", "xlsx", "fmu")
TABLES = ("csv", "xlsx")


@pytest.fixture(scope="module")
def campaign(tmp_path_factory) -> Callable[[str], Path]:
    """The folder with the campaign of a shape, simulated once."""

    @cache
    def simulated(shape: str) -> Path:
        folder, (text, *hidden) = tmp_path_factory.mktemp("shape"), SHAPES[shape]
        (folder / "rig.toml").write_text(text, encoding="utf-8")
        typing(folder)("simulate", "rig.toml", *hidden, "-o", "tests", "--no-plots")
        tests = folder / "tests"
        if shape == "a resonance":
            reduced(tests)
        if shape == "described":
            bent(tests / "sweep_axial.csv")
            bent(tests / "sweep_radial.csv")
        return tests

    return simulated


def reduced(tests: Path) -> None:
    """The resonance test reduced, and added, as the comment in the campaign says."""
    said = [line.removeprefix("# ") for line in (tests / "campaign.toml").read_text(encoding="utf-8").splitlines()]
    typed = [line for line in said if line.startswith("bushfit reduce")]
    for line in typed:
        typing(tests)(*shlex.split(line)[1:], "--no-plots")
    told = [
        line for line in said if line not in typed and not line.startswith(("This command converts", "Simulated by"))
    ]
    (tests / "campaign.toml").write_text("\n".join(told), encoding="utf-8")


def bent(file: Path) -> None:
    """A hump that no effect of the library has, over frequency and amplitude."""
    table = pd.read_csv(file)
    over = np.square(np.log(table["frequency [Hz]"] / 40.0)) + np.square(np.log(table["amplitude [mm]"] / 0.2))
    table["stiffness [N/mm]"] *= 1.0 + 0.1 * np.exp(-2.0 * over)
    table.to_csv(file, index=False)


def written(tests: Path, writer: str, folder: Path) -> list[Path]:
    """The models that a command writes of a campaign; none where its tests tell too little, as it says."""
    command, *options = shlex.split(writer)
    if command == "batch":
        (folder / "bushings.csv").write_text(f"campaign\n{tests / 'campaign.toml'}\n", encoding="utf-8")
        typing(folder)("batch", "bushings.csv", "--jobs", "1", "-o", "out", "--reports")
    else:
        done = call(folder, command, tests / "campaign.toml", *options, "-o", "out", "--no-plots")
        if done.returncode == 2 and writer in ("fit-static", "fit-dynamic", "fit --effect inertia"):
            assert "bushfit: error: " in done.stderr
            assert not (folder / "out").exists()
            return []
        assert done.returncode == 0, done.stderr
    documents = (folder / "out").rglob("*.json")
    found = [file for file in documents if str(read(file).get("schema")).startswith("bushfit/model/")]
    assert any(file.stem == WRITERS[writer] for file in found)
    return sorted(found)


def taken(tests: Path, model: Path, folder: Path, more: str) -> None:
    """A model taken by commands that read one; with `more`, by this one too, and in every format."""
    document = read(model)
    assert list(Draft202012Validator(schema("model")).iter_errors(document)) == []
    again = json.loads(json.dumps(to_document(load_result(model))))
    assert again == {key: value for key, value in document.items() if key in again}
    plain = ("--force", "--no-plots", "-q")
    well = typing(folder)
    well("predict", model, "-o", "predicted", *plain)
    well("compare", model, tests / "truth.json", model, "-o", "compared", *plain)
    well("report", model.parent, "-o", "page", *plain)
    if more:
        arms = ["--arms"] if "springpot" in document["effects"] else []
        well("predict", model, "--campaign", tests / "campaign.toml", *arms, "-o", "predicted", *plain)
        own = (model, "--hours", "1") if more == "plan" else (tests / "campaign.toml", "--model", model)
        well(more, *own, "-o", more, *plain)
    bushing = document["bushing"] is not None
    if bushing:
        well("simulate", model, "-o", "simulated", *plain)
    for form in (FORMATS if more else ("nastran", "csv")) if bushing else TABLES:
        well("export", model, "--format", *shlex.split(form), "-o", "exported", *plain)


#: Shape, command, and which of the commands that take longest takes what it wrote, in every format. Slow: all shapes by
#: `run`, which writes a model of every kind, and each by one of the others.
CASES = [
    *((shape, "fit", "") for shape in ("coloured loops", "amplitudes at one frequency", "coupons alone")),
    ("one loop in torsion", "run", ""),
    *(
        pytest.param(shape, *how, marks=pytest.mark.slow)
        for shape, other, more in zip(
            SHAPES, cycle(sorted({*WRITERS} - {"run"})), cycle(("plan", "diagnose")), strict=False
        )
        for how in (("run", more), (other, ""))
    ),
]


@pytest.mark.parametrize(("shape", "writer", "more"), CASES)
def test_what_a_command_writes_is_read_by_those_that_take_it(campaign, tmp_path, shape, writer, more):
    tests = campaign(shape)
    for model in written(tests, writer, tmp_path):
        taken(tests, model, tmp_path, more if model.stem == WRITERS[writer] else "")
