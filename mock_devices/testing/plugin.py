"""Fixtures of the pytest plug-in `tissue-rig`, for the tests of a laboratory's own drivers and analyses.

`mock_bench` is the whole simulated bench, products of installed plug-ins included, in a process of its own; after each
test its faults are healed and what was hidden in it is gone. `service` is `rig serve` on it. What they start takes a
second; nothing is imported before a test asks for it.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from mock_devices.testing.hand import MockBench
    from mock_devices.testing.service import ServedRig


@pytest.fixture(scope="session")
def mock_bench_process(tmp_path_factory: pytest.TempPathFactory) -> Iterator["MockBench"]:
    """The bench of all tests of a run; what it keeps by itself is kept for that run alone."""
    from mock_devices.testing.hand import serving  # noqa: PLC0415 - loads numpy

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        with serving(tmp_path_factory.mktemp("links")) as bench:
            yield bench


@pytest.fixture
def mock_bench(mock_bench_process: "MockBench") -> Iterator["MockBench"]:
    """The simulated bench, with faults and hidden effects by name, as good as new for each test."""
    yield mock_bench_process
    mock_bench_process.mend()


@pytest.fixture
def service(mock_bench: "MockBench", tmp_path: Path, request: pytest.FixtureRequest) -> Iterator["ServedRig"]:
    """`rig serve` on the simulated bench; ``@pytest.mark.rig_set("force.product=...")`` sets keys of its wiring."""
    from mock_devices.testing.service import ServedRig  # noqa: PLC0415 - loads the HTTP service

    marker = request.node.get_closest_marker("rig_set")
    settings = mock_bench.settings(*(marker.args if marker else ()))
    served = ServedRig(mock_bench.served, tmp_path, ["--sessions", tmp_path / "sessions", *settings])
    yield served
    served.running.interrupt()
    served.running.end()


def pytest_configure(config: pytest.Config) -> None:
    """Tells pytest of the marker."""
    config.addinivalue_line("markers", "rig_set(*settings): keys of the wiring of the fixture `service`")
