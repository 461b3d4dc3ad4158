"""The examples in the docstrings of effects, geometry and model."""

from __future__ import annotations

import doctest
import pkgutil
from importlib import import_module

import numpy as np
import pytest

from bushfit import effects, geometry, model
from bushfit.effects.contract import Array, Setting
from bushfit.geometry import Direction
from bushfit.model.model import Model

PACKAGES = (effects, geometry, model)
MODULES = [
    *(package.__name__ for package in PACKAGES),
    *(found.name for package in PACKAGES for found in pkgutil.iter_modules(package.__path__, f"{package.__name__}.")),
]


def spring(omega: Array, amplitude: Array) -> float:
    """A response below a layer: 500 N/mm, whatever the test."""
    return 5e5


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_are_right(name: str, paper_model: Model) -> None:
    """Each effect has one; contract.py says what the names in them stand for."""
    tests = {kind: Setting(paper_model.bushing, Direction.AXIAL, kind) for kind in ("sweep", "loop")}
    known = {"np": np, "paper": paper_model, "spring": spring, **tests}
    done = doctest.testmod(import_module(name), extraglobs=known)
    assert done.failed == 0
    assert done.attempted or not name.startswith("bushfit.effects.")
