"""The session of a campaign: turns, temperatures and the strains that went before."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bushfit.campaign.campaign import load_campaign
from bushfit.campaign.session import Visit, session
from bushfit.fitting.data import Data
from bushfit.geometry import Bushing, Direction, Specimen, unit_strain

BUSHING = Bushing("CMP 15 961", 0.010, 0.018, 0.034)
COUPON = Specimen("DMA", "modulus")


def test_turns_go_from_first_to_last_and_strains_remember_the_largest_before() -> None:
    loop = Visit(Direction.AXIAL, np.array([1e-3]), 300.0)
    sweep = Visit(Direction.AXIAL, np.array([1e-4, 5e-4, 2e-4]))
    first, second = session(BUSHING, [loop, sweep])
    assert first.temperature == 300.0
    assert second.temperature is None
    np.testing.assert_allclose(first.turn, [0.0])
    np.testing.assert_allclose(second.turn, [1 / 3, 2 / 3, 1.0])
    np.testing.assert_allclose(first.strained, [0.0])
    np.testing.assert_allclose(second.strained, 3 * [1e-3 * unit_strain(BUSHING, Direction.AXIAL)])


def test_the_last_larger_strain_counts_from_when_it_was_left() -> None:
    up_and_down = np.array([1.0, 2.0, 4.0, 4.1, 2.0, 2.1, 1.0, 2.0]) * 1e-4
    (found,) = session(BUSHING, [Visit(Direction.AXIAL, up_and_down)])
    strain = up_and_down * unit_strain(BUSHING, Direction.AXIAL)
    np.testing.assert_allclose(found.left, [0.0, 0.0, 0.0, 0.0, strain[3], strain[3], strain[5], strain[3]])
    np.testing.assert_allclose(7.0 * found.rested[4:], [1.0, 2.0, 1.0, 4.0])


def test_the_order_that_is_stated_counts() -> None:
    small, large = Visit(Direction.AXIAL, np.array([1e-4]), order=2), Visit(Direction.AXIAL, np.array([1e-3]), order=1)
    later, earlier = session(BUSHING, [small, large])
    assert (later.turn[0], earlier.turn[0]) == (1.0, 0.0)
    assert later.strained[0] > earlier.strained[0] == 0.0


def test_every_body_has_a_session_of_its_own() -> None:
    coupon, mount = Visit(COUPON, np.array([0.5, 0.1])), Visit(Direction.RADIAL, np.array([1e-4, 1e-4, 1e-4]))
    of_coupon, of_mount = session(BUSHING, [coupon, mount])
    np.testing.assert_allclose(of_coupon.turn, [0.0, 1.0])
    np.testing.assert_allclose(of_mount.turn, [0.0, 0.5, 1.0])
    np.testing.assert_allclose(of_coupon.strained, [0.0, 0.5 * unit_strain(None, COUPON)])
    assert of_mount.strained[2] < 0.1


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
def test_a_campaign_gives_temperatures_and_order(tmp_path: Path, order: tuple[str, str], first: str) -> None:
    data = Data.of(load_campaign(write(tmp_path, order)))
    under = {sweep.name: sweep.circumstances for sweep in data.sweeps}
    assert under["cold"].temperature == pytest.approx(293.15)
    np.testing.assert_allclose(under["warm"].temperature, [303.15, 304.15, 305.15])
    assert under[first].turn[0] == 0.0
    part = data.sweeps[1].at_amplitudes([1e-4]).circumstances
    np.testing.assert_array_equal(part.turn, under["warm"].turn)
