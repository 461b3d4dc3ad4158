"""The benchmark: made alike from a seed, sealed, and scored as its rules say."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from baselines import single, sparse
from benchmark import ToolAnswer, benchmark, judge, location_score, make, read_answers, score, sha256, tasks
from click.testing import CliRunner
from lab_campaign import campaign
from sessions import evaluate

COUNT = 5
MUTE: ToolAnswer = {"sees": False, "claims": [], "where": []}


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A handful of campaigns, made as typed."""
    folder = tmp_path_factory.mktemp("benchmark")
    made = CliRunner().invoke(benchmark, ["make", str(folder), "--campaigns", str(COUNT)])
    assert made.exit_code == 0, made.output
    assert made.output.split()[::2] == [sha256(folder / "campaigns"), sha256(folder / "answers.json")]
    return folder


@pytest.fixture(scope="module")
def answers(folder) -> dict[str, Any]:
    return json.loads((folder / "answers.json").read_text())


def test_300_campaigns_are_balanced_and_no_two_alike():
    drawn = tasks(55, 300)
    groups = [task[0] for task in drawn]
    counts = {group: groups.count(group) for group in sorted(set(groups))}
    assert counts == {"clean": 51, "other law": 60, "own law": 93, "record": 40, "rig fault": 56}
    assert len({task[3] for task in drawn}) == 300


def test_the_same_seed_makes_the_same_and_the_answers_are_apart(folder, tmp_path):
    campaigns, truth = make(tmp_path, 55, COUNT)
    assert (campaigns, truth) == (sha256(folder / "campaigns"), sha256(folder / "answers.json"))
    assert make(tmp_path / "other", 56, 1)[0] != make(tmp_path / "one", 55, 1)[0]
    kinds = {task[1] for task in tasks(55, COUNT)} - {""}
    text = "".join(file.read_text() for file in (folder / "campaigns").rglob("*") if file.is_file())
    assert not [kind for kind in kinds if kind in text]


def rates(answers: dict[str, Any], told: dict[str, ToolAnswer]) -> dict[str, str]:
    return {measure: cell.partition(" (")[0] for measure, cell in score(answers, told).items()}


def test_a_perfect_a_mute_and_a_prejudiced_tool(answers):
    perfect, friction = {}, {}
    for name, truth in answers.items():
        right = [*truth["right"], *(f"fault.{place}" for place in truth["place"])]
        planted = [point[:3] for point in truth["points"] if point[3]]
        regions = [{"direction": d, "frequency_Hz": [f, f], "amplitude_mm": [x, x]} for d, f, x in planted]
        claims = [[right[0]]] if right else []
        perfect[name] = {"sees": bool(truth["kind"] or truth["law"]), "claims": claims, "where": regions}
        friction[name] = {"sees": True, "claims": [["second_friction"]], "where": []}
    ideal = rates(answers, perfect)
    none, all_of_them = "0.0 %", "100.0 %"
    seen = {"hits": all_of_them, "in the set": all_of_them, "wrong names": none, "location F1": "1.00"}
    assert ideal == {**seen, "false alarms": none, "passed over": none}
    mute = rates(answers, {})
    assert [mute[name] for name in ("hits", "wrong names", "false alarms")] == [none] * 3
    assert mute["passed over"] == all_of_them
    prejudiced = rates(answers, friction)
    wrong = sum("second_friction" not in (*truth["right"], *truth["also"]) for truth in answers.values())
    assert prejudiced["wrong names"] == f"{100 * wrong / COUNT:.1f} %"
    assert prejudiced["false alarms"] == "100.0 %"


TRUTH = {
    "kind": "inertia",
    "law": "intrinsic_time",
    "right": ["inertia"],
    "also": ["kraus"],
    "place": ["level"],
    "visible": True,
    "points": [],
}


@pytest.mark.parametrize(
    ("claims", "hit", "in_the_set", "wrong"),
    [
        ([["inertia"]], True, True, False),
        ([["inertia"], ["delay"]], True, True, True),
        ([["kraus"]], False, False, False),
        ([["delay", "inertia"]], False, True, False),
        ([["delay", "viscous + inertia"]], False, True, False),
        ([["a", "b", "c", "d", "inertia"]], False, False, False),
        ([["fault.level"]], True, True, False),
        ([["fault.repeat"]], False, False, True),
        ([], False, False, False),
    ],
)
def test_what_a_claim_is_worth(claims, hit, in_the_set, wrong):
    judged = judge(TRUTH, {"sees": True, "claims": claims, "where": []})
    assert (judged["hits"], judged["in the set"], judged["wrong names"]) == (hit, in_the_set, wrong)
    assert judge(TRUTH | {"visible": False}, MUTE)["hits"] is None
    assert judge(TRUTH | {"visible": False}, MUTE)["passed over"] is None


def test_location_is_the_f1_of_points():
    points = [("axial", f, x, int(f > 50.0)) for f in (10.0, 60.0, 110.0) for x in (0.1, 0.5)]
    region = {"direction": "axial", "frequency_Hz": [60.0, 110.0], "amplitude_mm": [0.1, 0.1]}
    assert location_score(points, [region]) == pytest.approx(2 / 3)  # two of four, none beside
    assert location_score(points, [region | {"frequency_Hz": [0.0, 999.0]}]) == pytest.approx(4 / 7)
    assert location_score(points, [region | {"direction": "radial"}]) == 0.0


def test_tools_answer_and_a_stopped_run_continues(folder, answers, tmp_path):
    """Of two campaigns the first was answered before; its answer stays as it is."""
    shutil.copy(folder / "answers.json", tmp_path)
    names, first = [*answers][:2], {"campaign": next(iter(answers)), **MUTE}
    for name in names:
        shutil.copytree(folder / "campaigns" / name, tmp_path / "campaigns" / name)
    for tool in ("bushfit", "sparse"):
        (tmp_path / f"{tool}.jsonl").write_text(json.dumps(first) + "\n")
        done = CliRunner().invoke(benchmark, ["run", str(tmp_path), "--tool", tool])
        assert done.exit_code == 0, done.output
        told = read_answers(tmp_path / f"{tool}.jsonl")
        assert ([*told], told[names[0]], "error" in told[names[1]]) == (names, first, False)
    table = CliRunner().invoke(benchmark, ["score", str(tmp_path), "--groups"]).output
    assert "| bushfit | " in table
    assert "| sparse, clean | " in table


def test_baselines_name_what_is_plain(tmp_path):
    campaign("inertia", 0.1, 5, tmp_path)
    plain = (["inertia"], ["fixture_resonance"])
    for answer in (sparse(tmp_path), single(tmp_path)):
        assert answer["claims"][0] in plain
        assert {region["frequency_Hz"][0] for region in answer["where"]}


@pytest.mark.slow
def test_a_planned_session_settles_what_was_left_open():
    assert evaluate((1777477785, ("rig_compliance",)), 8.0) == "rightly"
