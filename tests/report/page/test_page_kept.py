"""Reports that are kept are those that are made now, and results of older versions have a page as well."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from commandline import call
from reading_html import change, loads, made_of, page_of, parsed

Results = Callable[[str], Path]
STYLED = re.compile(r"<(style|script)>(.*?)</\1>", re.DOTALL)


def test_results_of_older_versions_have_a_page_and_are_compared(root: Path, tmp_path: Path) -> None:
    """Without probabilities (diagnosis_2.json), what a model says of its campaign, and all but residuals of the gap."""
    folder = tmp_path / "x"
    shutil.copytree(root / "data/reports/mystery_mount", folder)
    shutil.copy(Path(__file__).with_name("diagnosis_2.json"), folder / "diagnosis.json")
    change(folder / "model.json", campaign=None)
    (folder / "gap.csv").write_text("test,kind,direction,force before [noise]\na,loop,axial,1\n")
    text = parsed(made_of(folder)).text
    for words in (
        *("Mystery mount", "axial: stiffness", "Verdict: named", "sleeve_compliance closes the gap"),
        *("Told without odds", "put a steel dummy"),
    ):
        assert words in text
    assert "all but sure" not in text
    (folder / "sweeps.csv").unlink()
    assert "Lines" not in parsed(made_of(folder)).text
    done = call(tmp_path, "compare", "x", root / "data/reports/mystery_mount", "-o", "y", "--no-plots")
    assert done.returncode == 0, done.stderr


def bare(page: str) -> str:
    """A page without its pictures, every number the same: other processors round otherwise."""
    return re.sub(
        r"[-+]?\d+(?:\.\d+)?(?:e-?\d+)?", "#", re.sub(r"<svg.*?</svg>|[0-9a-f]{64}", "", page, flags=re.DOTALL)
    )


def assert_current(kept: Path, made: Path) -> None:
    one, other = kept.read_text(encoding="utf-8"), made.read_text(encoding="utf-8")
    remedy = f"stale: copy {made.name} of the command that data/README.md names to {kept}"
    assert STYLED.findall(one) == STYLED.findall(other), remedy
    assert bare(one) == bare(other), remedy
    assert one.count("<svg") == other.count("<svg")
    assert len(one) == pytest.approx(len(other), rel=0.02)


@pytest.mark.parametrize("name", ["cmp_15961", "mystery_mount"])
def test_the_reports_of_the_readme_are_current(root: Path, results: Results, name: str) -> None:
    assert_current(root / f"data/reports/{name}.html", results(name) / "report.html")


def test_the_report_of_measured_rubber_is_current_and_says_that_the_mount_was_not_fitted(
    root: Path, measured: Path
) -> None:
    assert_current(root / "data/measured/epdm_70/report.html", measured / "report.html")
    text = parsed(page_of(measured)).text
    assert loads(page_of(measured)) == []
    specimen = "2 blocks in parallel in shear, 772 mm² each, 6 mm thick"
    for words in ("18.4 °C, 0.151 %", "(not fitted)", specimen, "mount 24 %", "Fitted, not diagnosed"):
        assert words in text


def test_the_results_to_try_it_on_are_current(root: Path, results: Results) -> None:
    made = results("mystery_mount")
    kept = sorted((root / "data/reports/mystery_mount").iterdir())
    assert len(kept) == 5
    for file in kept:
        one, other = (bare(folder.read_text(encoding="utf-8")) for folder in (file, made / file.name))
        assert one == other, f"stale: copy {file.name} of bushfit run configs/mystery_mount.toml to {file}"
