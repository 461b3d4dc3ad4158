"""The Tab key, by the protocol in which shells ask: commands, options, words, files, and names of what is typed."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from bushfit.cli import cli

MISTAKES = {"plain,peak_to_peak:sweep_axial", "plain,peak_to_peak:sweep_radial"}
PLACES = {"plain,axial", "plain,radial", "plain,torsion"}
ASKED = [
    ("fit-", {"plain,fit-static", "plain,fit-dynamic"}),
    ("fit|x.toml|--prof", {"plain,--profile"}),
    ("fit|x.toml|--loss|", {"plain,linear", "plain,soft_l1"}),
    ("export|m.json|--format|na", {"plain,nastran"}),
    ("run|conf", {"file,conf"}),
    ("run|x.toml|-o|res", {"dir,res"}),
    ("init|x.csv|--direction|ra", {"plain,radial"}),
    ("fit|configs/epdm_70.toml|--direction|", {*PLACES, "plain,DMA", "plain,DMA 2", "plain,mount"}),
    ("fit|configs/lost.toml|--direction|", PLACES),
    ("fit|half.toml|--direction|", PLACES),
    ("fit|README.md|--effect|interf", {"plain,interface_slip"}),
    ("diagnose|configs/cmp_15961.toml|--adopt|peak_to", MISTAKES),
    ("diagnose|--without|inerti", {"plain,inertia"}),
    ("plan|x.toml|--rivals|delay,iner", {"plain,delay,inertia"}),
    ("compare|x.toml|--families|sliders+kra", {"plain,sliders+kraus"}),
    ("schema|mod", {"plain,model"}),
    ("inspect|configs/cmp_15961.toml|--thou", {"plain,--thousands"}),
]


def asking(*words: str) -> dict[str, str]:
    """What a shell puts into the environment, the cursor behind the last word."""
    line = ["bushfit", *words]
    return {"_BUSHFIT_COMPLETE": "bash_complete", "COMP_WORDS": " ".join(line), "COMP_CWORD": str(len(line) - 1)}


@pytest.mark.parametrize(("words", "offered"), ASKED, ids=[words for words, _ in ASKED])
def test_tab_offers(root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: str, offered: set[str]) -> None:
    (tmp_path / "half.toml").write_text("specimens = [1, {}]\nloops = 3\n")  # as while it is written
    words = words.replace("half.toml", str(tmp_path / "half.toml"))
    monkeypatch.chdir(root)
    done = CliRunner().invoke(cli, prog_name="bushfit", env=asking(*words.split("|")))
    assert (done.exit_code, set(done.stdout.split("\n")) - {""}, done.stderr) == (0, offered, "")


def test_the_installed_command_answers_a_shell() -> None:
    program = str(Path(sys.executable).with_name("bushfit"))
    env = {**os.environ, **asking("simu")}
    assert subprocess.run([program], env=env, capture_output=True, check=True).stdout == b"plain,simulate\n"


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish", "powershell"])
def test_the_line_on_the_page_is_what_each_shell_takes(root: Path, shell: str) -> None:
    assert f"{shell}_source" in (root / "configs/README.md").read_text(encoding="utf-8")
    done = CliRunner().invoke(cli, prog_name="bushfit", env={"_BUSHFIT_COMPLETE": f"{shell}_source"})
    assert f"{shell}_complete" in done.stdout
