"""A cycle at 2 kHz on a sensor of 1 kHz: two cycles a sample, in step with it."""

from pathlib import Path

import numpy as np
import pytest

from mock_devices.testing.commands import Running, served_bench
from rig.recording.reader import read_recording

pytestmark = [pytest.mark.bench, pytest.mark.extra, pytest.mark.xdist_group("two_kilohertz")]

PROTOCOL = "speeds_mm_s = [10]\ntrials = 1\ndepth_mm = 8\n"
# Of the computer, which plays the devices too: `cyclictest` beside it misses as many.
MISSED_SHARE = 0.05


def test_two_cycles_go_with_each_sample_of_a_sensor_at_half_the_rate(tmp_path: Path) -> None:
    (tmp_path / "one.toml").write_text(PROTOCOL)
    with served_bench("--seed", "3") as bench:
        settings = bench.settings("loop.rate_Hz=2000")
        ended = Running(["capture", tmp_path / "one.toml", "--out", tmp_path / "session", *settings], tmp_path).end()
    assert ended.code in (0, 4), ended.err
    tables = read_recording(tmp_path / "session" / "trial_001.mcap").tables
    loop, force = tables["loop"], tables["force"]
    sample_ns = np.diff(force["device_us"]).mean() * 1000
    due = loop[np.diff(loop["cycle"], prepend=loop["cycle"][0]) == 1]["scheduled_ns"]
    assert np.median(np.diff(due)) == pytest.approx(sample_ns / 2, rel=0.001)
    assert loop["missed"][-1] - loop["missed"][0] < MISSED_SHARE * loop.size
    unused = ~np.isin(force["capture_ns"], loop["capture_ns"] - loop["force_age_ns"])
    delay_ns = force["arrival_ns"] - force["capture_ns"]
    # At least half, by the median. The simulated sensor shares the cores and sends the others late, two at a time, of
    # which the loop uses the newer one: how many those are says something of the computer alone.
    in_time = delay_ns < np.median(delay_ns) + sample_ns / 4
    assert (unused & in_time).sum() < 0.01 * force.size
