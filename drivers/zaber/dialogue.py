"""One command, one reply, with a deadline: what set-up, homing and moves are made of. Everything here waits."""

from collections.abc import Callable

from drivers.ports import Port, read_until
from drivers.roles import LinkCounters
from drivers.zaber import flags
from drivers.zaber.codec import NUMBERS, LineDecoder, ZaberReply, encode_command
from rig.errors import DeviceError, SafetyStop

REPLY_S = 0.3  # a device answers within some milliseconds; USB adapters hold bytes back for 16
TRIES = 3  # one damaged line is the cable's noise, three in a row are its state
POLL_S = 0.005


class AsciiDialogue:
    """A device's axis behind ``port``; ``name`` is what messages call it."""

    def __init__(
        self,
        port: Port,
        device: int,
        axis: int,
        name: str,
        counters: LinkCounters,
        now: Callable[[], int],
        sleep: Callable[[float], None],
    ) -> None:
        self.port, self.name = port, name
        self.decoder = LineDecoder(counters)
        self._device, self._axis, self._now, self._sleep = device, axis, now, sleep
        self._counters, self._number = counters, 0

    def sent(self, command: str) -> tuple[int, bytes]:
        """The command's number and its bytes, for the caller to write."""
        self._number = (self._number + 1) % NUMBERS
        return self._number, encode_command(self._device, self._axis, self._number, command)

    def heard(self, data: bytes) -> list[ZaberReply]:
        """Replies of this device among what came."""
        return [reply for reply in self.decoder.feed(data) if reply.device == self._device and reply.kind == "@"]

    def ask(self, command: str, tries: int = TRIES) -> ZaberReply:
        """The reply; a command without one is said again, which none of those here minds. Raises DeviceError."""
        for _ in range(tries):
            number, text = self.sent(command)
            self.port.write(text)
            reply = self._answer(number)
            if reply is not None:
                return self._accepted(command, reply)
        raise DeviceError(
            f"{self.name}: no reply to {command or 'a poll'!r} in {tries} tries of {REPLY_S:g} s;"
            " check power, cable, axis.port, axis.baud and axis.device"
        )

    def value(self, setting: str) -> str:
        """A setting as the device has it."""
        return self.ask(f"get {setting}").data

    def flags(self) -> tuple[str, ...]:
        """All flags that are up, `01 WR` for one."""
        return tuple(self.ask("warnings").data.split()[1:])

    def wait_idle(self, seconds: float, what: str, interrupted: Callable[[], bool]) -> ZaberReply:
        """Polls until it stands; raises SafetyStop where it is interrupted, DeviceError where it does not stand."""
        deadline_ns = self._now() + round(seconds * 1e9)
        while (reply := self.ask("")).busy:
            if interrupted():
                raise SafetyStop(f"{self.name}: stopped on request while it was moved")
            if self._now() > deadline_ns:
                raise DeviceError(f"{self.name}: {what} did not end within {seconds:.1f} s; see what hinders the axis")
            self._sleep(POLL_S)
        return reply

    def _answer(self, number: int) -> ZaberReply | None:
        """None where none comes, or a damaged one."""
        deadline_ns, damaged = self._now() + round(REPLY_S * 1e9), self._counters.checksum_errors
        while (left_s := (deadline_ns - self._now()) * 1e-9) > 0 and self._counters.checksum_errors == damaged:
            replies = self.heard(read_until(self.port, lambda data: data.endswith(b"\n"), left_s))
            for reply in replies:
                if reply.number == number:
                    return reply
        return None

    def _accepted(self, command: str, reply: ZaberReply) -> ZaberReply:
        if not reply.accepted:
            raise DeviceError(f"{self.name}: refused {command!r}: {flags.reason(reply.data)}")
        return reply
