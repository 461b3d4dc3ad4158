"""What the tests of the model share: the joint fit of the paper's bushing."""

from __future__ import annotations

from pathlib import Path

import pytest

from bushfit.campaign.campaign import load_campaign
from bushfit.fitting.data import Data
from bushfit.fitting.procedures import fit_joint
from bushfit.model.result import Result


@pytest.fixture(scope="session")
def result(root: Path) -> Result:
    return fit_joint(Data.of(load_campaign(root / "configs/cmp_15961.toml")))
