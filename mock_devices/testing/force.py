"""A force mock at work in another process, on a pseudo-terminal."""

import multiprocessing
import select
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import Literal

from drivers.roles import ForceSensor
from mock_devices.bota.mock import BotaMock
from mock_devices.interfaces import NEVER_NS
from mock_devices.robotiq.mock import RobotiqMock
from mock_devices.wire import PtyWire
from rig.channels import ForceSample

Product = Literal["bota", "robotiq"]
Knobs = dict[str, bool | int | str]
WAIT_S = 20.0
WRENCH = (1.25, -2.5, -7.75, 0.125, -0.25, 0.5)


class StillPlant:
    """A load that changes only when the test changes it."""

    def __init__(self) -> None:
        self.temperature_C = 24.5
        self.load: tuple[float, float, float, float, float, float] = WRENCH
        self.over = False

    def wrench(self) -> tuple[float, float, float, float, float, float]:
        return self.load

    def overrange(self) -> bool:
        return self.over


class ServedMock:
    """The test's hand on the mock in the other process."""

    def __init__(self, endpoint: str, ask: Callable[[object], object]) -> None:
        self.endpoint = endpoint
        self._ask = ask

    def set(self, **knobs: bool | int | str) -> None:
        """Sets failure knobs of the mock and returns when they are in force."""
        self._ask(knobs)

    def load(self, *wrench: float) -> None:
        """Puts another load on the plant."""
        self._ask(wrench)

    def cut(self) -> None:
        """Cuts the cable."""
        self._ask("cut")


class ForceBench:
    """A process in which mocks live, one at a time and in real time."""

    def __init__(self, control: Connection) -> None:
        self._control = control

    @contextmanager
    def serve(self, product: Product) -> Iterator[ServedMock]:
        """A new mock, just powered, on a new pseudo-terminal, until the block ends."""
        yield ServedMock(str(self._ask(product)), self._ask)
        self._ask("cut")

    def _ask(self, what: object) -> object:
        self._control.send(what)
        assert self._control.poll(30), "the bench process does not answer"
        return self._control.recv()


def collect(sensor: ForceSensor, enough: Callable[[list[ForceSample]], bool]) -> list[ForceSample]:
    """Samples until there are enough; the deadline only ends a test that has failed."""
    samples: list[ForceSample] = []
    deadline = time.monotonic() + WAIT_S
    while not enough(samples):
        assert time.monotonic() < deadline, f"only {len(samples)} samples, {sensor.counters}"
        select.select([sensor.fileno()], [], [], 0.1)
        samples += sensor.poll(time.monotonic_ns())
    return samples


@contextmanager
def bench_process() -> Iterator[ForceBench]:
    """The process, until the block ends."""
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=_serve, args=(there,), daemon=True)
    process.start()
    there.close()
    try:
        yield ForceBench(here)
    finally:
        here.close()
        process.join(10)
        if process.is_alive():
            process.kill()
            process.join()
        process.close()


def _serve(control: Connection) -> None:
    plant = StillPlant()
    mock = _powered("bota", plant)
    while True:
        _wait(mock, control)
        try:
            order = control.recv() if control.poll() else None
        except EOFError:
            mock.close()
            return
        if order in ("bota", "robotiq"):
            mock.close()
            plant = StillPlant()
            mock = _powered(order, plant)
            control.send(mock.endpoints()["serial"])
        elif order is not None:
            _obey(mock, plant, order)
            control.send(None)
        if mock.filenos():
            mock.receive(time.monotonic_ns())
        if mock.due_ns <= time.monotonic_ns():
            mock.tick(mock.due_ns)


def _powered(product: Product, plant: StillPlant) -> BotaMock | RobotiqMock:
    make = BotaMock if product == "bota" else RobotiqMock
    return make(PtyWire(), plant, time.monotonic_ns())


def _wait(mock: BotaMock | RobotiqMock, control: Connection) -> None:
    due_s = None if mock.due_ns == NEVER_NS else max(mock.due_ns - time.monotonic_ns(), 0) / 1e9
    select.select([*mock.filenos(), control.fileno()], [], [], due_s)


def _obey(mock: BotaMock | RobotiqMock, plant: StillPlant, order: Knobs | tuple[float, ...] | str) -> None:
    if isinstance(order, dict):
        vars(mock).update(order)
    elif isinstance(order, tuple):
        fx, fy, fz, mx, my, mz = order
        plant.load = (fx, fy, fz, mx, my, mz)
    else:
        mock.close()
