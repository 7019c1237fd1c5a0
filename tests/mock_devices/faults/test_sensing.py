"""Faults inside sensor, camera, drive and limb; every figure expected is a closed form of the bench's parameters."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from mock_devices.bench import Bench
from mock_devices.faults.sensing import CAMERA_FAULTS, SENSOR_FAULTS
from mock_devices.faults.wires import Fault, Value, faults_of
from mock_devices.parameters import Parameters
from rig.errors import UsageError
from tests.mock_devices.playing import MS_NS, QUIET, SURFACE_MM, quiet_bench, settle

DEPTH_MM = 8.0
LOAD_N = 0.12 * DEPTH_MM * math.exp(0.22 * DEPTH_MM)
"""The index law with the bench's default a and b."""
CROSSTALK = 0.004
ZERO = np.array([*QUIET.zero_N, *QUIET.zero_N_m])


@pytest.fixture
def pressed() -> Bench:
    """A bench whose tip rests at 8 mm."""
    bench = quiet_bench()
    settle(bench, SURFACE_MM + DEPTH_MM, 3.0)
    return bench


def inject(bench: Bench, kind: str, value: Value | None = None) -> None:
    faults: dict[str, Fault] = faults_of(bench.force, SENSOR_FAULTS) | faults_of(bench.tracker, CAMERA_FAULTS)
    faults[kind].apply(faults[kind].default if value is None else value)


def loads(bench: Bench) -> NDArray[np.float64]:
    read: NDArray[np.float64] = np.array(bench.force.wrench()) - ZERO
    return read


def test_a_turned_polarity_turns_every_channel_but_not_the_zero(pressed: Bench) -> None:
    before = loads(pressed)
    inject(pressed, "polarity")
    assert before[2] == pytest.approx(-LOAD_N, abs=1e-3)
    assert loads(pressed) == pytest.approx(-before)
    inject(pressed, "polarity", False)
    assert loads(pressed) == pytest.approx(before)


@pytest.mark.parametrize("gain", [0.5, 2.0])
def test_a_wrong_gain_scales_every_channel(pressed: Bench, gain: float) -> None:
    before = loads(pressed)
    inject(pressed, "gain", gain)
    assert loads(pressed) == pytest.approx(gain * before)


def test_a_dead_channel_answers_no_load_and_keeps_its_zero_and_noise() -> None:
    bench = Bench(Parameters())
    settle(bench, SURFACE_MM + DEPTH_MM, 3.0)
    inject(bench, "dead")
    readings = np.array([bench.force.wrench() for _ in range(500)]) - ZERO
    assert readings[:, 2].mean() == pytest.approx(0.0, abs=0.002)
    assert readings[:, 2].std() == pytest.approx(0.005, rel=0.2)
    assert readings[:, 0].mean() == pytest.approx(-CROSSTALK * LOAD_N, abs=0.005)


def test_crossed_channels_come_out_one_place_further(pressed: Bench) -> None:
    inject(pressed, "crossed")
    assert loads(pressed)[:3] == pytest.approx([-LOAD_N, -CROSSTALK * LOAD_N, -CROSSTALK * LOAD_N], abs=1e-3)


def test_a_drifting_zero_runs_from_the_moment_of_the_fault(pressed: Bench) -> None:
    inject(pressed, "drift", 0.5)
    assert loads(pressed)[2] == pytest.approx(-LOAD_N, abs=1e-3)
    pressed.advance(pressed.now_ns + 2000 * MS_NS)
    assert loads(pressed)[2] == pytest.approx(-LOAD_N - 0.5 * 2.0, abs=2e-3)
    inject(pressed, "drift", 0)
    assert loads(pressed)[2] == pytest.approx(-LOAD_N, abs=1e-3)


def test_a_saturated_sensor_ends_there_and_says_so(pressed: Bench) -> None:
    inject(pressed, "saturate", 2.0)
    assert pressed.force.wrench()[2] == -2.0
    assert pressed.force.overrange()
    inject(pressed, "saturate", 50.0)
    assert not pressed.force.overrange()


def test_a_load_beside_the_axis_is_a_moment(pressed: Bench) -> None:
    inject(pressed, "lever", 50.0)
    assert loads(pressed)[3] == pytest.approx(-LOAD_N * 0.050, rel=1e-3)
    assert loads(pressed)[2] == pytest.approx(-LOAD_N, abs=1e-3)


@pytest.mark.parametrize(("kind", "value"), [("polarity", 1.0), ("gain", True), ("dead", 6), ("saturate", 0.0)])
def test_a_value_that_means_nothing_is_refused(kind: str, value: Value) -> None:
    with pytest.raises(UsageError, match="this fault"):
        inject(quiet_bench(), kind, value)


@pytest.mark.parametrize(("kind", "tip_mm", "arm_mm"), [("tip_slips", 9, 0), ("arm_slips", 0, 9), ("pushed", 9, 9)])
def test_markers_slip_and_the_camera_is_pushed(kind: str, tip_mm: float, arm_mm: float) -> None:
    bench = quiet_bench(tracker={"noise_mm": 0.0, "noise_deg": 0.0})
    before = bench.tracker.markers(bench.now_ns)
    inject(bench, kind, 9.0)
    after = bench.tracker.markers(bench.now_ns)
    for was, seen, slipped_mm in zip(before, after, (tip_mm, arm_mm), strict=True):
        assert was is not None
        assert seen is not None
        assert np.array(seen[:3]) - was[:3] == pytest.approx([slipped_mm, 0.0, 0.0])


def test_an_inclusion_adds_a_straight_line_from_its_depth_on(pressed: Bench) -> None:
    pressed.tissue.inclusion_mm, pressed.tissue.inclusion_N_mm = 7.5, 20.0
    assert pressed.tissue.included_N(7.4) == 0.0
    pressed.advance(pressed.now_ns + MS_NS)
    assert pressed.contact_N == pytest.approx(LOAD_N + 20.0 * 0.5, abs=0.02)


def test_a_limb_can_be_told_how_fast_to_move() -> None:
    bench = quiet_bench()
    bench.limb.wanted_mm, bench.limb.speed_limit_mm_s = 10.0, 5.0
    bench.advance(bench.now_ns + 1000 * MS_NS)
    assert bench.limb.position_mm == pytest.approx(SURFACE_MM - 5.0, abs=0.01)
