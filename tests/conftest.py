"""What all tests share: how every property is searched, how much linear algebra may take, and a process of mocks.

How long an example of a property takes says nothing on a machine that others use too, and a failure is worth most where
it can be had again; ``pytest --hypothesis-profile=default`` looks for new examples, and more of them.
"""

import contextlib
import gc
import os
import secrets
import signal
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, settings

from tests.long import LongTests, listed
from tests.witness import Witness, watched

if TYPE_CHECKING:
    from mock_devices.testing.force import ForceBench, ServedMock

# One thread for each worker, and for all that it starts: more wait for one another, and take three times the time.
# It is read when numpy is loaded, which is later than this.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# A shell that starts the tests in the background has Ctrl-C ignored by all that they start, also where it is to end it.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Drawn before any worker starts, and inherited by all: sessions that nobody has seen are hidden in each run.
NEW_SEED = os.environ.setdefault("TISSUE_RIG_SEED", str(10_000 + secrets.randbelow(10**8)))

# One file for all workers of a run.
STALLS = Path(os.environ.setdefault("TISSUE_RIG_STALLS", str(Path(tempfile.gettempdir()) / f"stalls-{os.getpid()}")))

# The same half of the library's hundred in each run; `make campaigns` draws a hundred new ones.
EXAMPLES = 50
settings.register_profile(
    "shared machine",
    deadline=None,
    derandomize=True,
    max_examples=EXAMPLES,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("shared machine")


# Markers of a few files: whoever asks for one of them need not load all the others, which takes ten seconds a worker.
RARE = {"bench", "campaign", "extra", "by_hand"}


def pytest_addoption(parser: pytest.Parser) -> None:
    """Which quarter of what is selected runs."""
    parser.addoption(
        "--draw", type=int, metavar="SEED", help="run a quarter of the selected tests, another with each seed"
    )


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leaves out a file in which, and in whose folder's conftest, a rare marker that is asked for does not stand."""
    marker = config.getoption("markexpr").partition(" ")[0]
    if marker not in RARE or not collection_path.name.startswith("test_"):
        return None
    sources = [collection_path, collection_path.with_name("conftest.py")]
    return None if any(f"mark.{marker}" in file.read_text() for file in sources if file.exists()) else True


# Groups that take longest, in that order: two workers end together where neither begins a long one last.
LONGEST = ("conformance", "bench", "wire", "commands", "clients", "recovery", "postgresql", "cluster", "lsl")


def _place(item: pytest.Item) -> int:
    group = item.get_closest_marker("xdist_group")
    return LONGEST.index(group.args[0]) if group and group.args[0] in LONGEST else len(LONGEST)


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Long groups come first where whole groups are dealt out to workers."""
    if config.getoption("markexpr").partition(" ")[0] in RARE:
        items.sort(key=_place)


def pytest_configure(config: pytest.Config) -> None:
    """Whoever hands tests on to workers does not know yet whether there are tests of the bench among them."""
    config.pluginmanager.register(Witness(STALLS))
    config.pluginmanager.register(LongTests(listed()))
    if config.getoption("numprocesses", None):
        _watch(config)


def pytest_collection_finish(session: pytest.Session) -> None:
    """Whoever runs tests without workers has witnesses for those of the bench; other tests need none."""
    gc.freeze()  # what is loaded stays to the end: looking through it again and again finds nothing
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
