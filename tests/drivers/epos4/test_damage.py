"""One damaged line of the adapter while the axis starts, wherever it falls: asked for again, and nobody is blamed."""

import pytest

from drivers.epos4.device import Epos4Axis
from drivers.epos4.node import TRIES
from mock_devices.testing.epos4 import DriveBench
from rig.errors import DeviceError
from tests.drivers.epos4.sessions import axis_on

COMMAND_DIGIT, INDEX_DIGIT, VALUE_DIGIT = 16, 12, 8


def started(bench: DriveBench) -> Epos4Axis:
    axis = axis_on(bench)
    axis.start()
    return axis


@pytest.fixture(scope="module")
def answers() -> int:
    bench = DriveBench()
    started(bench)
    return bench.answers


@pytest.mark.parametrize(
    ("digit", "becomes"), [(1, b"G"), (COMMAND_DIGIT, b"2"), (INDEX_DIGIT, b"F"), (VALUE_DIGIT, b"7")]
)
def test_any_one_damaged_answer_is_asked_for_again(answers: int, digit: int, becomes: bytes) -> None:
    """A line that is none, an answer to nothing, another object's, and one that is right but for its value."""
    assert answers > 90
    for number in range(1, answers + 1):
        bench = DriveBench()
        bench.spoil, bench.digit, bench.becomes = {number}, digit, becomes
        axis = started(bench)
        axis.home()
        assert not axis.fault
        axis.close()


def test_an_answer_that_never_comes_right_is_told_after_three_tries(answers: int) -> None:
    bench = DriveBench()
    bench.spoil = set(range(answers // 2, answers // 2 + TRIES))
    with pytest.raises(DeviceError, match=r"does not answer: .* took longer than 1 s, tries: 3; check its power"):
        started(bench)


def test_a_drive_left_enabled_is_made_safe_although_an_answer_to_its_controlword_is_lost() -> None:
    """The order is not repeated: the state says what became of it."""
    for lost in range(1, 40):
        bench = DriveBench()
        first = started(bench)
        first.home()
        first.enable()
        bench.spoil = {bench.answers + lost}
        second = started(bench)
        assert not bench.plant.powered
        second.close()
