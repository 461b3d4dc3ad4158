"""What the tests share: commands as typed, the paper's bushing and model, other bushings, and where the data lie."""

import os

# Small matrices, and a worker a core: threads of the linear algebra would only stand in each other's way.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from collections.abc import Callable
from functools import cache
from pathlib import Path

import production
import pytest
from commandline import Done, Run, Shared, typing
from fits import joint_fit
from hypothesis import HealthCheck, settings
from paper import CMP_15961, TABLE_1

from bushfit.campaign.campaign import Campaign, load_campaign
from bushfit.effects import BASE
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.geometry import Bushing
from bushfit.model.model import Model
from bushfit.model.result import Result

#: Tries of each property: few for a commit, many where CI looks once more (`--hypothesis-profile=full`).
for name, tries in (("commit", 10), ("full", 50)):
    settings.register_profile(
        name, max_examples=tries, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
    )
settings.load_profile("commit")

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="session")
def root() -> Path:
    """The repository."""
    return ROOT


@pytest.fixture(scope="session")
def bushing() -> Bushing:
    """The bushing of the paper."""
    return CMP_15961


@pytest.fixture(scope="session")
def made(paper_model, tmp_path_factory) -> Path:
    """A simulated production run, and in `out` the batch of it; what the terminal said is in `said`."""
    folder = tmp_path_factory.mktemp("production")
    production.make(folder, paper_model)
    batch = ("batch", "part_*/bushing.toml", "--limits", "limits.toml", "--jobs", "1", "-o", "out", "--no-plots")
    done = typing(folder)(*batch, status=1)
    (folder / "said").write_text(done.stdout, encoding="utf-8")
    return folder


@pytest.fixture
def table_1() -> dict[str, float]:
    """Table 1 of the paper."""
    return dict(TABLE_1)


@pytest.fixture(scope="session")
def paper_model() -> Model:
    """The paper's bushing with the parameters of Table 1."""
    return Model(CMP_15961, BASE, TABLE_1)


@pytest.fixture(scope="session")
def campaign() -> Campaign:
    """The paper's bushing as an independent rig simulation measured it."""
    return load_campaign(ROOT / "configs/cmp_15961.toml")


@pytest.fixture(scope="session")
def measured(campaign) -> PreparedCampaign:
    """The same, made ready; its joint fit is `result`."""
    return PreparedCampaign.from_campaign(campaign)


@pytest.fixture(scope="session")
def result(campaign) -> Result:
    """The joint fit to its axial tests."""
    return joint_fit(campaign)


@pytest.fixture(scope="session")
def other_models() -> dict[str, Model]:
    """Bushings unlike the paper's: soft and long, stiff and thin, strongly filled."""
    sizes = {
        "soft and long": ((0.012, 0.028, 0.080), (4.5e5, 3.0e4, 0.31, 5.0e3, 1.0e-2)),
        "stiff and thin": ((0.015, 0.019, 0.025), (1.9e6, 4.0e5, 0.19, 3.0e4, 2.0e-2)),
        "strongly filled": ((0.009, 0.020, 0.040), (1.3e6, 4.5e5, 0.21, 6.0e4, 9.0e-3)),
    }
    return {
        name: Model(Bushing(name, *size), BASE, dict(zip(TABLE_1, values, strict=True)))
        for name, (size, values) in sizes.items()
    }


@pytest.fixture
def typed(tmp_path) -> Run:
    """Commands in an empty folder."""
    return typing(tmp_path)


@pytest.fixture(scope="session")
def shared(tmp_path_factory) -> Shared:
    """Commands that run once a session, for all its workers."""
    base = tmp_path_factory.getbasetemp()
    store = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "shared"
    store.mkdir(exist_ok=True)
    return Shared(store)


@pytest.fixture(scope="session")
def campaign_run(shared, root, tmp_path_factory) -> Callable[[str], tuple[Path, Done]]:
    """The folder of `bushfit run` of a campaign in configs, without pictures, and what it printed; made once."""
    home = tmp_path_factory.mktemp("runs")
    for part in ("configs", "data"):
        (home / part).symlink_to(root / part)

    @cache
    def run(name: str) -> tuple[Path, Done]:
        done = shared.call(home, "run", f"configs/{name}.toml", "-o", name, "--no-plots", "--json")
        assert done.returncode == 0, done.stderr
        return home / name, done

    return run
