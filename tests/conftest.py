"""What all tests share: how every property is searched, how much linear algebra may take, and a process of mocks.

How long an example of a property takes says nothing on a machine that others use too, and a failure is worth most where
it can be had again; ``pytest --hypothesis-profile=default`` looks for new examples.
"""

import os
from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, settings

if TYPE_CHECKING:
    from mock_devices.testing.force import ForceBench, ServedMock

# One thread for each worker, and for all that it starts: more wait for one another, and take three times the time.
# It is read when numpy is loaded, which is later than this.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

settings.register_profile(
    "shared machine", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("shared machine")


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
