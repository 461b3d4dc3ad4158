"""One row as a worker does it: a record of what was found, kept with its files, or what befell it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from bushfit.batch.manifest import Row, Settings, read_manifest
from bushfit.batch.points import parse_point
from bushfit.batch.work import Orders, given_up, work
from bushfit.errors import BatchError
from bushfit.geometry import Direction
from bushfit.model.file import load_result
from bushfit.report.contents import Formats

POINT = parse_point("axial 25 Hz 0.1 mm")


@pytest.fixture
def rows(shop: Path) -> list[Row]:
    """A campaign, and one that is not there."""
    (shop / "m.toml").write_text(
        '[[bushings]]\ncampaign = "bushings/b0/bushing.toml"\n[[bushings]]\ncampaign = "none.toml"\n'
    )
    return list(read_manifest(str(shop / "m.toml"), Settings()).rows)


@pytest.fixture
def orders(shop: Path) -> Orders:
    for name in ("bushings", ".aside"):
        (shop / "out" / name).mkdir(parents=True)
    return Orders(shop / "out", (POINT,), Formats(pictures=False), resume=True)


def test_a_record_holds_the_numbers_of_the_files_beside_it(rows: list[Row], orders: Orders) -> None:
    ((status, line),) = work(rows[:1], orders)
    record = json.loads(line)
    assert status == record["status"] == "done"
    folder = orders.output / "bushings" / rows[0].folder
    assert {file.name for file in folder.iterdir()} == {"row.json", "model.json", "loops.csv", "sweeps.csv"}
    model = load_result(folder / "model.json").model
    assert {name: entry[0] for name, entry in record["parameters"].items()} == model.values
    stiffness = abs(complex(model.stiffness(Direction.AXIAL, 25.0, 1e-4)))
    assert record["points"][str(POINT)]["stiffness"][0] == pytest.approx(stiffness, rel=1e-9)
    ((_, again),) = work(rows[:1], orders)
    assert json.loads(again) == {**record, "kept": True}


def test_a_row_that_fails_costs_that_row_and_says_why(rows: list[Row], orders: Orders) -> None:
    (failed, line), (done, _) = work(rows[::-1], orders)
    assert (failed, done) == ("failed", "done")
    assert "there is no such file" in json.loads(line)["error"]


def test_a_worker_of_another_version_refuses(rows: list[Row], orders: Orders) -> None:
    other = Orders(orders.output, (), Formats(False, False), resume=False, version="0.0.0")
    with pytest.raises(BatchError, match=r"another bushfit[\s\S]*0\.0\.0"):
        work(rows, other)


def test_a_row_given_up_is_a_failed_one() -> None:
    status, line = given_up("no worker survived it")
    assert status == "failed"
    assert json.loads(line)["error"] == "no worker survived it"
