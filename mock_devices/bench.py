"""The simulated bench: one motor, one limb, one sensor place and one camera behind all mocks.

It knows no wires and no clock: ``advance`` integrates in fixed steps up to a time it is given, so that it runs in real
time behind the mocks and as fast as it can in a test, and gives the same figures for the same calls and seed.
"""

from collections.abc import Mapping

import numpy as np

from mock_devices.parameters import Parameters
from mock_devices.physics import STEP_NS, STEP_S
from mock_devices.physics.camera import CameraPlant
from mock_devices.physics.chain import Chain, HiddenEffect
from mock_devices.physics.drive_plant import DrivePlant
from mock_devices.physics.effects import Hidden, build, complete
from mock_devices.physics.sensor import ForcePlant
from mock_devices.physics.tissue import Limb, TissueLaw


class Bench:
    """All physics; ``axis``, ``force``, ``force_modbus`` and ``tracker`` are the plants the mocks are given.

    ``weight_N`` presses on the tip along the axis besides the tissue, as a person would put it there.
    """

    def __init__(self, parameters: Parameters, seed: int = 0, start_ns: int = 0) -> None:
        self.parameters = parameters
        self.axis = DrivePlant(parameters.axis)
        self.limb = Limb(parameters.surface)
        self.tissue = TissueLaw(parameters.tissue)
        tip_mm = parameters.axis.start_mm
        randoms = [np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(3)]
        self.force = ForcePlant(parameters.force, randoms[0])
        self.force_modbus = ForcePlant(parameters.force_modbus, randoms[1])
        self.tracker = CameraPlant(parameters.tracker, randoms[2], start_ns, tip_mm, self.limb.position_mm)
        self.tip_mm, self.tip_speed_mm_s, self.contact_N = tip_mm, 0.0, 0.0
        self.weight_N = 0.0
        self.hidden: Hidden = {}
        self._operators: dict[str, HiddenEffect] = {}
        self._chain = Chain()
        self._start_ns = start_ns
        self._steps = 0
        self._load_N = 0.0
        self.hide(parameters.hide)

    @property
    def time_s(self) -> float:
        """Time simulated."""
        return self._steps * STEP_S

    @property
    def now_ns(self) -> int:
        """Time up to which physics is known."""
        return self._start_ns + self._steps * STEP_NS

    def hide(self, wanted: Mapping[str, Mapping[str, float]]) -> None:
        """Switches on exactly the effects ``wanted``; one that is on with the same parameters keeps its state."""
        hidden = complete(wanted)
        self._operators = {
            effect: self._operators[effect] if self.hidden.get(effect) == values else build(effect, values)
            for effect, values in hidden.items()
        }
        self.hidden = hidden
        self._chain = Chain.of(self._operators.values())
        self.tracker.extra_delay_s = self._chain.camera_delay_s

    def advance(self, now_ns: int) -> None:
        """Integrates up to ``now_ns``; the plants then show their last step, extrapolated by less than one."""
        lag_ns = now_ns - self.now_ns
        while lag_ns >= STEP_NS:
            self._step()
            lag_ns -= STEP_NS
        lag_s = max(lag_ns, 0) * 1e-9
        self.axis.publish(lag_s)
        self.force.publish(self._chain, self.time_s, lag_s)
        self.force_modbus.publish(self._chain, self.time_s, lag_s)

    def skip(self, gap_ns: int) -> None:
        """Lets ``gap_ns`` pass without physics, after the process was stopped for long."""
        self._start_ns += gap_ns
        self.tracker.start_ns = self._start_ns

    def _step(self) -> None:
        chain = self._chain
        self._steps += 1
        time_s = self._steps * STEP_S
        tip_mm, speed_mm_s = self.axis.step(self._load_N)
        if chain.kinematics:
            for kinematic in chain.kinematics:
                tip_mm = kinematic(tip_mm, self.contact_N)
            speed_mm_s = (tip_mm - self.tip_mm) / STEP_S
        limb = self.limb
        surface_mm = limb.step(chain, time_s, self.contact_N > 0)
        contact_N = self.tissue.force_N(chain, tip_mm - surface_mm, speed_mm_s - limb.speed_mm_s, time_s)
        load_N = contact_N + self.weight_N
        for guide in chain.guide:
            load_N += guide(tip_mm - self.tip_mm, (speed_mm_s - self.tip_speed_mm_s) / STEP_S)
        self.tip_mm, self.tip_speed_mm_s, self.contact_N, self._load_N = tip_mm, speed_mm_s, contact_N, load_N
        for sensing in chain.sensing:
            load_N = sensing(load_N)
        self.force.step(load_N)
        self.force_modbus.step(load_N)
        self.tracker.step(tip_mm, surface_mm)
