"""Every test here starts real processes. One worker runs those in which something goes wrong at a certain moment, one
after another; whole commands from start to end (`commands`) may run beside them on another."""

from collections.abc import Iterator

import pytest

from mock_devices.testing.commands import Running, ServedBench, served_bench


@pytest.hookimpl(tryfirst=True)  # before the tests are dealt out to workers by group
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if "tests/system" in item.nodeid:
            item.add_marker(pytest.mark.bench)
            if item.get_closest_marker("xdist_group") is None:
                item.add_marker(pytest.mark.xdist_group("bench"))


@pytest.fixture(autouse=True)
def nothing_left_running() -> Iterator[None]:
    """A failed test leaves no command behind that would disturb the next."""
    yield
    while Running.started:
        Running.started.pop().kill()


@pytest.fixture
def bench() -> Iterator[ServedBench]:
    """A fresh mock bench."""
    with served_bench("--seed", "1") as served:
        yield served
