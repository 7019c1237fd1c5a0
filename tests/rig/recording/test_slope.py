"""The slope of the tip's marker against the axis: its value, its interval, and where there is none."""

from pathlib import Path

import numpy as np
import pytest

from rig.channels import AXIS, MARKER
from rig.recording.reader import Recording
from rig.recording.slope import Slope, tracker_slope

DIRECTION = np.array([0.12, 0.25, -0.9608]) / np.linalg.norm([0.12, 0.25, -0.9608])
START_NS = 10**12
FRAME_S = 1 / 60


def stroke_mm(time_s: np.ndarray) -> np.ndarray:
    """Rests, goes 12 mm in at 15 mm/s, rests, and comes back."""
    return np.asarray(np.interp(time_s, [0.0, 0.5, 1.3, 2.0, 2.8, 3.3], [5.0, 5.0, 17.0, 17.0, 5.0, 5.0]))


def recording(
    scale: float = 1.0, late_s: float = 0.0, noise_mm: float = 0.06, hidden: int = 0, seed: int = 1
) -> Recording:
    """Axis at 1 kHz and tip at 60 Hz, the tip ``scale`` times the axis and seen ``late_s`` later than it says."""
    time_s, frame_s = np.arange(0.0, 3.3, 0.001), np.arange(0.01, 3.29, FRAME_S)
    axis, marker = np.zeros(len(time_s), AXIS.dtype), np.zeros(2 * len(frame_s), MARKER.dtype)
    axis["capture_ns"], axis["valid"] = START_NS + (time_s * 1e9).astype(np.int64), 1
    axis["position_mm"], axis["velocity_mm_s"] = stroke_mm(time_s), np.gradient(stroke_mm(time_s), 0.001)
    tip = marker[: len(frame_s)]
    tip["capture_ns"], tip["valid"] = START_NS + (frame_s * 1e9).astype(np.int64), 1
    noise = np.random.default_rng(seed).normal(0.0, noise_mm, (len(frame_s), 3)) if noise_mm else 0.0
    places = np.outer(scale * stroke_mm(frame_s - late_s), DIRECTION) + noise
    tip["x_mm"], tip["y_mm"], tip["z_mm"] = places.T
    tip["valid"][:hidden] = 0
    marker[len(frame_s) :]["tool"] = 1  # a limb that moves on its own counts nothing
    marker[len(frame_s) :]["valid"], marker[len(frame_s) :]["z_mm"] = 1, 100.0 * np.sin(frame_s)
    marker[len(frame_s) :]["capture_ns"] = tip["capture_ns"]
    return Recording(Path("trial.mcap"), {}, {"axis": axis, "marker": marker}, (), True, ())


def slope(**changes: float) -> Slope:
    found = tracker_slope(recording(**changes))  # type: ignore[arg-type]
    assert found is not None
    return found


@pytest.mark.parametrize("scale", [0.5, 1.0, 1.02, 2.0])
def test_the_slope_is_millimetres_of_the_tip_for_each_of_the_axis(scale: float) -> None:
    found = slope(scale=scale, noise_mm=0.0)
    assert found.slope == pytest.approx(scale, rel=1e-9)
    assert found.direction == pytest.approx(tuple(DIRECTION), abs=1e-9)
    assert found.travel_mm == pytest.approx(12.0, abs=0.01)


def test_a_tracker_that_comes_late_does_not_bend_the_slope() -> None:
    # At 15 mm/s, 20 ms are 0.3 mm: 2.5 % of the way, were they not told from it.
    assert slope(late_s=0.02, noise_mm=0.0).slope == pytest.approx(1.0, abs=0.002)


def test_the_interval_holds_the_truth_nineteen_times_in_twenty() -> None:
    found = [slope(scale=1.01, seed=seed) for seed in range(200)]
    held = sum(one.low <= 1.01 <= one.high for one in found)
    assert 180 <= held <= 199  # binomial(200, 0.95): 99.9 % within 178 and 199
    assert np.std([one.slope for one in found]) == pytest.approx(np.mean([one.deviation for one in found]), rel=0.2)


def test_without_tip_or_travel_there_is_no_slope() -> None:
    assert tracker_slope(recording(hidden=1000)) is None
    assert tracker_slope(recording(hidden=185)) is None
    still = recording()
    still.tables["axis"]["position_mm"] = 5.0
    assert tracker_slope(still) is None
