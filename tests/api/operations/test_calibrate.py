"""A calibration that is cancelled: no further load is asked for, no further move is made, and the bench is free."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from types import SimpleNamespace

import pytest

from api.operations import calibrate
from api.operations.calibrate import AxisStart, AxisTravel, GaugeBlock, force_calibration_operation
from controller.commissioning.axis_moves import RestingAxis
from controller.commissioning.readings import Reading
from controller.commissioning.weights import Weights
from controller.operation import Cancelled, Operation
from drivers.roles import Identity
from rig.config.wiring import Wiring
from rig.errors import CheckFailed, UsageError

WEIGHTS = Weights((1.0, 2.0), uncertainty=0.0)


class FakeSensor:
    identity = Identity("BFT", "000271", "1")
    load_N = 0.0
    closed = False

    def start(self) -> None:
        """Is ready."""

    def put(self, load_N: float) -> None:
        self.load_N = load_N

    def close(self) -> None:
        self.closed = True


@pytest.fixture
def sensor(monkeypatch: pytest.MonkeyPatch) -> FakeSensor:
    """One that is exact: -1 N a newton of compression along z, as the default wiring says."""
    found = FakeSensor()

    def read(*_: object) -> Reading:
        return Reading((0.0, 0.0, -found.load_N, 0.0, 0.0, 0.0), (0.001,) * 6, 1000)

    monkeypatch.setattr(calibrate, "open_force", lambda _: found)
    monkeypatch.setattr(calibrate, "read", read)
    monkeypatch.setattr(calibrate, "claimed", lambda *_, **__: nullcontext())
    return found


def test_a_force_calibration_tells_each_load(sensor: FakeSensor) -> None:
    operation, told = force_calibration_operation(WEIGHTS), list[tuple[float, str]]()
    operation.watch = lambda now: told.append((now.done, now.message))
    found = calibrate.calibrate_force(operation, Wiring(), WEIGHTS, sensor.put)
    assert found.serial == "000271" and found.compression == "negative"
    assert told == [(0, "0 N"), (1, "1 N"), (2, "2 N"), (3, "1 N"), (4, "0 N")]
    assert operation.progress.total == 5 and sensor.closed


def test_one_that_is_cancelled_asks_for_no_further_load(sensor: FakeSensor) -> None:
    operation, loads = force_calibration_operation(WEIGHTS), list[float]()

    def put_on(load_N: float) -> None:
        loads.append(load_N)
        sensor.put(load_N)
        if load_N == 1.0:
            operation.cancel()

    with pytest.raises(Cancelled, match="calibrate force was cancelled before: 2 N"):
        calibrate.calibrate_force(operation, Wiring(), WEIGHTS, put_on)
    assert loads == [0.0, 1.0] and sensor.closed


class FakeAxis:
    identity = Identity("EPOS4", "A1", "1")

    def __init__(self) -> None:
        self.moves = list[float | str]()

    def home(self) -> None:
        self.moves.append("home")

    def move_to(self, position_mm: float, _speed_mm_s: float) -> None:
        self.moves.append(position_mm)


@contextmanager
def braked(_: object, __: object) -> Iterator[tuple[object, int]]:
    yield SimpleNamespace(moving=nullcontext, interrupted=lambda: False, refuse=lambda: None), 4711


@pytest.fixture
def axis(monkeypatch: pytest.MonkeyPatch) -> FakeAxis:
    found = FakeAxis()
    devices = SimpleNamespace(axis=found, close=lambda: found.moves.append("closed"))
    monkeypatch.setattr(calibrate, "claimed", lambda *_, **__: nullcontext())
    monkeypatch.setattr(calibrate, "stoppable", braked)
    monkeypatch.setattr(calibrate, "start_devices", lambda *_: devices)
    return found


def test_an_axis_calibration_that_is_cancelled_moves_no_further(
    axis: FakeAxis, monkeypatch: pytest.MonkeyPatch
) -> None:
    operation = Operation("calibrate axis")

    def place(resting: RestingAxis) -> None:
        resting.go(5.0)
        operation.cancel()
        resting.go(6.0)

    monkeypatch.setattr(calibrate, "drive_to_positions", lambda resting, _: place(resting))
    with pytest.raises(Cancelled, match="cancelled before: the next move"):
        calibrate.axis_by_tracker(operation, Wiring(), AxisTravel(2.0, 14.0), lambda: True)
    assert axis.moves == ["home", 5.0, "closed"]
    assert operation.progress.log == ("stop: Ctrl-C, the foot switch, or POST http://127.0.0.1:4711/estop",)


def test_the_block_is_laid_between_the_searches_for_table_and_block(
    axis: FakeAxis, monkeypatch: pytest.MonkeyPatch
) -> None:
    def touches(_: RestingAxis, near_mm: float) -> list[float]:
        axis.moves.append(f"search from {near_mm:g}")
        return [near_mm + 0.5] * 3

    monkeypatch.setattr(calibrate, "touches_mm", touches)
    monkeypatch.setattr(RestingAxis, "place", lambda _: None)
    monkeypatch.setattr(RestingAxis, "wait_for", lambda _, act: act())
    operation = Operation("calibrate axis")
    found = calibrate.axis_by_block(
        operation, Wiring(), 2.0, GaugeBlock(10.0, 30.0), lambda: axis.moves.append("the block is laid")
    )
    assert axis.moves == [
        "home", 2.0, "search from 30", 19.0, "the block is laid", "search from 20", "closed"
    ]  # fmt: skip
    assert found.scale == pytest.approx(1.0) and found.direction_known_by == "contact"
    assert operation.progress.done == 0.5


def test_nothing_moves_before_the_way_is_said_to_be_free(axis: FakeAxis) -> None:
    def refused() -> None:
        axis.moves.append("asked")
        raise Cancelled("cancelled before: see that the way is free")

    with pytest.raises(Cancelled, match="see that the way is free"):
        calibrate.axis_by_tracker(
            Operation("calibrate axis"), Wiring(), AxisTravel(2.0, 14.0), lambda: True, AxisStart(refused)
        )
    assert axis.moves == ["asked"]


def test_without_a_marker_on_the_limb_a_person_says_where_the_tip_went_while_the_drive_is_kept_alive(
    axis: FakeAxis, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(calibrate, "drive_to_positions", lambda *_: [])
    monkeypatch.setattr(calibrate, "ahead_mm", lambda _: None)
    monkeypatch.setattr(calibrate, "known_direction", lambda _: None)

    def waited(_: RestingAxis, act: Callable[[], bool]) -> bool:
        axis.moves.append("alive")
        return act()

    monkeypatch.setattr(RestingAxis, "wait_for", waited)
    with pytest.raises(CheckFailed, match=r"away from the limb .* turn axis.direction"):
        calibrate.axis_by_tracker(Operation("calibrate axis"), Wiring(), AxisTravel(2.0, 14.0), lambda: False)
    assert axis.moves == ["home", "alive", "closed"]


@pytest.mark.parametrize(("block", "end"), [(GaugeBlock(10.0, 8.0), "-3 mm"), (GaugeBlock(1.0, 57.0), "62 mm")])
def test_a_search_that_would_leave_the_workspace_is_refused(block: GaugeBlock, end: str) -> None:
    with pytest.raises(UsageError, match=f"the axis would go to {end}, outside 0 to 60 mm"):
        calibrate.refuse_block(block, Wiring())
