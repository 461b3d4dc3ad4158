"""Tables of a campaign: settings arrive in SI, and what they may not say has its one error."""

from __future__ import annotations

import contextlib
import math
import pickle
from pathlib import Path
from typing import Any

import pytest
from campaigns import BUSHING, TESTS, campaign_from
from hypothesis import given
from hypothesis import strategies as st

from bushfit.errors import BushfitError, CampaignError, MeasurementError, ModelError, UnitError
from bushfit.geometry import Direction


def test_settings_arrive_in_si(folder: Path) -> None:
    settings = """
[fit]
dynamic_amplitudes = ["0.1 mm", "0.5 deg"]
residuals = "magnitude_loss_factor"
[fit.mu]
value = "1.09 MPa"
min = "0.1 MPa"
vary = false
[fit.m]
max = "0.2 MPa s^alpha"
[fit.eps_half]
value = "1.3 %"
[fit.alpha]
value = 0.24
[fit."inertia.mass"]
value = "100 g"
[predict]
frequencies = { start = "5 Hz", stop = "155 Hz", step = "10 Hz" }
amplitudes = ["0.1 mm"]
torsion_amplitudes = ["0.5 deg"]
directions = ["axial", "torsion"]
[simulate]
parameters = { mu = "1.2 MPa", m = "0.2 MPa*s^alpha", alpha = 0.24 }
effects = { inertia = { mass = 0.1 }, delay = { tau = "50 us" } }
seed = 7
repeats = 3
noise = "0.5 %"
phase_error = "0.2 deg"
loops = [{ direction = "axial", amplitude = "1 mm", frequency = "0.1 Hz" }]
sweeps = [{ direction = "torsion", amplitudes = ["1 deg"], frequencies = ["5 Hz"] }]
"""
    campaign = campaign_from(BUSHING + settings, folder)
    fit, predict, simulate = campaign.fit, campaign.predict, campaign.simulate
    assert (fit.parameters["mu"].value, fit.parameters["mu"].min, fit.parameters["mu"].vary) == (1.09e6, 1e5, False)
    assert fit.parameters["m"].max == 2e5
    assert fit.parameters["eps_half"].value == 0.013
    assert fit.parameters["inertia.mass"].value == 0.1
    assert fit.dynamic_amplitudes == pytest.approx((1e-4, math.radians(0.5)))
    assert fit.residuals == "magnitude_loss_factor"
    assert predict.frequencies == tuple(range(5, 156, 10))
    assert predict.directions == (Direction.AXIAL, Direction.TORSION)
    assert simulate is not None
    assert simulate.parameters == {"mu": 1.2e6, "m": 2e5, "alpha": 0.24}
    assert simulate.effects == {"inertia": {"mass": 0.1}, "delay": {"tau": 5e-5}}
    assert (simulate.noise, simulate.gain_error) == (0.005, 0.0)
    assert simulate.loops[0].cycles == 3
    assert simulate.sweeps[0].amplitudes == pytest.approx((math.radians(1),))


SIMULATE = BUSHING + "[simulate]\n"


BAD: list[tuple[type[BushfitError], str, list[str]]] = [
    (CampaignError, "", ["empty"]),
    (CampaignError, BUSHING, ["no tests", "[[loops]]"]),
    (CampaignError, BUSHING + "x = [\n[y]", ["line", "TOML"]),
    (CampaignError, BUSHING + "x = " + "[" * 5000, ["nested too deeply"]),
    (CampaignError, BUSHING + f"x = 0x{'f' * 9000}", ["digits"]),
    (CampaignError, BUSHING + "#" * 1_000_001, ["too large"]),
    (CampaignError, SIMULATE.replace("length", "lenght"), ["bushing.lenght", "unknown key", 'mean "length"']),
    (CampaignError, SIMULATE.replace('length = "34 mm"', ""), ["bushing.length", "missing"]),
    (CampaignError, SIMULATE.replace('"CMP 15 961"', "15961"), ["bushing.name", "15961", "a text in quotes"]),
    (UnitError, SIMULATE.replace('"10 mm"', "10"), ["bushing.inner_radius", "without a unit", 'write "10 mm"']),
    (UnitError, SIMULATE.replace("10 mm", "10"), ["bushing.inner_radius", "without a unit", 'write "10 mm"']),
    (UnitError, SIMULATE.replace("10 mm", "10 kg"), ["bushing.inner_radius", "kg", "a length"]),
    (CampaignError, SIMULATE.replace("10 mm", "-10 mm"), ["bushing.inner_radius", "-10 mm", "greater than 0"]),
    (ModelError, SIMULATE.replace("10 mm", "20 mm"), ["impossible bushing", "inner_radius below outer_radius"]),
    (CampaignError, "bushing = 3", ["bushing", "a table"]),
    (CampaignError, BUSHING + TESTS.replace("loops", "loop"), ["loop", "unknown key", 'mean "loops"']),
    (CampaignError, BUSHING + TESTS.replace('"axial"', '"axail"'), ["loops #1.direction", "axail", "'axial'"]),
    (CampaignError, BUSHING + TESTS.replace("loop.csv", ""), ["loops #1.file", "not empty"]),
    (MeasurementError, BUSHING + TESTS.replace("loop.csv", "lop.csv"), ["lop.csv", "no such file", 'mean "loop.csv"']),
    (MeasurementError, BUSHING + TESTS.replace("loop.csv", "sweep.csv"), ["sweep.csv, line 1", "no column"]),
    (MeasurementError, BUSHING + TESTS + TESTS.replace("loop.csv", "./loop.csv"), ["listed twice", "loop.csv"]),
    (MeasurementError, BUSHING + TESTS.replace("loop.csv", "x" * 5000), ["cannot be read", "too long"]),
    (MeasurementError, BUSHING + TESTS.replace("loop.csv", "\\u0000"), ["no such file"]),
    (CampaignError, BUSHING + TESTS + 'noice = "1 %"', ["sweeps #1.noice", 'mean "noise"']),
    (UnitError, BUSHING + TESTS + "noise = 0.5", ["sweeps #1.noise", "without a unit", "%"]),
    (CampaignError, BUSHING + TESTS + 'noise = "120 %"', ["sweeps #1.noise", "less than 1"]),
    (CampaignError, BUSHING + TESTS + 'columns = { stifness = "k" }', ["sweeps #1.columns", 'mean "stiffness"']),
    (CampaignError, BUSHING + TESTS + 'amplitude = "peak"', ["sweeps #1.amplitude", "peak", "peak-to-peak"]),
    (CampaignError, BUSHING + TESTS.replace("\n\n", '\nfrequency = "1 Hz"\n\n'), ["loops #1", "waveform", "frequency"]),
    (UnitError, BUSHING + TESTS.replace("\n\n", '\nrate = "1 deg/s"\n\n'), ["loops #1.rate", "a speed"]),
    (CampaignError, BUSHING + TESTS.replace("\n\n", "\nforce_sign = 2\n\n"), ["loops #1.force_sign", "1 or -1"]),
    (CampaignError, SIMULATE + "[fit]\ndynamic_amplitude = []", ["fit.dynamic_amplitude", 'mean "dynamic_amplitudes"']),
    (CampaignError, SIMULATE + '[fit]\ndynamic_amplitudes = "1 mm"', ["fit.dynamic_amplitudes", "a list"]),
    (UnitError, SIMULATE + '[fit]\ndynamic_amplitudes = ["1 N"]', ["fit.dynamic_amplitudes #1", "a length"]),
    (CampaignError, SIMULATE + "[fit.nu]\nvary = true", ["fit.nu", 'mean "mu"']),
    (CampaignError, SIMULATE + '[fit."inertia.mas"]\nvary = true', ["fit.inertia.mas", 'mean "inertia.mass"']),
    (CampaignError, SIMULATE + "[fit.parameters.mu]", ["fit", "unknown key"]),
    (CampaignError, SIMULATE + "[fit]\nmu = 3", ["fit.mu", "a table"]),
    (UnitError, SIMULATE + "[fit.mu]\nvalue = 3", ["fit.mu.value", "without a unit", "MPa"]),
    (UnitError, SIMULATE + "[fit.alpha]\nvalue = nan", ["fit.alpha.value", "no quantity"]),
    (UnitError, SIMULATE + '[fit."inertia.mass"]\nvalue = "1 N"', ["fit.inertia.mass.value", "kg"]),
    (CampaignError, SIMULATE + '[fit.mu]\nvalue = "1 Pa"\nmin = "2 Pa"', ["fit.mu", "limits", "min below max"]),
    (
        CampaignError,
        SIMULATE + '[fit.mu]\nmin = "2 GPa"\nmax = "3 GPa"',
        ["fit.mu", "within 1000 to 1e+09 Pa"],
    ),
    (CampaignError, SIMULATE + '[fit.mu]\nvary = "no"', ["fit.mu.vary", "no", "true or false"]),
    (CampaignError, SIMULATE + "[predict]\nfrequencies = []", ["predict.frequencies", "at least one"]),
    (UnitError, SIMULATE + '[predict]\nfrequencies = ["5 mm"]', ["predict.frequencies #1", "a frequency"]),
    (CampaignError, SIMULATE + '[predict]\nfrequencies = { start = "5 Hz" }', ["predict.frequencies", "stop"]),
    (
        CampaignError,
        SIMULATE + '[predict]\nfrequencies = { start = "5 Hz", stop = "1 MHz", step = "1 mHz" }',
        ["predict.frequencies", "no range"],
    ),
    (ModelError, SIMULATE + '[predict]\ndirections = ["up"]', ["predict.directions", "up", "torsion"]),
    (CampaignError, SIMULATE + "seed = -1", ["simulate.seed", "-1"]),
    (CampaignError, SIMULATE + "repeats = 1.5", ["simulate.repeats", "1.5", "whole number"]),
    (CampaignError, SIMULATE + "parameters = { nu = 1 }", ["simulate.parameters.nu", "unknown key", 'mean "mu"']),
    (CampaignError, SIMULATE + "effects = { inertia = { mas = 1 } }", ["simulate.effects.inertia.mas", "inertia.mass"]),
    (
        UnitError,
        SIMULATE + 'sweeps = [{ direction = "axial", amplitudes = ["1 deg"], frequencies = ["5 Hz"] }]',
        ["simulate.sweeps #1.amplitudes #1", "a length"],
    ),
]


@pytest.mark.parametrize(("kind", "text", "words"), BAD)
def test_bad_campaigns_have_one_clear_error(
    kind: type[BushfitError], text: str, words: list[str], folder: Path
) -> None:
    with pytest.raises(BushfitError) as caught:
        campaign_from(text, folder)
    message = str(caught.value)
    assert type(caught.value) is kind
    assert str(folder) in message
    assert all(word in message for word in words), message
    assert str(pickle.loads(pickle.dumps(caught.value))) == message


VALUES = st.recursive(
    st.sampled_from(['"1 mm"', '"5 Hz"', "1", "-1.5", "nan", "true", '"axial"', '"loop.csv"', "1979-05-27", '"1 MPa"']),
    lambda inner: (
        st.lists(inner, max_size=3).map(lambda parts: f"[{', '.join(parts)}]")
        | st.dictionaries(
            st.sampled_from(["mu", "value", "direction", "file", "start", "stop", "step"]), inner, max_size=3
        ).map(lambda table: "{" + ", ".join(f"{key} = {value}" for key, value in table.items()) + "}")
    ),
    max_leaves=6,
)


@given(
    st.sampled_from(["fit", "predict", "simulate", "loops", "sweeps"]),
    st.sampled_from(
        ["mu", "frequencies", "directions", "parameters", "effects", "loops", "sweeps", "file", "residuals"]
    ),
    VALUES,
)
def test_any_value_is_understood_or_a_clear_error(
    tmp_path_factory: pytest.TempPathFactory, table: str, key: str, value: Any
) -> None:
    header = f"[[{table}]]" if table in ("loops", "sweeps") else f"[{table}]"
    with contextlib.suppress(BushfitError):
        campaign_from(f"{BUSHING}\n{header}\n{key} = {value}\n", tmp_path_factory.getbasetemp())


def test_a_limit_beyond_what_a_parameter_can_have_is_moved_there(folder: Path) -> None:
    """A least modulus of 0 says that it is not negative; a logarithm has no 0."""
    limits = campaign_from(SIMULATE + '[fit.mu]\nmin = "0 MPa"\nmax = "1e6 MPa"', folder).fit.parameters["mu"]
    assert (limits.min, limits.max) == (1e3, 1e9)
