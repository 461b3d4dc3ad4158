"""A unit that is wrong by a power of 1000: the test that no rubber could have given is the one to name."""

import json

import pandas as pd
import pytest
from shell import CAMPAIGN

SWEEP, LOOP = "sweep_axial", "loop_axial_1"


@pytest.mark.parametrize(
    ("test", "stated", "wrong", "mistake"),
    [
        (SWEEP, "stiffness [N/mm]", "stiffness [N/m]", "thousandfold_force"),
        (SWEEP, "stiffness [N/mm]", "stiffness [kN/mm]", "thousandth_of_force"),
        pytest.param(*(SWEEP, "amplitude [mm]", "amplitude [um]", "thousandfold_displacement"), marks=pytest.mark.slow),
        pytest.param(*(LOOP, "force [N]", "force [mN]", "thousandfold_force"), marks=pytest.mark.slow),
    ],
)
def test_the_unit_and_not_another_test_is_named(bushfit, own, test, stated, wrong, mistake):
    file = own / f"data/cmp_15961/{test}.csv"
    pd.read_csv(file, comment="#").rename(columns={stated: wrong}).to_csv(file, index=False)
    bushfit("diagnose", own / CAMPAIGN, "-o", own / "x", "--no-plots")
    diagnosis = json.loads((own / "x/diagnosis.json").read_text(encoding="utf-8"))
    assert diagnosis["verdict"] == "named"
    assert [(effect["name"], effect["test"]) for effect in diagnosis["effects"]] == [(mistake, test)]
    adopted = f"{mistake}:{test}"
    bushfit("diagnose", own / CAMPAIGN, "--adopt", adopted, "-o", own / "adopted", "--no-plots")
    mended = json.loads((own / "adopted/diagnosis.json").read_text(encoding="utf-8"))
    assert mended["verdict"] == "consistent"
