"""A Polaris or Vega position sensor on its wire: the combined API over a serial line or TCP, one tool per marker.

Frames come at 60 Hz; nothing is sent unasked. What the manuals leave open is decided here and said where it is.
Checked against ndicapi and scikit-surgerynditracker, unchanged.
"""

import re
from collections.abc import Callable, Sequence
from typing import Literal

from drivers.crc import crc16_arc
from drivers.ndi import replies
from drivers.ndi.codec import encode_binary, encode_text
from mock_devices.interfaces import MarkerPose, TrackerPlant
from mock_devices.ndi.port_handles import CommandRefused, PortHandles
from mock_devices.wire import OnWire, Wire

FRAME_HZ = 60
MAX_COMMAND = 1024  # the longest command, PVWR with its 64 bytes, has 144 characters: more is a line that never ends
SYSTEM_PORT_UNOCCUPIED = 0x0080
_COMMAND = re.compile(r"([A-Z0-9]+)(?:([: ])(.*))?", re.DOTALL)
_COMM = re.compile(r"[0-7A][01][012][01][01]")
_OPTIONS = re.compile(r"[0-9A-F]{4}")
_TRACKING_OPTIONS = replies.TRANSFORMS | replies.OUT_OF_VOLUME | replies.STRAYS
_PRODUCTS = {
    "polaris": ("Polaris Control Firmware", "P4-00001", "POLARIS Rev 021"),
    "vega": ("Polaris Vega Control Firmware", "P9-00001", "Polaris Vega 024"),
}
_FIRMWARE = "Features.Firmware.Version"

Mode = Literal["reset", "setup", "tracking"]
_ALWAYS: tuple[Mode, ...] = ("reset", "setup", "tracking")
_READY: tuple[Mode, ...] = ("setup", "tracking")
_SETUP: tuple[Mode, ...] = ("setup",)
_TRACKING: tuple[Mode, ...] = ("tracking",)


class NdiMock(OnWire):
    """The tracker; ``tools`` names the markers of ``plant`` in order, each plugged into a port at power-up.

    Faults, to be set at any time:

    * ``silent``: answers nothing
    * ``frozen``: answers, but the frame number stands still
    * ``missing``: indexes of tools reported MISSING whatever the camera sees
    * ``unplugged``: indexes of tools pulled out of their ports: DISABLED, and a bit of the system status
    * ``corrupt_every``: one bit is wrong in every n-th reply; 0 for none
    * ``error_reply``: this ERROR code answers TX and BX; None for none

    ``freeze_tag`` is what VER:0 gives; with "Polaris Vega 008" scikit-surgerynditracker asks by TX instead of BX.
    """

    name = "tracker"

    def __init__(
        self,
        wire: Wire,
        plant: TrackerPlant,
        start_ns: int,
        tools: Sequence[str] = ("tip", "arm"),
        kind: Literal["polaris", "vega"] = "vega",
    ) -> None:
        super().__init__(wire)
        self._is_tcp = ":" in wire.endpoint
        self._plant = plant
        self._start_ns = start_ns
        self._ports = PortHandles(tuple(tools))
        self._product, self._serial, self.freeze_tag = _PRODUCTS[kind]
        self.silent = self.frozen = False
        self.missing: set[int] = set()
        self.corrupt_every = 0
        self.error_reply: int | None = None
        self._mode: Mode = "reset"
        self._ticks = self._frame = self._replies = 0
        self._markers: list[MarkerPose | None] = []
        self._input = b""
        self._commands = self._table()

    def _table(self) -> dict[str, tuple[tuple[Mode, ...], Callable[[str], str | bytes]]]:
        return {
            "RESET": (_ALWAYS, self._reset),
            "INIT": (_ALWAYS, self._initialise),
            "VER": (_ALWAYS, self._version),
            "GETINFO": (_ALWAYS, self._information),
            "COMM": (("reset", "setup"), self._communication),
            "PHSR": (_READY, self._ports.search),
            "PHRQ": (_READY, self._ports.request),
            "PHINF": (_READY, self._ports.describe),
            "PHF": (_SETUP, self._ports.free),
            "PVWR": (_SETUP, self._ports.write),
            "PINIT": (_SETUP, self._ports.initialise),
            "PENA": (_SETUP, self._ports.enable),
            "PDIS": (_SETUP, self._ports.disable),
            "TSTART": (_SETUP, self._start),
            "TSTOP": (_TRACKING, self._stop),
            "TX": (_TRACKING, self._tx),
            "BX": (_TRACKING, self._bx),
        }

    @property
    def unplugged(self) -> set[int]:
        """Indexes of tools pulled out of their ports."""
        return self._ports.unplugged

    @unplugged.setter
    def unplugged(self, tools: set[int]) -> None:
        self._ports.unplugged = tools

    @property
    def due_ns(self) -> int:
        """The next frame."""
        return self._start_ns + (self._ticks + 1) * 1_000_000_000 // FRAME_HZ

    def tick(self, now_ns: int) -> None:
        """Takes a frame; the number advances in every mode."""
        self._ticks += 1
        if not self.frozen:
            self._frame = (self._frame + 1) & 0xFFFFFFFF
            self._markers = self._plant.markers(now_ns)

    def receive(self, now_ns: int) -> None:  # noqa: ARG002 - an answer depends on the last frame, not on the instant
        """Answers each complete command by one write."""
        *lines, rest = (self._input + self._wire.read()).split(b"\r")
        self._input = rest[: MAX_COMMAND + 1]
        for line in lines:
            if not self.silent:
                self._wire.write(self._damaged(self._answer(line)))

    def _damaged(self, reply: bytes) -> bytes:
        self._replies += 1
        if not self.corrupt_every or self._replies % self.corrupt_every:
            return reply
        middle = len(reply) // 2
        return reply[:middle] + bytes([reply[middle] ^ 0x01]) + reply[middle + 1 :]

    def _answer(self, line: bytes) -> bytes:
        try:
            name, params = parse_command(line)
            modes, handler = self._commands.get(name, (None, None))
            if modes is None or handler is None:
                raise CommandRefused(0x01)
            if self._mode not in modes:
                raise CommandRefused(0x10 if self._mode == "reset" else 0x0C)
            reply = handler(params)
        except CommandRefused as refusal:
            reply = f"ERROR{refusal.code:02X}"
        return encode_binary(reply) if isinstance(reply, bytes) else encode_text(reply)

    def _reset(self, _: str) -> str:
        self._mode = "reset"
        self._ports.power_up()
        return "RESET"

    def _initialise(self, _: str) -> str:
        """Ends tracking; port handles stay, which the manual's front matter leaves open."""
        self._ports.initialise_system()
        self._mode = "setup"
        return "OKAY"

    def _version(self, params: str) -> str:
        if params == "5":
            return self.freeze_tag.split()[-1]
        if params not in ("0", "4"):
            raise CommandRefused(0x07)
        return (
            f"{self._product}\nNDI S/N: {self._serial}\nCharacterization Date: 01/02/03\n"
            f"Freeze Tag: {self.freeze_tag}\nFreeze Date: 01/02/03\n(C) Northern Digital Inc.\n"
        )

    def _information(self, params: str) -> str:
        if params not in ("", _FIRMWARE, "Features.Firmware.*"):
            raise CommandRefused(0x34)
        return f"{_FIRMWARE}=007.000.012;3;1;0;12;;Current firmware revision number"

    def _communication(self, params: str) -> str:
        """A pseudo-terminal has no speed to change, a TCP connection has no COMM."""
        if self._is_tcp:
            raise CommandRefused(0x01)
        if not _COMM.fullmatch(params):
            raise CommandRefused(0x07)
        return "OKAY"

    def _start(self, params: str) -> str:
        if params not in ("", "40", "80"):
            raise CommandRefused(0x07)
        if params == "80":
            self._frame = 0
        self._mode = "tracking"
        return "OKAY"

    def _stop(self, _: str) -> str:
        self._mode = "setup"
        return "OKAY"

    def _tx(self, params: str) -> str:
        options = self._options(params)
        return replies.encode_tx(self._readings(), self._system_status(), options)

    def _bx(self, params: str) -> bytes:
        options = self._options(params)
        return replies.encode_bx(self._readings(), self._system_status(), options)

    def _options(self, params: str) -> int:
        """Reply options; markers of their own (0002, 0004, 0008) the mock does not have."""
        if self.error_reply is not None:
            raise CommandRefused(self.error_reply)
        if params and not _OPTIONS.fullmatch(params):
            raise CommandRefused(0x07)
        options = int(params or "0001", 16)
        if not options & replies.TRANSFORMS or options & ~_TRACKING_OPTIONS:
            raise CommandRefused(0x23)
        return options

    def _system_status(self) -> int:
        return SYSTEM_PORT_UNOCCUPIED if self.unplugged else 0

    def _readings(self) -> list[replies.ToolReading]:
        readings = []
        for handle in self._ports.tracked():
            if not self._ports.in_port(handle):
                readings.append(replies.ToolReading(handle.number, replies.DISABLED))
                continue
            seen = self._seen(handle.tool)
            status = self._ports.status(handle)
            readings.append(replies.ToolReading(handle.number, seen or replies.MISSING, status, self._frame))
        return readings

    def _seen(self, tool: int | None) -> replies.Pose | None:
        if tool is None or tool in self.missing or tool >= len(self._markers):
            return None
        marker = self._markers[tool]
        if marker is None:
            return None
        x_mm, y_mm, z_mm, q0, qx, qy, qz, error_mm = marker
        return replies.Pose(q0, qx, qy, qz, x_mm, y_mm, z_mm, error_mm)


def parse_command(line: bytes) -> tuple[str, str]:
    """Name and parameters of a command without its CR; raises CommandRefused: too long, unknown form, checksum."""
    if len(line) > MAX_COMMAND:
        raise CommandRefused(0x02)
    text = line.decode("latin-1")
    match = _COMMAND.fullmatch(text)
    if not match:
        raise CommandRefused(0x01)
    name, separator, rest = match.groups(default="")
    if separator != ":":
        return name, rest.strip()
    if f"{crc16_arc(line[:-4]):04X}" != text[-4:]:
        raise CommandRefused(0x04)
    return name, text[len(name) + 1 : -4]
