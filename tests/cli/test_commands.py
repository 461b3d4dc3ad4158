"""The commands as typed: files, exit statuses, what goes to which stream, and one error for what is wrong."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest
from commandline import Done, call

Run = Callable[..., Done]
CAMPAIGN_FILES = {
    "fit-static": {"static.json", "loops.csv", "loops.png"},
    "fit-dynamic": {"dynamic.json", "sweeps.csv", "sweeps.png"},
    "fit": {"model.json", "loops.csv", "loops.png", "sweeps.csv", "sweeps.png"},
}


@pytest.fixture(scope="module")
def work(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a copy of the campaign and, under `model`, its joint fit."""
    folder = tmp_path_factory.mktemp("work")
    shutil.copytree(root / "data/cmp_15961", folder / "data/cmp_15961")
    (folder / "configs").mkdir()
    shutil.copy(root / "configs/cmp_15961.toml", folder / "configs")
    done = call(folder, "fit", "configs/cmp_15961.toml", "-o", "model", "--no-plots")
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture
def bushfit(work: Path) -> Run:
    return lambda *arguments: call(work, *arguments)


CAMPAIGN = "configs/cmp_15961.toml"


@pytest.mark.parametrize("command", CAMPAIGN_FILES)
def test_fits_write_the_files_of_the_interface(bushfit: Run, tmp_path: Path, command: str) -> None:
    done = bushfit(command, CAMPAIGN, "-o", str(tmp_path / "x"))
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    assert {file.name for file in (tmp_path / "x").iterdir()} == CAMPAIGN_FILES[command]
    for word in ("parameter", "std error", "95 % interval", "unit", "NRMSE", "correlation"):
        assert word in done.stderr


def test_run_does_the_whole_chain_and_says_what_two_steps_cost(bushfit: Run, tmp_path: Path) -> None:
    done = bushfit("run", CAMPAIGN, "-o", str(tmp_path / "x"), "-v")
    assert done.returncode == 0, done.stderr
    named = {file.name for file in (tmp_path / "x").iterdir()}
    tables = {f"{kind}.{end}" for kind in ("loops", "sweeps", "axial", "radial") for end in ("csv", "png")}
    assert {"static.json", "dynamic.json", "model.json"} | tables <= named
    assert "pass by pass" in done.stderr
    assert "what the two-step procedure costs" in done.stderr
    assert f"the model to use: {tmp_path / 'x/model.json'}, the joint fit" in done.stderr
    assert "springpot was left out" in done.stderr
    radial = pd.read_csv(tmp_path / "x" / "radial.csv")
    assert list(radial.columns[:2]) == ["frequency [Hz]", "amplitude [mm]"]
    assert len(radial) == 48
    ordered = radial.sort_values(["amplitude [mm]", "frequency [Hz]"], ignore_index=True)
    pd.testing.assert_frame_equal(radial, ordered)


def test_run_shows_the_result_first_and_the_steps_in_a_line(bushfit: Run, tmp_path: Path) -> None:
    done = bushfit("run", CAMPAIGN, "-o", str(tmp_path / "x"), "--no-plots")
    assert done.returncode == 0, done.stderr
    words = (
        *("CMP 15 961: consistent", "joint fit", "mu ", "NRMSE", "correlation: ", "tested range"),
        *("frequencies: 0.1 to 155 Hz", "strains: 0.62 to 6.2 %, which is axial 0.1 to 1 mm, radial "),
        *("directions: axial", "axial, corners", "radial, corners", "extrapolated beyond"),
        "two-step procedure (the paper's): 10 passes, agrees with the joint fit within 1 standard error",
        *("times less certain than there (static.json, dynamic.json; -v shows it)", "wrote static.json"),
        "the model to use: ",
    )
    places = [done.stderr.index(word) for word in words]
    assert places == sorted(places)
    for word in ("pass by pass", "what the two-step procedure costs", "springpot was left out", "held out"):
        assert word not in done.stderr


def test_run_with_an_effect_shows_what_diagnose_shows(root: Path, tmp_path: Path) -> None:
    done = call(root, "run", "configs/mystery_mount.toml", "-o", str(tmp_path / "x"), "--no-plots")
    assert done.returncode == 0, done.stderr
    for words in ("Mystery mount: named", "rig_compliance (instrument)", "held out", "7.7 x noise:", "next test:"):
        assert done.stderr.count(words) == 1
    assert "model with what was added" in done.stderr
    assert "was not fitted, and the model misses it" not in done.stderr, "of the joint fit, which is not the one to use"
    assert f"{tmp_path / 'x/model.json'}, with rig_compliance; joint.json is without" in done.stderr


@pytest.mark.parametrize("ending", ["csv", "txt", "tsv", "dat", "asc", "xls", "xlsx", "xlsm", "xlsb", "ods", "XLSX"])
@pytest.mark.parametrize("command", ["run", "fit-static"])
def test_a_test_file_is_no_campaign(typed: Run, tmp_path: Path, command: str, ending: str) -> None:
    (tmp_path / f"x.{ending}").write_bytes(b"PK\x03\x04")
    done = typed(command, f"x.{ending}")
    assert done.returncode == 2
    assert f"x.{ending}: a campaign is needed" in done.stderr
    assert f"try: bushfit init x.{ending} " in done.stderr
    assert typed(command, f"lost.{ending}").stderr.count("there is no such file") == 1


def held(work: Path, name: str, mu: str = "1.09 MPa") -> str:
    """A campaign that holds all five parameters."""
    values = {"mu": mu, "m": "0.2 MPa*s^alpha", "alpha": 0.24, "sigma_fmax": "14.6 kPa", "eps_half": 0.013}
    tables = "".join(f"\n[fit.{key}]\nvalue = {json.dumps(value)}\nvary = false\n" for key, value in values.items())
    (work / "configs" / name).write_text((work / CAMPAIGN).read_text() + tables)
    return f"configs/{name}"


@pytest.mark.parametrize("loss", ["linear", "soft_l1"])
@pytest.mark.parametrize("command", [*CAMPAIGN_FILES, "run"])
def test_five_held_parameters_are_checked_against_the_tests(
    bushfit: Run, work: Path, tmp_path: Path, command: str, loss: str
) -> None:
    campaign = held(work, "held.toml")
    done = bushfit(command, campaign, "-o", str(tmp_path / "x"), "--no-plots", "--loss", loss)
    assert done.returncode == 0, done.stderr
    assert "nothing was fitted here, every parameter is held; the values given meet the tests" in done.stderr
    document = json.loads(next((tmp_path / "x").glob("[sdm]*.json")).read_text())
    assert {entry["vary"] for entry in document["parameters"].values()} == {False}
    assert document["parameters"]["mu"]["value"] == 1.09e6
    assert document["fit"]["nrmse"] < 0.01


def test_held_parameters_that_miss_the_tests_are_said_to(bushfit: Run, work: Path, tmp_path: Path) -> None:
    campaign = held(work, "off.toml", mu="1.3 MPa")
    done = bushfit("fit", campaign, "-o", str(tmp_path / "x"), "--no-plots", "--max-nrmse", "0.02")
    assert done.returncode == 1, done.stderr
    assert "the values given miss the tests by" in done.stderr
    refused = bushfit("diagnose", campaign, "-o", str(tmp_path / "y"), "--no-plots")
    assert refused.returncode == 2
    assert "every parameter is held" in refused.stderr


def test_a_parameter_at_nothing_shows_no_interval(bushfit: Run, work: Path, tmp_path: Path) -> None:
    """Sweeps whose stiffness falls with frequency leave the springpot nothing."""
    from bushfit.model.result import load_result

    sweep = pd.read_csv(work / "data/cmp_15961/sweep_axial.csv")
    sweep["stiffness [N/mm]"] *= (sweep["frequency [Hz]"] / 5.0) ** -0.15
    sweep.to_csv(work / "data/cmp_15961/falling.csv", index=False)
    (work / "configs/falling.toml").write_text((work / CAMPAIGN).read_text().replace("sweep_axial", "falling"))
    done = bushfit("fit", "configs/falling.toml", "-o", str(tmp_path / "x"), "--no-plots")
    assert done.returncode == 0, done.stderr
    result = load_result(tmp_path / "x" / "model.json")
    assert result.at_bound["m"] == "min"
    (row,) = [line for line in done.stderr.splitlines() if line.split()[:1] == ["m"]]
    assert row.split()[:3] == ["m", "(at", "min)"]
    assert " to " not in row
    assert result.interval("m") is not None, "files keep it"


def test_the_paper_s_order_by_hand(bushfit: Run, tmp_path: Path) -> None:
    """fit-static, fit-dynamic --static, predict: each takes what the one before wrote."""
    s, d, p = (str(tmp_path / name) for name in "sdp")
    assert bushfit("fit-static", CAMPAIGN, "-o", s, "--no-plots").returncode == 0
    assert bushfit("fit-dynamic", CAMPAIGN, "--static", f"{s}/static.json", "-o", d, "--no-plots").returncode == 0
    done = bushfit("predict", f"{d}/dynamic.json", "-o", p, "--no-plots", "--direction", "torsion")
    assert done.returncode == 0, done.stderr
    assert [file.name for file in Path(p).iterdir()] == ["torsion.csv"]
    again = bushfit("fit-static", CAMPAIGN, "--dynamic", f"{d}/dynamic.json", "-o", str(tmp_path / "s2"), "--no-plots")
    assert "left out" not in again.stderr


def test_predict_lays_measurements_over_and_takes_grids(bushfit: Run, tmp_path: Path) -> None:
    done = bushfit(
        "predict", "model/model.json", "--campaign", CAMPAIGN, "-o", str(tmp_path / "x"),
        "--frequencies", "10:30:10 Hz", "--amplitudes", "0.1, 0.3 mm",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert {file.name for file in (tmp_path / "x").iterdir()} == {
        f"{d}.{end}" for d in ("axial", "radial") for end in ("csv", "png")
    }
    table = pd.read_csv(tmp_path / "x" / "axial.csv")
    assert table["frequency [Hz]"].tolist() == [10, 20, 30] * 2
    assert table["amplitude [mm]"].tolist() == [0.1] * 3 + [0.3] * 3


def test_predict_says_each_warning_once_and_in_its_document(bushfit: Run, root: Path, tmp_path: Path) -> None:
    at = (*("-o", str(tmp_path / "x")), "--no-plots", "--force", "--json")
    truth = str(root / "data/mystery_mount/open_last/truth.json")
    for model, said in ((truth, "left out of the prediction"), ("model/model.json", "radial: not fitted")):
        done = bushfit("predict", model, *at)
        told = [line for line in done.stderr.splitlines() if line.startswith("warning: ")]
        assert len(set(told)) == len(told) > 0
        warnings = json.loads(done.stdout)["warnings"]
        assert [f"warning: {line}" for line in warnings] == [line for line in told if ": of the fit: " not in line]
        assert any(line.startswith(said) for line in warnings)


def test_simulate_writes_a_campaign_that_run_takes(bushfit: Run, tmp_path: Path) -> None:
    at = str(tmp_path / "sim")
    one = bushfit("simulate", "model/model.json", "--seed", "7", "--noise", "0.5 %", "-o", at)
    assert one.returncode == 0, one.stderr
    assert {"campaign.toml", "truth.json", "loop_axial_1.csv", "sweep_axial.csv", "sweep_radial.csv"} == {
        file.name for file in Path(at).iterdir()
    }
    bushfit("simulate", "model/model.json", "--seed", "7", "--noise", "0.5 %", "-o", f"{at}2")
    bushfit("simulate", "model/model.json", "--seed", "8", "--noise", "0.5 %", "-o", f"{at}3")
    same, other = ((Path(at + n) / "sweep_axial.csv").read_text() for n in ("2", "3"))
    assert (Path(at) / "sweep_axial.csv").read_text() == same != other
    fitted = bushfit("fit", f"{at}/campaign.toml", "-o", str(tmp_path / "fit"), "--no-plots", "--json")
    truth = json.loads((Path(at) / "truth.json").read_text())["parameters"]
    for name, entry in json.loads(fitted.stdout)["parameters"].items():
        assert entry["value"] == pytest.approx(truth[name]["value"], rel=0.06)


@pytest.mark.parametrize(
    "arguments",
    [
        ("fit-static", CAMPAIGN),
        ("fit-dynamic", CAMPAIGN),
        ("fit", CAMPAIGN),
        ("run", CAMPAIGN),
        ("predict", "model/model.json"),
        ("simulate", "model/model.json"),
    ],
    ids=lambda arguments: arguments[0],
)
def test_json_alone_on_standard_output_and_quiet_is_quiet(
    bushfit: Run, tmp_path: Path, arguments: tuple[str, ...]
) -> None:
    done = bushfit(*arguments, "-o", str(tmp_path / "x"), "--json", "-q", "--no-plots")
    assert done.returncode == 0, done.stderr
    assert isinstance(json.loads(done.stdout), dict)
    assert done.stderr == ""
    assert not list((tmp_path / "x").glob("*.png"))
    loud = bushfit(*arguments, "-o", str(tmp_path / "y"), "-v", "--no-plots")
    assert loud.stdout == ""
    assert "wrote " in loud.stderr


def test_json_is_the_file(bushfit: Run, tmp_path: Path) -> None:
    done = bushfit("fit", CAMPAIGN, "-o", str(tmp_path / "x"), "--json", "--no-plots")
    assert done.stdout == (tmp_path / "x" / "model.json").read_text(encoding="utf-8")


def test_results_are_not_replaced_unasked(bushfit: Run, tmp_path: Path) -> None:
    folder = tmp_path / "x"
    folder.mkdir()
    (folder / "static.json").write_text("mine")
    refused = bushfit("fit-static", CAMPAIGN, "-o", str(folder), "--no-plots")
    assert refused.returncode == 2
    assert "--force" in refused.stderr
    assert "static.json" in refused.stderr
    assert [file.name for file in folder.iterdir()] == ["static.json"]
    assert (folder / "static.json").read_text() == "mine"
    forced = bushfit("fit-static", CAMPAIGN, "-o", str(folder), "--no-plots", "--force")
    assert forced.returncode == 0
    assert (folder / "static.json").read_text() != "mine"


@pytest.mark.parametrize("command", ["fit-static", "fit-dynamic", "fit", "run"])
def test_a_missed_limit_is_status_1_with_the_results_written(bushfit: Run, tmp_path: Path, command: str) -> None:
    missed = bushfit(command, CAMPAIGN, "-o", str(tmp_path / "x"), "--no-plots", "--max-nrmse", "1e-4")
    assert missed.returncode == 1
    assert "is above --max-nrmse 0.0001" in missed.stderr
    assert list((tmp_path / "x").glob("*.json"))
    met = bushfit(command, CAMPAIGN, "-o", str(tmp_path / "y"), "--no-plots", "--max-nrmse", "0.05")
    assert met.returncode == 0


def test_output_that_cannot_be(bushfit: Run, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    done = bushfit("fit-static", CAMPAIGN, "-o", str(tmp_path / "file"), "--force")
    assert done.returncode == 2
    assert "not a folder" in done.stderr


def test_results_go_to_a_folder_of_the_campaign_by_default(work: Path, tmp_path: Path) -> None:
    done = call(tmp_path, "fit-static", str(work / CAMPAIGN), "--no-plots")
    assert done.returncode == 0
    assert (tmp_path / "results" / "CMP 15 961" / "static.json").exists()


def test_one_loop_alone_is_fitted_and_what_it_leaves_open_is_named(work: Path, tmp_path: Path) -> None:
    text = (work / CAMPAIGN).read_text()
    (work / "configs/loop.toml").write_text(text[: text.index("[[sweeps]]")])
    done = call(work, "run", "configs/loop.toml", "-o", str(tmp_path / "x"), "--no-plots")
    assert done.returncode == 0, done.stderr
    assert "no sweeps: the two-step procedure is passed over" in done.stderr
    assert "one loop rate, 0.1 Hz: mu, m and alpha cannot be told from one another" in done.stderr
    assert "the further test that would help most: a loop at" in done.stderr


def test_the_installed_command(work: Path, tmp_path: Path) -> None:
    """In a process of its own, with warnings as errors."""
    command = [sys.executable, "-W", "error", str(Path(sys.executable).with_name("bushfit"))]
    folder = tmp_path / "x"
    done = subprocess.run(
        [*command, "fit", CAMPAIGN, "-o", str(folder), "--json", "--no-plots"],
        cwd=work, capture_output=True, text=True, check=False, encoding="utf-8",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout == (folder / "model.json").read_text(encoding="utf-8")
    assert "CMP 15 961: joint fit" in done.stderr


@pytest.mark.parametrize("arguments", [("--help",), ("--version",), ("-h",)])
def test_help_is_instant(arguments: tuple[str, ...]) -> None:
    """Neither NumPy nor pandas nor any other slow package is imported to print it."""
    code = (
        "import sys\nfrom bushfit.cli import cli\n"
        f"cli.main({list(arguments)!r}, standalone_mode=False)\n"
        "slow = {'numpy', 'pandas', 'scipy', 'matplotlib', 'lmfit', 'pint', 'pydantic', 'rich'} & set(sys.modules)\n"
        "assert not slow, slow\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout


def test_everyday_units_need_no_pint(work: Path, tmp_path: Path) -> None:
    arguments = ["bushfit", "fit", CAMPAIGN, "--no-plots", "-q", "-o", str(tmp_path / "fit")]
    code = (
        f"import sys\nfrom bushfit.cli import main\nsys.argv = {arguments!r}\n"
        "try:\n    main()\nfinally:\n    assert not {'pint', 'matplotlib.pyplot', 'distributed'} & set(sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=work, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "fit" / "model.json").exists()


@pytest.mark.parametrize("command", ["run", "fit-static", "fit-dynamic", "fit", "predict", "simulate"])
def test_every_command_has_help_that_names_its_files(bushfit: Run, command: str) -> None:
    done = bushfit(command, "--help")
    assert done.returncode == 0
    assert "Writes" in done.stdout
    for option in ("-o, --output", "-v, --verbose", "-q, --quiet", "--json", "--no-plots", "--force"):
        assert option in done.stdout
    assert f"  {command} " in bushfit("--help").stdout
