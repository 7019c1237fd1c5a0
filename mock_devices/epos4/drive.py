"""The mock drive's inside: CiA 402 state machine, modes of operation and fault reactions, moving an AxisPlant.

Knows no bus and no clock. Positions are increments; the raw counter starts at 0 with the drive and ``zero`` is where
home is on it.
"""

import math
from collections.abc import Callable, Iterator

from drivers.epos4.cia402 import STATE_WORDS, Controlword, PdsState, Statusword
from drivers.epos4.faults import FAULTS, UNKNOWN
from drivers.epos4.objects import U32_MAX
from mock_devices.canopen.sdo_server import SdoAbort
from mock_devices.cia402.states import TRANSITIONS, command_of
from mock_devices.epos4 import torque
from mock_devices.epos4.dictionary import Dictionary
from mock_devices.epos4.motion import NEEDS_HOME_SWITCH, HomingSetup, Inputs, TrapezoidalProfile, homing
from mock_devices.interfaces import AxisPlant

PROFILE_POSITION, PROFILE_VELOCITY, HOMING, CYCLIC_POSITION, CYCLIC_VELOCITY, CYCLIC_TORQUE = 1, 3, 6, 8, 9, 10
MODES = (PROFILE_POSITION, PROFILE_VELOCITY, HOMING, CYCLIC_POSITION, CYCLIC_VELOCITY, CYCLIC_TORQUE)
STANDSTILL_RPM = 30  # the EPOS4's standstill window as delivered (object 30E0:1)
RANGE_ABORT = 0x06090030
MODE_BITS = Statusword.TARGET_REACHED | Statusword.ACKNOWLEDGE | Statusword.MODE_ERROR


def _counter(value: float) -> int:
    """As a 32-bit register holds it."""
    return (round(value) + (1 << 31)) % (1 << 32) - (1 << 31)


class Drive:
    """``report`` is told each error code as it happens, and 0 when the fault was reset."""

    def __init__(
        self,
        plant: AxisPlant,
        dictionary: Dictionary,
        report: Callable[[int], None],
        increments_per_mm: float,
        increments_per_rev: float,
        speed_unit: float = 0.0,
    ) -> None:
        """``speed_unit`` is what the drive's unit of speed is in increments/s; 0: it counts in rpm."""
        self.state = PdsState.SWITCH_ON_DISABLED
        self.mode = PROFILE_POSITION
        self.remote = False
        self.cause = 0
        self.unguarded, self.astray = False, 0.0
        self._plant = plant
        self._dictionary = dictionary
        self._values = dictionary.values
        self._report = report
        self._scale = increments_per_mm
        self._per_rpm = speed_unit or increments_per_rev / 60
        self._index_spacing = increments_per_rev
        self._ramp = TrapezoidalProfile(0.0)
        self._inputs = Inputs()
        self._word = 0
        self._bits = 0
        self.zero = 0.0
        self.restart()

    def restart(self) -> None:
        """As after power-up: no torque, no reference, the counter at 0."""
        self._plant.power(False)
        self.state = PdsState.SWITCH_ON_DISABLED
        self.mode = PROFILE_POSITION
        self.cause = 0
        self._word = 0
        self._bits = 0
        self._leaving: PdsState | None = None
        self._deceleration = 0.0
        self._goal: float | None = None
        self._queued: float | None = None
        self._homing: Iterator[float | None] | None = None
        self.zero = self._raw()
        self._inside = True

    @property
    def status(self) -> int:
        """The statusword."""
        word = STATE_WORDS[self.state] | Statusword.VOLTAGE | self._bits
        still = self.mode == PROFILE_VELOCITY and abs(self.rpm) <= STANDSTILL_RPM
        if self.state is PdsState.ENABLED and (still or self.mode >= CYCLIC_POSITION):
            word |= Statusword.ACKNOWLEDGE
        word &= self._dictionary.table.status_mask
        return int(word | Statusword.REMOTE if self.remote else word)

    @property
    def position(self) -> int:
        """Actual position from home."""
        return _counter(self._raw() - self.zero)

    @property
    def demand(self) -> int:
        """Position the drive follows, from home."""
        return _counter(self._ramp.position - self.zero)

    @property
    def following_error(self) -> int:
        """Demand minus actual position."""
        return _counter(self._ramp.position - self._raw())

    @property
    def rpm(self) -> int:
        """Actual velocity."""
        return _counter(self._plant.velocity_mm_s * self._scale / self._per_rpm)

    @property
    def current_mA(self) -> int:
        """Motor current, positive where it drives increments up."""
        return round(math.copysign(1000, self._scale) * self._plant.current_A)

    @property
    def powered(self) -> bool:
        """Whether there is torque."""
        return self.state in (PdsState.ENABLED, PdsState.QUICK_STOP, PdsState.FAULT_REACTION)

    @property
    def moving(self) -> bool:
        """Whether the drive makes its own profile now and wants a tick each millisecond."""
        if self.state is PdsState.ENABLED:
            return self.mode != CYCLIC_POSITION or self._leaving is not None
        return self.state is PdsState.FAULT_REACTION or (self.state is PdsState.QUICK_STOP and self._ramp.speed != 0)

    def control(self, word: int) -> None:
        """Object 6040 was written."""
        if word == self._word and self.state is PdsState.ENABLED:
            return
        rising, falling = word & ~self._word, self._word & ~word
        self._word = word
        if word & Controlword.FAULT_RESET:
            if rising & Controlword.FAULT_RESET:
                self._reset_fault()
            return
        command = command_of(word)
        while (self.state, command) in TRANSITIONS and not self._leaving:
            self._go(TRANSITIONS[self.state, command])
        if self.state is PdsState.ENABLED and not self._leaving:
            self._mode_bits(rising, falling)

    def set_mode(self, mode: int) -> None:
        """Object 6060 was written; raises SdoAbort."""
        if mode not in MODES or not self._values[0x6502, 0] >> (mode - 1) & 1:
            raise SdoAbort(RANGE_ABORT)
        if mode == self.mode:
            return
        if self.mode == CYCLIC_TORQUE and self.powered:
            self._aim()
        self.mode = mode
        self._bits &= ~MODE_BITS
        self._goal = self._queued = self._homing = None
        if mode == CYCLIC_POSITION:
            self.set_target(self._values[0x607A, 0])

    def set_target(self, increments: int) -> None:
        """Object 607A was written; only cyclic position mode acts on it at once."""
        if self.mode != CYCLIC_POSITION or self.state is not PdsState.ENABLED or self._leaving:
            return
        if self._within(increments):
            self._ramp.position = increments + self.astray + self.zero
            self._watch()
            self._aim()
        else:
            self.fault(0x8A82)

    def fault(self, code: int) -> None:
        """Error ``code`` happens now."""
        self._report(code)
        if self.state is PdsState.FAULT:
            return
        reaction = FAULTS.get(code, UNKNOWN).reaction
        option = {"abort connection": self._values[0x6007, 0], "fault reaction": self._values[0x605E, 0]}.get(reaction)
        self._homing = None
        ramps = {"abort connection": {3: 0x6085}, "fault reaction": {1: 0x6084, 2: 0x6085}}.get(reaction, {})
        if self.powered and option in ramps:
            self._brake(self._values[ramps[option], 0])
            self.state = PdsState.FAULT_REACTION
        else:
            self._cut(PdsState.FAULT)

    def tick(self, dt_s: float) -> None:
        """Time passes: own profiles advance, ramps end, the following error is watched."""
        if self.state in (PdsState.FAULT_REACTION, PdsState.QUICK_STOP) or self._leaving:
            self._braked(dt_s)
        elif self.state is PdsState.ENABLED and self.mode == CYCLIC_TORQUE:
            self._push()
        elif self.state is PdsState.ENABLED and self.mode != CYCLIC_POSITION:
            self._advance(dt_s)
            self._aim()
        if self.powered:
            self._watch()

    def _go(self, state: PdsState) -> None:
        if state is PdsState.ENABLED:
            self._enter_enabled()
        elif self.state is PdsState.ENABLED and state is PdsState.QUICK_STOP:
            self._brake(self._values[0x6085, 0])
            self.state = state
        elif self.state is PdsState.ENABLED and self._values[0x605C if state is PdsState.SWITCHED_ON else 0x605B, 0]:
            self._brake(self._values[0x6084, 0])
            self._leaving = state
        else:
            self._cut(state)

    def _enter_enabled(self) -> None:
        if self.state is not PdsState.QUICK_STOP:
            self._ramp = TrapezoidalProfile(self._raw())
            self._plant.power(True)
            self._aim()
        self.state = PdsState.ENABLED
        self._bits &= ~MODE_BITS
        self._goal = self._queued = self._homing = None
        self._inside = self._within(self.position)
        self.set_target(self._values[0x607A, 0])

    def _brake(self, rpm_s: int) -> None:
        """From here on down to rest: from where the demand is, at the speed the axis has."""
        self._deceleration = rpm_s * self._per_rpm
        self._ramp.speed = self._plant.velocity_mm_s * self._scale
        self._goal = self._queued = self._homing = None
        self._bits &= ~MODE_BITS

    def _braked(self, dt_s: float) -> None:
        at_rest = self._ramp.stop(self._deceleration, dt_s) and abs(self.rpm) <= STANDSTILL_RPM
        self._aim()
        if not at_rest:
            return
        if self._leaving:
            self._cut(self._leaving)
        elif self.state is PdsState.FAULT_REACTION:
            self._cut(PdsState.FAULT)
        elif self._values[0x605A, 0] < 5:  # 1 to 4 end without torque, 5 to 8 stay there (CiA 402)
            self._cut(PdsState.SWITCH_ON_DISABLED)
        else:
            self._bits |= Statusword.TARGET_REACHED

    def _cut(self, state: PdsState) -> None:
        self._plant.power(False)
        self._leaving = None
        self._bits &= ~(Statusword.TARGET_REACHED | Statusword.ACKNOWLEDGE)
        self.state = state

    def _reset_fault(self) -> None:
        if self.state is not PdsState.FAULT:
            return
        if self.cause:
            self._report(self.cause)
        else:
            self.state = PdsState.SWITCH_ON_DISABLED
            self._bits &= ~MODE_BITS
            self._report(0)

    def _mode_bits(self, rising: int, falling: int) -> None:
        if self.mode == PROFILE_POSITION:
            if rising & Controlword.START:
                self._take_setpoint()
            elif falling & Controlword.START and self._queued is None:
                self._bits &= ~Statusword.ACKNOWLEDGE
        elif self.mode == HOMING and rising & Controlword.START:
            self._start_homing()

    def _take_setpoint(self) -> None:
        target = self._values[0x607A, 0] + self.zero
        if self._word & Controlword.RELATIVE:
            target += (self._ramp.position if self._goal is None else self._goal) - self.zero
        if not self._within(target - self.zero):
            self.fault(0x8A82)
        elif self._goal is None or self._word & Controlword.IMMEDIATELY:
            self._goal, self._queued = target, None
            self._bits = self._bits & ~MODE_BITS | Statusword.ACKNOWLEDGE
        elif self._queued is None:
            self._queued = target
            self._bits |= Statusword.ACKNOWLEDGE

    def _start_homing(self) -> None:
        values, rpm = self._values, self._per_rpm
        self._bits &= ~(MODE_BITS | Statusword.REFERENCED)
        method = values[0x6098, 0]
        if method in NEEDS_HOME_SWITCH:
            self._bits |= Statusword.MODE_ERROR
            return
        setup = HomingSetup(
            method,
            fast=values[0x6099, 1] * rpm,
            slow=values[0x6099, 2] * rpm,
            acceleration=values[0x609A, 0] * rpm,
            offset=values[0x30B1, 0],
            current_threshold_A=values[0x30B2, 0] / 1000,
            index_spacing=self._index_spacing,
        )
        self._sense(0.001)
        self._homing = homing(setup, self._ramp, self._inputs)

    def _advance(self, dt_s: float) -> None:
        if self._word & Controlword.HALT:
            self._bits &= ~Statusword.TARGET_REACHED
            if self._ramp.stop(self._values[0x6084, 0] * self._per_rpm, dt_s):
                self._bits |= Statusword.TARGET_REACHED
        elif self.mode == HOMING:
            self._home(dt_s)
        elif self.mode == PROFILE_POSITION:
            self._to_goal(dt_s)
        else:
            self._at_velocity(dt_s)

    def _to_goal(self, dt_s: float) -> None:
        values, rpm = self._values, self._per_rpm
        acceleration, deceleration = values[0x6083, 0] * rpm, values[0x6084, 0] * rpm
        top = min(values[0x6081, 0], values[0x607F, 0], values[0x6080, 0]) * rpm
        if self._goal is None:
            self._ramp.stop(deceleration, dt_s)
        elif self._ramp.towards(self._goal, top, acceleration, deceleration, dt_s):
            self._goal, self._queued = self._queued, None
            if self._goal is None:
                self._bits |= Statusword.TARGET_REACHED
            elif not self._word & Controlword.START:
                self._bits &= ~Statusword.ACKNOWLEDGE

    def _at_velocity(self, dt_s: float) -> None:
        values, rpm = self._values, self._per_rpm
        cyclic = self.mode == CYCLIC_VELOCITY
        top = min(values[0x607F, 0], values[0x6080, 0])
        wanted = values[0x60FF, 0] + (values[0x60B1, 0] if cyclic else 0)
        speed = max(min(wanted, top), -top) * rpm
        acceleration = min(values[0x60C5 if cyclic else 0x6083, 0], values[0x60C5, 0]) * rpm
        deceleration = min(values[0x60C5 if cyclic else 0x6084, 0], values[0x60C5, 0]) * rpm
        if self._ramp.at_speed(speed, acceleration, deceleration, dt_s):
            self._bits |= Statusword.TARGET_REACHED
        else:
            self._bits &= ~Statusword.TARGET_REACHED

    def _push(self) -> None:
        """By torque: the demand is wherever the axis is."""
        self._ramp.position, self._ramp.speed = self._raw(), self._plant.velocity_mm_s * self._scale
        self._plant.push(math.copysign(1.0, self._scale) * torque.current_A(self._values, self.rpm))

    def _home(self, dt_s: float) -> None:
        if self._homing is None:
            self._ramp.stop(self._values[0x609A, 0] * self._per_rpm, dt_s)
            return
        self._sense(dt_s)
        home = next(self._homing)
        if home is not None:
            self.zero = home - self._values[0x30B0, 0]
            self._homing = None
            self._inside = self._within(self.position)
            self._bits |= Statusword.TARGET_REACHED | Statusword.ACKNOWLEDGE | Statusword.REFERENCED

    def _sense(self, dt_s: float) -> None:
        inputs = self._inputs
        inputs.position, inputs.current_A, inputs.dt_s = self._raw(), self.current_mA / 1000, dt_s
        inputs.negative_switch = self._plant.at_reference and self._scale > 0
        inputs.positive_switch = self._plant.at_reference and self._scale < 0

    def _raw(self) -> float:
        return self._plant.position_mm * self._scale

    def _aim(self) -> None:
        self._plant.target(self._ramp.position / self._scale)

    def _within(self, increments: float) -> bool:
        return self.unguarded or self._values[0x607D, 1] <= increments <= self._values[0x607D, 2]

    def _watch(self) -> None:
        """Following error always; leaving the software limits except while homing."""
        raw = self._raw()
        window = self._values[0x6065, 0]
        inside = self._within(raw - self.zero)
        left, self._inside = self._inside and not inside, inside
        if self.state is PdsState.FAULT_REACTION or self.unguarded:
            return
        if abs(self._ramp.position - raw) > window != U32_MAX:
            # The demand is where the axis cannot follow: it brakes from where it is.
            self._ramp.position = raw
            self.fault(0x8611)
            self._bits |= Statusword.MODE_ERROR
        elif left and self.mode != HOMING:
            self.fault(0x8A82)
