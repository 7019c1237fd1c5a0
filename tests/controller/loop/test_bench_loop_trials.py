"""Whole programs through the loop on a clock of its own, at both sensors' rates; expected values are the spring's."""

import pytest

from controller.loop.modes import Mode
from controller.loop.steps import Compress
from drivers.roles import LinkCounters
from tests.controller.fake_bench import APPROACH, LEAVE, PRESS, ZERO, FakeBench, wired
from tests.controller.fake_devices import SURFACE_MM, ZERO_N

RATES_HZ = pytest.mark.parametrize("sensor_Hz", [1000.0, 100.0])


@RATES_HZ
def test_a_trial_finds_the_surface_presses_by_the_springs_law_and_leaves(sensor_Hz: float) -> None:
    bench = FakeBench(wired(sensor_Hz))
    finished = bench.run(ZERO, APPROACH, PRESS, LEAVE)
    # Extrapolated back to where force began: no better known than the samples of the approach lie apart.
    apart_mm = max(APPROACH.speed_mm_s / sensor_Hz, 0.01)
    assert (finished["outcome"], finished["cause"]) == ("complete", "")
    assert finished["zero_N"] == pytest.approx(ZERO_N, abs=0.001)
    assert finished["surface_mm"] == pytest.approx(SURFACE_MM, abs=apart_mm)
    assert finished["touch"]["low_mm"] < SURFACE_MM < finished["touch"]["high_mm"]
    pressed_mm = finished["surface_mm"] - SURFACE_MM + PRESS.depth_mm
    assert finished["peak_force_N"] == pytest.approx(bench.force.stiffness_N_mm * pressed_mm, abs=0.12)
    bench.wait(0.05)  # ten lags of the axis
    assert bench.axis.position_mm == pytest.approx(finished["surface_mm"] - LEAVE.clearance_mm, abs=0.001)
    assert list(dict.fromkeys(row.mode for row in bench.ring.loop)) == [
        Mode.IDLE, Mode.FREE, Mode.APPROACH, Mode.COMPRESS, Mode.RETRACT
    ]  # fmt: skip


@RATES_HZ
def test_the_force_limit_of_a_step_ends_it_within_one_sample_and_one_lag(sensor_Hz: float) -> None:
    bench = FakeBench(wired(sensor_Hz))
    finished = bench.run(ZERO, APPROACH, Compress(depth_mm=5.0, speed_mm_s=20.0, force_limit_N=2.0), LEAVE)
    assert finished["outcome"] == "force limit"
    # 1 N/mm at 20 mm/s gives 20 N/s for one sample period; then the axis catches up with its lag of 4.7 ms.
    assert 2.0 < bench.true_peak_N < 2.0 + 20.0 * (1 / sensor_Hz + 0.0047 + 0.003)


def test_force_that_arrives_long_after_the_axis_of_its_time_gives_the_same_surface() -> None:
    bench = FakeBench(wired(100.0))
    bench.force.latency_ns = 20_000_000
    finished = bench.run(ZERO, APPROACH, LEAVE)
    assert finished["surface_mm"] == pytest.approx(SURFACE_MM, abs=0.06)
    # Ten millimetres at 5 mm/s and 100 Hz, but for the half millimetre in which the guide may slip.
    assert finished["touch"]["samples"] == pytest.approx(190, abs=5)


def test_touches_stay_within_the_workspace_of_the_wiring() -> None:
    """A limb near the end of the workspace: a touch begins a millimetre above it, or where the workspace does."""
    bench = FakeBench(wired(100.0, limits={"position_min_mm": 9.9}))
    bench.force.surface_mm = bench.axis.position_mm + 0.7
    finished = bench.run(ZERO, APPROACH.model_copy(update={"touches": 2, "within_mm": 1e-6}))
    assert (finished["outcome"], finished["touch"]["touches"]) == ("complete", 2)
    assert finished["surface_mm"] == pytest.approx(bench.force.surface_mm, abs=0.02)
    approaching = [row.command_mm for row in bench.ring.loop if row.mode == Mode.APPROACH]
    assert min(approaching) == pytest.approx(9.9)


def test_an_outcome_says_what_each_wire_brought_besides_messages_while_it_ran() -> None:
    bench = FakeBench()
    bench.force.counters = LinkCounters(frames=100, checksum_errors=7, discarded_bytes=30)
    bench.begin(ZERO)
    bench.force.counters.frames += 50
    bench.force.counters.checksum_errors += 2
    bench.force.counters.discarded_bytes += 3
    bench.until(lambda: bool(bench.link.of("finished")))
    finished = bench.link.of("finished")[-1]
    assert finished["wire_damage"] == {"force": 0.1, "axis": 0.0, "tracker": 0.0}
