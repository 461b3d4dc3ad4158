"""The page of a batch: a row a bushing, links, control charts, limits."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commandline import call
from production import COUNT, LOSSY, SOFT
from reading_html import LARGEST, loads, parsed

from bushfit.report.contents import pages_of
from bushfit.report.page.index import index_page, read_batch

#: A batch that is diagnosed and reported takes ten seconds.
pytestmark = pytest.mark.slow


def test_a_batch_writes_its_page_and_the_folder_gives_the_same(batch: Path) -> None:
    written = (batch / "index.html").read_bytes()
    assert pages_of(read_batch(batch))["index.html"] == written
    page = written.decode()
    assert loads(page) == []
    found = parsed(page)
    for words in ("m: 4 bushings", "3 done, 1 failed", "=1+1 <b>", "mu [MPa]", "inertia", "Control charts"):
        assert words in found.text
    links = [value for tag, key, value in found.attributes if (tag, key) == ("a", "href")]
    assert sorted(links) == [f"bushings/c{n}/report.html" for n in range(3)]
    assert all((batch / link).is_file() for link in links)
    summary = json.loads((batch / "batch.json").read_text(encoding="utf-8"))
    mu = summary["quantities"]["mu [MPa]"]
    assert mu["allowed"] == [1.2, None]
    table = pd.read_csv(batch / "batch.csv")
    assert mu["median"] == pytest.approx(table["mu [MPa]"].median())
    out = table["mu [MPa]"] < 1.2
    assert f"{int(out.sum())} out of limits" in page
    rows = re.findall(r'<tr><th scope="row" align="left">(?:<a [^>]*>)?([^<]*)', page.partition('id="h-rows"')[2])
    assert rows[0] == "=1+1 &lt;b&gt;", "what failed comes first"
    assert len(rows) == 4


def test_report_makes_it_again_and_elsewhere_with_whole_links(batch: Path, tmp_path: Path) -> None:
    done = call(tmp_path, "report", batch, "-o", "x")
    assert done.returncode == 0, done.stderr
    links = re.findall(r'href="([^"]*)"', (tmp_path / "x/index.html").read_text(encoding="utf-8"))
    assert sorted(links) == [f"{batch.resolve().as_uri()}/bushings/c{n}/report.html" for n in range(3)]


def test_the_page_shows_each_curve_against_the_batch_and_who_differs(made: Path) -> None:
    page = (made / "out/index.html").read_text(encoding="utf-8")
    assert pages_of(read_batch(made / "out"))["index.html"].decode() == page
    found = parsed(page)
    assert loads(page) == []
    alts = [value for tag, key, value in found.attributes if (tag, key) == ("svg", "aria-label")]
    curves = [alt for alt in alts if alt.endswith(" % off the median")]
    assert len(curves) == COUNT
    numbers = [[float(word) for word in alt.split()[:3:2]] for alt in curves]
    rows = re.findall(r'<tr><th scope="row" align="left"><a [^>]*>([^<]*)', page.partition('id="h-rows"')[2])
    assert max(numbers[rows.index(f"part_{SOFT}")]) < -5.0 < 5.0 < max(numbers[rows.index(f"part_0{LOSSY}")])
    assert {f"part_{SOFT}", f"part_0{LOSSY}"} < set(rows[:8]), "what differs is among those that come first"
    assert any(alt.endswith("single curves: part_07, part_20") for alt in alts)
    for words in ("2 bushings differ from the others", "SN 907", "moving range: mu [MPa]", "drifts", "Ppk = "):
        assert words in found.text


def test_many_bushings_stay_small(made: Path) -> None:
    contents = read_batch(made / "out")
    table = contents.tables["batch"]()
    random = np.random.default_rng(1)
    ordered = {"mu [MPa]": random.normal(1.1, 0.05, 20_010), "order of test [-]": np.arange(1.0, 20_011.0)}
    many = table.iloc[[*range(COUNT)] * 667].assign(**ordered).reset_index(drop=True)
    many["limits"] = ["pass"] * 20_010
    page = index_page(contents.documents, {"batch": many})
    assert len(page.encode()) < LARGEST
    assert re.search(r"Here are 2 of 2 that need a look and, evenly taken, (\d+) of the others", page)
    assert "of 20010; batch.csv has all" in page


def test_a_batch_without_a_page(root: Path, tmp_path: Path) -> None:
    pattern = root / "data/practice/case_00[0]/bushing.toml"
    done = call(tmp_path, "batch", pattern, "-o", "x", "--no-report", "--jobs", "1", "-q")
    assert done.returncode == 0, done.stderr
    assert not (tmp_path / "x/index.html").exists()
    assert (tmp_path / "x/batch.json").exists()
