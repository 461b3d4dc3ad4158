"""The pages of a comparison and of a batch: whole, escaped, small, and true to the tables."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from commandline import call
from hypothesis import given
from production import COUNT, LOSSY, SOFT
from reading_html import LARGEST, NASTY, assert_harmless, drawn, loads, parsed, spoiled

from bushfit.jobs.report import report
from bushfit.report.contents import pages_of
from bushfit.report.page import comparison_page
from bushfit.report.page.index import index_page, read_batch

NAMES = ["two", "families"]
#: Keys of compare.json whose texts come from a user's files or names.
FOREIGN = {"name", "source", "words", "warnings", "command", "file", "note", "part", "reason"}


def page_of(document: Any) -> str:
    return comparison_page({"compare": document}, {})


def document_of(compared: Path, name: str) -> Any:
    return json.loads((compared / name / "compare.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def documents(compared: Path) -> dict[str, Any]:
    return {name: document_of(compared, name) for name in NAMES}


@pytest.mark.parametrize("name", NAMES)
def test_compare_writes_a_whole_page_and_its_folder_gives_the_same(compared: Path, name: str) -> None:
    page = (compared / name / "compare.html").read_text(encoding="utf-8")
    assert pages_of(report(compared / name))["compare.html"].decode() == page
    found = parsed(page)
    assert loads(page) == []
    assert len(page.encode()) < LARGEST
    described = [value for tag, key, value in found.attributes if (tag, key) == ("svg", "aria-label")]
    assert len(described) == found.counts["svg"] == {"two": 8, "families": 4}[name]
    assert min(map(len, described)) > 40


@pytest.mark.parametrize("name", NAMES)
def test_it_says_what_the_document_says(documents: dict[str, Any], compared: Path, name: str) -> None:
    document, text = documents[name], parsed(page_of(documents[name])).text
    said = document["words"] if name == "two" else [family["words"] for family in document["families"]]
    for entry in document["compared"]:
        said += [entry["name"], *(source["sha256"] for source in entry["inputs"])]
    assert len(document["compared"][0]["sha256"]) == 64
    for words in (*said, *document["warnings"][:12], document["command"], "numpy", "What this comparison cannot tell"):
        assert words in text
    table = pd.read_csv(compared / name / "parameters.csv").set_index(["parameter", "other"])
    low, high = (100 * table.loc[("mu", "B"), f"difference, {end}"] for end in ("low", "high"))
    shown = re.search(r"mu ([\d.]+) ([\d.]+) ([-+][\d.]+) % ([-+][\d.]+) to ([-+][\d.]+)", text)
    assert shown is not None
    np.testing.assert_allclose([float(shown[4]), float(shown[5])], [low, high], rtol=1e-4, atol=0.06)


def test_lines_are_those_of_the_table(compared: Path) -> None:
    """Stiffness of both, and the difference, within a tenth of a pixel."""
    page = (compared / "two/compare.html").read_text(encoding="utf-8")
    table = pd.read_csv(compared / "two/differences.csv").query("place == 'radial'")
    levels = table["amplitude [mm]"].unique()
    columns = {"A": "reference stiffness [N/mm]", "B": "other stiffness [N/mm]"}
    for level in (levels.min(), levels.max()):
        there = table[table["amplitude [mm]"] == level]
        for label, column in columns.items():
            line = drawn(page, "radial: stiffness")[f"{label}, {level:g} mm"]["model"]
            np.testing.assert_allclose(line[1], there[column], atol=np.ptp(table[[*columns.values()]].to_numpy()) / 900)
        off = drawn(page, "radial: stiffness less A&#39;s")[f"B, {level:g} mm"]["model"]
        relative = 100 * (there[columns["B"]] / there[columns["A"]] - 1)
        np.testing.assert_allclose(off[1], relative, atol=np.ptp(relative) / 100 + 0.2)


@given(name=NASTY)
def test_names_do_no_harm(compared: Path, name: str) -> None:
    for document in (document_of(compared, each) for each in NAMES):
        plain = parsed(page_of(spoiled(document, "plain", FOREIGN)))
        assert_harmless(page_of(spoiled(document, name, FOREIGN)), plain, name)


def grown(document: dict[str, Any]) -> dict[str, Any]:
    """Eight results at twelve places over a grid three times as fine."""
    first, entry = document["pairs"][0], document["compared"][1]
    columns = {name: 3 * column for name, column in first["places"]["axial"].items()}
    labels = "BCDEFGH"
    pairs = [first | {"other": label, "places": {f"place {n}": columns for n in range(12)}} for label in labels]
    more = [entry | {"label": label, "name": f"bushing {label}"} for label in labels]
    words = document["words"] * 60
    return document | {"pairs": pairs, "compared": [document["compared"][0], *more], "words": words}


def test_many_results_at_many_places_stay_small_and_what_is_left_out_is_said(documents: dict[str, Any]) -> None:
    page = page_of(grown(documents["two"]))
    assert len(page.encode()) < LARGEST
    text = parsed(page).text
    assert "8 further places are left out" in text
    assert "more, in compare.json" in text


def test_a_folder_with_a_model_too_has_both_pages(root: Path, documents: dict[str, Any], tmp_path: Path) -> None:
    (tmp_path / "compare.json").write_text(json.dumps(documents["two"]))
    (tmp_path / "model.json").write_bytes((root / "data/reports/mystery_mount/model.json").read_bytes())
    done = call(tmp_path, "report", ".")
    assert "wrote compare.html, report.html to ." in done.stderr


#: A batch that is diagnosed and reported takes ten seconds.
SLOW = pytest.mark.slow


@SLOW
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


@SLOW
def test_report_makes_it_again_and_elsewhere_with_whole_links(batch: Path, tmp_path: Path) -> None:
    done = call(tmp_path, "report", batch, "-o", "x")
    assert done.returncode == 0, done.stderr
    links = re.findall(r'href="([^"]*)"', (tmp_path / "x/index.html").read_text(encoding="utf-8"))
    assert sorted(links) == [f"{batch.resolve().as_uri()}/bushings/c{n}/report.html" for n in range(3)]


@SLOW
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


@SLOW
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
