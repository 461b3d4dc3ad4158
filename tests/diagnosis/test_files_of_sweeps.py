"""A sweep in one file, or with a file for each level as many rigs write it: diagnose finds the same in both."""

import re
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

from bushfit.campaign.campaign import load_campaign
from bushfit.diagnosis.record import Diagnosis
from bushfit.fitting.data import Data
from bushfit.jobs.diagnose import Diagnose


def diagnosed(campaign: Path) -> Diagnosis:
    return Diagnose().run(Data.of(load_campaign(campaign))).diagnosis


def parted(case: Path, folder: Path, spoil: Callable[[pd.DataFrame, str], None]) -> tuple[Path, Path]:
    """Campaigns of the sweeps of a case, spoiled by their table and file: one file each, and one a level."""
    head, *sweeps = re.split(r"(?m)^(?=\[\[sweeps\]\])", (case / "bushing.toml").read_text(encoding="utf-8"))
    head = head.replace('file = "', f'file = "{case.as_posix()}/')
    whole, levels = [head], [head]
    for text in sweeps:
        name = re.findall(r'file = "(.*)"', text)[0]
        table = pd.read_csv(case / name, comment="#")
        spoil(table, name)
        table.to_csv(folder / name, index=False)
        whole.append(text)
        amplitude = next(header for header in table if header.startswith("amplitude"))
        for number, (_, rows) in enumerate(table.groupby(amplitude)):
            rows.to_csv(folder / f"{number}_{name}", index=False)
            levels.append(text.replace(name, f"{number}_{name}"))
    files = folder / "whole.toml", folder / "levels.toml"
    for file, texts in zip(files, (whole, levels), strict=True):
        file.write_text("\n".join(texts), encoding="utf-8")
    return files


def nothing(table: pd.DataFrame, name: str) -> None:
    pass


def hum(table: pd.DataFrame, name: str) -> None:
    """4 % at one frequency of the axial sweep, at every amplitude."""
    if "axial" in name:
        steps = sorted(set(table["frequency [Hz]"]))
        size = next(header for header in table if "stiffness" in header)
        table.loc[table["frequency [Hz]"] == steps[len(steps) // 2], size] *= 1.04


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "spoil"), [("case_015", nothing), ("case_004", nothing), ("case_000", nothing), ("case_000", hum)]
)
def test_verdict_does_not_depend_on_how_sweeps_are_parted(
    root: Path, tmp_path: Path, case: str, spoil: Callable[[pd.DataFrame, str], None]
) -> None:
    """A mislabelled level, a dashpot, nothing, and a disturbance at one frequency."""
    one, many = map(diagnosed, parted(root / "data/practice" / case, tmp_path, spoil))
    assert many.verdict == one.verdict
    assert [each.label for each in many.effects] == [each.label for each in one.effects]
    assert (one.verdict == "consistent") == (case == "case_000" and spoil is nothing)
    if spoil is hum:
        assert [found.odds.told[0][0].count("Hz in axial") for found in (one, many)] == [1, 1]
