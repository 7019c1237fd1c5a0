"""Opens a lost device again beside the loop: a new driver, started in a thread, for the loop to take over."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from controller.loop.realtime import switch_promptly
from drivers.roles import Device, Identity
from rig.errors import RigError

# The drive's ramp takes at most 0.1 s, and a plug that is pushed in bounces: nothing is asked before both are over.
FIRST_WAIT_NS = 1_000_000_000
# A start that fails takes up to 4 s (Bota, silent); longer pauses would be felt by whoever holds the cable.
LONGEST_WAIT_NS = 4_000_000_000
# Start-ups have deadlines of their own of a few seconds; the loop's process does not wait for one longer than this.
LEAVING_S = 1.0

Spawn = Callable[[Callable[[], None]], None]
Open = Callable[[], Device]


def in_thread(work: Callable[[], None]) -> None:
    """Runs ``work`` beside the loop; it ends with the process."""
    switch_promptly()
    threading.Thread(target=work, name="reopening", daemon=True).start()


@dataclass(frozen=True)
class Openers:
    """How a new driver of each role is made, not yet started, and how its start is run beside the loop."""

    by_role: dict[str, Open]
    spawn: Spawn = in_thread


class Reopening:
    """One role's way back. ``error`` is why the last attempt failed; ``stranger`` says so where another device answers.

    ``identity`` is the device that is expected; without one, before it was ever heard, any is taken.
    """

    def __init__(self, open_device: Open, identity: Identity | None, spawn: Spawn = in_thread) -> None:
        self.error = self.stranger = ""
        self.active = False
        self.identity = identity
        self._open, self._spawn = open_device, spawn
        self._under_way = self._abandoned = False
        self._found: Device | None = None
        self._due_ns: int | None = None
        self._wait_ns = FIRST_WAIT_NS

    def update(self, old: Device, next_seq: int, at_rest: bool, now_ns: int) -> Device | None:
        """The next thing to do; returns the new driver, started, its samples numbered from ``next_seq``, once there.

        An attempt begins only ``at_rest``; ``old`` is closed by it and must not be used from then on.
        """
        if self._under_way:
            return None
        if self._found:
            return self._handed_over()
        if self._due_ns is None:
            self._due_ns = now_ns + self._wait_ns
        if at_rest and now_ns >= self._due_ns:
            self._due_ns, self._wait_ns = None, min(2 * self._wait_ns, LONGEST_WAIT_NS)
            self.active = self._under_way = True
            self._spawn(lambda: self._attempt(old, next_seq))
        return None

    def _handed_over(self) -> Device | None:
        found, self._found = self._found, None
        self.error = self.stranger = ""
        self.active = False
        self._due_ns, self._wait_ns = None, FIRST_WAIT_NS
        return found

    def _attempt(self, old: Device, next_seq: int) -> None:
        try:
            self._found = self._started(old, next_seq)
        except RigError as error:
            self.error = str(error)
        except Exception as error:  # a driver's own mistake must be seen, and must not end the attempts
            self.error = f"the driver met an error of its own: {type(error).__name__}: {error}"
        finally:
            if self._abandoned and self._found:
                self._found.close()
            self._under_way = False

    def _started(self, old: Device, next_seq: int) -> Device | None:
        old.close()
        device = self._open()
        try:
            device.next_seq = next_seq
            device.start()
            self.stranger = self._strange(device.identity)
        except BaseException:
            device.close()
            raise
        if not self.stranger:
            return device
        device.close()
        self.error = self.stranger
        return None

    def _strange(self, found: Identity) -> str:
        known = self.identity
        if known is None:
            return ""
        if (found.product, found.serial) == (known.product, known.serial):
            was, now = (who.settings.get("increments_per_mm") for who in (known, found))
            changed = f"counts {now} increments a mm and counted {was}: end the bench and start it with this scale"
            return "" if was == now else f"{found.product} serial {found.serial} {changed}"
        return (
            f"another device answers: {found.product} serial {found.serial} instead of {known.product} serial"
            f" {known.serial}; plug the right one in, or end the bench and start it with this one"
        )

    def close(self) -> None:
        """Gives up; what an attempt still finds is closed."""
        self._abandoned = True
        deadline = time.monotonic() + LEAVING_S
        while self._under_way and time.monotonic() < deadline:
            time.sleep(0.01)
        if self._found:
            self._found.close()
