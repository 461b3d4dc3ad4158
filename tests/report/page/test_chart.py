"""Charts and maps of a page: values to pixels and back, round ticks, every text escaped, every cell drawn."""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bushfit.report.page.chart import Axis, Cells, Rule, Series, chart, maps

positive = st.floats(1e-6, 1e6)
SVG = "{http://www.w3.org/2000/svg}"


@given(positive, positive, st.booleans())
def test_ticks_are_round_few_and_within(one: float, other: float, log: bool) -> None:
    axis = Axis.over("x", [np.array([one, other])], 0.0, 400.0, log=log)
    assert axis.low <= min(one, other)
    assert axis.high >= max(one, other)
    assert 1 <= len(axis.ticks) <= 11
    for pixel, words in axis.ticks:
        assert -1e-6 <= pixel <= 400.0 + 1e-6
        assert float(axis(float(words))) == pytest.approx(pixel, abs=0.4)


@given(st.lists(positive, min_size=2, max_size=9, unique=True), st.booleans())
def test_pixels_go_back_to_values(values: list[float], log: bool) -> None:
    axis = Axis.over("x", [np.array(values)], 50.0, 450.0, log=log)
    *ends, kind = axis.described.split()
    low, high, first, last = map(float, ends)
    share = (axis(np.array(values)) - first) / (last - first)
    back = low * (high / low) ** share if kind == "log" else low + share * (high - low)
    np.testing.assert_allclose(back, values, rtol=1e-5, atol=1e-6 * max(values))


@given(st.text(st.characters(exclude_categories=["Cs", "Cc"], exclude_characters="\ufffe\uffff"), min_size=1))
def test_texts_are_texts(words: str) -> None:
    words, x = f"<{words}", np.linspace(1.0, 9.0, 5)
    one = Series(words, "#123456", "6 2", (x, x**2), (x, x**2 - 1, x**2 + 1), (x, x**2))
    drawn = ET.fromstring(chart("t & u", ("x [mm]", words), [one], words, rules=[Rule(5.0, "limit")]))
    texts = [element.text for element in drawn.iter(f"{SVG}text")]
    assert texts.count(words) == 2
    assert {"t & u", "limit", "x [mm]"} <= set(texts)
    (group,) = drawn.iter(f"{SVG}g")
    assert [element.tag for element in group] == [f"{SVG}path"] * 3
    if words == " ".join(words.split()):
        assert drawn.get("aria-label") == group.get("data-series") == words


def test_what_is_not_known_parts_a_line() -> None:
    x, y = np.arange(5.0), np.array([1.0, 2.0, math.nan, 4.0, 5.0])
    (d,) = re.findall(
        'd="([^"]*)"[^>]*data-of="model"', chart("t", ("x", "y"), [Series("", "red", line=(x, y))], "alt")
    )
    assert re.sub("[-. 0-9]", "", d) == "MLML"
    none = Series("", "red", line=(x[:0], y[:0]))
    assert 'data-of="model"' not in chart("t", ("x", "y"), [none], "alt")


def test_a_map_has_a_cell_a_value_and_bars_where_the_measurement_is_far_below() -> None:
    before = np.array([[0.1, -3.0, 7.0], [math.nan, 0.0, -0.7]])
    cells = Cells("storage", ("a", "b"), ("1", "x", "3 Hz"), (before, 0 * before))
    drawn = maps("t", ("before", "after"), [cells], "alt")
    paths = re.findall(r'd="([^"]*z)" fill="(#\w+)"', drawn)
    assert sum(d.count("z") for d, _ in paths) == 10, "one of six was not measured, twice"
    assert len({color for _, color in paths}) == 4
    (bars,) = re.findall(r'd="(M[^"z]*)" stroke="#ffffff"', drawn)
    assert bars.count("M") == 1
