"""A played loop under the real routes of streams."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.api.streams.played import PlayedBench, PlayedService


@pytest.fixture
def service(tmp_path: Path) -> Iterator[PlayedService]:
    bench = PlayedBench(tmp_path)
    service = PlayedService()
    service.bench = bench
    with service.served():
        yield service
    bench.close()


@pytest.fixture
def bench(service: PlayedService) -> PlayedBench:
    assert service.bench
    return service.bench
