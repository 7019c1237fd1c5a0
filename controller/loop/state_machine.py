"""The state machine of one cycle: run the program's step, or be safe. Pure but for the state it owns.

IDLE -> (program) -> FREE / APPROACH / COMPRESS / CONTACT / RETRACT -> IDLE
any  -> (soft stop) -> RETRACT -> SAFE;   any -> (immediate stop) -> SAFE;   SAFE -> (reset) -> IDLE
"""

import math
from collections.abc import Callable

from controller.loop.carried import carried_by
from controller.loop.modes import AT_REST, Mode
from controller.loop.setpoint import Setpoint, arrived, toward
from controller.loop.state import LoopState
from controller.loop.steps import Program, Run, Step
from controller.safety.inputs import SafetyInputs
from controller.safety.table import TABLE, Action, Check, Incident, evaluate
from rig.config.wiring import Wiring
from rig.errors import SafetyStop

SAFE_CLEARANCE_MM = 10.0  # as far as a limb may move before it stops a program (`limits.patient_mm`)
# Less way than this is none: the end of the workspace is where a retreat ends.
LEAST_WAY_MM = 0.5

# Stops that a person asks for: at rest they forbid what comes next, and move the tip only out of contact.
ASKED = ("pain_stop", "operator_stop")


class MotionStateMachine:
    """Decides mode and set-point every cycle; ``finished`` is called once a program with its outcome."""

    def __init__(
        self,
        wiring: Wiring,
        state: LoopState,
        finished: Callable[[str, Incident | None], None],
        table: tuple[Check, ...] = TABLE,
    ) -> None:
        self._wiring, self.state, self._finished, self._table = wiring, state, finished, table
        self.mode = Mode.IDLE
        self.latched: Incident | None = None
        self.step_index = -1
        self._program: Program | None = None
        self._run: Run | None = None
        self.step_start_ns = 0
        self._escape_mm = math.nan
        self._stays = False

    @property
    def busy(self) -> bool:
        """Whether a program or a retraction is under way."""
        return self._program is not None or self.mode is Mode.RETRACT

    @property
    def run(self) -> Run | None:
        """The step under way as it is run."""
        return self._run

    @property
    def step(self) -> Step | None:
        """The step under way."""
        return self._program.steps[self.step_index] if self._program else None

    def start(self, program: Program) -> None:
        """Begins a program at the present position."""
        state = self.state
        state.setpoint, state.carried = self._here(), carried_by(state)
        state.surface_mm = state.reference_N = state.tangent_N_mm = math.nan
        state.peak_force_N, state.outcome, state.memory, state.touch = 0.0, "", None, None
        self._program = program
        self._enter(0)

    def acknowledge(self) -> None:
        """Leaves SAFE once the cause was looked at."""
        if self.mode is Mode.SAFE:
            self.mode, self.latched, self._stays = Mode.IDLE, None, False
            self.state.setpoint, self.state.rest_N = self._here(), math.nan

    def hold(self, incident: Incident) -> None:
        """At rest, and stays so until this is acknowledged."""
        self.mode, self.latched = Mode.SAFE, incident

    def withdraw(self) -> None:
        """Out to the end of the way, with the stop still in force: nothing but a failing axis ends it."""
        self.state.setpoint = self._here()
        self._escape_mm = self._wiring.limits.position_min_mm
        self.mode, self._stays = Mode.RETRACT, False

    def _here(self) -> Setpoint:
        """The present position; at the end of the workspace the encoder's last count may lie beyond it."""
        limits = self._wiring.limits
        return Setpoint(min(max(self.state.position_mm, limits.position_min_mm), limits.position_max_mm), 0.0)

    def update(self, inputs: SafetyInputs) -> Incident | None:
        """One cycle; returns the incident that has just stopped motion, if any."""
        inputs.mode = self.mode
        self._note_rest()
        self._note_peak()
        incident = self._evaluate(inputs)
        if incident:
            self._stop(incident)
        elif self.latched:
            self._escape()
        elif self._run:
            incident = self._advance()
        return incident

    def _evaluate(self, inputs: SafetyInputs) -> Incident | None:
        resting = self.mode in AT_REST
        retreating = self.latched and not resting
        least = Action.IMMEDIATE if retreating or self._stuck else Action.SOFT
        return evaluate(self.state, inputs, self._wiring, self._table, least, at_rest=resting)

    @property
    def _stuck(self) -> bool:
        """Whether a stop is in force and the axis can do no more for a limb that pushes."""
        at_the_end = self.state.position_mm - self._wiring.limits.position_min_mm < LEAST_WAY_MM
        return self.latched is not None and (self._stays or at_the_end)

    def stay(self) -> None:
        """The drive has no power, or cannot have it: there is no way out until the stop is acknowledged."""
        self.mode, self._stays = Mode.SAFE, True

    def _note_rest(self) -> None:
        """The smallest load since the tip came to rest: what comes on top is a limb that pushes."""
        state = self.state
        if self.mode not in AT_REST:
            state.rest_N = math.nan
        elif not state.load.force_N >= state.rest_N:
            state.rest_N = state.load.force_N

    def _note_peak(self) -> None:
        """The largest force of a program, what came after its stop until the tip is out of it included."""
        if self.mode is not Mode.IDLE:
            self.state.peak_force_N = max(self.state.peak_force_N, self.state.force_N)

    def _holds(self, incident: Incident) -> bool:
        """Whether a person asked for a stop at rest, where it is out of contact or another stop is in force already."""
        stopped = self.latched is not None or not self.state.depth_mm > 0
        return self.mode in AT_REST and incident.code in ASKED and stopped

    def _stop(self, incident: Incident) -> None:
        if self._holds(incident):
            self.mode, self.latched = Mode.SAFE, self.latched or incident
            return
        if self.mode in AT_REST:  # what was wanted last may be far from where the tip was left
            self.state.setpoint = self._here()
        self.latched, self._escape_mm = incident, self._way_out_mm()
        self._end(incident.code, incident)
        self.mode = Mode.SAFE if incident.action is Action.IMMEDIATE else Mode.RETRACT

    def _way_out_mm(self) -> float:
        """Clear of the surface, or of the tip where none was met yet; all the way where a retreat does not know it."""
        state, outermost_mm = self.state, self._wiring.limits.position_min_mm
        if self.mode is Mode.RETRACT and math.isnan(state.surface_mm):
            return outermost_mm
        surface_mm = state.setpoint.position_mm if math.isnan(state.surface_mm) else state.surface_mm
        return max(min(surface_mm, state.setpoint.position_mm) - SAFE_CLEARANCE_MM, outermost_mm)

    def _escape(self) -> None:
        if self.mode is not Mode.RETRACT:
            return
        state, limits = self.state, self._wiring.limits
        state.reference_N = state.tangent_N_mm = math.nan
        state.setpoint = toward(
            state.setpoint, self._escape_mm, limits.retract_speed_mm_s, state.acceleration_mm_s2, state.dt_s
        )
        if arrived(state.setpoint, self._escape_mm):
            self.mode = Mode.SAFE

    def _advance(self) -> Incident | None:
        state = self.state
        assert self._run and self._program
        try:
            over = self._run.advance(state, (state.now_ns - self.step_start_ns) * 1e-9)
        except SafetyStop as stop:
            refused = Incident(Action.SOFT, "protocol", str(stop))
            self._stop(refused)
            return refused
        incident = self._outside()
        if incident:
            self._stop(incident)
        elif over:
            self._enter(self.step_index + 1)
        return incident

    def _outside(self) -> Incident | None:
        """A step that leads out of the workspace is stopped before the drive is asked to go there."""
        wanted_mm = self.state.setpoint.position_mm
        low_mm, high_mm = self._wiring.limits.position_min_mm, self._wiring.limits.position_max_mm
        if low_mm <= wanted_mm <= high_mm:
            return None
        bounded_mm = min(max(wanted_mm, low_mm), high_mm) if math.isfinite(wanted_mm) else self._here().position_mm
        self.state.setpoint = Setpoint(bounded_mm, 0.0)
        text = f"the program leads to {wanted_mm:.2f} mm, outside {low_mm:g} to {high_mm:g} mm"
        return Incident(Action.SOFT, "workspace", text)

    def _enter(self, index: int) -> None:
        assert self._program
        if index == len(self._program.steps):
            self.mode = Mode.IDLE
            self._end(self.state.outcome or "complete", None)
            return
        step = self._program.steps[index]
        self._run, self.mode, self.step_index = step.begin(), step.mode, index
        self.step_start_ns = self.state.now_ns

    def _end(self, outcome: str, incident: Incident | None) -> None:
        had_program = self._program is not None
        self._program = self._run = None
        self.step_index = -1
        if had_program:
            self._finished(outcome, incident)
