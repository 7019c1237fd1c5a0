"""One input in its thread: opened, lost, named and opened again, its numbers going on; drivers of any kind of wrong."""

import asyncio
import itertools
import os
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from controller.devices import states
from controller.devices.guard import GuardedInput
from controller.devices.states import DeviceState
from controller.inputs.process import Publisher
from controller.inputs.runner import OPEN_NS, TURN_NS, InputRunner
from controller.inputs.states import INPUT_STATE, InputState
from drivers.roles import Identity, LinkCounters
from mock_devices.testing.clock import Clock
from rig.config.products.evdev_switch import EvdevSwitch
from rig.errors import DeviceError
from rig.input_streams import InputSample, input_stream
from rig.plugins import Plugin
from rig.recording.ring import RingReader, RingWriter

CONFIG = EvdevSwitch(port="/dev/pedal")
STREAM = input_stream(0, "pedal", CONFIG.channels)
WITHIN_S = 10.0


class PlantedInput:
    """A sample a poll, 100 times a second, until ``fails`` is raised; what is called is noted."""

    identity = Identity("planted", "", "")

    def __init__(self, fails: BaseException | None = None, period_ns: int = 10_000_000, silent: bool = False) -> None:
        self.counters, self.next_seq, self.period_ns = LinkCounters(), 0, period_ns
        self.fails, self.silent, self.worry = fails, silent, ""
        self.closed, self.back_ns = 0, 0  # each sample's time lies so far before the one before
        self.free, self.held = threading.Event(), threading.Event()
        self.free.set()
        self._readable, self._end = os.pipe()

    def start(self) -> None:
        self.wait()

    def wait(self) -> None:
        """Does not come back until it is set free."""
        if not self.free.is_set():
            self.held.set()
            self.free.wait(WITHIN_S)

    def fileno(self) -> int:
        return self._readable

    def poll(self, now_ns: int) -> list[InputSample]:
        self.wait()
        if self.fails:
            raise self.fails
        if self.silent:
            return []
        seq, self.next_seq = self.next_seq, self.next_seq + 1
        return [InputSample(seq, now_ns - seq * self.back_ns, now_ns, 0, 0, -1, (1.0, 48.0), 0, 1)]

    def concern(self) -> str:
        return self.worry

    def close(self) -> None:
        self.closed += 1
        for fd in (self._readable, self._end):
            os.close(fd)


class Kept:
    """Rows by their numbers."""

    def __init__(self) -> None:
        self.numbers: list[int] = []

    def put(self, stream_id: int, body: bytes) -> None:
        assert stream_id == STREAM.id
        self.numbers.append(int(STREAM.unpack(body)[0]))


Make = Callable[..., tuple[InputRunner, Kept]]


@pytest.fixture
def make(monkeypatch: pytest.MonkeyPatch) -> Iterator[Make]:
    monkeypatch.setattr("controller.inputs.runner.FIRST_WAIT_S", 0.02)
    monkeypatch.setattr("controller.inputs.runner.LISTEN_S", 0.005)
    runners: list[InputRunner] = []

    def made(*devices: Any, now: Callable[[], int] = time.monotonic_ns) -> tuple[InputRunner, Kept]:
        kept, opened = Kept(), iter(devices)

        def opens(_: object) -> Any:
            device = next(opened)
            if isinstance(device, BaseException):
                raise device
            return device

        runners.append(InputRunner(CONFIG, STREAM, kept.put, opens, now))
        runners[-1].begin()
        return runners[-1], kept

    yield made
    for runner in runners:
        runner.close()


def until(condition: Callable[[], bool]) -> None:
    end_s = time.monotonic() + WITHIN_S
    while not condition():
        assert time.monotonic() < end_s
        time.sleep(0.002)


def test_its_rows_come_and_it_is_ok(make: Make) -> None:
    device = PlantedInput()
    runner, kept = make(device)
    until(lambda: len(kept.numbers) > 5 and runner.status.state is DeviceState.OK)
    runner.close()
    assert device.closed == 1
    assert kept.numbers == list(range(len(kept.numbers)))


def test_one_that_is_lost_is_named_and_opened_again_with_numbers_that_go_on(make: Make) -> None:
    first, again = PlantedInput(), PlantedInput()
    runner, kept = make(first, DeviceError("/dev/pedal: still unplugged"), again)
    until(lambda: len(kept.numbers) > 3)
    first.fails = DeviceError("/dev/pedal: the switch is gone; plug it in again")
    until(lambda: runner.status.state is DeviceState.LOST)
    assert "pedal" in runner.status.detail
    before = len(kept.numbers)
    until(lambda: len(kept.numbers) > before + 3 and runner.status.state is DeviceState.OK)
    assert kept.numbers == list(range(len(kept.numbers)))
    assert (first.closed, runner.status.detail) == (1, "")


@pytest.mark.parametrize(
    "error", [ValueError("planted"), ZeroDivisionError(), SystemExit("no dongle"), asyncio.CancelledError()]
)
def test_a_driver_that_raises_something_else_is_named_and_harms_nothing(make: Make, error: BaseException) -> None:
    runner, _ = make(*(PlantedInput(fails=error) for _ in range(50)))
    until(lambda: runner.status.state is DeviceState.LOST)
    assert f"its driver failed: {type(error).__name__}" in runner.status.detail


def test_why_it_was_lost_stays_until_it_is_there_again(make: Make) -> None:
    silent = PlantedInput(silent=True)
    runner, _ = make(DeviceError("no board with Firmata answered"), silent)
    until(lambda: runner.status.state is DeviceState.LOST)
    time.sleep(0.1)
    assert runner.status.detail == "no board with Firmata answered"


def test_a_port_that_stays_open_and_says_nothing_is_opened_again(make: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(states, "CONNECTING_NS", 100_000_000)
    silent, sound = PlantedInput(silent=True), PlantedInput()
    runner, kept = make(silent, sound)
    until(lambda: silent.closed == 1)
    until(lambda: len(kept.numbers) > 0 and runner.status.state is DeviceState.OK)


def test_a_switch_that_nobody_presses_is_there(make: Make) -> None:
    runner, kept = make(PlantedInput(silent=True, period_ns=0))
    until(lambda: runner.status.state is DeviceState.OK)
    assert kept.numbers == []


def test_a_concern_makes_it_degraded_after_a_second(make: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(states, "DEGRADED_NS", 50_000_000)
    device = PlantedInput()
    device.worry = "no calibration of thumb"
    runner, _ = make(device)
    until(lambda: runner.status.state is DeviceState.DEGRADED)
    assert runner.status.detail == "no calibration of thumb"


def test_numbers_have_no_gap_over_many_losses(make: Make) -> None:
    devices = [PlantedInput() for _ in range(4)]
    runner, kept = make(*devices)
    for device in devices[:-1]:
        before = len(kept.numbers)
        until(lambda at=before: len(kept.numbers) > at + 2)  # type: ignore[misc]
        device.fails = DeviceError("gone")
    until(lambda: devices[-2].closed == 1 and runner.status.state is DeviceState.OK)
    steps = {after - before for before, after in itertools.pairwise(kept.numbers)}
    assert steps == {1}


def said_of(runner: InputRunner, folder: Path) -> tuple[str, str]:
    """What the process says of it to the loop: state and why."""
    ring = RingWriter.create(folder / f"{time.monotonic_ns()}.ring", 64)
    reader = RingReader.open(ring.path)
    Publisher(ring).say([runner], time.monotonic_ns())
    (slot,) = reader.drain(8)
    said = InputState(*INPUT_STATE.unpack(slot["body"][: slot["size"]].tobytes()))
    reader.close()
    ring.close()
    return said.state, said.detail


def test_one_whose_driver_does_not_come_back_is_lost_after_a_second_and_there_again_when_it_does(
    make: Make, tmp_path: Path
) -> None:
    """A stop that may be lost unnoticed would be none."""
    clock, device = Clock(), PlantedInput(period_ns=0)
    runner, _ = make(device, now=clock)
    until(lambda: runner.status.state is DeviceState.OK)
    device.free.clear()
    until(device.held.is_set)
    clock.now_ns += TURN_NS
    assert said_of(runner, tmp_path) == ("ok", "")
    clock.now_ns += 1
    assert said_of(runner, tmp_path) == ("lost", "its driver does not come back; look at the device, then start again")
    device.free.set()
    until(lambda: runner.status.state is DeviceState.OK)


def test_one_whose_start_never_ends_is_lost_after_the_longest_start(make: Make, tmp_path: Path) -> None:
    clock, device = Clock(), PlantedInput()
    device.free.clear()
    runner, _ = make(device, now=clock)
    until(device.held.is_set)
    clock.now_ns += OPEN_NS
    assert said_of(runner, tmp_path)[0] == "connecting"
    clock.now_ns += 1
    assert said_of(runner, tmp_path)[0] == "lost"
    device.free.set()


def test_why_it_was_lost_stays_while_it_is_opened_in_vain(make: Make) -> None:
    clock, again = Clock(), PlantedInput()
    again.free.clear()
    runner, _ = make(DeviceError("/dev/pedal: is unplugged"), again, now=clock)
    until(again.held.is_set)
    clock.now_ns += OPEN_NS + 1
    assert (runner.status.state, runner.status.detail) == (DeviceState.LOST, "/dev/pedal: is unplugged")
    again.free.set()


def test_a_plug_in_whose_times_run_back_is_lost_by_name(make: Make) -> None:
    plugin = Plugin("tissue_rig.input", "x", "acme-rig", "2.1", "acme-pedal")

    def backwards() -> GuardedInput:
        device = PlantedInput()
        device.back_ns = 1_000_000_000
        return GuardedInput(plugin, CONFIG, lambda: device)

    runner, _ = make(*(backwards() for _ in range(50)))
    until(lambda: runner.status.state is DeviceState.LOST)
    assert "acme-pedal, a plug-in of acme-rig 2.1: its times run back by " in runner.status.detail
