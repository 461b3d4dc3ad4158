"""Reports that are kept are current, results of older versions have a page, and of spoiled folders none is made."""

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from commandline import call
from reading_html import change, loads, page_of, parsed

STYLED = re.compile(r"<(style|script)>(.*?)</\1>", re.DOTALL)


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


Spoil = Callable[[Path], object]
#: A batch in which nothing happened.
EMPTY = ("failed", "missed", "conditional", "not_judged", "differ", "warnings", "curve_points", "parts")
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

    def rename(folder: Path) -> None:
        text = (folder / name).read_text(encoding="utf-8")
        assert text.count(f",{header},") == 1
        (folder / name).write_text(text.replace(f",{header},", ",else,", 1), encoding="utf-8")

    return rename


OF_RESULTS = [
    (shutil.rmtree, ("a folder of results is needed", "nothing")),
    (without("*.json"), ("there is no model in this folder", "axial.csv", "bushfit run CAMPAIGN")),
    (written("model.json", "{"), ("model.json, line 1", "not valid JSON")),
    (written("model.json", "[]"), ("model.json: not a result", "a list")),
    (changed("model.json", schema="bushfit/model/9"), ("model.json, schema",)),
    (changed("model.json", campaign={"name": 3}), ("model.json, campaign.",)),
    (changed("diagnosis.json", schema="bushfit/diagnosis/1"), ("diagnosis.json, schema", "bushfit/diagnosis/3")),
    (changed("diagnosis.json", gap=7), ("diagnosis.json, gap", "a table")),
    (written("sweeps.csv", "sweep,direction\na,axial\n"), ("a column of a table is missing", "stepped")),
    *(
        (without_column("sweeps.csv", header), ("a column of a table is missing", header))
        for header in ("stiffness [N/mm]", "amplitude [mm]", "loss residual [noise]", "stiffness [N m/rad]")
    ),
    *(
        (written("validation_road.csv", f"{headers}\n"), ("a column of a table is missing", header))
        for headers, header in (
            ('time [s],displacement [mm],force [N],"force [N], high",measured force [N]', "force [N], low"),
            ('time [s],displacement [mm],force [N],"force [N], low"', "force [N], high"),
            ('displacement [mm],force [N],"force [N], low","force [N], high"', "time [s]"),
            ('time [s],force [N],"force [N], low","force [N], high"', "displacement before force [N]"),
        )
    ),
    (
        written("axial.csv", "frequency [Hz],amplitude [mm]\nx,1\n"),
        ("axial.csv: this table is not as bushfit writes it", "'x'"),
    ),
    (written("axial.csv", ""), ("axial.csv: the file is empty",)),
    (lambda folder: (folder / "axial.csv").write_bytes(b"\xff\xfe\x00"), ("axial.csv", "not UTF-8")),
    (written("report.html", "mine"), ("that bushfit did not write", "report.html")),
]
OF_COMPARISON = [
    (written("compare.json", "{"), ("compare.json, line 1", "not valid JSON")),
    (written("compare.json", "[]"), ("compare.json: not a result", "a list")),
    (changed("compare.json", schema="bushfit/compare/9"), ("compare.json, schema", "bushfit/compare/1")),
    (changed("compare.json", pairs=7), ("compare.json, pairs",)),
    (changed("compare.json", pairs=[]), ("compare.json, pairs",)),
    (written("compare.html", "mine"), ("that bushfit did not write", "compare.html")),
]
OF_BATCH = [
    (written("batch.json", "{"), ("not valid JSON",)),
    (written("batch.json", '{"schema": "x"}'), ("not a batch this version reads",)),
    (without("batch.json"), ("there is no model in this folder",)),
    (
        written("batch.json", json.dumps(BATCH | {"quantities": {"a [-]": {"median": 1.0}}})),
        ("batch.json, quantities.a [-].", "a key is missing"),
    ),
]


@pytest.mark.parametrize(
    ("kind", "spoil", "says"),
    [
        *(("results", *case) for case in OF_RESULTS),
        *(("comparison", *case) for case in OF_COMPARISON),
        *(("batch", *case) for case in OF_BATCH),
    ],
)
def test_spoiled_folders_are_one_clear_error(root, request, tmp_path, kind, spoil, says):
    folder = tmp_path / "x"
    if kind == "results":
        shutil.copytree(root / "data/reports/mystery_mount", folder)
    elif kind == "comparison":
        folder.mkdir()
        shutil.copy(request.getfixturevalue("compared") / "two/compare.json", folder)
    else:
        folder.mkdir()
        (folder / "batch.json").write_text(json.dumps(BATCH))
        assert call(tmp_path, "report", "x", "-o", "y").returncode == 0
    spoil(folder)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    done = call(tmp_path, "report", "x")
    assert (done.returncode, done.stderr.count("bushfit: error: ")) == (2, 1), done.stderr
    for words in says:
        assert words in done.stderr
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before
