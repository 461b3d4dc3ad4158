"""Kinds of warnings: the table and the code have the same ones."""

import ast
import tomllib

import pytest

from bushfit.caveat import KINDS, Caveat, to_caveats
from bushfit.effects import LIBRARY


def test_every_kind_is_in_the_code_and_once_in_the_table(root):
    trees = [ast.parse(file.read_text(encoding="utf-8")) for file in (root / "bushfit").rglob("*.py")]
    nodes = [node for tree in trees for node in ast.walk(tree)]
    texts = {node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)}
    texts |= {effect.assumption.kind for effect in LIBRARY.values() if effect.assumption}
    assert KINDS.keys() <= texts
    calls = [node for node in nodes if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Caveat"]
    stated = {call.args[0].value for call in calls if call.args and isinstance(call.args[0], ast.Constant)}
    assert len(stated) > 100
    assert stated <= KINDS.keys()
    tables = tomllib.loads((root / "bushfit/caveat.toml").read_text(encoding="utf-8"))
    assert sum(len(kinds) for table in tables.values() for kinds in table.values()) == len(KINDS)


def test_an_unknown_kind_is_refused_but_read_from_a_file_of_another_version():
    with pytest.raises(ValueError, match="no kind of warning 'strange'"):
        Caveat("strange", "this is odd")
    assert [caveat.kind for caveat in to_caveats(["a", "b", "c"], ["misfit", "strange"])] == [
        "misfit",
        "other",
        "other",
    ]
