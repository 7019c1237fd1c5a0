"""Clients of others, unchanged, against the example plug-in's simulated Net F/T: `pynetft` and `NetFT`."""

import importlib
import itertools
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

import NetFT
import pynetft
import pytest

from mock_devices.testing.commands import ROOT, until
from mock_devices.testing.force import WRENCH, StillPlant
from mock_devices.testing.played import played

pytestmark = [pytest.mark.bench, pytest.mark.xdist_group("clients")]
POUND_N = 4.4482216152605
INTERNAL_HZ = 7000
PATIENCE_S = 10.0
ENOUGH = 200
COUNTS = [round(1e6 * value) for value in WRENCH]


@pytest.fixture
def plugin(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """The mock's module, of a distribution that need not be installed."""
    monkeypatch.syspath_prepend(ROOT / "examples/plugin-netft/src")
    yield importlib.import_module("rig_netft.mock")
    for name in [name for name in sys.modules if name.startswith("rig_netft")]:
        del sys.modules[name]


@pytest.fixture
def mock(plugin: Any) -> Iterator[Any]:
    made = plugin.NetFtMock(*plugin._ports(), StillPlant(), time.monotonic_ns(), 27_462)
    with played(made):
        yield made


def port_of(mock: Any) -> int:
    return int(mock.endpoints()["udp"].rpartition(":")[2])


def client_of(mock: Any, **more: Any) -> pynetft.Client:
    port = port_of(mock)
    return pynetft.Client(pynetft.Config(sensor_host="127.0.0.1", rdt_port=port, http_port=port, **more))


def taken(client: pynetft.Client, count: int = ENOUGH) -> list[pynetft.Sample]:
    return list(itertools.islice(client.samples(timeout=PATIENCE_S), count))


def follows_the_stream(mock: Any) -> None:
    """Its own health sees no record that repeats, runs back or is cut, and the sensor's clock at 7 kHz."""
    with client_of(mock) as client:
        samples, health = taken(client), client.health()
    assert {sample.force for sample in samples} == {WRENCH[:3]} and {sample.torque for sample in samples} == {
        WRENCH[3:]
    }
    assert {sample.force_unit for sample in samples} == {pynetft.ForceUnit.NEWTON}
    assert health.sensor_configuration and health.sensor_configuration.product_name == "Net F/T"
    troubles = (health.duplicate_count, health.out_of_order_count, health.malformed_count, health.ft_backward_count)
    assert (troubles, health.ft_stall_count, health.device_error_count) == ((0, 0, 0, 0), 0, 0)
    first, last = samples[0], samples[-1]
    ticks = (last.ft_sequence - first.ft_sequence) / (last.rdt_sequence - first.rdt_sequence)
    assert ticks == INTERNAL_HZ / 1000
    took_s = (last.received_at_ns - first.received_at_ns) * 1e-9
    assert (last.ft_sequence - first.ft_sequence) / took_s == pytest.approx(INTERNAL_HZ, rel=0.2)


def counts_in_pounds_when_told(mock: Any) -> None:
    mock.pounds = True
    with client_of(mock) as client:
        (sample,) = taken(client, 1)
    assert sample.force_unit is pynetft.ForceUnit.POUND_FORCE
    assert [POUND_N * value for value in sample.force] == pytest.approx(WRENCH[:3], abs=1e-5)


def is_zeroed(mock: Any) -> None:
    with client_of(mock) as client:
        assert taken(client, 1)[0].wrench == WRENCH
        client.bias()
        until(lambda: taken(client, 1)[0].wrench == (0.0,) * 6, PATIENCE_S, "the zero")


def marks_bad_records(mock: Any) -> None:
    mock.invalid = True
    with client_of(mock, deliver_samples_with_error_status=True) as client:
        until(lambda: client.health().device_error_count > 0, PATIENCE_S, "an error in the status")


SESSIONS = (follows_the_stream, counts_in_pounds_when_told, is_zeroed, marks_bad_records)


@pytest.mark.parametrize("session", SESSIONS, ids=lambda session: session.__name__)
def test_pynetft_and_the_sensor(session: Callable[[Any], None], mock: Any) -> None:
    session(mock)


def test_netft_takes_records_one_by_one_and_as_a_stream(mock: Any) -> None:
    sensor = NetFT.Sensor("127.0.0.1")
    sensor.sock.connect(("127.0.0.1", port_of(mock)))  # its own port is a number of the maker's, which may be taken
    sensor.sock.settimeout(PATIENCE_S)
    try:
        assert sensor.getMeasurement() == COUNTS
        assert sensor.tare(10) == pytest.approx(COUNTS) and sensor.getForce() == pytest.approx([0.0] * 3)
        sensor.zero()
        sensor.startStreaming(handler=False)
        assert [sensor.receive() for _ in range(ENOUGH)] == [COUNTS] * ENOUGH
        sensor.stopStreaming()
        sensor.sock.settimeout(0.2)
        with pytest.raises(TimeoutError):
            for _ in range(10 * ENOUGH):
                sensor.receive()
    finally:
        sensor.sock.close()


def counts_in_thousandths(patch: pytest.MonkeyPatch, plugin: Any) -> None:
    """Of what its page says."""
    measured = plugin.NetFtMock._measured
    patch.setattr(plugin.NetFtMock, "_measured", lambda mock: tuple(value // 1000 for value in measured(mock)))


def runs_at_another_clock(patch: pytest.MonkeyPatch, plugin: Any) -> None:
    patch.setattr(plugin, "INTERNAL_HZ", 8000)


def repeats_its_number(patch: pytest.MonkeyPatch, plugin: Any) -> None:
    def record(mock: Any, tick: int) -> bytes:
        mock._counts = mock._measured()
        return bytes(plugin.RECORD.pack(1, tick, 0, *mock._counts))

    patch.setattr(plugin.NetFtMock, "_record", record)


def does_not_know_the_zero(patch: pytest.MonkeyPatch, plugin: Any) -> None:
    patch.setattr(plugin, "BIAS", 0x43)


def says_newton_for_pounds(patch: pytest.MonkeyPatch, plugin: Any) -> None:
    page = plugin.NetFtMock._page
    patch.setattr(plugin.NetFtMock, "_page", lambda mock: page(mock).replace("lbf", "N"))


PLANTED = (
    (counts_in_thousandths, follows_the_stream),
    (runs_at_another_clock, follows_the_stream),
    (repeats_its_number, follows_the_stream),
    (does_not_know_the_zero, is_zeroed),
    (says_newton_for_pounds, counts_in_pounds_when_told),
)


@pytest.mark.parametrize(("plant", "session"), PLANTED, ids=lambda either: either.__name__)
def test_a_mistake_of_the_sensor_is_noticed(
    plant: Callable[[pytest.MonkeyPatch, Any], None], session: Callable[[Any], None], plugin: Any,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    plant(monkeypatch, plugin)
    monkeypatch.setitem(globals(), "PATIENCE_S", 1.0)
    made = plugin.NetFtMock(*plugin._ports(), StillPlant(), time.monotonic_ns(), 27_462)
    with pytest.raises((AssertionError, TimeoutError, pynetft.NetFTError, pytest.fail.Exception)), played(made):
        session(made)
