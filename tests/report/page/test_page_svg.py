"""Axes and pictures: values to pixels and back, round ticks, and every text escaped."""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bushfit.report.page.chart import Cells, Rule, Series, chart, maps
from bushfit.report.page.svg import Axis, path, tag, text

positive = st.floats(1e-6, 1e6)


@given(positive, positive, st.booleans())
def test_ticks_are_round_few_and_within(one: float, other: float, log: bool) -> None:
    axis = Axis.over("x", [np.array([one, other])], 0.0, 400.0, log=log)
    assert axis.low <= min(one, other)
    assert axis.high >= max(one, other)
    values = [value for value, _ in axis.ticks]
    assert 1 <= len(values) <= 11
    assert all(axis.low * (1 - 1e-9) <= value <= axis.high * (1 + 1e-9) for value in values)
    for value, words in axis.ticks:
        assert float(words) == pytest.approx(value, rel=1e-3, abs=1e-9 * axis.high)


@given(st.lists(positive, min_size=2, max_size=9, unique=True), st.booleans())
def test_pixels_go_back_to_values(values: list[float], log: bool) -> None:
    axis = Axis.over("x", [np.array(values)], 50.0, 450.0, log=log)
    low, high, first, last, kind = axis.described.split()
    share = (axis(np.array(values)) - float(first)) / (float(last) - float(first))
    back = (
        float(low) * (float(high) / float(low)) ** share
        if kind == "log"
        else float(low) + share * (float(high) - float(low))
    )
    np.testing.assert_allclose(back, values, rtol=1e-5, atol=1e-6 * max(values))


def test_what_is_not_known_parts_a_line() -> None:
    x, y = np.arange(5.0), np.array([1.0, 2.0, math.nan, 4.0, 5.0])
    assert 'd="M0 1L1 2M3 4L4 5"' in path(x, y)
    assert path(x[:0], y[:0]) == ""


@given(st.text(st.characters(exclude_categories=["Cs", "Cc"], exclude_characters="\ufffe\uffff"), min_size=1))
def test_texts_are_texts(words: str) -> None:
    element = ET.fromstring(text(1, 2, words, data_name=words))
    assert element.text == words
    assert (
        ET.fromstring(tag("g", data_series=words)).get("data-series") == " ".join(words.splitlines())
        or words.isspace()
        or "\t" in words
        or len(words.splitlines()) > 1
    )
    assert list(element) == []


def test_a_chart_has_its_series_bands_rules_and_legend() -> None:
    x = np.linspace(1.0, 9.0, 5)
    one = Series("<one>", "#123456", "6 2", (x, x**2), (x, x**2 - 1, x**2 + 1), (x, x**2))
    drawn = ET.fromstring(chart("t & u", ("x [mm]", "y"), [one], "what it is", rules=[Rule(5.0, "limit", limit=True)]))
    ns = "{http://www.w3.org/2000/svg}"
    words = [element.text for element in drawn.iter(f"{ns}text")]
    for said in ("t & u", "<one>", "limit", "x [mm]", "y"):
        assert said in words
    assert drawn.get("role") == "img"
    assert drawn.get("aria-label") == "what it is"
    (group,) = drawn.iter(f"{ns}g")
    assert len(list(group)) == 3


def test_a_map_has_a_cell_a_value_and_bars_where_the_measurement_is_far_below() -> None:
    before = np.array([[0.1, -3.0, 7.0], [math.nan, 0.0, -0.7]])
    drawn = maps(
        "t", ("before", "after"), [Cells("storage", ("a", "b"), ("1", "x", "3 Hz"), (before, 0 * before))], "alt"
    )
    cells = re.findall(r'd="([^"]*z)" fill="(#\w+)"', drawn)
    assert sum(d.count("z") for d, _ in cells) == 10, "one of six was not measured, twice"
    (bars,) = re.findall(r'd="(M[^"z]*)" stroke="#ffffff"', drawn)
    assert bars.count("M") == 1
    colors = {color for _, color in cells}
    assert len(colors) == 4
