"""The maker's own library, zaber-motion, unchanged, against the simulated axis; native units, no unit database."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from zaber_motion import Units
from zaber_motion.ascii import Axis, Connection
from zaber_motion.exceptions import BadCommandException, BadDataException, MovementFailedException

from drivers.zaber.device import open_axis
from mock_devices.bench import Bench
from mock_devices.parameters import Parameters
from mock_devices.testing.played import played
from mock_devices.wire import TcpWire, Wire
from mock_devices.zaber.mock import ZaberMock
from rig.config.products.zaber_ascii import ZaberWiring
from rig.config.wiring import Limits

pytestmark = [pytest.mark.bench, pytest.mark.xdist_group("clients")]
NATIVE = Units.NATIVE


@contextmanager
def simulated(wire: Wire) -> Iterator[tuple[ZaberMock, Bench]]:
    bench = Bench(Parameters(), start_ns=time.monotonic_ns())
    mock = ZaberMock(wire, bench.axis, bench.now_ns)
    with played(mock, bench.advance):
        yield mock, bench


@contextmanager
def makers_axis(wire: TcpWire) -> Iterator[Axis]:
    host, port = wire.endpoint.split(":")
    with Connection.open_tcp(host, int(port)) as connection:
        yield connection.get_device(1).get_axis(1)


def test_zaber_motion_homes_moves_and_reads_its_place() -> None:
    with simulated(wire := TcpWire()) as (_, bench), makers_axis(wire) as axis:
        assert not axis.is_homed()
        axis.home()
        assert axis.is_homed() and axis.warnings.get_flags() == set()
        axis.move_absolute(8000, NATIVE, velocity=30 * 2000 * 1.6384, velocity_unit=NATIVE)
        assert bench.axis.position_mm == pytest.approx(4.0, abs=0.05)
        axis.move_relative(-2000)
        assert axis.get_position() == pytest.approx(6000, abs=60)
        axis.move_max(velocity=50 * 2000 * 1.6384, wait_until_idle=False)
        time.sleep(0.1)
        axis.stop()
        assert not axis.is_busy() and 3.0 < bench.axis.position_mm < 60.0


def test_zaber_motion_understands_settings_flags_and_refusals() -> None:
    with simulated(wire := TcpWire()) as (mock, _), makers_axis(wire) as axis:
        axis.settings.set("limit.max", 100_000)
        assert axis.settings.get("limit.max") == 100_000
        axis.home()
        with pytest.raises(BadDataException):
            axis.move_absolute(100_001)
        with pytest.raises(BadCommandException):
            axis.generic_command("dance")
        mock.raise_flag("FS")
        assert "FS" in axis.warnings.get_flags()
        with pytest.raises(BadCommandException):
            axis.move_absolute(10)
        axis.warnings.clear_flags()
        axis.driver_disable()
        assert "FO" in axis.warnings.get_flags()
        axis.driver_enable()
        axis.move_absolute(2000)


def test_zaber_motion_is_told_of_a_stall_on_the_way() -> None:
    with simulated(wire := TcpWire()) as (mock, _), makers_axis(wire) as axis:
        axis.home()
        axis.move_absolute(100_000, NATIVE, False, 20 * 2000 * 1.6384, NATIVE)
        mock.raise_flag("FS")
        with pytest.raises(MovementFailedException):
            axis.wait_until_idle()


def test_zaber_motion_finds_it_on_its_line_and_our_driver_follows() -> None:
    """Checksums that our driver switched on stay on, and the maker's library reads them."""
    wire = TcpWire()
    with simulated(wire):
        ours = open_axis(ZaberWiring(port=f"tcp://{wire.endpoint}"), Limits())
        ours.start()
        ours.home()
        ours.move_to(5.0, 30.0)
        ours.close()
        with Connection.open_tcp(*_split(wire)) as connection:
            (device,) = connection.detect_devices(identify_devices=False)
            assert device.get_axis(1).get_position() == pytest.approx(10_000, abs=60)


def _split(wire: TcpWire) -> tuple[str, int]:
    host, port = wire.endpoint.split(":")
    return host, int(port)
