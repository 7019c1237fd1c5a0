"""A captured trial as a reader gives it, with every stream, in which faults are planted by changing its tables."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mock_devices.testing.made.synthetic import START_NS, Bench, metadata, tables
from rig.channels import MARKER
from rig.config.quality import QualityLimits
from rig.config.wiring import Wiring
from rig.recording.reader import Recording
from rig.trials.measures import CHANNELS

FREE, COMPRESS, RETRACT = 1, 3, 5
PRESS_STEP, HOLD_STEP, LAST_STEP = 3, 4, 6
DIRECTION = np.array([0.12, 0.25, -0.9608])
TIP_MM, CAMERA_NOISE_MM, CAMERA_HZ = np.array([35.0, -60.0, -1400.0]), 0.06, 60.0
Tables = dict[str, NDArray[np.void]]
Plant = Callable[[Tables], None]


def trial(
    plant: Plant = lambda _: None, bench: Bench | None = None, speed_mm_s: float = 10.0, **said: str
) -> Recording:
    """A good trial of 8 mm, then ``plant`` works on its tables; ``said`` goes into the summary."""
    bench = bench or Bench()
    cycle = bench.cycle(speed_mm_s, seed=7)
    made = tables(cycle)
    random = np.random.default_rng(3)
    for name in CHANNELS:
        if name != "fz_N":
            made["force"][name] = np.round(random.normal(0.2, 0.005, len(made["force"])), 3)
    _steps(made, cycle.position_mm)
    made["marker"] = _marker(made["axis"], random)
    plant(made)
    return Recording(Path("trial_001.mcap"), _said(metadata(cycle), bench, said), made, (), True, ())


def _said(about: dict[str, dict[str, str]], bench: Bench, said: dict[str, str]) -> dict[str, dict[str, str]]:
    wiring = {name: json.dumps(value) for name, value in Wiring().model_dump(mode="json").items()}
    contact = {"surface_mm": bench.surface_mm, "low_mm": bench.surface_mm - 0.02, "high_mm": bench.surface_mm + 0.03}
    summary = {"outcome": "complete", "cause": "", "contact": json.dumps(contact), "dropped": "{}"}
    protocol = {"quality": json.dumps(QualityLimits().model_dump(mode="json"))}
    return about | {"wiring": wiring, "summary": summary | said, "protocol": protocol}


def _steps(made: Tables, position_mm: NDArray[np.float64]) -> None:
    """Modes and steps as the machine gives them, from where the tip is."""
    loop, deep = made["loop"], np.flatnonzero(position_mm > position_mm.max() - 0.01)
    lifted = np.flatnonzero(position_mm[: deep[0]] < position_mm[deep[0]] - 9.99)
    leaving = position_mm[deep[-1] :] > position_mm[-1] + 0.001
    loop["step"], loop["mode"] = 1, FREE
    loop["step"][: np.argmax(position_mm > position_mm[0] + 0.001)] = 0
    loop["step"][lifted[-1] : deep[0]], loop["mode"][lifted[-1] : deep[-1]] = PRESS_STEP, COMPRESS
    loop["step"][deep[0] : deep[-1]] = HOLD_STEP
    loop["step"][deep[-1] :], loop["mode"][deep[-1] :] = LAST_STEP - 1, RETRACT
    rest = deep[-1] + int(np.count_nonzero(leaving))
    loop["step"][rest:], loop["mode"][rest:] = LAST_STEP, COMPRESS


def _marker(axis: NDArray[np.void], random: np.random.Generator) -> NDArray[np.void]:
    taken_ns = np.arange(START_NS, axis["capture_ns"][-1], round(1e9 / CAMERA_HZ))
    rows = np.zeros(len(taken_ns), MARKER.dtype)
    rows["seq"] = rows["frame"] = np.arange(len(rows))
    rows["capture_ns"], rows["arrival_ns"], rows["valid"] = taken_ns, taken_ns + 15_000_000, 1
    way_mm = np.interp(taken_ns - START_NS, axis["capture_ns"] - START_NS, axis["position_mm"])
    place_mm = TIP_MM + way_mm[:, None] * DIRECTION / np.linalg.norm(DIRECTION)
    place_mm = place_mm + random.normal(0, CAMERA_NOISE_MM, place_mm.shape)
    rows["x_mm"], rows["y_mm"], rows["z_mm"] = place_mm.T
    return rows


def incomplete(made: Recording) -> Recording:
    """The same, never finished by its recorder."""
    return replace(made, complete=False, metadata={k: v for k, v in made.metadata.items() if k != "summary"})
