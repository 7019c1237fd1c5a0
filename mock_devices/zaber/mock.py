"""A Zaber axis of firmware 7 on its wire: settings, moves with a trapezoidal profile, flags, replies with checksums.

Checked against zaber-motion, unchanged. A command whose checksum is wrong is not answered. Where the manual leaves it
open: a message for another device is passed over, and a move beyond the limits is refused with BADDATA.
"""

from collections.abc import Callable

from drivers.zaber.codec import ZaberReply, encode_reply
from mock_devices.interfaces import NEVER_NS, AxisPlant
from mock_devices.wire import OnWire, Wire
from mock_devices.zaber.commands import CommandLines, Refused, Request
from mock_devices.zaber.motion import AxisMotion
from mock_devices.zaber.settings import ZaberSettings

MS = 1_000_000


class ZaberMock(OnWire):
    """One device with one axis on ``plant``; its counter starts at 0, without reference.

    Faults, to be set at any time: ``silent`` answers nothing; ``frozen`` repeats its position; ``corrupt_every`` spoils
    the checksum of every n-th reply; ``old`` answers with firmware 6; ``raise_flag(FS)`` and ``restart()`` happen.
    """

    name = "axis"

    def __init__(
        self, wire: Wire, plant: AxisPlant, start_ns: int, microsteps_per_mm: float = 2000.0, serial_number: int = 68123
    ) -> None:
        super().__init__(wire)
        self.serial_number = str(serial_number)
        self.silent = self.old = False
        self.corrupt_every = 0
        self.settings = ZaberSettings(serial_number)
        self.motion = AxisMotion(plant, self.settings, abs(microsteps_per_mm))
        self._lines = CommandLines()
        self._frozen_at: int | None = None
        self._replies, self._ticked_ns = 0, start_ns
        self._commands: dict[str, Callable[[Request], str]] = {
            "": lambda _: "0",
            "get": self._get,
            "set": self._set,
            "home": lambda _: self.motion.home(),
            "move": self._move,
            "stop": lambda _: self.motion.stop(),
            "estop": lambda _: self.motion.stop(at_once=True),
            "driver": self._driver,
            "warnings": self._warnings,
        }

    @property
    def frozen(self) -> bool:
        """Whether the position it reports stands still."""
        return self._frozen_at is not None

    @frozen.setter
    def frozen(self, frozen: bool) -> None:
        self._frozen_at = self.motion.position if frozen else None

    def raise_flag(self, flag: str) -> None:
        """A flag comes up; one that begins with F stops the axis."""
        self.motion.raise_flag(flag)

    def restart(self) -> None:
        """Loses its power for a moment: the reference is gone, settings stay."""
        self.motion.restart()

    @property
    def due_ns(self) -> int:
        """The next millisecond of a move."""
        return self._ticked_ns + MS if self.motion.busy else NEVER_NS

    def tick(self, now_ns: int) -> None:
        """One step of a move."""
        self.motion.step((now_ns - self._ticked_ns) * 1e-9)
        self._ticked_ns = now_ns

    def receive(self, now_ns: int) -> None:
        """Answers each complete command by one write."""
        for request in self._lines.feed(self._wire.read()):
            if request.device in (0, self.settings.device) and not self.silent:
                was_busy = self.motion.busy
                reply = self._answer(request)
                if not was_busy:
                    self._ticked_ns = now_ns
                self._send(reply)

    def _answer(self, request: Request) -> ZaberReply:
        try:
            if request.axis > 1:
                raise Refused("BADAXIS")
            command = self._commands.get(request.verb)
            if command is None:
                raise Refused("BADCOMMAND")
            return self._reply(request, command(request))
        except Refused as refusal:
            return self._reply(request, refusal.word, accepted=False)

    def _reply(self, request: Request, data: str, accepted: bool = True) -> ZaberReply:
        motion = self.motion
        device = self.settings.device
        return ZaberReply("@", device, request.axis, request.number, accepted, motion.busy, motion.flag, data)

    def _send(self, reply: ZaberReply) -> None:
        self._replies += 1
        raw = encode_reply(reply, bool(self.settings.values["comm.checksum"]))
        if self.corrupt_every and self._replies % self.corrupt_every == 0:
            raw = raw[:-4] + bytes([raw[-4] ^ 0x01]) + raw[-3:]
        self._wire.write(raw)

    def _get(self, request: Request) -> str:
        name = request.word(0)
        if name in ("pos", "encoder.pos"):
            return str(self.motion.position if self._frozen_at is None else self._frozen_at)
        if name == "version" and self.old:
            return "6.28"
        return self.settings.text(name)

    def _set(self, request: Request) -> str:
        self.settings.write(request.word(0), request.number_at(1))
        return "0"

    def _move(self, request: Request) -> str:
        kind = request.word(0)
        if kind == "vel":
            return self.motion.move_at(request.number_at(1))
        speed, acceleration = request.optional(2), request.optional(3)
        ends = {"min": self.settings.values["limit.min"], "max": self.settings.values["limit.max"]}
        if kind in ends:
            return self.motion.move_to(ends[kind], request.optional(1), request.optional(2))
        if kind not in ("abs", "rel"):
            raise Refused("BADCOMMAND")
        target = request.number_at(1) + (self.motion.position if kind == "rel" else 0)
        return self.motion.move_to(target, speed, acceleration)

    def _driver(self, request: Request) -> str:
        if request.word(0) not in ("enable", "disable"):
            raise Refused("BADDATA")
        return self.motion.power(request.word(0) == "enable")

    def _warnings(self, request: Request) -> str:
        up = self.motion.flags(clear=bool(request.words))
        return " ".join([f"{len(up):02d}", *up])
