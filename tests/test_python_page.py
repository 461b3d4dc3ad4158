"""The page on Python: its examples run, and say what is shown."""

from __future__ import annotations

import doctest
import re
import shutil
from pathlib import Path

import pytest
from test_readme import says

BLOCK = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)


class Checker(doctest.OutputChecker):
    """The words as they stand; numbers as near as other processors round."""

    def check_output(self, want: str, got: str, optionflags: int) -> bool:
        if super().check_output(want, got, optionflags):
            return True
        lines = want.splitlines(), got.splitlines()
        return len(lines[0]) == len(lines[1]) and all(map(says, *lines))


def test_every_example_runs_and_says_what_is_shown(root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("configs", "data"):
        shutil.copytree(root / name, tmp_path / name)
    monkeypatch.chdir(tmp_path)
    page = root / "bushfit/python.md"
    blocks = BLOCK.findall(page.read_text(encoding="utf-8"))
    test = doctest.DocTestParser().get_doctest("".join(blocks), {}, "python.md", str(page), 0)
    said: list[str] = []
    runner = doctest.DocTestRunner(Checker(), optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
    failed, tried = runner.run(test, out=said.append)
    print(f"{tried} examples")
    assert tried > 20
    assert failed == 0, "".join(said)


def test_what_is_not_said_is_noticed() -> None:
    checker = Checker()
    assert checker.check_output("a 1.00 b\n", "a  1.001 b\n", 0)
    assert not checker.check_output("a 1.00 b\n", "a 1.2 b\n", 0)
    assert not checker.check_output("a 1.00 b\n", "a 1.00 c\n", 0)
    assert not checker.check_output("a 1.00 b\n", "a 1.00 b\nand more\n", 0)
