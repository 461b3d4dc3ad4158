"""Stale documentation fails: every `$ bushfit ...` of the README runs, in order, in a copy of what it needs."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

CONSOLE = re.compile(r"^```console\n(.*?)^```", re.MULTILINE | re.DOTALL)


#: Numbers of the README and of a run agree within this: other processors round otherwise.
TOLERANCE = 0.03
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def examples(text: str) -> list[tuple[str, list[str]]]:
    """Each line after `$ ` of the console blocks, continued ones joined, and the output shown below it."""
    found: list[tuple[str, list[str]]] = []
    for block in CONSOLE.findall(text):
        for line in block.replace("\\\n", " ").splitlines():
            if line.startswith("$ "):
                found.append((line.removeprefix("$ ").strip(), []))
            elif line.strip() and line.strip() != "..." and "──" not in line:
                found[-1][1].append(line)
    return found


def says(line: str, output: str) -> bool:
    """Whether some line of the output is the line shown: the same words, and numbers within TOLERANCE."""
    words, numbers = NUMBER.sub("#", line).split(), [float(number) for number in NUMBER.findall(line)]
    return any(
        NUMBER.sub("#", other).split() == words
        and all(
            abs(float(mine) - shown) <= TOLERANCE * abs(shown) + 0.011
            for mine, shown in zip(NUMBER.findall(other), numbers, strict=True)
        )
        for other in output.splitlines()
    )


def test_blocks_are_understood() -> None:
    text = "a\n```console\n$ bushfit run \\\n    x.toml\n...\nwrote 1.5 it\n$ cd y\n```\n```python\n$ bushfit no\n```\n"
    (one, shown), (other, nothing) = examples(text)
    assert [shlex.split(one), shlex.split(other)] == [["bushfit", "run", "x.toml"], ["cd", "y"]]
    assert (shown, nothing) == (["wrote 1.5 it"], [])
    assert says(shown[0], "so\n wrote  1.51 it")
    assert not says(shown[0], "wrote 1.7 it")
    assert not says(shown[0], "wrote 1.5 them")


def status(command: str) -> int:
    """The exit status that a command's comment tells, as in `# exit status 1: ...`; 0 where it tells none."""
    told = re.search(r"# exit status (\d)", command)
    return int(told[1]) if told else 0


def test_every_command_of_the_readme_runs_and_says_what_is_shown(root: Path, tmp_path: Path) -> None:
    text = (root / "README.md").read_text(encoding="utf-8")
    runs = [(command, shown) for command, shown in examples(text) if re.match(r"(?:\S+/)?bushfit\b", command)]
    assert runs, "the README shows no `$ bushfit ...` in a ```console block"
    for name in ("data", "configs"):
        shutil.copytree(root / name, tmp_path / name)
    program = str(Path(sys.executable).with_name("bushfit"))
    stale = []
    for command, shown in runs:
        done = subprocess.run(
            [program, *shlex.split(command, comments=True)[1:]],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
            encoding="utf-8",
        )
        print(f"$ {command} -> {done.returncode}")
        assert done.returncode == status(command), f"$ {command}\n{done.stderr}"
        stale += [f"$ {command}\n{line}" for line in shown if not says(line, done.stdout + done.stderr)]
    assert not stale, "the README shows what its commands do not say:\n" + "\n".join(stale)


def test_links_of_the_readme_lead_somewhere(root: Path) -> None:
    text = (root / "README.md").read_text(encoding="utf-8")
    targets = re.findall(r"\]\((?!https?://|#|mailto:)([^)#\s]+)", text)
    missing = [target for target in targets if not (root / target).exists()]
    assert missing == []
