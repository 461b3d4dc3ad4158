"""`batch` that goes on: results that stand, what is torn or changed, and a batch that was killed."""

from __future__ import annotations

import json
import random
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import openpyxl
import pytest
from trees import PATTERN, command, rows, stamps, tree

from bushfit.batch import ledger


def test_results_that_stand_are_refused_resumed_or_replaced(typed: Callable[..., Any], shop: Path) -> None:
    assert typed("batch", PATTERN, "-o", "all", "--no-plots", "-q").returncode == 0
    before, files = stamps(shop / "all/bushings"), tree(shop / "all")
    refused = typed("batch", PATTERN, "-o", "all", "--no-plots")
    assert refused.returncode == 2
    assert "--resume" in refused.stderr
    assert tree(shop / "all") == files
    again = typed("batch", PATTERN, "-o", "all", "--no-plots", "--resume", "--json")
    assert (again.returncode, json.loads(again.stdout)["kept"]) == (0, 5)
    assert stamps(shop / "all/bushings") == before, "what is done is not done again"
    assert tree(shop / "all") == files
    forced = typed("batch", PATTERN, "-o", "all", "--no-plots", "--force", "--json")
    assert (forced.returncode, json.loads(forced.stdout)["kept"]) == (0, 0)
    assert not set(stamps(shop / "all/bushings").items()) & set(before.items())
    assert tree(shop / "all") == files


def test_another_form_replaces_the_table_and_does_again_only_what_has_tables_of_it(
    typed: Callable[..., Any], shop: Path
) -> None:
    few = "bushings/b[01]/bushing.toml"
    assert typed("batch", few, "-o", "all", "-q").returncode == 0
    refused = typed("batch", few, "-o", "all", "--table-format", "xlsx")
    assert refused.returncode == 2
    assert "batch.csv" in refused.stderr
    again = typed("batch", few, "-o", "all", "--resume", "--json", "--table-format", "xlsx", "--plot-format", "svg")
    assert json.loads(again.stdout)["kept"] == 2, "no bushing has a table or a picture"
    assert "wrote batch.json, batch.xlsx, index.html, bushings/ to" in again.stderr
    assert sorted(file.name for file in (shop / "all").iterdir()) == [
        "batch.json",
        "batch.xlsx",
        "bushings",
        "index.html",
    ], "batch.csv is gone"
    (sheet,) = openpyxl.load_workbook(shop / "all/batch.xlsx")
    header, *lines = sheet.iter_rows(values_only=True)
    model = json.loads((shop / "all/bushings/b1/model.json").read_text())
    assert dict(zip(header, lines[1], strict=True))["mu [MPa]"] == pytest.approx(
        1e-6 * model["parameters"]["mu"]["value"], rel=1e-15
    )
    tables = ("batch", few, "-o", "all", "--resume", "--json", "--tables")
    assert json.loads(typed(*tables).stdout)["kept"] == 0
    assert json.loads(typed(*tables, "--table-format", "decimal-comma").stdout)["kept"] == 0
    assert json.loads(typed(*tables, "--table-format", "decimal-comma").stdout)["kept"] == 2


@pytest.mark.slow
def test_results_of_rows_that_are_gone_do_not_stay_unsaid(typed: Callable[..., Any], shop: Path) -> None:
    assert typed("batch", PATTERN, "-o", "all", "-q").returncode == 0
    (shop / "all/bushings/notes").mkdir()
    (shop / "all/bushings/notes/mine.txt").write_text("keep")
    names = sorted(path.name for path in (shop / "all/bushings").iterdir())
    resumed = typed("batch", "bushings/b[0-2]/bushing.toml", "-o", "all", "--resume", "--json")
    assert resumed.returncode == 0, resumed.stderr
    (said,) = [line for line in json.loads(resumed.stdout)["warnings"] if "of an earlier batch" in line]
    assert "results of 2 bushings" in said
    assert "--force removes them" in said
    assert sorted(path.name for path in (shop / "all/bushings").iterdir()) == names
    forced = typed("batch", "bushings/b[0-2]/bushing.toml", "-o", "all", "--force")
    assert "were removed" in forced.stderr
    assert sorted(path.name for path in (shop / "all/bushings").iterdir()) == ["b0", "b1", "b2", "notes"]


def test_only_what_changed_or_is_torn_is_done_again(typed: Callable[..., Any], shop: Path) -> None:
    typed("batch", PATTERN, "-o", "all", "--no-plots", "-q")
    files, before = tree(shop / "all"), stamps(shop / "all/bushings")
    place = shop / "all/bushings"
    (place / "b0/model.json").write_bytes(b"{")
    (place / "b1/row.json").write_bytes((place / "b1/row.json").read_bytes()[:100])
    loop = shop / "bushings/b2/loop_axial_1.csv"
    loop.write_text(loop.read_text() + "\n")
    campaign = shop / "bushings/b3/bushing.toml"
    campaign.write_text(campaign.read_text() + "\n")
    again = typed("batch", PATTERN, "-o", "all", "--no-plots", "--resume", "--json", "-q")
    assert json.loads(again.stdout)["kept"] == 1
    kept = {name for name, stamp in stamps(place).items() if before.get(name) == stamp}
    assert {Path(name).parent.name for name in kept} == {"b4"}
    for row in ("b0", "b1"):
        assert (place / row / "model.json").read_bytes() == files[f"bushings/{row}/model.json"]
    old, new = (json.loads(text) for text in (files["bushings/b3/model.json"], (place / "b3/model.json").read_bytes()))
    assert old.pop("campaign") != new.pop("campaign"), "the campaign's own hash"
    assert old == new
    other = typed("batch", PATTERN, "-o", "all", "--no-plots", "--resume", "--json", "-q", "--effect", "inertia")
    assert json.loads(other.stdout)["kept"] == 0


def test_a_failed_row_is_tried_again_and_its_old_results_do_not_stay(typed: Callable[..., Any], shop: Path) -> None:
    typed("batch", PATTERN, "-o", "all", "--no-plots", "-q")
    sweep = shop / "bushings/b2/sweep_axial.csv"
    good, files = sweep.read_bytes(), tree(shop / "all")
    sweep.write_text("nonsense\n1\n")
    assert typed("batch", PATTERN, "-o", "all", "--no-plots", "-q", "--resume").returncode == 1
    assert not (shop / "all/bushings/b2/model.json").exists()
    sweep.write_bytes(good)
    assert typed("batch", PATTERN, "-o", "all", "--no-plots", "-q", "--resume").returncode == 0
    assert tree(shop / "all") == files


@pytest.mark.parametrize(("kills", "many"), [(1, 8), pytest.param(3, 20, marks=pytest.mark.slow)])
def test_killed_at_any_moment_and_resumed_it_is_as_if_it_had_run_through(
    typed: Callable[..., Any], shop: Path, kills: int, many: int
) -> None:
    (shop / "many.csv").write_text("campaign\n" + "".join(f"bushings/b{n % 5}/bushing.toml\n" for n in range(many)))
    assert typed("batch", "many.csv", "-o", "whole", "--no-plots", "-q").returncode == 0
    draw, kept = random.Random(5), []
    for wanted in sorted(draw.sample(range(2, many - 4), kills)):
        running = subprocess.Popen(command(Path("killed"), "--resume", "-q"), cwd=shop, stderr=subprocess.DEVNULL)
        while running.poll() is None and sum(1 for _ in (shop / "killed/bushings").glob("*/row.json")) < wanted:
            time.sleep(0.001)
        time.sleep(draw.uniform(0.0, 0.03))
        running.send_signal(signal.SIGKILL)
        running.wait()
        kept.append(sum(1 for _ in (shop / "killed/bushings").glob("*/row.json")))
    time.sleep(1.0)
    workers = subprocess.run(["pgrep", "-f", str(shop)], capture_output=True, text=True, check=False).stdout
    assert workers == "", "workers follow their parent"
    before = stamps(shop / "killed/bushings")
    done = subprocess.run(command(Path("killed"), "--resume", "-q"), cwd=shop, check=False)
    print(f"killed with {kept} of {many} rows kept")
    assert done.returncode == 0
    assert 0 < kept[0] < many, "killed in mid-run"
    assert before.items() <= stamps(shop / "killed/bushings").items(), "nothing kept is done again"
    assert tree(shop / "killed") == tree(shop / "whole")


@pytest.mark.slow
def test_two_batches_do_not_share_a_folder(typed: Callable[..., Any], shop: Path) -> None:
    (shop / "many.csv").write_text("campaign\n" + "".join(f"bushings/b{n % 5}/bushing.toml\n" for n in range(80)))
    first = subprocess.Popen(command(Path("all"), "-q", "--jobs", "1"), cwd=shop)
    while first.poll() is None and not list((shop / "all").glob("bushings/*/row.json")):
        time.sleep(0.001)
    for option in ("--force", "--resume"):
        second = typed("batch", PATTERN, "-o", "all", option)
        assert first.poll() is None, "refused at once"
        assert (second.returncode, second.stdout) == (2, "")
        assert "another batch is at work there" in second.stderr
        assert "Traceback" not in second.stderr
        assert (shop / "all" / ledger.ASIDE).exists()
    assert first.wait() == 0
    assert [row["status"] for row in rows(shop / "all")] == ["done"] * 80
    assert typed("batch", PATTERN, "-o", "all", "--resume", "-q").returncode == 0
