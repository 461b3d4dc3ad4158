"""A card goes on where it was stopped: outcomes on whole lines, one card a folder, one run at a time."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from cards.hidden import Sealed
from cards.ledger import LEDGER, ledger
from cards.outcome import Outcome, Task

from bushfit.errors import OutputError

ASKED = {"families": ["awkward"], "campaigns": 5, "seed": 1}
SEALED = Sealed(("delay",), {"mu": 1.1e6}, 0.05, True, 1)
ONE = Outcome(Task("fault", 1, (), "preload"), SEALED, "named", (("delay", "viscous"),), heldout=1.01)
TWO = replace(ONE, task=replace(ONE.task, seed=2), error="FitError: no")


def written(folder: Path, *outcomes: Outcome, force: bool = False) -> dict[Task, Outcome]:
    """What stands in the folder, before these are written to it."""
    with ledger(folder, ASKED, force=force) as (done, write):
        for outcome in outcomes:
            write(outcome)
    return done


def test_what_stands_comes_back_whole(tmp_path: Path) -> None:
    assert written(tmp_path / "card", ONE) == {}
    assert written(tmp_path / "card", TWO) == {ONE.task: ONE}
    assert written(tmp_path / "card") == {ONE.task: ONE, TWO.task: TWO}


@pytest.mark.parametrize("cut", [1, 40, 10_000])
def test_a_torn_line_is_made_again(tmp_path: Path, cut: int) -> None:
    written(tmp_path, ONE, TWO)
    file = tmp_path / LEDGER
    whole = file.read_bytes()
    file.write_bytes(whole[:-cut] or whole[:20])  # in the last line, or in the first
    standing = written(tmp_path, TWO)
    assert standing == ({ONE.task: ONE} if cut < len(whole) else {})
    assert file.read_bytes() == (
        whole if standing else whole.splitlines(keepends=True)[0] + whole.splitlines()[2] + b"\n"
    )


def test_another_card_needs_another_folder(tmp_path: Path) -> None:
    written(tmp_path, ONE)
    other = {**ASKED, "seed": 2}
    with pytest.raises(OutputError, match="outcomes of another card stand there"), ledger(tmp_path, other, force=False):
        pass
    with ledger(tmp_path, other, force=True) as (done, _):
        assert done == {}


def test_a_line_that_is_no_outcome_is_told(tmp_path: Path) -> None:
    written(tmp_path, ONE)
    file = tmp_path / LEDGER
    file.write_bytes(file.read_bytes() + b'{"task": 1}\n')
    with pytest.raises(OutputError, match="line 3"):
        written(tmp_path)


def test_two_runs_do_not_share_a_folder(tmp_path: Path) -> None:
    with ledger(tmp_path, ASKED, force=False), pytest.raises(OutputError, match="another score card is made there"):
        written(tmp_path)
