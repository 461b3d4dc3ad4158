"""A campaign whose file counts amplitudes otherwise than it says: told with the line that mends it, and adopted."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commandline import Done, call

Run = Callable[..., Done]
LABEL = "peak_to_peak:sweep_axial"
#: A clean campaign, of which one file is spoiled.
CAMPAIGN = "case_000/bushing.toml"


@pytest.fixture(scope="module")
def work(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("work")
    shutil.copytree(root / "data/practice/case_000", folder / "case_000")
    file = folder / "case_000/sweep_axial.csv"
    table = pd.read_csv(file, comment="#")
    column = next(name for name in table.columns if name.startswith("amplitude"))
    table[column] *= 2.0
    table.to_csv(file, index=False)
    return folder


@pytest.fixture(scope="module")
def bushfit(work: Path) -> Run:
    return partial(call, work)


def test_it_is_told_with_its_line_and_nothing_is_mended(bushfit: Run, work: Path) -> None:
    done = bushfit("diagnose", CAMPAIGN, "-o", "told")
    assert done.returncode == 0, done.stderr
    for words in ("these tests agree if the", "sweep_axial.csv are peak-to-peak", 'amplitude = "peak-to-peak"', LABEL):
        assert words in " ".join(done.stderr.split())
    document, model = (json.loads((work / f"told/{name}.json").read_text()) for name in ("diagnosis", "model"))
    (effect,) = document["effects"]
    assert (document["verdict"], effect["name"], effect["level"]) == ("named", "peak_to_peak", "record")
    assert (effect["test"], effect["parameters"]) == ("sweep_axial", {})
    assert any("fitted to the tests as they are" in warning for warning in model["warnings"])
    table = pd.read_csv(work / "told/gap.csv")
    for when in ("before", "after"):
        columns = [name for name in table.columns if name.endswith(f"{when} [noise]")]
        gap = np.sqrt(np.nanmean(np.square(table[columns].to_numpy())))
        print(f"{when}: {gap:.3f}")
        assert gap > 0.99 * document["gap"]["calibration"][when]  # rows of a loop share its gain, and tell of the next
    candidates = pd.read_csv(work / "told/candidates.csv").set_index("effect")
    assert candidates.loc[LABEL, ["level", "why"]].tolist() == ["record", "closes the gap"]


def test_adopted_it_is_mended_aloud(bushfit: Run, work: Path) -> None:
    done = bushfit("diagnose", CAMPAIGN, "--adopt", LABEL, "-o", "adopted", "--no-plots")
    assert done.returncode == 0, done.stderr
    assert f"mended by --adopt {LABEL}" in " ".join(done.stderr.split())
    assert json.loads((work / "adopted/diagnosis.json").read_text())["verdict"] == "consistent"
    assert any("mended by" in line for line in json.loads((work / "adopted/model.json").read_text())["warnings"])


def test_the_line_in_the_campaign_puts_it_right(bushfit: Run, work: Path) -> None:
    text = (work / CAMPAIGN).read_text()
    line = 'file = "sweep_axial.csv"'
    assert line in text
    (work / "case_000/mended.toml").write_text(text.replace(line, f'{line}\namplitude = "peak-to-peak"'))
    done = bushfit("diagnose", "case_000/mended.toml", "--json", "--no-plots", "-o", "mended")
    assert json.loads(done.stdout)["verdict"] == "consistent"


def test_run_uses_the_tests_as_they_are_and_warns(bushfit: Run, work: Path) -> None:
    done = bushfit("run", CAMPAIGN, "-o", "ran", "--no-plots")
    assert done.returncode == 0, done.stderr
    said = " ".join(done.stderr.split())
    assert "sweep_axial.csv are peak-to-peak" in said
    assert f"(or bushfit diagnose CAMPAIGN --adopt {LABEL})" in said, "run takes no --adopt"
    last = done.stderr.splitlines()[-1]
    assert last.startswith("the model to use: ")
    assert last.endswith("fit to the tests as they are: put the record right first, then run again")
    model = json.loads((work / "ran/model.json").read_text())
    assert model["effects"] == ["elastic", "springpot", "friction"]
    assert any("fitted to the tests as they are" in warning for warning in model["warnings"])
