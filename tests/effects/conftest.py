"""Every effect of the library, and random numbers."""

import numpy as np
import pytest
from random_models import ADDED

from bushfit.effects import LIBRARY, Effect


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20240607)


@pytest.fixture(params=ADDED)
def effect(request: pytest.FixtureRequest) -> Effect:
    return LIBRARY[request.param]
