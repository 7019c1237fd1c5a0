"""The marker tracker's camera: tool tip rides on the true tip, tool arm on the limb's surface, both seen late."""

import math

import numpy as np

from mock_devices.interfaces import MarkerPose
from mock_devices.parameters import Camera, Vector
from mock_devices.physics import STEP_NS, STEP_S
from mock_devices.physics.channels import Slips, moved
from mock_devices.physics.sensor import normals

HISTORY = 8192  # steps: 2 s, twice the 0.5 s of latency and 0.4 s of hidden delay that a camera may have
HALF_DEGREE_RAD = math.radians(0.5)


class CameraPlant:
    """TrackerPlant of the bench; remembers two seconds, so that it can show what was."""

    def __init__(self, camera: Camera, rng: np.random.Generator, start_ns: int, tip_mm: float, arm_mm: float) -> None:
        self.tip_in_view = camera.tip_in_view
        self.arm_in_view = camera.arm_in_view
        self.extra_delay_s = 0.0
        self.slips = Slips()
        self.start_ns = start_ns
        self._camera = camera
        self._direction = _unit(camera.direction)
        self._noise = normals(rng, 7)
        self._tips = [tip_mm] * HISTORY
        self._arms = [arm_mm] * HISTORY
        self._steps = 0

    def step(self, tip_mm: float, arm_mm: float) -> None:
        """Remembers one more step."""
        self._steps += 1
        at = self._steps % HISTORY
        self._tips[at] = tip_mm
        self._arms[at] = arm_mm

    def markers(self, now_ns: int) -> list[MarkerPose | None]:
        """Tools tip and arm as they were one latency ago."""
        age_s = self._camera.latency_s + self.extra_delay_s
        steps = (now_ns - self.start_ns) / STEP_NS - age_s / STEP_S
        tip = self._pose(moved(self._camera.tip_origin_mm, self.slips.tip_mm), self._past(self._tips, steps))
        arm = self._pose(moved(self._camera.arm_origin_mm, self.slips.arm_mm), self._past(self._arms, steps))
        return [tip if self.tip_in_view else None, arm if self.arm_in_view else None]

    def _past(self, history: list[float], steps: float) -> float:
        """The value at a fractional step, within what is remembered."""
        oldest = max(self._steps - HISTORY + 2, 0)
        steps = min(max(steps, oldest), self._steps)
        at = int(steps)
        before, after = history[at % HISTORY], history[min(at + 1, self._steps) % HISTORY]
        return before + (after - before) * (steps - at)

    def _pose(self, origin_mm: Vector, along_mm: float) -> MarkerPose:
        nx, ny, nz, ax, ay, az, error = next(self._noise)
        place, noise = self._camera, self._camera.noise_mm
        half = place.noise_deg * HALF_DEGREE_RAD
        x, y, z = self._direction
        return MarkerPose(
            origin_mm[0] + along_mm * x + noise * nx,
            origin_mm[1] + along_mm * y + noise * ny,
            origin_mm[2] + along_mm * z + noise * nz,
            *_turn(half * ax, half * ay, half * az),
            abs(place.error_mm * (1 + 0.2 * error)),
        )


def _unit(vector: Vector) -> Vector:
    x, y, z = vector
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


def _turn(x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Unit quaternion of a small rotation by twice (x, y, z) rad."""
    length = math.sqrt(1 + x * x + y * y + z * z)
    return 1 / length, x / length, y / length, z / length
