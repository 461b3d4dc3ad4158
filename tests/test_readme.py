"""Stale documentation fails: every `$ bushfit ...` of the README runs, in order, in a copy of what it needs."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

CONSOLE = re.compile(r"^```console\n(.*?)^```", re.MULTILINE | re.DOTALL)


def commands(text: str) -> list[str]:
    """The lines after `$ ` of the console blocks, continued ones joined."""
    lines = "\n".join(CONSOLE.findall(text)).replace("\\\n", " ").splitlines()
    return [line.removeprefix("$ ").strip() for line in lines if line.startswith("$ ")]


def test_blocks_are_understood() -> None:
    text = "a\n```console\n$ bushfit run \\\n    x.toml\nwrote it\n$ cd y\n```\n```python\n$ bushfit no\n```\n"
    assert [shlex.split(command) for command in commands(text)] == [["bushfit", "run", "x.toml"], ["cd", "y"]]


def test_every_command_of_the_readme_runs(root: Path, tmp_path: Path) -> None:
    text = (root / "README.md").read_text(encoding="utf-8")
    if len(text.splitlines()) < 5:
        pytest.skip("the README is a title yet")
    runs = [command for command in commands(text) if re.match(r"(?:\S+/)?bushfit\b", command)]
    assert runs, "the README shows no `$ bushfit ...` in a ```console block"
    for name in ("data", "configs"):
        shutil.copytree(root / name, tmp_path / name)
    program = str(Path(sys.executable).with_name("bushfit"))
    for command in runs:
        done = subprocess.run(
            [program, *shlex.split(command, comments=True)[1:]],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
            encoding="utf-8",
        )
        print(f"$ {command} -> {done.returncode}")
        assert done.returncode == 0, f"$ {command}\n{done.stderr}"


def test_links_of_the_readme_lead_somewhere(root: Path) -> None:
    text = (root / "README.md").read_text(encoding="utf-8")
    targets = re.findall(r"\]\((?!https?://|#|mailto:)([^)#\s]+)", text)
    missing = [target for target in targets if not (root / target).exists()]
    assert missing == []
