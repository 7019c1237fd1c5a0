"""Whether the sensor answers the first touch of a program as it was calibrated: that channel, that sign, no dead one.

A calibration says how the sensor was mounted and wired when it was made. From then on a plug may have been exchanged,
the sensor turned, a channel lost; what is then steered by says nothing of what the limb bears. So before the load is
1 N, most of it must be compression along the calibrated channel; and no moment comes without a force.
"""

import math

from controller.loop.state import LoopState
from controller.safety.load import Wrench
from rig.config.wiring import Wiring

# Twice the friction of the guide that an approach accepts as none, and ten times the noisier sensor's noise of a norm.
TOUCH_N = 1.0
# Cosine of 45 degrees: friction of 0.5 on a tip that slides leaves 0.9 along the axis.
SHARE_ALONG = 0.7
# A force this far beside the sensor's axis is no tip of this bench; a moment with less force is a channel that is dead.
LONGEST_LEVER_M = 0.05
# Times the rms of the norm in the air: by chance twice running once in a thousand days of 1 kHz.
MOMENT_NOISE = 3.0
# A tenth of a newton at 20 mm: below it a contact is not yet found.
LEAST_MOMENT_N_M = 0.002
# One sample is a disturbance, two are a load.
SAMPLES = 2
CHANNELS = ("fx", "fy", "fz")


class FirstTouch:
    """``update`` is called once a cycle of a program, ``begin`` before it."""

    def __init__(self, wiring: Wiring) -> None:
        self._channel, self._compression = wiring.force.axis, wiring.force.compression
        self.begin()

    def begin(self) -> None:
        """A new program: nothing was touched yet."""
        self._confirmed = False
        self._wrong = self._seen = 0

    def update(self, state: LoopState) -> str:
        """What is wrong with the touch, in a sentence; "" where nothing is, or nothing is touched yet."""
        if self._confirmed or state.zero is None or state.force_samples == self._seen:
            return ""
        self._seen = state.force_samples
        said = self._said(state.wrench, state.zero, state.force_N, state.noise_N_m)
        self._wrong = self._wrong + 1 if said else 0
        return said if self._wrong >= SAMPLES else ""

    def _said(self, wrench: Wrench, zero: Wrench, along_N: float, noise_N_m: float) -> str:
        load_N, moment_N_m = math.dist(wrench[:3], zero[:3]), math.dist(wrench[3:], zero[3:])
        if load_N >= TOUCH_N and along_N >= SHARE_ALONG * load_N:
            self._confirmed = True
            return ""
        if load_N >= TOUCH_N:
            return self._wrong_way(wrench, zero, along_N, load_N)
        least_N_m = max(LEAST_MOMENT_N_M, MOMENT_NOISE * noise_N_m)
        if moment_N_m >= least_N_m and along_N < moment_N_m / LONGEST_LEVER_M:
            return (
                f"the first touch gives a moment of {moment_N_m:.3f} N m but only {along_N:.2f} N along"
                f" {self._channel}: that channel seems dead; check sensor and cable, then `rig calibrate force`"
            )
        return ""

    def _wrong_way(self, wrench: Wrench, zero: Wrench, along_N: float, load_N: float) -> str:
        changes = {name: wrench[place] - zero[place] for place, name in enumerate(CHANNELS)}
        name = max(changes, key=lambda channel: abs(changes[channel]))
        calibrated = f"compression is {self._compression} on {self._channel}"
        why = "the sign is wrong" if name == self._channel and along_N < 0 else "another channel answers"
        return (
            f"the first touch gives {changes[name]:+.2f} N on {name} ({along_N:.2f} of {load_N:.2f} N along), where"
            f" {calibrated}: {why}; check how the sensor is mounted and wired, then `rig calibrate force`"
        )
