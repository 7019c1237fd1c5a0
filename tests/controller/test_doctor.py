"""What the doctor says of a device: noise of the channel that is used, and where to look at one that is not heard."""

import contextlib
from collections.abc import Iterator

import numpy as np
import pytest

from controller import doctor
from drivers.roles import Identity
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
