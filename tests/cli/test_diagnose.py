"""`diagnose` as typed: its tables and its model."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commandline import typing
from shell import document

from bushfit.effects import BASE, effects_for_places
from bushfit.effects.mistakes import MISTAKES

#: An inertia is hidden here.
CAMPAIGN = "data/practice/case_001/bushing.toml"


@pytest.fixture(scope="module")
def found(root, tmp_path_factory) -> Path:
    """The folder of one diagnosis."""
    folder = tmp_path_factory.mktemp("found")
    typing(root)("diagnose", CAMPAIGN, "-o", folder, "--no-plots")
    return folder


def test_every_residual_and_every_candidate_is_in_a_table(found):
    """Their mean squares are the gaps that the document states, but for what a loop's rows tell of the next."""
    table = pd.read_csv(found / "gap.csv")
    gap = document(found / "diagnosis.json")["gap"]["calibration"]
    assert {"test", "kind", "direction", "frequency [Hz]", "amplitude [mm]", "repeat", "time [s]"} <= set(table.columns)
    for when in ("before", "after"):
        columns = [name for name in table.columns if name.endswith(f"{when} [noise]")]
        assert len(columns) == 3
        values = np.sqrt(np.nanmean(np.square(table[columns].to_numpy())))
        assert values == pytest.approx(gap[when], rel=0.02)  # a loop's rows share its gain
    assert table[table.kind == "sweep"].groupby("test").size().to_dict() == {"sweep_axial": 144, "sweep_radial": 144}
    assert set(table[table.kind == "loop"].test) == {"loop_axial_1", "loop_axial_2"}
    table = pd.read_csv(found / "candidates.csv")
    asked = {name for name, effect in effects_for_places(("axial", "radial")).items() if effect.after in (None, *BASE)}
    mistakes = table.effect.str.partition(":")[0].isin(MISTAKES)
    assert set(table.effect[~mistakes]) == asked - set(BASE)
    assert table.probability[mistakes].max() < 1e-6
    levels = table.set_index("effect").level
    assert (levels["sleeve_compliance"], levels["inertia"]) == ("unresolved", "instrument")
    assert table.why.notna().all()
    assert table.set_index("effect").why["inertia"] == "part of the most probable explanation"
    assert table["expected chi-square gain"].is_monotonic_decreasing
    assert table.effect[table.probability.idxmax()] == "inertia"
    assert table[table["chi-square gain"].notna() & ~mistakes].parameters.str.contains("=").all()


def test_its_own_model_is_consistent_and_predicts_without_the_rig(root, found, tmp_path):
    bushfit, model = typing(root), found / "model.json"
    again = bushfit("diagnose", CAMPAIGN, "--model", model, "-o", tmp_path / "again", "--json", "--no-plots")
    assert json.loads(again.stdout)["verdict"] == "consistent"
    assert document(tmp_path / "again/model.json")["effects"] == [*BASE, "inertia"]
    assert "inertia" in bushfit("predict", model, "-o", tmp_path / "predicted", "--no-plots").stderr


def test_without_names_each_law_is_a_family(bushfit, tmp_path, monkeypatch):
    monkeypatch.setattr("bushfit.diagnosis.families.known_families", lambda *_: ("sliders",))
    done = bushfit("compare", "configs/cmp_15961.toml", "-o", tmp_path / "x", "--json", "--no-plots", "--families")
    assert [family["name"] for family in json.loads(done.stdout)["families"]] == ["paper", "sliders"]
