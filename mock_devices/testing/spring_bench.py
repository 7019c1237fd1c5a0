"""A perfect axis over a linear spring, on an injected clock: what state machine and safety table are tried on."""

import random
from collections.abc import Callable
from dataclasses import dataclass, field

from controller.loop.modes import Mode
from controller.loop.setpoint import Setpoint
from controller.loop.state import LoopState
from controller.loop.state_machine import MotionStateMachine
from controller.loop.steps import Approach, Compress, Program, Retract, Step, Zero
from controller.safety.inputs import SafetyInputs
from controller.safety.load import NO_WRENCH, LoadMonitor
from controller.safety.table import TABLE, Action, Check, Incident
from rig.config.subject import Subject
from rig.config.wiring import Wiring

SURFACE_MM = 20.0
STIFFNESS_N_MM = 1.0
ZERO_N = 0.8
WIRING = Wiring(subject=Subject(pain_threshold_N=10.0))

ZERO = Zero(duration_s=0.05)
APPROACH = Approach(speed_mm_s=5.0, contact_force_N=0.05, search_to_mm=40.0)
PRESS = Compress(depth_mm=5.0, speed_mm_s=20.0, force_limit_N=9.0)
LEAVE = Retract(clearance_mm=5.0, speed_mm_s=10.0)


@dataclass
class SpringBench:
    """A perfect axis over a linear spring; ``stiffness`` and ``watch`` may be changed while it runs."""

    wiring: Wiring = WIRING
    table: tuple[Check, ...] = TABLE
    stiffness_N_mm: float = STIFFNESS_N_MM
    position_mm: float = 15.0
    inputs: SafetyInputs = field(default_factory=SafetyInputs)
    ended: list[tuple[str, Incident | None]] = field(default_factory=list)
    modes: list[Mode] = field(default_factory=list)
    forces_N: list[float] = field(default_factory=list)
    positions_mm: list[float] = field(default_factory=list)
    every: int = 1
    noise_N: float = 0.0
    friction_N: float = 0.0
    noise: random.Random = field(default_factory=lambda: random.Random(1))
    count: int = -1

    def __post_init__(self) -> None:
        self.state = LoopState(position_mm=self.position_mm, round_tip=self.wiring.tip.round)
        self.machine = MotionStateMachine(
            self.wiring, self.state, lambda outcome, cause: self.ended.append((outcome, cause)), self.table
        )
        self.load_monitor = LoadMonitor(self.every * 1_000_000)
        self.sense()

    def tissue_N(self, moved_mm: float) -> float:
        """What presses on the tip that has ``moved_mm`` since the cycle before."""
        return self.stiffness_N_mm * max(0.0, self.position_mm - SURFACE_MM)

    def converted_N(self, force_N: float) -> float:
        """What the sensor makes of a force."""
        return force_N + self.noise.gauss(0.0, self.noise_N)

    def sense(self) -> None:
        """What the bench shows of where the axis stands now."""
        force_N = self.tissue_N(self.position_mm - self.state.position_mm)
        if self.position_mm > self.state.position_mm:
            force_N += self.friction_N
        self.state.position_mm = self.position_mm
        self.load_monitor.axis(self.state.now_ns, self.position_mm)
        self.count += 1
        if self.count % self.every == 0:
            self.state.force_samples += 1
            self.state.raw_N = self.converted_N(force_N + ZERO_N)
            self.state.wrench = (0.0, 0.0, -self.state.raw_N, 0.0, 0.0, 0.0)
            self.load_monitor.force(self.state.now_ns, self.state.wrench)
            self.state.paired.force(self.state.now_ns, self.state.raw_N)
        self.state.paired.axis(self.state.now_ns, self.position_mm)
        self.state.force_N = self.state.raw_N - self.state.zero_N
        going = self.state.setpoint if self.machine.busy else Setpoint(self.position_mm, 0.0)
        self.state.load = self.load_monitor.load(
            self.state.now_ns, self.state.reference_zero or NO_WRENCH, self.state.noise_N, going,
            self.state.acceleration_mm_s2,
        )  # fmt: skip

    def run_cycle(self) -> Incident | None:
        """One turn of the machine; the axis is where it is told to be at once."""
        self.sense()
        incident = self.machine.update(self.inputs)
        self.inputs.requests = frozenset()
        if not (incident and incident.action is Action.IMMEDIATE) and self.machine.mode is not Mode.SAFE:
            self.position_mm = self.state.setpoint.position_mm
        self.state.now_ns += 1_000_000
        self.modes.append(self.machine.mode)
        self.forces_N.append(self.state.force_N)
        self.positions_mm.append(self.position_mm)
        return incident

    def run(self, *steps: Step, until: Callable[[], bool] | None = None, cycles: int = 30_000) -> None:
        """Ticks until the program is over, or ``until``."""
        if steps:
            self.machine.start(Program(name="test", steps=steps))
        for _ in range(cycles):
            self.run_cycle()
            if until() if until else not self.machine.busy:
                return
        raise AssertionError(f"still {self.machine.mode.name} after {cycles} cycles")
