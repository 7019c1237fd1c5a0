"""Waiting at a port: what had come when the time was over counts, however late this process looks."""

from types import SimpleNamespace

import pytest

from drivers import ports
from drivers.ports import open_port, read_until
from rig.errors import DeviceError
from tests.drivers.scripted_port import ScriptedPort


def test_what_came_while_this_process_was_paused_is_no_silence(monkeypatch: pytest.MonkeyPatch) -> None:
    port = ScriptedPort()
    port.push(b"early")
    clock_s = iter((100.0, 200.0))
    monkeypatch.setattr(ports, "time", SimpleNamespace(monotonic=lambda: next(clock_s)))
    assert read_until(port, lambda data: data == b"early", 1.0) == b"early"
    port.close()


def test_waiting_ends_with_what_there_is() -> None:
    port = ScriptedPort()
    port.push(b"half")
    assert read_until(port, lambda data: data == b"half and half", 0.01) == b"half"
    port.close()


@pytest.mark.parametrize("address", ["tcp://host:\u00b2", "udp://host:\u00b2"])
def test_a_digit_that_is_no_number_is_no_port(address: str) -> None:
    with pytest.raises(DeviceError, match=r"not a (TCP|UDP) address"):
        open_port(address, 0)
