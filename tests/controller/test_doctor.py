"""What the doctor says of a device: noise of the channel that is used, and where to look at one that is not heard."""

import contextlib
from collections.abc import Iterator
from dataclasses import replace
from typing import cast

import numpy as np
import pytest

from api.cli.hardware import _row
from controller import doctor
from drivers.roles import Device, Identity, LinkCounters
from rig.channels import ForceSample
from rig.config.products.bota_sensone import BotaWiring
from rig.config.products.maxon_epos4 import Epos4Wiring
from rig.config.wiring import Loop, Wiring

WHO = Identity("bota-sensone", "000271", "1.0.6")


def samples(noise_N: tuple[float, float, float]) -> list[ForceSample]:
    """A thousand at 1 kHz, white noise of that rms on each force channel."""
    white = np.random.default_rng(1).normal(0.0, noise_N, (1000, 3))
    return [
        ForceSample(k, k * 1_000_000, k * 1_000_000, 0, fx_N, fy_N, fz_N, 0.0, 0.0, 0.0, 25.0, 0, 1)
        for k, (fx_N, fy_N, fz_N) in enumerate(white.tolist())
    ]


@pytest.mark.parametrize("channel", [0, 1, 2])
def test_noise_is_that_of_the_channel_along_the_tip(channel: int) -> None:
    noise_N = (0.1, 0.2, 0.4)
    said = doctor._finding("force", WHO, 1000.0, samples(noise_N), channel)
    assert float(said.noise.split()[0]) == pytest.approx(noise_N[channel], rel=0.1)
    assert said.problem == ""


@pytest.mark.parametrize("of", [2, 3, 10])
def test_samples_of_one_time_are_said_to_be_so_and_not_to_be_few(of: int) -> None:
    """In bunches that are dated by their arrival, or by a clock of 2, 3 or 10 ms."""
    bunched = [one._replace(capture_ns=one.seq // of * of * 1_000_000) for one in samples((0.1, 0.1, 0.1))]
    said = doctor._finding("force", WHO, 1000.0, bunched, 0)
    assert "date samples by their numbers (rig.timing.ClockMap), not by arrival" in said.problem


class Slow:
    """A sensor of 1 kHz; every second sample is lost in the first looks at it."""

    identity, period_ns = WHO, 1_000_000

    def __init__(self, slow_looks: int) -> None:
        self.slow_looks, self.looks, self.closed = slow_looks, 0, 0
        self.counters = LinkCounters()

    def start(self) -> None:
        assert self.looks == 0

    def close(self) -> None:
        self.closed += 1

    def listen(self, device: object) -> list[ForceSample]:
        assert device is self
        self.looks += 1
        return samples((0.1, 0.1, 0.1))[:: 2 if self.looks <= self.slow_looks else 1]


@pytest.mark.parametrize(("slow_looks", "looks", "problem"), [(0, 1, ""), (2, 3, ""), (9, 3, "rate 500.0 Hz is not")])
def test_a_wrong_rate_is_said_where_it_was_wrong_each_time(slow_looks: int, looks: int, problem: str) -> None:
    device = Slow(slow_looks)
    said = doctor._look("force", BotaWiring(), lambda: cast(Device, device), device.listen)
    assert said.problem.startswith(problem) and bool(said.problem) == bool(problem)
    assert (device.looks, device.closed) == (looks, 1)


def test_trouble_of_the_link_is_a_problem_though_the_rate_is_right() -> None:
    device = Slow(0)
    device.counters.trouble = "the CAN bus is loaded to 93%: take nodes or messages off it"
    said = doctor._look("force", BotaWiring(), lambda: cast(Device, device), device.listen)
    assert said.problem == device.counters.trouble


class OnOne(Slow):
    """A device on a bus."""

    bus = "CAN 1000 kbit/s, load 31%"


def test_the_bus_of_a_device_is_told_though_nothing_is_wrong_with_it() -> None:
    for device, told in ((OnOne(0), OnOne.bus), (Slow(0), "")):
        said = doctor._look("axis", BotaWiring(), lambda device=device: cast(Device, device), device.listen)  # type: ignore[misc]
        assert (said.bus, said.problem) == (told, "")


def test_the_scale_that_a_drive_says_of_itself_is_told() -> None:
    device, scale = Slow(0), "1000 units a mm by its unit of position (object 60A8)"
    device.identity = replace(WHO, settings={"scale": scale})
    said = doctor._look("axis", BotaWiring(), lambda: cast(Device, device), device.listen)
    assert said.settings == {"scale": scale}
    assert _row(said)[1] == f"bota-sensone, serial 000271, firmware 1.0.6; {scale}"


def test_a_device_that_is_not_there_comes_with_where_to_look() -> None:
    wiring = Wiring(force=BotaWiring(port="/dev/no-sensor"), axis=Epos4Wiring(port="/dev/no-adapter"), tracker=None)
    force, axis = doctor.examine(wiring, 0.0)
    assert "/dev/no-sensor" in force.problem and force.advice == BotaWiring.advice
    assert "/dev/no-adapter" in axis.problem and axis.advice == Epos4Wiring.advice


def test_devices_are_listened_to_at_the_loops_priority(monkeypatch: pytest.MonkeyPatch) -> None:
    asked, looked_at = list[int](), list[int]()

    @contextlib.contextmanager
    def promptly(priority: int) -> Iterator[None]:
        asked.append(priority)
        yield
        asked.clear()

    monkeypatch.setattr(doctor, "promptly", promptly)
    monkeypatch.setattr(doctor, "_examined", lambda *_: looked_at.extend(asked))
    doctor.examine(Wiring(loop=Loop(priority=37)), 0.0)
    assert looked_at == [37]
