"""A perfect axis over a linear spring, on an injected clock: what state machine and safety table are tried on."""

import random
from collections.abc import Callable
from dataclasses import dataclass, field

from controller.force_watch import NO_WRENCH, ForceWatch
from controller.machine import Machine
from controller.modes import Mode
from controller.motion import Setpoint
from controller.safety import TABLE, Action, Check, Incident
from controller.steps import Approach, Compress, Program, Retract, Step, Zero
from controller.watch import Watch
from controller.world import World
from rig.config.wiring import Subject, Wiring

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
    watch: Watch = field(default_factory=Watch)
    ended: list[tuple[str, Incident | None]] = field(default_factory=list)
    modes: list[Mode] = field(default_factory=list)
    forces_N: list[float] = field(default_factory=list)
    positions_mm: list[float] = field(default_factory=list)
    every: int = 1
    noise_N: float = 0.0
    rubbing_N: float = 0.0
    noise: random.Random = field(default_factory=lambda: random.Random(1))
    count: int = -1

    def __post_init__(self) -> None:
        self.world = World(position_mm=self.position_mm)
        self.machine = Machine(
            self.wiring, self.world, lambda outcome, cause: self.ended.append((outcome, cause)), self.table
        )
        self.force_watch = ForceWatch(self.every * 1_000_000)
        self.sense()

    def tissue_N(self, moved_mm: float) -> float:
        """What presses on the tip that has ``moved_mm`` since the tick before."""
        return self.stiffness_N_mm * max(0.0, self.position_mm - SURFACE_MM)

    def converted_N(self, force_N: float) -> float:
        """What the sensor makes of a force."""
        return force_N + self.noise.gauss(0.0, self.noise_N)

    def sense(self) -> None:
        """What the bench shows of where the axis stands now."""
        force_N = self.tissue_N(self.position_mm - self.world.position_mm)
        if self.position_mm > self.world.position_mm:
            force_N += self.rubbing_N
        self.world.position_mm = self.position_mm
        self.force_watch.axis(self.world.now_ns, self.position_mm)
        self.count += 1
        if self.count % self.every == 0:
            self.world.force_samples += 1
            self.world.raw_N = self.converted_N(force_N + ZERO_N)
            self.world.wrench = (0.0, 0.0, -self.world.raw_N, 0.0, 0.0, 0.0)
            self.force_watch.force(self.world.now_ns, self.world.wrench)
            self.world.paired.force(self.world.now_ns, self.world.raw_N)
        self.world.paired.axis(self.world.now_ns, self.position_mm)
        self.world.force_N = self.world.raw_N - self.world.zero_N
        going = self.world.setpoint if self.machine.busy else Setpoint(self.position_mm, 0.0)
        self.world.load = self.force_watch.load(
            self.world.now_ns, self.world.reference_zero or NO_WRENCH, self.world.noise_N, going,
            self.world.acceleration_mm_s2,
        )  # fmt: skip

    def tick(self) -> Incident | None:
        """One turn of the machine; the axis is where it is told to be at once."""
        self.sense()
        incident = self.machine.update(self.watch)
        self.watch.requests = frozenset()
        if not (incident and incident.action is Action.IMMEDIATE) and self.machine.mode is not Mode.SAFE:
            self.position_mm = self.world.setpoint.position_mm
        self.world.now_ns += 1_000_000
        self.modes.append(self.machine.mode)
        self.forces_N.append(self.world.force_N)
        self.positions_mm.append(self.position_mm)
        return incident

    def run(self, *steps: Step, until: Callable[[], bool] | None = None, ticks: int = 30_000) -> None:
        """Ticks until the program is over, or ``until``."""
        if steps:
            self.machine.start(Program(name="test", steps=steps))
        for _ in range(ticks):
            self.tick()
            if until() if until else not self.machine.busy:
                return
        raise AssertionError(f"still {self.machine.mode.name} after {ticks} ticks")
