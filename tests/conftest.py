"""What all tests share: how every property is searched, how much linear algebra may take, and a process of mocks.

How long an example of a property takes says nothing on a machine that others use too, and a failure is worth most where
it can be had again; ``pytest --hypothesis-profile=default`` looks for new examples.
"""

import contextlib
import os
import secrets
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, settings

from tests.witness import Witness, watched

if TYPE_CHECKING:
    from mock_devices.testing.force import ForceBench, ServedMock

# One thread for each worker, and for all that it starts: more wait for one another, and take three times the time.
# It is read when numpy is loaded, which is later than this.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Drawn before any worker starts, and inherited by all: sessions that nobody has seen are hidden in each run.
NEW_SEED = os.environ.setdefault("TISSUE_RIG_SEED", str(10_000 + secrets.randbelow(10**8)))

# One file for all workers of a run.
STALLS = Path(os.environ.setdefault("TISSUE_RIG_STALLS", str(Path(tempfile.gettempdir()) / f"stalls-{os.getpid()}")))

settings.register_profile(
    "shared machine", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("shared machine")


def pytest_configure(config: pytest.Config) -> None:
    """Whoever hands tests on to workers does not know yet whether there are tests of the bench among them."""
    config.pluginmanager.register(Witness(STALLS))
    if config.getoption("numprocesses", None):
        _watch(config)


def pytest_collection_finish(session: pytest.Session) -> None:
    """Whoever runs tests without workers has witnesses for those of the bench; other tests need none."""
    alone = not session.config.getoption("numprocesses", None) and "PYTEST_XDIST_WORKER" not in os.environ
    if alone and any(item.get_closest_marker("bench") for item in session.items):
        _watch(session.config)


def _watch(config: pytest.Config) -> None:
    """Witnesses of the computer's own stalls run beside the tests."""
    ending = contextlib.ExitStack()
    ending.callback(STALLS.unlink, missing_ok=True)
    ending.enter_context(watched(STALLS))
    config.add_cleanup(ending.close)


def pytest_report_header() -> str:
    """The seed of what is new in this run; with it in the environment the same comes again."""
    return f"TISSUE_RIG_SEED={NEW_SEED}"


@pytest.fixture(scope="session", autouse=True)
def state_folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """What the software keeps by itself is kept for this run alone: mock sensors are calibrated once in it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        yield


@pytest.fixture(scope="session")
def force_bench() -> Iterator["ForceBench"]:
    """The process in which mocks of force sensors live, one at a time."""
    from mock_devices.testing.force import bench_process  # noqa: PLC0415 - loads numpy

    with bench_process() as bench:
        yield bench


@pytest.fixture
def bota(force_bench: "ForceBench") -> Iterator["ServedMock"]:
    """A mock of the Bota SensONE, just powered, on a pseudo-terminal."""
    with force_bench.serve("bota") as served:
        yield served


@pytest.fixture
def robotiq(force_bench: "ForceBench") -> Iterator["ServedMock"]:
    """A mock of the Robotiq FT 300, just powered, on a pseudo-terminal."""
    with force_bench.serve("robotiq") as served:
        yield served
