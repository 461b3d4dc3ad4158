"""batch that goes on: results that stand, what is torn or changed, a batch that was killed, and workers that die."""

import json
import os
import signal
import subprocess
import time
from functools import partial
from pathlib import Path

import pytest
from trees import PATTERN, command, kept, list_many, stamps, tree, wait_for

from bushfit.batch import store
from bushfit.batch.executor import local_workers, run_rows

ALL = ("batch", PATTERN, "-o", "all", "--no-plots")


def test_results_that_stand_are_refused_resumed_or_replaced(typed, shop):
    typed(*ALL, "-q")
    before, files = stamps(shop / "all/bushings"), tree(shop / "all")
    refused = typed(*ALL, status=2)
    assert "--resume" in refused.stderr
    again = typed(*ALL, "--resume", "--json")
    assert json.loads(again.stdout)["kept"] == 5
    assert stamps(shop / "all/bushings") == before, "what is done is not done again"
    assert tree(shop / "all") == files
    (shop / "all/bushings/notes").mkdir()
    (shop / "all/bushings/notes/mine.txt").write_text("keep")
    few = ("batch", "bushings/b[0-2]/bushing.toml", *ALL[2:])
    resumed = typed(*few, "--resume", "--json")
    (said,) = [line for line in json.loads(resumed.stdout)["warnings"] if "of an earlier batch" in line]
    assert "results of 2 bushings" in said
    assert "--force removes them" in said
    assert before.items() <= stamps(shop / "all/bushings").items()
    forced = typed(*few, "--force", "--json")
    assert json.loads(forced.stdout)["kept"] == 0
    assert "were removed" in forced.stderr
    assert sorted(path.name for path in (shop / "all/bushings").iterdir()) == ["b0", "b1", "b2", "notes"]
    assert not set(stamps(shop / "all/bushings").items()) & set(before.items())
    assert tree(shop / "all/bushings/b2") == {
        name.rpartition("/")[2]: content for name, content in files.items() if "/b2/" in name
    }


def test_only_what_changed_or_is_torn_is_done_again(typed, shop):
    typed(*ALL, "-q")
    files, before = tree(shop / "all"), stamps(shop / "all/bushings")
    place = shop / "all/bushings"
    (place / "b0/model.json").write_bytes(b"{")
    (place / "b1/row.json").write_bytes((place / "b1/row.json").read_bytes()[:100])
    loop = shop / "bushings/b2/loop_axial_1.csv"
    good = loop.read_bytes()
    loop.write_text("nonsense\n1\n")
    campaign = shop / "bushings/b3/bushing.toml"
    campaign.write_text(campaign.read_text() + "\n")
    again = typed(*ALL, "--resume", "--json", "-q", status=1)
    assert json.loads(again.stdout)["kept"] == 1
    unchanged = {name for name, stamp in stamps(place).items() if before.get(name) == stamp}
    assert {Path(name).parent.name for name in unchanged} == {"b4"}
    for row in ("b0", "b1"):
        assert (place / row / "model.json").read_bytes() == files[f"bushings/{row}/model.json"]
    old, new = (json.loads(text) for text in (files["bushings/b3/model.json"], (place / "b3/model.json").read_bytes()))
    assert old.pop("campaign") != new.pop("campaign"), "the campaign's own hash"
    assert old == new
    assert not (place / "b2/model.json").exists(), "old results of a row that fails do not stay"
    loop.write_bytes(good)
    mended = typed(*ALL, "--resume", "--json", "-q")
    assert json.loads(mended.stdout)["kept"] == 4, "a failed row is tried again"
    assert (place / "b2/model.json").read_bytes() == files["bushings/b2/model.json"]


def test_killed_in_mid_run_and_resumed_it_is_as_if_it_had_run_through(typed, shop):
    list_many(shop, 8)
    typed("batch", "many.csv", "-o", "whole", "--no-plots", "-q")
    running = subprocess.Popen(command("killed", "--resume", "-q"), cwd=shop, stderr=subprocess.DEVNULL)
    wait_for(running, shop / "killed", 3)
    running.send_signal(signal.SIGKILL)
    running.wait()
    left = kept(shop / "killed")
    time.sleep(1.0)
    workers = subprocess.run(["pgrep", "-f", str(shop)], capture_output=True, text=True, check=False).stdout
    assert workers == "", "workers follow their parent"
    before = stamps(shop / "killed/bushings")
    done = subprocess.run(command("killed", "--resume", "-q"), cwd=shop, check=False)
    print(f"killed with {left} of 8 rows kept")
    assert done.returncode == 0
    assert 0 < left < 8, "killed in mid-run"
    assert before.items() <= stamps(shop / "killed/bushings").items(), "nothing kept is done again"
    assert tree(shop / "killed") == tree(shop / "whole")


@pytest.mark.parametrize("option", ["--force", "--resume"])
def test_one_batch_holds_a_folder(typed, shop, option):
    with store.batch_folder(shop / "all"):
        second = typed(*ALL, option, status=2)
        assert second.stdout == ""
        assert "another batch is running in this folder" in second.stderr


def double(row: int, folder: Path, once: tuple[int, ...] = ()) -> str:
    """Twice a row; some rows kill this process the first time."""
    mark = folder / f"died at {row}"
    if row in once and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return str(2 * row)


@pytest.mark.parametrize(("count", "once"), [(300, ()), (40, (100, 117))], ids=str)
def test_a_worker_that_dies_costs_a_second_try(tmp_path, count, once):
    """What always kills its worker is given up, as the command shows."""
    task = partial(double, folder=tmp_path, once=once)
    found = list(run_rows(range(100, 100 + count), task, lambda why: why, local_workers(2)))
    assert sorted(found) == [(number, str(2 * (100 + number))) for number in range(count)], "each row once"
    assert len(list(tmp_path.iterdir())) == len(once)
