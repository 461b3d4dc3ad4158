"""Histories that move several bushings of one compound."""

import json
import shlex
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commandline import typing
from shell import refused

N = 200
TIME = np.arange(N) / 200.0
MOTION = 0.2 * np.sin(2.0 * np.pi * 5.0 * TIME)


@pytest.fixture(scope="module")
def shapes(root, tmp_path_factory) -> Path:
    """A folder with the fit of three shapes under `model`, and displacement histories."""
    folder = tmp_path_factory.mktemp("shapes")
    typing(folder)("fit", root / "configs/three_shapes.toml", "-o", "model", "--no-plots")
    histories = {
        "road": {"axial [mm]": MOTION, "torsion [deg]": MOTION},
        "plain": {"displacement [mm]": MOTION},
        "radial": {"displacement [mm]": MOTION},
        "turn": {"displacement [deg]": MOTION},
    }
    for name, columns in histories.items():
        pd.DataFrame({"time [s]": TIME, **columns}).to_csv(folder / f"{name}.csv", index=False)
    return folder


@pytest.mark.parametrize(
    ("history", "direction", "places"),
    [
        ("road", None, "short axial, long axial, thick axial, short torsion, long torsion, thick torsion"),
        ("road", "long", "long axial, long torsion"),
        ("road", "torsion", "short torsion, long torsion, thick torsion"),
        ("plain", "long radial", "long radial"),
        ("radial", "long", "long radial"),
        ("turn", "thick", "thick torsion"),
    ],
)
def test_a_history_moves_the_bushings_asked_for(shapes, tmp_path, history, direction, places):
    options = ("--direction", direction) if direction else ()
    done = typing(shapes)("respond", "model", f"{history}.csv", *options, "-o", tmp_path / "x", "--no-plots", "--json")
    assert list(json.loads(done.stdout)["directions"]) == places.split(", ")


@pytest.mark.parametrize(
    ("command", "problem"),
    [
        ("respond model plain.csv --direction long", "try: state it: --direction 'long axial'"),
        ("respond model plain.csv", "the direction of this displacement is not stated"),
        ("respond model road.csv --direction lon", 'did you mean "long"?'),
    ],
)
def test_a_bushing_or_direction_that_is_not_there_is_one_error(shapes, tmp_path, command, problem):
    done = typing(shapes)(*shlex.split(command), "-o", tmp_path / "x", status=2)
    refused(done, tmp_path / "x", problem)


def test_a_name_of_two_bodies_is_refused(root, tmp_path):
    text = (root / "configs/three_shapes.toml").read_text(encoding="utf-8").replace("../data", f"{root}/data")
    (tmp_path / "c.toml").write_text(text.partition("[simulate]")[0].replace('"thick"', '"long axial"'))
    assert "two bodies have one name" in typing(tmp_path)("fit", "c.toml", "-o", "x", status=2).stderr
