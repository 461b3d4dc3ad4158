"""Commands that bushfit prints, as next steps and in hints, run as printed from the same folder."""

import re
import shlex

import pytest
from commandline import call
from tries import some

TYPED = [
    "diagnose ROOT/configs/mystery_mount.toml --no-plots -o",
    "diagnose data/practice/case_003/bushing.toml --no-plots -o",
    "fit-static configs/cmp_15961.toml --no-plots -o",
    "export configs/cmp_15961.toml --format csv -o",
]


@pytest.mark.parametrize("typed", some(TYPED, TYPED[2:]))
def test_printed_commands_run_as_printed(typed, root, tmp_path):
    for folder in ("configs", "data"):
        (tmp_path / folder).symlink_to(root / folder)
    text = call(tmp_path, *typed.replace("ROOT", str(tmp_path)).split(), "a b").text
    printed = re.findall(r": bushfit (.*)$", text, re.MULTILINE)
    assert printed
    assert not any(call(tmp_path, *shlex.split(command)).returncode for command in printed)
