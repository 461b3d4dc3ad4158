"""`manual` and `example`: what a new user has without the source tree."""

import re
from pathlib import Path

import pytest
from shell import refused, values


def test_the_manual_is_one_file_whose_links_stay_in_it(bushfit, root, tmp_path):
    bushfit("manual", "diagnosis", "-o", tmp_path / "m")
    text = (tmp_path / "m/manual.html").read_text(encoding="utf-8")
    pages = {page.stem for page in (root / "bushfit/manual").glob("*.md")}
    identifiers = re.findall(r' id="([^"]+)"', text)
    assert len(identifiers) == len(set(identifiers))
    assert pages <= set(identifiers)
    targets = set(re.findall(r'href="([^"]+)"', text))
    assert {target for target in targets if not target.startswith(("#", "https://"))} == set()
    assert {target[1:] for target in targets if target.startswith("#")} <= set(identifiers)
    assert len(targets) > 30
    assert "src=" not in text
    assert text.count("<table>") > 20


def test_without_a_folder_the_browser_opens_at_the_page(bushfit, monkeypatch):
    opened = list[str]()
    monkeypatch.setattr("click.launch", opened.append)
    bushfit("manual", "fitting")
    assert len(opened) == 1
    assert re.fullmatch(r"file:///.*/manual\.html#fitting", opened[0])
    refused(bushfit("manual", "fiting", status=2), Path("nowhere"), "no such page", 'did you mean "fitting"?')


def test_the_example_runs_and_gives_back_its_parameters(bushfit, table_1, tmp_path):
    done = bushfit("example", "-o", tmp_path / "my example")
    assert f'next: bushfit run "{tmp_path}/my example/campaign.toml"' in done.stderr
    assert "Simulated by bushfit simulate" in (tmp_path / "my example/campaign.toml").read_text(encoding="utf-8")
    fitted = values(bushfit("fit", tmp_path / "my example/campaign.toml", "-o", tmp_path / "f", "--no-plots", "--json"))
    assert fitted == pytest.approx(table_1, rel=0.05)
