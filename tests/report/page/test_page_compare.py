"""Pages of a comparison and of a batch: whole, escaped, small, and true to the tables; and charts, to the pixel."""

import json
import re
from typing import Any

import numpy as np
import pandas as pd
import pytest
from production import COUNT, LOSSY, SOFT
from reading_html import LARGEST, loads, parsed

from bushfit import units
from bushfit.report.compared import read_comparison
from bushfit.report.page import folder_pages
from bushfit.report.page.comparison import comparison_page
from bushfit.report.results import Formats, encode_all

NAMES = ["two", "families"]
#: A batch that is diagnosed and reported takes ten seconds.
SLOW = pytest.mark.slow


def page_of(document: Any) -> str:
    return comparison_page(read_comparison(document))


@pytest.mark.parametrize("name", NAMES)
def test_compare_writes_a_whole_page_and_its_folder_gives_the_same(compared, name):
    page = (compared / name / "compare.html").read_text(encoding="utf-8")
    assert encode_all(folder_pages(compared / name), Formats())["compare.html"].decode() == page
    found = parsed(page)
    assert loads(page) == []
    assert len(page.encode()) < LARGEST
    described = [value for tag, key, value in found.attributes if (tag, key) == ("svg", "aria-label")]
    assert len(described) == found.counts["svg"] == 1
    assert min(map(len, described)) > 40
    assert ("<span><b>" in page) == (name == "two"), "significant differences alone are bold"


@SLOW
def test_a_batch_writes_its_page_and_the_folder_gives_the_same(batch):
    written = (batch / "index.html").read_bytes()
    assert encode_all(folder_pages(batch), Formats())["index.html"] == written
    page = written.decode()
    assert loads(page) == []
    found = parsed(page)
    for words in ("1 could not be evaluated", "=1+1 <b>", "mu [MPa]", "inertia", "What 3 of 4 parts can show"):
        assert words in found.text
    links = {value for tag, key, value in found.attributes if (tag, key) == ("a", "href")}
    assert sorted(links) == [f"bushings/c{n}/report.html" for n in range(3)]
    assert all((batch / link).is_file() for link in links)
    summary = json.loads((batch / "batch.json").read_text(encoding="utf-8"))
    mu = summary["quantities"]["mu [MPa]"]
    assert (mu["min"], mu["max"]) == (1.2, None)
    table = pd.read_csv(batch / "batch.csv")
    assert mu["median"] == pytest.approx(table["mu [MPa]"].median())
    soft = table[table["mu [MPa]"] < 1.2]
    assert summary["missed"] == list(soft["name"])
    first = found.text[: found.text.index("What 3 of 4 parts can show")]
    assert all(f"{name} fails: mu " in first and "limit 1.2" in first for name in soft["name"])
    rows = re.findall(r'<tr><th scope="row" align="left">(?:<a [^>]*>)?([^<]*)', page.partition('id="h-rows"')[2])
    assert rows[0] == "=1+1 &lt;b&gt;", "what failed comes first"
    assert len(rows) == 4


@SLOW
def test_the_page_shows_each_curve_against_the_batch_and_who_differs(made):
    page = (made / "out/index.html").read_text(encoding="utf-8")
    assert encode_all(folder_pages(made / "out"), Formats())["index.html"].decode() == page
    found = parsed(page)
    alts = [value for tag, key, value in found.attributes if (tag, key) == ("svg", "aria-label")]
    curves = [alt for alt in alts if alt.endswith(" % off the median")]
    assert len(curves) == COUNT
    numbers = [[float(word) for word in alt.split()[:3:2]] for alt in curves]
    rows = re.findall(r'<tr><th scope="row" align="left">(?:<a [^>]*>)?([^<]*)', page.partition('id="h-rows"')[2])
    assert max(numbers[rows.index(f"part_{SOFT}")]) < -5.0 < 5.0 < max(numbers[rows.index(f"part_0{LOSSY}")])
    assert {f"part_{SOFT}", f"part_0{LOSSY}"} < set(rows[:8]), "what differs is among those that come first"
    assert any(alt.endswith("Single curves: part_07, part_20") for alt in alts)
    parts = json.loads((made / "out/batch.json").read_text(encoding="utf-8"))["parts"]
    measured = np.array([part["curve"] for part in parts])
    usual = [not (part["deviations"] or part["poor_fit"]) for part in parts]
    scale = 150.0 * np.abs(measured / np.median(measured, axis=0) - 1.0)[usual].max()
    assert f"scale {units.number(-scale, 2)} to {units.number(scale, 2, '+')} %" in found.text
    assert loads(page) == []
    for words in ("2 differ from the others", "SN 907", "part_20 fails: mu 0.", "Differs from the others: mu -3"):
        assert words in found.text
