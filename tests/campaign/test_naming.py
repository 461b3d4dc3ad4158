"""Names as folders: one folder on every system, wherever the name comes from."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.naming import folder_name
from bushfit.geometry import Bushing


@pytest.mark.parametrize(
    ("name", "folder"),
    [
        ("CMP 15 961", "CMP 15 961"),
        ("../../etc", "_.._etc"),
        ("", "campaign"),
        ("...", "campaign"),
        ("a/b\\c:d", "a_b_c_d"),
        ("CON", "_CON"),
        ("nul.txt", "_nul.txt"),
        ("lpt1", "_lpt1"),
        ("console", "console"),
        ("a\ud800b", "a_b"),
        ("line\nbreak", "line_break"),
    ],
)
def test_folder_names_never_lead_out(name: str, folder: str) -> None:
    assert folder_name(name).strip(".") == folder.strip(".")
    assert not {"/", "\\"} & set(folder_name(name))
    assert folder_name("x" * 500) == "x" * 60


@given(st.text(max_size=300))
@example("con")
@example("Aux .txt")
@example("../" * 50)
def test_a_name_is_one_folder_on_every_system(name: str) -> None:
    folder = folder_name(name)
    assert (Path("base") / folder).parent == Path("base")
    assert folder.strip(" .") == folder
    assert 0 < len(folder.encode()) < 250
    assert not set(folder) & set('/\\:*?"<>|\n')
    assert folder.partition(".")[0].upper() not in {"CON", "PRN", "AUX", "NUL", "COM1", "LPT9"}


@given(st.text(max_size=100))
def test_a_slug_is_one_folder(name: str) -> None:
    slug = Campaign(name, Path("c.toml"), Bushing("b", 1.0, 2.0, 3.0)).slug
    folder = Path("/results")
    assert (folder / slug).parent == folder
    assert (folder / slug).resolve().parent == folder
    assert len(slug.encode("utf-8", "surrogatepass")) <= 255


@pytest.mark.parametrize(
    ("name", "slug"),
    [
        ("CMP 15 961", "CMP 15 961"),
        ("../../etc", "_.._etc"),
        ("..", "campaign"),
        ("a/b\\c", "a_b_c"),
        ("Buchse Ø 36", "Buchse Ø 36"),
    ],
)
def test_slugs(name: str, slug: str) -> None:
    assert Campaign(name, Path("c.toml"), Bushing("b", 1.0, 2.0, 3.0)).slug == slug
