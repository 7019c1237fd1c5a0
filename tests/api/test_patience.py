"""Limits of time: strict with real devices, patient with simulated ones, as the file says where it says anything."""

from api.cli.mock_bench import patient
from api.cli.options import built_in
from rig.config.products.maxon_epos4 import Epos4Wiring

REAL = ["force.port=/dev/ttyUSB0", "axis.port=/dev/ttyACM0", "tracker.port=tcp://192.168.1.10:8765"]


def test_a_simulated_device_may_be_as_late_as_a_busy_computer_makes_it() -> None:
    wiring = patient(built_in())
    assert isinstance(wiring.axis, Epos4Wiring)
    assert (wiring.stale_force_ms, wiring.loop.stale_axis_ms, wiring.axis.heartbeat_ms) == (400.0, 400.0, 200)


def test_real_devices_keep_the_strict_defaults() -> None:
    assert patient(built_in(REAL)) == built_in(REAL)


def test_each_device_has_its_own_patience() -> None:
    wiring = patient(built_in(REAL[:1]))
    assert (wiring.stale_force_ms, wiring.loop.stale_axis_ms) == (4.0, 400.0)


def test_what_the_wiring_states_is_kept() -> None:
    wiring = patient(built_in(["axis.following_error_mm=1.5", "loop.missed_periods=3"]))
    assert (wiring.axis.following_error_mm, wiring.loop.missed_periods) == (1.5, 3)
    assert isinstance(wiring.axis, Epos4Wiring)
    assert wiring.axis.heartbeat_ms != Epos4Wiring().heartbeat_ms
