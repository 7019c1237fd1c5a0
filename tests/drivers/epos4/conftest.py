"""The servo axis against the mock drive in one process, started and homed."""

from collections.abc import Iterator

import pytest

from drivers.epos4.device import Epos4Axis
from mock_devices.testing.epos4 import DriveBench
from tests.drivers.epos4.sessions import axis_on


@pytest.fixture
def bench() -> DriveBench:
    return DriveBench()


@pytest.fixture
def axis(bench: DriveBench) -> Iterator[Epos4Axis]:
    axis = axis_on(bench)
    axis.start()
    yield axis
    axis.close()


@pytest.fixture
def homed(axis: Epos4Axis) -> Epos4Axis:
    axis.home()
    return axis
