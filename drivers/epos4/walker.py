"""Controlword and statusword through SDO: the state walk, modes, waiting for bits, each with a deadline."""

import contextlib
from collections.abc import Callable

from drivers.epos4 import objects
from drivers.epos4.cia402 import (
    Controlword,
    Goal,
    PdsState,
    Statusword,
    decode_state,
    next_controlword,
    obstacle,
    reached,
)
from drivers.epos4.faults import describe
from drivers.epos4.node import NoAnswer, Node
from rig.errors import DeviceError, SafetyStop

REACTION_S = 1.0
"""How long a drive may take to do what takes no way: change state or mode, acknowledge a set-point."""
POLL_S = 0.002
STANDSTILL_RPM = 1  # the drive's own resolution of speed, by which a hold ripples


def never() -> bool:
    """Nobody interrupts."""
    return False


class Walker:
    """Leads one drive; ``braking_s`` is the longest its ramp takes, by which waits for a state are longer."""

    def __init__(self, node: Node, now: Callable[[], int], braking_s: float) -> None:
        self.node = node
        self.status = 0
        self.standstill = STANDSTILL_RPM
        self.mode = 0
        self.controlword = int(Controlword.DISABLE_VOLTAGE)
        self.interrupted: Callable[[], bool] = never
        """Asked in every wait; a yes ends the wait with SafetyStop."""
        self._now = now
        self._braking_s = braking_s

    @property
    def state(self) -> PdsState:
        """State of the drive as last heard."""
        return decode_state(self.status)

    @property
    def fault(self) -> str:
        """Error code and meaning, empty if the drive reports none."""
        code = self.node.emergency.code
        if code:
            return describe(code)
        return "fault without an emergency message" if self.status & Statusword.FAULT else ""

    def read_status(self) -> int:
        """The statusword now."""
        self.status = self.node.read(objects.STATUSWORD)
        return self.status

    def control(self, word: int) -> None:
        """Writes the controlword, once: its edges give orders. Set-points that follow repeat it."""
        self.node.write(objects.CONTROLWORD, int(word), tries=1)
        self.controlword = int(word)

    def set_mode(self, mode: int) -> None:
        """Changes the mode of operation; raises DeviceError where the drive does not show it."""
        self.node.write(objects.MODE, mode)
        self.mode = mode
        deadline_ns = self._deadline_ns(REACTION_S)
        while (shown := self.node.read(objects.MODE_DISPLAY)) != mode:
            if self._now() >= deadline_ns:
                raise DeviceError(f"{self.node.name}: does not take mode {mode}, it shows {shown}; restart the drive")
            self._pause()

    def walk(self, goal: Goal) -> None:
        """Goes to ``goal`` state by state; raises DeviceError with the reason where it cannot."""
        deadline_ns = self._deadline_ns(REACTION_S + self._braking_s)
        while not reached(status := self.read_status(), goal):
            why = obstacle(status, goal)
            if why or self._now() >= deadline_ns:
                why = why or f"it stays in {decode_state(status).value}"
                raise DeviceError(f"{self.node.name}: is not {goal.value}: {why} ({self.fault or 'no fault'})")
            # No answer to an order is no end of it: the state tells what became of it, and what to order next.
            with contextlib.suppress(NoAnswer):
                self.control(next_controlword(status, goal))
            self._pause()

    def make_safe(self) -> None:
        """From wherever it is: stopped by its ramp, then without torque."""
        self.walk(Goal.STOPPED)
        deadline_ns = self._deadline_ns(REACTION_S + self._braking_s)
        while abs(self.node.read(objects.VELOCITY)) > self.standstill and self._now() < deadline_ns:
            self._pause()
        self.walk(Goal.DISABLED)

    def watch(self, timeout_s: float, done: Callable[[int], bool]) -> bool:
        """Reads the statusword until it is ``done``; whether it was, in time."""
        deadline_ns = self._deadline_ns(timeout_s)
        while not done(self.read_status()):
            if self._now() >= deadline_ns:
                return False
            self._pause()
        return True

    def require(self, timeout_s: float, bit: Statusword, value: bool, otherwise: str) -> None:
        """Waits for a statusword bit while enabled; raises DeviceError, beginning ``otherwise``, where it fails to."""

        def over(status: int) -> bool:
            return bool(status & bit) is value or decode_state(status) is not PdsState.ENABLED

        in_time = self.watch(timeout_s, over)
        if not in_time or self.state is not PdsState.ENABLED:
            why = self.fault or (f"in {self.state.value}" if in_time else f"within {timeout_s:.1f} s")
            raise DeviceError(f"{self.node.name}: {otherwise}: {why}; see what hinders the axis")

    def reset_fault(self) -> None:
        """One rising edge of the reset bit, then without torque; raises DeviceError where the fault is still there."""
        for word in (Controlword.DISABLE_VOLTAGE, Controlword.FAULT_RESET, Controlword.DISABLE_VOLTAGE):
            self.control(word)
        gone = self.watch(REACTION_S, lambda status: not status & Statusword.FAULT)
        if not gone or self.node.read(objects.ERROR_REGISTER):
            code = self.node.read(objects.ERROR_CODE)
            raise DeviceError(f"{self.node.name}: the fault is still there: {describe(code)}; remove its cause first")
        self.node.emergency = self.node.emergency._replace(code=0)
        self.walk(Goal.DISABLED)

    def note_old_fault(self) -> None:
        """Takes over a fault that was there before anyone listened."""
        if self.read_status() & Statusword.FAULT:
            self.node.emergency = self.node.emergency._replace(code=self.node.read(objects.ERROR_CODE))

    def _pause(self) -> None:
        if self.interrupted():
            raise SafetyStop(f"{self.node.name}: stopped on request while it was moved")
        self.node.pump(POLL_S)

    def _deadline_ns(self, timeout_s: float) -> int:
        return self._now() + round(timeout_s * 1e9)
