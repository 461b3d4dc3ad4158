"""Campaign files: what they say arrives in SI with the tests they name, in the order in which these were made.

Most of what can be wrong with a campaign is in tests/files/spoiled, with the command that says it.
"""

import math
from pathlib import Path

import numpy as np
import pytest

from bushfit.campaign.campaign import Campaign, load_campaign
from bushfit.campaign.copies import group_copies
from bushfit.campaign.session import SessionTest, planned_session, session
from bushfit.campaign.simulated import SimulatedLoop, SimulatedSweep
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.geometry import Bushing, Direction, Specimen, unit_strain
from bushfit.reading.measurement import Loop

BUSHING = """
[bushing]
name = "CMP 15 961"
inner_radius = "10 mm"
outer_radius = "18 mm"
length = "34 mm"
"""
TESTS = """
[[loops]]
file = "loop.csv"
direction = "axial"

[[sweeps]]
file = "sweep.csv"
direction = "radial"
"""
SIMULATE = BUSHING + "[simulate]\n"
LOOP = "displacement [mm],force [N],time [s]\n" + "".join(f"{math.sin(i)},{math.sin(i + 0.1)},{i}\n" for i in range(20))
SWEEP = "frequency [Hz],amplitude [mm],stiffness [N/mm],loss factor [-]\n" + "".join(
    f"{f},0.1,600,0.1\n" for f in (5, 15, 25)
)
RUBBER = Bushing("CMP 15 961", 0.010, 0.018, 0.034)
COUPON = Specimen("DMA", "modulus")


@pytest.fixture
def folder(tmp_path) -> Path:
    (tmp_path / "loop.csv").write_text(LOOP)
    (tmp_path / "sweep.csv").write_text(SWEEP)
    return tmp_path


def campaign_from(text: str, folder: Path) -> Campaign:
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    return load_campaign(folder / "campaign.toml")


def test_what_a_campaign_says_of_its_files_their_names_and_limits(folder):
    (folder / "loop.csv").write_text(LOOP.replace("force [N]", "Kraft").replace("time [s]", "x [s]"))
    said = """
name = "of files"
bushing = { name = "b", inner_diameter = "2 cm", outer_radius = "18 mm", length = "34 mm" }
sweeps = [{ file = "sweep.csv", direction = "axial", amplitude = "peak-to-peak", noise = "1 %" }]
[[loops]]
file = "loop.csv"
direction = "axial"
columns = { force = "Kraft" }
units = { force = "kN" }
noise = "0.5 %"
frequency = "0.1 Hz"
waveform = "sine"
"""
    campaign = campaign_from(said, folder)
    assert campaign.name == "of files"
    assert (campaign.bushing.inner_radius, campaign.bushing.outer_radius) == (0.01, 0.018)
    assert campaign.loops[0].noise == 0.005
    assert campaign.loops[0].force.max() == pytest.approx(1000.0, rel=1e-2)
    assert campaign.sweeps[0].amplitude[0] == pytest.approx(0.05e-3)
    (folder / "loop.csv").write_text(LOOP)
    (folder / "more").mkdir()
    (folder / "more/loop.csv").write_text(LOOP.replace("[N]", "[kN]"))
    campaign = campaign_from(BUSHING + TESTS + '[[loops]]\nfile = "more/loop.csv"\ndirection = "axial"\n', folder)
    assert [loop.name for loop in campaign.loops] == ["loop.csv", "more/loop.csv"]
    # A least modulus of 0 says that it is not negative; a logarithm has no 0.
    limits = campaign_from(SIMULATE + '[fit.mu]\nmin = "0 MPa"\nmax = "1e6 MPa"', folder).fit.parameters["mu"]
    assert (limits.min, limits.max) == (1e3, 1e9)


def test_settings_arrive_in_si(folder):
    settings = """
[fit]
dynamic_amplitudes = ["0.1 mm", "0.5 deg"]
residuals = "magnitude_loss_factor"
mu = { value = "1.09 MPa", min = "0.1 MPa", vary = false }
m = { max = "0.2 MPa s^alpha" }
eps_half = { value = "1.3 %" }
"inertia.mass" = { value = "100 g" }
[predict]
frequencies = { start = "5 Hz", stop = "155 Hz", step = "10 Hz" }
directions = ["axial", "torsion"]
[simulate]
parameters = { mu = "1.2 MPa", m = "0.2 MPa*s^alpha", alpha = 0.24 }
effects = { inertia = { mass = 0.1 }, delay = { tau = "50 us" } }
noise = "0.5 %"
loops = [{ direction = "axial", amplitude = "1 mm", frequency = "0.1 Hz" }]
sweeps = [{ direction = "torsion", amplitudes = ["1 deg"], frequencies = ["5 Hz"] }]
"""
    campaign = campaign_from("\ufeff" + BUSHING + settings, folder)
    fit, predict, simulate = campaign.fit, campaign.predict, campaign.simulate
    assert (fit.parameters["mu"].value, fit.parameters["mu"].min, fit.parameters["mu"].vary) == (1.09e6, 1e5, False)
    assert fit.parameters["m"].max == 2e5
    assert fit.parameters["eps_half"].value == 0.013
    assert fit.parameters["inertia.mass"].value == 0.1
    assert fit.dynamic_amplitudes == pytest.approx((1e-4, math.radians(0.5)))
    assert fit.residuals == "magnitude_loss_factor"
    assert predict.frequencies == tuple(range(5, 156, 10))
    assert predict.directions == (Direction.AXIAL, Direction.TORSION)
    assert simulate.parameters == {"mu": 1.2e6, "m": 2e5, "alpha": 0.24}
    assert simulate.effects == {"inertia": {"mass": 0.1}, "delay": {"tau": 5e-5}}
    assert (simulate.noise, simulate.gain_error, simulate.loops[0].cycles) == (0.005, 0.0, 3)
    assert simulate.sweeps[0].amplitudes == pytest.approx((math.radians(1),))


def test_turns_strains_and_rests_of_a_session():
    loop = SessionTest(Direction.AXIAL, np.array([1e-3]), 300.0)
    sweep = SessionTest(Direction.AXIAL, np.array([1e-4, 5e-4, 2e-4]))
    first, second = session(RUBBER, [loop, sweep])
    assert first.temperature == 300.0
    assert second.temperature is None
    np.testing.assert_allclose(first.session_time, [0.0])
    np.testing.assert_allclose(second.session_time, [1 / 3, 2 / 3, 1.0])
    np.testing.assert_allclose(first.largest_strain, [0.0])
    np.testing.assert_allclose(second.largest_strain, 3 * [1e-3 * unit_strain(RUBBER, Direction.AXIAL)])
    up_and_down = np.array([1.0, 2.0, 4.0, 4.1, 2.0, 2.1, 1.0, 2.0]) * 1e-4
    (found,) = session(RUBBER, [SessionTest(Direction.AXIAL, up_and_down)])
    strain = up_and_down * unit_strain(RUBBER, Direction.AXIAL)
    np.testing.assert_allclose(found.previous_strain, [0.0, 0.0, 0.0, 0.0, strain[3], strain[3], strain[5], strain[3]])
    np.testing.assert_allclose(7.0 * found.rest_time[4:], [1.0, 2.0, 1.0, 4.0])
    coupon, mount = SessionTest(COUPON, np.array([0.5, 0.1])), SessionTest(Direction.RADIAL, np.full(3, 1e-4))
    of_coupon, of_mount = session(RUBBER, [coupon, mount])
    np.testing.assert_allclose(of_coupon.session_time, [0.0, 1.0])
    np.testing.assert_allclose(of_mount.session_time, [0.0, 0.5, 1.0])
    np.testing.assert_allclose(of_coupon.largest_strain, [0.0, 0.5 * unit_strain(None, COUPON)])
    assert of_mount.largest_strain[2] < 0.1


def write(folder: Path, order: tuple[str, str]) -> Path:
    """A campaign of two sweeps, one with a temperature in a column, one with it stated."""
    rows = "frequency [Hz],amplitude [mm],stiffness [N/mm],loss factor [-]"
    lines = [f"{f},0.1,{500 + f},0.1" for f in (5, 15, 25)]
    (folder / "cold.csv").write_text("\n".join([rows, *lines]))
    warm = [f"{line},{30 + i}" for i, line in enumerate(lines)]
    (folder / "warm.csv").write_text("\n".join([f"{rows},temperature [degC]", *warm]))
    text = 'bushing = { name = "b", inner_radius = "10 mm", outer_radius = "18 mm", length = "34 mm" }\n'
    text += f'[[sweeps]]\nfile = "cold.csv"\ndirection = "axial"\ntemperature = "20 degC"\n{order[0]}\n'
    text += f'[[sweeps]]\nfile = "warm.csv"\ndirection = "axial"\n{order[1]}\n'
    (folder / "campaign.toml").write_text(text)
    return folder / "campaign.toml"


@pytest.mark.parametrize(("order", "first"), [(("", ""), "cold"), (("order = 2", "order = 1"), "warm")])
def test_a_campaign_gives_temperatures_and_order(tmp_path, order, first):
    data = PreparedCampaign.from_campaign(load_campaign(write(tmp_path, order)))
    conditions = {sweep.name: sweep.conditions for sweep in data.sweeps}
    assert conditions["cold"].temperature == pytest.approx(293.15)
    np.testing.assert_allclose(conditions["warm"].temperature, [303.15, 304.15, 305.15])
    assert conditions[first].session_time[0] == 0.0
    part = data.sweeps[1].select(data.sweeps[1].amplitude == 1e-4).conditions
    np.testing.assert_array_equal(part.session_time, conditions["warm"].session_time)


def test_a_planned_sweep_has_its_own_repeats_else_those_of_the_session():
    bushing = Bushing("b", 0.01, 0.018, 0.034)
    sweep = SimulatedSweep(Direction.AXIAL, (1e-4, 2e-4), (5.0, 15.0, 25.0), repeats=3)
    tests = [sweep, SimulatedLoop(Direction.AXIAL, 1e-3, 1.0), SimulatedSweep(Direction.AXIAL, (3e-3,), (5.0,))]
    conditions = planned_session(bushing, tests, repeats=2)
    assert [np.size(test.largest_strain) for test in conditions] == [18, 1, 2]


@pytest.mark.parametrize("rows", [slice(None), slice(0, None, 2), slice(300, 2400)], ids=["all", "second", "cut"])
@pytest.mark.parametrize("digits", [6, 4])
def test_a_loop_that_is_exported_again_is_used_once(rows, digits):
    rng, time = np.random.default_rng(11), np.arange(3000) * 0.01
    noisy = [np.round(np.sin(0.2 * np.pi * time) + 3e-3 * rng.normal(size=time.size), 6) for _ in range(4)]
    first, repeat = (Loop("", Direction.AXIAL, time, *columns) for columns in (noisy[:2], noisy[2:]))
    again = Loop("", Direction.AXIAL, time[rows] - time[rows][0], *(np.round(c[rows], digits) for c in noisy[:2]))
    assert sorted(map(len, group_copies([again, repeat, first]))) == [1, 2]
