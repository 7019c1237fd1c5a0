"""A cycle at 2 kHz on a sensor of 1 kHz: two cycles a sample, in step with it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from mock_devices.testing.commands import Running, ServedBench, served_bench
from rig.recording.reader import read_recording

pytestmark = [pytest.mark.bench, pytest.mark.extra]

PROTOCOL = "speeds_mm_s = [10]\ntrials = 1\ndepth_mm = 8\n"
# Of the computer, which plays the devices too: `cyclictest` beside it misses as many.
MISSED_SHARE = 0.05
# Of the samples: the simulated sensor shares the cores and sends the others late, two at a time, of which one is used.
IN_TIME_SHARE = 0.75
# A busy computer may send more of them late once; a loop that looks at the line too rarely finds them late each time.
TRIES = 3

Column = NDArray[Any]


def captured(bench: ServedBench, folder: Path) -> Mapping[str, Column]:
    """What one capture at 2 kHz recorded."""
    folder.mkdir()
    (folder / "one.toml").write_text(PROTOCOL)
    settings = bench.settings("loop.rate_Hz=2000")
    ended = Running(["capture", folder / "one.toml", "--out", folder / "session", *settings], folder).end()
    assert ended.code in (0, 4), ended.err
    return read_recording(folder / "session" / "trial_001.mcap").tables


def period_ns(force: Column) -> float:
    """From one sample to the next by the sensor's own clock."""
    return float(np.diff(force["device_us"]).mean() * 1000)


def in_time(force: Column) -> Column:
    """Which samples came less than a quarter of their period later than half of them."""
    delay_ns = force["arrival_ns"] - force["capture_ns"]
    return np.asarray(delay_ns < np.median(delay_ns) + period_ns(force) / 4)


@pytest.mark.timeout(300)
def test_two_cycles_go_with_each_sample_of_a_sensor_at_half_the_rate(tmp_path: Path) -> None:
    with served_bench("--seed", "3") as bench:
        for number in range(TRIES):
            tables = captured(bench, tmp_path / str(number))
            if in_time(tables["force"]).mean() > IN_TIME_SHARE:
                break
    loop, force = tables["loop"], tables["force"]
    due = loop[np.diff(loop["cycle"], prepend=loop["cycle"][0]) == 1]["scheduled_ns"]
    assert np.median(np.diff(due)) == pytest.approx(period_ns(force) / 2, rel=0.001)
    assert loop["missed"][-1] - loop["missed"][0] < MISSED_SHARE * loop.size
    unused = ~np.isin(force["capture_ns"], loop["capture_ns"] - loop["force_age_ns"])
    assert in_time(force).mean() > IN_TIME_SHARE
    assert (unused & in_time(force)).sum() < 0.01 * force.size
