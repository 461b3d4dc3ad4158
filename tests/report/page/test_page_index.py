"""The page of a batch: a row a bushing, links, control charts, limits."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commandline import call
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
    rows = re.findall(r'<tr><th scope="row" align="left">(?:<a [^>]*>)?([^<]*)', page)
    assert rows[0] == "=1+1 &lt;b&gt;", "what failed comes first"
    assert len(rows) == 4


def test_report_makes_it_again_and_elsewhere_with_whole_links(batch: Path, tmp_path: Path) -> None:
    done = call(tmp_path, "report", batch, "-o", "x")
    assert done.returncode == 0, done.stderr
    links = re.findall(r'href="([^"]*)"', (tmp_path / "x/index.html").read_text(encoding="utf-8"))
    assert sorted(links) == [f"{batch.resolve().as_uri()}/bushings/c{n}/report.html" for n in range(3)]


def test_many_bushings_stay_small(batch: Path) -> None:
    contents = read_batch(batch)
    table = contents.tables["batch"]()
    random = np.random.default_rng(1)
    many = table.iloc[[0] * 20_000].assign(**{"mu [MPa]": random.normal(1.3, 0.05, 20_000)}).reset_index(drop=True)
    page = index_page(contents.documents, {"batch": many})
    assert len(page.encode()) < LARGEST
    assert "of 20000; batch.csv has all" in page


def test_a_batch_without_a_page(root: Path, tmp_path: Path) -> None:
    pattern = root / "data/practice/case_00[0]/bushing.toml"
    done = call(tmp_path, "batch", pattern, "-o", "x", "--no-report", "--jobs", "1", "-q")
    assert done.returncode == 0, done.stderr
    assert not (tmp_path / "x/index.html").exists()
    assert (tmp_path / "x/batch.json").exists()
