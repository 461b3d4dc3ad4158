"""The report of a result: the same from a run and from its folder, whole, escaped, small, and true to the tables."""

import base64
import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commandline import typing
from reading_html import HARMFUL, LARGEST, assert_harmless, change, drawn, loads, made_of, page_of, parsed, spoiled

from bushfit.effects.history import History
from bushfit.geometry import Direction
from bushfit.model.file import from_document
from bushfit.simulation.rig import wave

#: Keys of the documents whose texts come from a user's files.
FOREIGN = {"name", "summary", "next_test", "command", "reading", "sentence", "evidence", "preload", "date", "warnings"}
STYLED = re.compile(r"<(style|script)>(.*?)</\1>", re.DOTALL)
Spoil = Callable[[Path], object]
#: A batch in which nothing happened.
EMPTY = ("failed", "missed", "conditional", "not_judged", "differ", "warnings", "curve_points", "parts")


@pytest.mark.parametrize("name", ["cmp_15961", "mystery_mount"])
def test_run_writes_a_whole_page_that_loads_nothing_and_its_folder_gives_the_same(results, name):
    page = page_of(results(name))
    found = parsed(page)
    assert loads(page) == []
    sections = [value for tag, key, value in found.attributes if (tag, key) == ("section", "id")]
    assert sections == ["result", "figures", "parameters", "tests", "appendix"]
    assert len(page.encode()) < LARGEST
    described = [value for tag, key, value in found.attributes if (tag, key) == ("svg", "aria-label")]
    assert len(described) == found.counts["svg"] >= 4
    assert min(map(len, described)) > 40
    assert not [key for _, key, _ in found.attributes if key == "style"], "a content policy would drop it"
    assert parsed(made_of(results(name))).text == found.text
    for words in ("unnamed (unresolved)", "do not tell", "go together", "K in", "before a release", "^"):
        assert words not in found.text


def test_the_first_block_is_what_a_customer_reads(results):
    """Stiffness at the stated point, static stiffness and their ratio, accuracy, verdict and its consequence."""
    folder = results("cmp_15961")
    first = parsed(page_of(folder)).text.partition("Figures")[0]
    model = from_document(json.loads((folder / "model.json").read_text()), None).model
    for place in ("axial", "radial"):
        loss = model.stiffness(place, 25.0, 2e-4)
        dynamic = abs(loss) / 1e3
        # the loop's 24 mm/min, radially at equal strain rate, over +/-0.2 mm
        rate = 24.0 * model.unit_strain(Direction.AXIAL) / model.unit_strain(Direction(place))
        triangle = 2e-4 * wave("triangle", np.arange(4000) / 4000)
        force = model.force(place, History.steady(triangle, rate / 60e3 / 8e-4))
        static = np.ptp(force) / 0.4
        row = first.partition(f" {place} 25 Hz 0.2 mm ")[2]
        assert row.startswith(f"{dynamic:.4g} N/mm")
        assert f"{loss.imag / loss.real:.3g} " in row
        interval = r"([\d.]+) to ([\d.]+)"
        stated = re.search(rf"([\d.]+) N/mm {interval} at {rate:.3g} mm/min ([\d.]+) {interval}", row)
        value, low, high, *stiffening = map(float, stated.groups())
        assert [value, stiffening[0]] == pytest.approx([static, dynamic / static], rel=5e-4)
        assert low < static < high < low + 0.1 * static
        assert stiffening[1] < dynamic / static < stiffening[2] < 1.05 * stiffening[1]
    for words in (
        *("(144 held-out points)", "fitted to tests in this direction", "Verdict: consistent"),
        *("predicted from axial tests; the measured sweep agrees within its noise",),
        "Use the model within the tested range",
    ):
        assert words in first


@pytest.mark.parametrize("form", ["xlsx", "decimal comma"])
def test_other_forms_of_tables_are_read_back(results, tmp_path, form):
    folder = tmp_path / "x"
    shutil.copytree(results("mystery_mount"), folder)
    for file in folder.glob("*.csv"):
        table = pd.read_csv(file)
        if form == "xlsx":
            table.to_excel(file.with_suffix(".xlsx"), index=False)
            file.unlink()
        else:
            file.write_bytes(table.to_csv(index=False, sep=";", decimal=",").encode("utf-8-sig"))
    assert parsed(made_of(folder)).text == parsed(page_of(folder)).text


def test_conditions_of_the_tests_are_told(root, tmp_path):
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
    typing(tmp_path)("fit", "c.toml", "-o", "x", "--no-plots", "-q", *options)
    typing(tmp_path)("report", "x", "-q")
    found = parsed(page_of(tmp_path / "x")).text
    conditions = ("22 °C", "150 N axial", "12 May 2025", "night shift", "A-7", "Fitted, not diagnosed")
    stated = ("Customer", "Vehicle works", "Part number", "15 961", "Drawing", "D 7, issue C", "Elasto Lab")
    for words in (*conditions, *stated, "20 May 2025"):
        assert words in found
    assert "bushfit fit c.toml --direction axial --direction radial --effect inertia" in found
    (shown,) = re.findall(r'<img src="data:image/png;base64,([^"]*)" alt="Logo of Elasto Lab"', page_of(tmp_path / "x"))
    assert base64.b64decode(shown) == logo
    typing(tmp_path)("report", "x", "-q", "--date", "21 May 2025")
    assert ("20 May 2025" in page_of(tmp_path / "x"), page_of(tmp_path / "x").count("21 May 2025")) == (False, 2)
    model = tmp_path / "x/model.json"
    model.write_text(model.read_text(encoding="utf-8").replace("data:image/png;base64,", "https://a.b/"))
    refused = typing(tmp_path)("report", "x", status=2)
    assert "campaign.logo: this is not a picture" in refused.stderr


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "there is no such file"),
        (b"GIF89a secret", "expected: PNG or SVG"),
        (b"\x89PNG\r\n\x1a\n" + bytes(64_000), "at most 64000 bytes"),
    ],
)
def test_a_logo_that_cannot_be_shown_is_refused(root, tmp_path, content, words):
    text = (root / "configs/cmp_15961.toml").read_text(encoding="utf-8").replace("../data", str(root / "data"))
    (tmp_path / "c.toml").write_text(f'{text}\n[report]\nlogo = "logo.png"\n', encoding="utf-8")
    if content is not None:
        (tmp_path / "logo.png").write_bytes(content)
    done = typing(tmp_path)("fit", "c.toml", "-o", "x", status=2)
    assert "logo.png, [report] logo: " in done.stderr
    assert words in done.stderr
    assert not (tmp_path / "x").exists()


def test_points_are_those_of_the_tables(results):
    """Means of the repeats over frequency and over amplitude, within half a point."""
    folder = results("cmp_15961")
    sweeps = pd.read_csv(folder / "sweeps.csv").query("direction == 'radial'")
    means = sweeps.groupby(["frequency [Hz]", "amplitude [mm]"])[["stiffness [N/mm]", "loss factor [-]"]].mean()
    points = means.reset_index().to_numpy().T
    over_frequency = drawn(page_of(folder), "radial: prediction and measurement")
    for panels, quantities in (
        (over_frequency[:2], (points[[0, 2]], points[[0, 3]])),
        (over_frequency[2:], (points[[1, 2]], points[[1, 3]])),
    ):
        for panel, expected in zip(panels, quantities, strict=False):
            scale = np.ptp(expected, axis=1, keepdims=True)
            distance = np.abs((panel[:, :, None] - expected[:, None]) / scale[:, None]).max(axis=0).min(axis=1)
            assert distance.max() < 5e-3, "each point that is drawn was measured"
            assert panel.shape[1] >= 12


def test_names_do_no_harm(root, tmp_path):
    """Whatever stands in a text, the page has the same elements and attributes, and says it to the letter."""
    kept = root / "data/reports/mystery_mount"
    plain = parsed(made_of(kept))
    shutil.copytree(kept, tmp_path / "x")
    for name in HARMFUL:
        for file in kept.glob("*.json"):
            document = spoiled(json.loads(file.read_text(encoding="utf-8")), name, FOREIGN)
            (tmp_path / "x" / file.name).write_text(json.dumps(document), encoding="utf-8")
        sweeps = pd.read_csv(kept / "sweeps.csv").replace({"sweep": {"sweep_axial": name}})
        sweeps.to_csv(tmp_path / "x/sweeps.csv", index=False)
        assert_harmless(made_of(tmp_path / "x"), plain, name)


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
def test_the_reports_of_the_readme_are_current(root, results, name):
    assert_current(root / f"data/reports/{name}.html", results(name) / "report.html")


def test_the_report_of_measured_rubber_is_current_and_says_that_the_mount_was_not_fitted(root, measured):
    assert_current(root / "data/measured/epdm_70/report.html", measured / "report.html")
    text = parsed(page_of(measured)).text
    assert loads(page_of(measured)) == []
    specimen = "2 blocks in parallel in shear, 772 mm² each, 6 mm thick"
    for words in (
        "18.4 °C, 0.151 %",
        "not fitted",
        specimen,
        "Fitted, not diagnosed",
        "the 8 measured sweeps differ by 17 to 24 %",
    ):
        assert words in text


def test_the_results_to_try_it_on_are_current(root, results):
    made = results("mystery_mount")
    kept = sorted((root / "data/reports/mystery_mount").iterdir())
    assert len(kept) == 5
    for file in kept:
        one, other = (bare(folder.read_text(encoding="utf-8")) for folder in (file, made / file.name))
        assert one == other, f"stale: copy {file.name} of bushfit run configs/mystery_mount.toml to {file}"


BATCH = {
    **{"schema": "bushfit/batch/2", "title": "x", "rows": 1, "done": 1, "headline": "1 part", "detectable": None},
    **{"quantities": {}, "limits": {}},
    **{key: [] for key in EMPTY},
}


def written(name: str, text: str) -> Spoil:
    return lambda folder: (folder / name).write_text(text)


def changed(name: str, **keys: object) -> Spoil:
    return lambda folder: change(folder / name, **keys)


def without(pattern: str) -> Spoil:
    return lambda folder: [file.unlink() for file in folder.glob(pattern)]


def without_column(name: str, header: str) -> Spoil:
    """Another name for a column of a table."""
    return lambda folder: pd.read_csv(folder / name).rename(columns={header: "else"}).to_csv(folder / name, index=False)


def without_rows(folder: Path) -> None:
    """A comparison whose tables are empty."""
    document = json.loads((folder / "compare.json").read_text(encoding="utf-8"))
    for columns in document["pairs"][0]["places"].values():
        columns.update({header: [] for header in columns})
    (folder / "compare.json").write_text(json.dumps(document), encoding="utf-8")


#: Spoiled folders of results, comparisons and batches, and the words of the error.
SPOILED: dict[str, list[tuple[Spoil, tuple[str, ...]]]] = {
    "results": [
        (shutil.rmtree, ("a folder of results is needed", "nothing")),
        (without("*.json"), ("there is no model in this folder", "axial.csv", "bushfit run CAMPAIGN")),
        (written("model.json", "{"), ("model.json: this is not valid JSON", "line 1")),
        (written("model.json", "[]"), ("model.json: not a result", "a list")),
        (changed("model.json", schema="bushfit/model/9"), ("model.json, schema",)),
        (changed("model.json", campaign={"name": 3}), ("model.json, campaign.",)),
        (changed("diagnosis.json", schema="bushfit/diagnosis/1"), ("diagnosis.json, schema", "bushfit/diagnosis/3")),
        (changed("diagnosis.json", gap=7), ("diagnosis.json, gap", "a table")),
        *(
            (without_column("sweeps.csv", header), ("a column of a table is missing", header))
            for header in ("amplitude [mm]", "stiffness [N/mm]", "loss residual [noise]", "stiffness [N m/rad]")
        ),
        (written("sweeps.csv", "sweep,direction\na,axial\n"), ("a column of a table is missing", "stepped")),
        *(
            (written("validation_road.csv", f"{headers}\n"), ("a column of a table is missing", header))
            for headers, header in (
                ('time [s],displacement [mm],force [N],"force [N], low"', "force [N], high"),
                ('time [s],force [N],"force [N], low","force [N], high"', "displacement before force [N]"),
            )
        ),
        (written("axial.csv", "frequency [Hz],amplitude [mm]\nx,1\n"), ("axial.csv: this table does not", "'x'")),
        (written("axial.csv", ""), ("axial.csv: the file is empty",)),
        (lambda folder: (folder / "axial.csv").write_bytes(b"\xff\xfe\x00"), ("axial.csv", "not UTF-8")),
    ],
    "comparison": [
        (changed("compare.json", schema="bushfit/compare/9"), ("compare.json, schema", "bushfit/compare/1")),
        (changed("compare.json", pairs=7), ("compare.json, pairs",)),
        (changed("compare.json", pairs=[]), ("compare.json, pairs",)),
        (without_rows, ("columns are missing, empty or of unequal length",)),
        (written("compare.html", "mine"), ("that bushfit did not write", "compare.html")),
    ],
    "batch": [
        (written("batch.json", '{"schema": "x"}'), ("this version cannot read the file as a batch",)),
        (without("batch.json"), ("there is no model in this folder",)),
        (changed("batch.json", quantities={"a [-]": {"median": 1.0}}), ("quantities.a [-].", "a key is missing")),
    ],
}


@pytest.mark.parametrize(
    ("kind", "spoil", "says"), [(kind, *case) for kind, cases in SPOILED.items() for case in cases]
)
def test_spoiled_folders_are_one_clear_error(root, request, tmp_path, kind, spoil, says):
    folder = tmp_path / "x"
    if kind == "results":
        shutil.copytree(root / "data/reports/mystery_mount", folder)
    folder.mkdir(exist_ok=True)
    if kind == "comparison":
        shutil.copy(request.getfixturevalue("compared") / "two/compare.json", folder)
    elif kind == "batch":
        (folder / "batch.json").write_text(json.dumps(BATCH))
        typing(tmp_path)("report", "x", "-o", "y")
    spoil(folder)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    done = typing(tmp_path)("report", "x", status=2)
    assert done.stderr.count("bushfit: error: ") == 1
    for words in says:
        assert words in done.stderr
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before
