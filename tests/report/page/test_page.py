"""The report of a result: the same from memory and from its files, whole, escaped, small, and true to the tables."""

from __future__ import annotations

import base64
import json
import re
import shutil
from collections.abc import Callable
from html import unescape
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commandline import call
from hypothesis import given
from hypothesis import strategies as st
from reading_html import (
    LARGEST,
    NASTY,
    assert_harmless,
    drawn,
    loads,
    made_of,
    page_of,
    parsed,
    spoiled,
)

from bushfit.campaign.campaign import load_campaign
from bushfit.commands.diagnose import diagnose
from bushfit.report.page import report_page, use_of
from bushfit.report.page.readback import canonical, read_results
from bushfit.report.results import Formats, encode_all

Results = Callable[[str], Path]


@pytest.mark.parametrize("name", ["cmp_15961", "mystery_mount"])
def test_run_writes_a_whole_page_that_loads_nothing_and_its_folder_gives_the_same(results: Results, name: str) -> None:
    page = page_of(results(name))
    found = parsed(page)
    assert loads(page) == []
    sections = [value for tag, key, value in found.attributes if (tag, key) == ("section", "id")]
    pictured = ["predicted", "amplitude", "colecole", "loops", "gap"]
    assert sections == ["tested", "verdict", "parameters", *pictured, "open", "terms", "provenance"]
    assert len(page.encode()) < LARGEST
    described = [value for tag, key, value in found.attributes if (tag, key) == ("svg", "aria-label")]
    assert len(described) == found.counts["svg"] >= 6
    assert min(map(len, described)) > 40
    assert not [key for _, key, _ in found.attributes if key == "style"], "a content policy would drop it"
    assert made_of(results(name)) == page


def test_diagnose_writes_it_too_and_its_folder_gives_the_same(root: Path, tmp_path: Path) -> None:
    """Without tables of their own, loops and sweeps are shown from that of the gap."""
    found = diagnose(load_campaign(root / "data/practice/case_001/bushing.toml"))
    files = encode_all(found.files, Formats(pictures=False))
    for file, content in files.items():
        (tmp_path / file).write_bytes(content)
    page = files["report.html"].decode()
    assert made_of(tmp_path) == page
    drawn_of = ("axial: stiffness", "axial: loss factor", "radial: stiffness", "axial: hysteresis")
    for words in (*drawn_of, "bushfit diagnose bushing.toml", "Lines without bands: the model at the measured points."):
        assert words in parsed(page).text


@pytest.mark.parametrize("form", ["xlsx", "decimal comma"])
def test_other_forms_of_tables_are_read_back(results: Results, tmp_path: Path, form: str) -> None:
    folder = tmp_path / "x"
    shutil.copytree(results("mystery_mount"), folder)
    for file in folder.glob("*.csv"):
        table = pd.read_csv(file)
        if form == "xlsx":
            table.to_excel(file.with_suffix(".xlsx"), index=False)
            file.unlink()
        else:
            file.write_bytes(table.to_csv(index=False, sep=";", decimal=",").encode("utf-8-sig"))
    assert made_of(folder) == page_of(folder)


def test_what_it_says_is_what_the_documents_say(results: Results) -> None:
    folder = results("mystery_mount")
    text = parsed(page_of(folder)).text
    diagnosis = json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))
    model = json.loads((folder / "model.json").read_text(encoding="utf-8"))
    for words in (
        *("Mystery mount", "inner diameter 24 mm, outer diameter 48 mm, length 50 mm", "Verdict: named"),
        *(diagnosis["summary"], diagnosis["next_test"], "rig_compliance"),
        "sleeve_compliance.compliance = 0.01398 mm/kN",
        "all but sure: a sleeve flexes in series with the rubber (sleeve_compliance)",
        *("0.7793", "0.7712 to 0.7874", "1.2 %", "bushfit run mystery_mount.toml"),
        *(where["reading"] for where in diagnosis["where"]),
        *(source["sha256"] for source in model["provenance"]["inputs"]),
        *(model["campaign"]["sha256"], "numpy", "1.69", "0.99"),
    ):  # fmt: skip
        assert words in text
    assert len(model["campaign"]["sha256"]) == 64


def test_conditions_of_the_tests_are_told(root: Path, tmp_path: Path) -> None:
    """Temperature, preload, date and the rest go from the campaign through the document onto the page."""
    text = (root / "configs/cmp_15961.toml").read_text(encoding="utf-8").replace("../data", str(root / "data"))
    stated = 'temperature = "22 degC"\npreload = "150 N axial"\ndate = "12 May 2025"\n'
    stated += 'operator = "night shift"\nspecimen_number = "A-7"\n'
    text = text.replace("[[sweeps]]\n", f"[[sweeps]]\n{stated}")
    head = '[report]\ncustomer = "Vehicle works"\npart_number = "15 961"\ndrawing = "D 7, issue C"\n'
    head += 'laboratory = "Elasto Lab"\ndate = "20 May 2025"\nlogo = "logo.png"\n'
    logo = b"\x89PNG\r\n\x1a\n" + bytes(range(256)) * 200
    (tmp_path / "logo.png").write_bytes(logo)
    (tmp_path / "c.toml").write_text(f"{text}\n{head}", encoding="utf-8")
    options = ("--effect", "inertia", "--direction", "axial", "--direction", "radial")
    done = call(tmp_path, "fit", "c.toml", "-o", "x", "--no-plots", "-q", *options)
    assert done.returncode == 0, done.stderr
    assert call(tmp_path, "report", "x", "-q").returncode == 0
    found = parsed(page_of(tmp_path / "x")).text
    conditions = ("22 °C", "150 N axial", "12 May 2025", "night shift", "A-7", "Fitted, not diagnosed")
    stated = ("Customer", "Vehicle works", "Part number", "15 961", "Drawing", "D 7, issue C", "Elasto Lab")
    for words in (*conditions, *stated, "20 May 2025"):
        assert words in found
    assert "bushfit fit c.toml --direction axial --direction radial --effect inertia" in found
    (shown,) = re.findall(r'<img src="data:image/png;base64,([^"]*)" alt="Logo of Elasto Lab"', page_of(tmp_path / "x"))
    assert base64.b64decode(shown) == logo
    model = tmp_path / "x/model.json"
    model.write_text(model.read_text(encoding="utf-8").replace("data:image/png;base64,", "https://a.b/"))
    refused = call(tmp_path, "report", "x", "--force")
    assert refused.returncode == 2, "nothing is loaded from elsewhere, whatever a file says"
    assert "campaign.logo: this is no picture" in refused.stderr


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "there is no such file"),
        (b"GIF89a", "found: a file that begins with b'GIF89a'"),
        (b"\x89PNG\r\n\x1a\n" + bytes(64_000), "at most 64000 bytes"),
    ],
)
def test_a_logo_that_cannot_be_shown_is_refused(root: Path, tmp_path: Path, content: bytes | None, words: str) -> None:
    text = (root / "configs/cmp_15961.toml").read_text(encoding="utf-8").replace("../data", str(root / "data"))
    (tmp_path / "c.toml").write_text(f'{text}\n[report]\nlogo = "logo.png"\n', encoding="utf-8")
    if content is not None:
        (tmp_path / "logo.png").write_bytes(content)
    done = call(tmp_path, "fit", "c.toml", "-o", "x")
    assert done.returncode == 2
    assert "logo.png, [report] logo: " in done.stderr
    assert words in done.stderr
    assert not (tmp_path / "x").exists()


def test_parts_of_one_campaign_are_told_apart_by_name(root: Path, tmp_path: Path) -> None:
    """Two parts, one stiffer: a curve each at every level, not the mean of both under one name."""
    text = (root / "configs/cmp_15961.toml").read_text(encoding="utf-8").replace("../data", str(root / "data"))
    sweep = pd.read_csv(root / "data/cmp_15961/sweep_axial.csv", comment="#")
    stiffness = next(name for name in sweep if "stiffness" in name)
    sweep.assign(**{stiffness: 1.1 * sweep[stiffness]}).to_csv(tmp_path / "stiffer.csv", index=False)
    own = text[text.index("[[sweeps]]") :].split("[[sweeps]]")[1]
    text = text.replace(own, f'{own}specimen_number = "A-7"\n', 1)
    text += '\n[[sweeps]]\nfile = "stiffer.csv"\ndirection = "axial"\nspecimen_number = "B-8"\n'
    (tmp_path / "c.toml").write_text(text, encoding="utf-8")
    assert call(tmp_path, "diagnose", "c.toml", "-o", "x", "--no-plots", "-q").returncode == 0
    page = made_of(tmp_path / "x")
    shown = drawn(page, "axial: stiffness")
    assert list(shown) == [f"part {part}, {level} mm" for part in ("A-7", "B-8") for level in (0.1, 0.2, 0.5)]
    one, other = (shown[f"part {part}, 0.2 mm"]["measured"][1] for part in ("A-7", "B-8"))
    np.testing.assert_allclose(other / one, 1.1, rtol=5e-3)
    assert "part B-8, 5 Hz" in drawn(page, "axial: stiffness over amplitude")
    (maps,) = re.findall(r"<svg(?:(?!</svg>).)*?>axial: measured less model, %</text>.*?</svg>", page, re.DOTALL)
    assert {f">part {part}, 0.1 mm<" in maps for part in ("A-7", "B-8")} == {True}


@pytest.mark.parametrize(
    ("title", "column"), [("radial: stiffness", "stiffness [N/mm]"), ("radial: loss factor", "loss factor [-]")]
)
def test_points_and_lines_are_those_of_the_tables(results: Results, title: str, column: str) -> None:
    """Means of the repeats and the prediction, within a tenth of a pixel."""
    folder = results("cmp_15961")
    shown = drawn(page_of(folder), title)
    sweeps, predicted = pd.read_csv(folder / "sweeps.csv"), pd.read_csv(folder / "radial.csv")
    assert list(shown) == ["0.1 mm", "0.2 mm", "0.5 mm"]
    for level in (0.1, 0.2, 0.5):
        mine = sweeps[(sweeps["direction"] == "radial") & (sweeps["amplitude [mm]"] == level)]
        means = mine.groupby("frequency [Hz]")[column].mean()
        points, line = shown[f"{level} mm"]["measured"], shown[f"{level} mm"]["model"]
        reach = np.ptp(sweeps.loc[sweeps["direction"] == "radial", column]) / 100
        np.testing.assert_allclose(points[0], means.index, atol=0.06)
        np.testing.assert_allclose(points[1], means.to_numpy(), atol=reach / 10)
        there = predicted[predicted["amplitude [mm]"] == level]
        np.testing.assert_allclose(line[1], there[column], atol=reach / 10)


def test_the_payne_curve_and_cole_cole_are_those_of_the_tables(results: Results) -> None:
    """Points measured, over amplitude at three frequencies, and the prediction through its own table; K'' over K'."""
    folder = results("cmp_15961")
    sweeps, predicted = pd.read_csv(folder / "sweeps.csv"), pd.read_csv(folder / "radial.csv")
    shown = drawn(page_of(folder), "radial: stiffness over amplitude")
    assert list(shown) == ["5 Hz", "85 Hz", "155 Hz"]
    mine = sweeps[sweeps["direction"] == "radial"]
    for frequency in (5, 85, 155):
        points, line = shown[f"{frequency} Hz"]["measured"], shown[f"{frequency} Hz"]["model"]
        means = mine[mine["frequency [Hz]"] == frequency].groupby("amplitude [mm]")["stiffness [N/mm]"].mean()
        np.testing.assert_allclose(points[0], means.index, rtol=2e-3)
        np.testing.assert_allclose(points[1], means.to_numpy(), rtol=2e-3)
        there = predicted[predicted["frequency [Hz]"] == frequency]
        curve = np.interp(np.log(there["amplitude [mm]"]), np.log(line[0]), line[1])
        np.testing.assert_allclose(curve, there["stiffness [N/mm]"], rtol=3e-3)
        assert line.shape[1] >= 20, "a smooth line, not one from level to level"
    shown = drawn(page_of(folder), "radial: Cole-Cole")
    for level in (0.1, 0.2, 0.5):
        there = predicted[predicted["amplitude [mm]"] == level]
        line, points = shown[f"{level} mm"]["model"], shown[f"{level} mm"]["measured"]
        np.testing.assert_allclose(line[0], there["storage stiffness [N/mm]"], rtol=2e-3)
        np.testing.assert_allclose(line[1], there["loss stiffness [N/mm]"], rtol=1e-2)
        tests = mine[mine["amplitude [mm]"] == level].groupby("frequency [Hz]")[["stiffness [N/mm]", "loss factor [-]"]]
        size, loss = tests.mean().to_numpy().T
        np.testing.assert_allclose(points[1], size * np.sin(np.arctan(loss)), rtol=1e-2)


def test_ellipses_are_those_of_the_covariance(results: Results, measured: Path) -> None:
    """Slanting as the correlation has it, 95 % of both at once; what was not told says so."""
    folder = results("cmp_15961")
    covariance = json.loads((folder / "model.json").read_text(encoding="utf-8"))["covariance"]
    (picture,) = re.findall(
        r"<svg(?:(?!</svg>).)*?>Which values go together</text>.*?</svg>", page_of(folder), re.DOTALL
    )
    paths = re.findall(r'<path d="([^"]*)" fill="#1f4e9c"', picture)
    rules = re.findall(r'<path d="([^"]*)" fill="none" stroke="#8a8a8a"', picture)
    names = ("mu", "m", "alpha", "sigma_fmax", "eps_half")
    pairs = [(left, low) for n, low in enumerate(names) for left in names[:n]]
    assert len(paths) == len(rules) == len(pairs) == 10
    for path, rule, (left, low) in zip(paths, rules, pairs, strict=True):
        x, y = np.array(re.findall(r"([\d.]+) ([\d.]+)", path), dtype=float).T
        i, j = (covariance["names"].index(name) for name in (left, low))
        matrix = np.array(covariance["matrix"])
        correlation = matrix[i, j] / np.sqrt(matrix[i, i] * matrix[j, j])
        assert -np.corrcoef(x, y)[0, 1] == pytest.approx(correlation, abs=0.01), (left, low)
        ends = np.array(re.findall(r"M([\d.]+) [\d.]+v", rule), dtype=float)
        ratio = np.sqrt(-2.0 * np.log(0.05)) / 1.96
        assert np.ptp(x) / np.ptp(ends) == pytest.approx(ratio, rel=0.02), "wider than either interval alone"
    assert "mu: at min no information" in page_of(measured)
    assert "unknown by" in parsed(page_of(measured)).text


def test_every_warning_says_what_it_means_for_use(results: Results, measured: Path) -> None:
    told = [row for folder in (results("cmp_15961"), results("mystery_mount"), measured) for row in uses(folder)]
    assert len(told) > 10
    assert use_of("of no known kind") not in [use for _, use in told], "each is of a known kind"
    means = dict(told)
    (open_,) = (use for warning, use in means.items() if warning.startswith("the tests leave sigma_fmax open"))
    assert "quote no more of this value" in open_
    (missed,) = (use for warning, use in means.items() if "were not fitted, and the model misses them" in warning)
    assert missed.startswith("Do not use for this place")


def uses(folder: Path) -> list[tuple[str, str]]:
    """Each warning of a page, and what it means."""
    found = re.findall(r'<li>([^<]*)\. <em class="use">([^<]+)</em></li>', page_of(folder))
    return [(unescape(warning), unescape(use)) for warning, use in found]


def test_loss_angles_and_maps_are_those_of_the_tables(results: Results) -> None:
    rows = re.findall(r'<td align="right" data-head="([^"]*)">([^<]*)</td>', page_of(results("cmp_15961")))
    angles, factors = (
        [float(cell) for head, cell in rows if head == key] for key in ("Loss angle [deg]", "Loss factor")
    )
    assert len(angles) == 12
    np.testing.assert_allclose(angles, np.degrees(np.arctan(factors)), atol=0.06)
    ((low, high),) = re.findall(r"predicted here ([\d.]+) to ([\d.]+) dB", page_of(results("cmp_15961")))
    tables = [pd.read_csv(results("cmp_15961") / f"{place}.csv") for place in ("axial", "radial")]
    sizes = np.log10([1e3 * size for table in tables for size in table["stiffness [N/mm]"]])
    assert (float(low), float(high)) == pytest.approx((20 * sizes.min(), 20 * sizes.max()), abs=0.06)
    # The mean of what is left of a direction, of the plain model and with the effect, as in words.
    folder = results("mystery_mount")
    gap = pd.read_csv(folder / "gap.csv")
    radial = gap[(gap["direction"] == "radial") & (gap["kind"] == "sweep")]
    cells = radial.groupby(["amplitude [mm]", "frequency [Hz]"])["storage before [%]"].mean()
    size = np.sqrt(np.mean(cells**2))
    told = re.search(
        r"Measured less model, radial, [^;]*; storage: before ([\d.]+) %, after ([\d.]+) %", page_of(folder)
    )
    assert told is not None
    assert float(told[1]) == pytest.approx(size, rel=0.02)
    assert float(told[2]) < 0.3 * float(told[1])
    off = radial["model stiffness [N/mm]"] / radial["stiffness [N/mm]"] - 1.0
    assert 100 * off.mean() == pytest.approx(radial["storage after [%]"].mean(), abs=0.1)
    assert cells.mean() > 2.0, "the plain model is stiffer than what was measured: model less measured is above zero"


def grown(table: pd.DataFrame, column: str, times: int) -> pd.DataFrame:
    """A table with so many times its tests."""
    return pd.concat([table.assign(**{column: table[column] + f" {n}"}) for n in range(times)], ignore_index=True)


@pytest.mark.slow
def test_a_large_campaign_stays_small_and_says_what_is_left_out(results: Results) -> None:
    contents = read_results(results("mystery_mount"))
    tables = {name: make() for name, make in contents.tables.items()}
    large = tables | {"loops": grown(tables["loops"], "loop", 30), "gap": grown(tables["gap"], "test", 30)}
    levels = [
        tables["sweeps"].assign(**{"amplitude [mm]": tables["sweeps"]["amplitude [mm]"] * 1.1**n}) for n in range(60)
    ]
    between = [level.assign(**{"frequency [Hz]": level["frequency [Hz]"] + n / 10}) for n, level in enumerate(levels)]
    large["sweeps"] = pd.concat([*levels, *between], ignore_index=True)
    page = report_page(contents.documents, large)
    assert len(page.encode()) < LARGEST
    text = parsed(page).text
    for words in ("further levels are left out", "further loops are left out", "one row in "):
        assert words in text


#: Keys of the documents whose texts come from a user's files.
FOREIGN = {"name", "summary", "next_test", "command", "reading", "sentence", "evidence", "preload", "date", "warnings"}


@given(name=NASTY)
def test_names_do_no_harm(root: Path, name: str) -> None:
    """Whatever stands in a text, the page has the same elements and attributes, and says it to the letter."""
    contents = read_results(root / "data/reports/mystery_mount")
    plain = {key: make() for key, make in contents.tables.items()}
    tables = {key: table.replace({"test": {"sweep_axial": name}}) for key, table in plain.items()}
    page = report_page(spoiled(contents.documents, name, FOREIGN), tables)
    assert_harmless(page, parsed(report_page(contents.documents, plain)), name)


def test_the_command(root: Path, tmp_path: Path) -> None:
    folder = root / "data/reports/mystery_mount"
    done = call(tmp_path, "report", folder, "-o", "page", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == {"pages": {"page/report.html": (tmp_path / "page/report.html").stat().st_size}}
    assert "wrote report.html to page" in done.stderr


@given(st.lists(st.floats() | st.floats(1e6, 1e7).map(lambda size: (round(size) + 0.5) / 1e9), min_size=1))
def test_a_page_of_a_table_not_yet_written_has_the_digits_of_its_file(values: list[float]) -> None:
    """Whether a number is large, small, half way between two of seven digits, or none."""
    read_back = np.array([float(f"{value:.7g}") for value in values])
    np.testing.assert_array_equal(canonical(pd.DataFrame({"force [N]": values}))["force [N]"], read_back)
