"""Commands typed in a folder, that end as they should, and what they leave there."""

import json
from pathlib import Path
from typing import Any

from commandline import Done

#: The paper's tests, in the folder `work`.
CAMPAIGN = "configs/cmp_15961.toml"
GEOMETRY = ("--inner-radius", "10 mm", "--outer-radius", "18 mm", "--length", "34 mm")


def refused(done: Done, folder: Path, *words: str) -> None:
    """One error that says these words, and nothing written."""
    assert done.stderr.count("rror: ") == 1
    for each in words:
        assert each in done.stderr
    assert not folder.exists()


def names(folder: Path) -> set[str]:
    """The files of a result."""
    return {file.name for file in folder.glob("[!.]*")}


def document(file: Path) -> dict[str, Any]:
    return json.loads(file.read_text(encoding="utf-8"))


def values(done: Done) -> dict[str, float]:
    """The parameters of a fit that was printed as JSON."""
    return {name: entry["value"] for name, entry in json.loads(done.stdout)["parameters"].items()}
