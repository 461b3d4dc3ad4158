"""Several bushings of one compound: one set of parameters, and a stiffness factor of each bushing."""

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binomtest

import bushfit
from bushfit.campaign.campaign import Campaign, load_campaign
from bushfit.commands.fit import fit
from bushfit.commands.predict import predict
from bushfit.commands.simulate import simulate
from bushfit.geometry import Bushing
from bushfit.model.file import load_result

SHAPES = ("short", "long", "thick")
_TEXT = Path(bushfit.__file__).parents[1].joinpath("configs/three_shapes.toml").read_text(encoding="utf-8")
#: The simulation of the campaign of three shapes, without its measured tests and free factors.
CAMPAIGN = _TEXT.replace('factor = "free"\n', "").partition("[[sweeps]]")[0] + _TEXT[_TEXT.index("[simulate]") :]
RIG = 'noise = "0.5 %"\nlevel_gain_error = "0.5 %"\nlevel_phase_error = "0.25 deg"'


def simulated(folder: Path, text: str = CAMPAIGN, factor: str = "free") -> Campaign:
    """Simulated tests of three bushings, whose factors a fit leaves free or takes as one."""
    (folder / "sim.toml").write_text(text, encoding="utf-8")
    simulate(load_campaign(folder / "sim.toml"), folder / "tests")
    file = folder / "tests/campaign.toml"
    written = file.read_text(encoding="utf-8").replace("[[bushings]]", f'[[bushings]]\nfactor = "{factor}"')
    file.write_text(written, encoding="utf-8")
    return load_campaign(file)


@pytest.mark.parametrize(("factor", "band"), [("free", 0.059), ("one", 0.0)])
def test_each_bushing_is_predicted_by_the_others(factor, band, tmp_path):
    """The spread of free factors holds a bushing 4 % stiffer than its formula; equal factors do not."""
    output = fit(simulated(tmp_path, factor=factor))
    (table,) = (part.content() for part in output.files if part.name == "bushings")
    rows = table.set_index("bushing")
    assert [*rows.index] == [*SHAPES]
    assert (rows["points"] == 24).all()
    assert rows.loc["long", "mean gap [%]"] == pytest.approx(100.0 * (1.0 - 0.99 / 1.04), abs=1.5)
    assert rows.loc["long", "NRMSE [%]"] == pytest.approx(abs(rows.loc["long", "mean gap [%]"]), rel=0.1)
    assert (rows.loc["long", "in band [%]"] > 90.0) == (factor == "free")
    (prediction, *_) = predict(output.result, bushing=Bushing("new", 0.009, 0.02, 0.03)).predictions
    half = prediction.stiffness.high / prediction.stiffness.value - 1.0
    common = output.result.covariance.stderr("mu") or 0.0
    assert (half > band).all()
    assert factor == "free" or (half < 4.0 * common / output.result.model.values["mu"]).all()


@pytest.mark.slow
@pytest.mark.parametrize("rig", ['noise = "0.5 %"', RIG], ids=["noise", "rig"])
def test_intervals_hold_the_truth_in_95_of_100_campaigns_of_three_shapes(rig, tmp_path):
    """Factors drawn from their prior, tests from the rig in time, starts from the tests alone.

    With level errors of the rig, the intervals of eps_half and sigma_fmax hold the truth in 199 and 198 of 200
    campaigns, because two levels a bushing leave two degrees of freedom for the size of these errors: Student's t
    widens the intervals by 54 and 16 %, and an estimate never below the stated class by 15 %. With the true size given,
    they hold it in 192 and 193; with six levels, in 196 and 192; with a rig of twice its stated class, in 189 and 181.
    Only too few are refused of a single parameter.
    """
    inside = dict[str, list[bool]]()
    for seed in range(200):
        factors = 1.0 + 0.03 * np.random.default_rng((seed, 55)).standard_normal(3)
        stated = "\n".join(f"{name} = {factor}" for name, factor in zip(SHAPES, factors, strict=True))
        text = CAMPAIGN.replace("seed = 55", f"seed = {seed}").replace('noise = "0.5 %"', rig)
        folder = tmp_path / str(seed)
        folder.mkdir()
        result = fit(simulated(folder, text.replace("long = 1.04\nthick = 0.98", stated))).result
        truth = load_result(folder / "tests/truth.json").model.values
        for name, value in truth.items():
            low, high = result.interval(name) or (0.0, 0.0)
            inside.setdefault(name, []).append(low <= value <= high)
    for name, hits in inside.items():
        assert binomtest(sum(hits), len(hits), 0.95, alternative="less").pvalue > 0.002, name
    assert 0.93 < np.mean([*inside.values()]) < 0.99
