"""The commands as typed: files, exit statuses, what goes to which stream, and one error for what is wrong."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from commandline import Done, call

Run = Callable[..., Done]


CAMPAIGN = "configs/cmp_15961.toml"


@pytest.mark.parametrize(
    "arguments",
    [
        ("fit-static", CAMPAIGN),
        ("fit-dynamic", CAMPAIGN),
        ("fit", CAMPAIGN),
        ("run", CAMPAIGN),
        ("predict", "model/model.json"),
        ("compare", "model", "model/model.json"),
        ("simulate", "model/model.json"),
        ("plan", "model/model.json", "--hours", "1.5"),
        ("export", "model/model.json", "--format", "abaqus"),
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


@pytest.mark.parametrize(
    "command", ["run", "fit-static", "fit-dynamic", "fit", "predict", "compare", "plan", "simulate", "export"]
)
def test_every_command_has_help_that_names_its_files(bushfit: Run, command: str) -> None:
    done = bushfit(command, "--help")
    assert done.returncode == 0
    assert "Writes" in done.stdout
    for option in ("-o, --output", "-v, --verbose", "-q, --quiet", "--json", "--no-plots", "--force"):
        assert option in done.stdout
    assert f"  {command} " in bushfit("--help").stdout
