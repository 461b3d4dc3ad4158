"""Agreement with numbers of others, held against what the README of this folder says of it."""

import re
from collections.abc import Sequence

import pytest
from agreement import Agree

#: A figure of the README may be that much too modest, but for those that rounding decides.
_MODESTY, _ROUNDING = 0.5, 12.0


@pytest.fixture(scope="session")
def agree(root) -> Agree:
    text = (root / "tests/reference/README.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| ([^|]+?) \| [^|]+ \| ([\d./ ]+) \|$", text, re.MULTILINE)
    said = {what: [float(part) for part in figures.split("/")] for what, figures in rows}

    def judge(what: str, found: Sequence[float]) -> None:
        print(f"{what}: {' / '.join(f'{value:.1f}' for value in found)} digits")
        assert what in said, f"the README has no row for: {what}"
        for value, stated in zip(found, said[what], strict=True):
            assert stated <= value, f"the README says {stated}"
            assert value < stated + _MODESTY or stated >= _ROUNDING, f"the README says {stated}"

    return judge
