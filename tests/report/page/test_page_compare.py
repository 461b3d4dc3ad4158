"""The page of a comparison: the same from memory and from its file, whole, escaped, small, and true to the tables."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from commandline import call
from hypothesis import given
from hypothesis import strategies as st
from reading_html import LARGEST, NASTY, assert_harmless, assert_page_or_error, drawn, loads, parsed, spoiled

from bushfit.report.contents import pages_of
from bushfit.report.page import comparison_page, folder_contents

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
    assert pages_of(folder_contents(compared / name))["compare.html"].decode() == page
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


def leaves(node: Any) -> Iterator[tuple[Any, Any]]:
    """Every table or list of a document with each of its keys."""
    for key in list(node) if isinstance(node, dict) else range(len(node)) if isinstance(node, list) else ():
        yield node, key
        yield from leaves(node[key])


@given(
    name=st.sampled_from(NAMES),
    place=st.integers(0, 10**6),
    value=st.sampled_from([None, "x", "", -1, 0, 1e300, True, (), "gone"]),
)
def test_any_value_may_be_spoiled(compared: Path, name: str, place: int, value: Any) -> None:
    document = document_of(compared, name)
    places = [each for each in leaves(document) if not isinstance(each[1], int) or each[1] < 3]
    node, key = places[place % len(places)]
    if value == "gone":
        del node[key]
    else:
        node[key] = value
    assert_page_or_error(lambda: page_of(document))


def test_a_folder_with_a_model_too_has_both_pages(root: Path, documents: dict[str, Any], tmp_path: Path) -> None:
    (tmp_path / "compare.json").write_text(json.dumps(documents["two"]))
    (tmp_path / "model.json").write_bytes((root / "data/reports/mystery_mount/model.json").read_bytes())
    done = call(tmp_path, "report", ".")
    assert "wrote compare.html, report.html to ." in done.stderr
