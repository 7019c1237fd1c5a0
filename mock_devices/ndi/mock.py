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
from mock_devices.ndi import gbf
from mock_devices.ndi.encoding import ALL_OPTIONS, Point, Scene, encode_bx, encode_tx
from mock_devices.ndi.port_handles import CommandRefused, PortHandles
from mock_devices.ndi.user_parameters import UserParameters
from mock_devices.wire import OnWire, Wire

FRAME_HZ = 60
MAX_COMMAND = 1024  # the longest command, PVWR with its 64 bytes, has 144 characters: more is a line that never ends
SYSTEM_PORT_UNOCCUPIED = 0x0080
_COMMAND = re.compile(r"([A-Z0-9]+)(?:([: ])(.*))?", re.DOTALL)
_COMM = re.compile(r"[0-7A][01][012][01][01]")
_OPTIONS = re.compile(r"[0-9A-Fa-f]{4}")
_PRODUCTS = {
    "polaris": ("Polaris Control Firmware", "P4-00001", "POLARIS Rev 021", "D.001.007"),
    "vega": ("Polaris Vega Control Firmware", "P9-00001", "Polaris Vega 024", "G.003.005"),
}

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

    ``strays`` are markers that belong to no tool; ``keeps_handles``: INIT does not free what was loaded.

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
        self._product, self._serial, self.freeze_tag, self._revision = _PRODUCTS[kind]
        self._parameters = UserParameters(self._serial, self._product)
        self.strays: Sequence[Point] = ()
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
            "APIREV": (_ALWAYS, lambda _: self._revision),
            "GETINFO": (_ALWAYS, self._parameters.describe),
            "GET": (_ALWAYS, self._parameters.get),
            "SET": (_ALWAYS, self._parameters.set),
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
            "BX2": (_TRACKING, self._bx2),
        }

    @property
    def unplugged(self) -> set[int]:
        """Indexes of tools pulled out of their ports."""
        return self._ports.unplugged

    @unplugged.setter
    def unplugged(self, tools: set[int]) -> None:
        self._ports.unplugged = tools

    @property
    def keeps_handles(self) -> bool:
        """Whether what was loaded outlives INIT, as with firmware that leaves freeing to the client."""
        return self._ports.outlive_init

    @keeps_handles.setter
    def keeps_handles(self, keeps: bool) -> None:
        self._ports.outlive_init = keeps

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
        for line in (line.lstrip(b"\n") for line in lines):
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
        """Ends tracking and frees what was loaded."""
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
        return encode_tx(self._scene(), self._options(params))

    def _bx(self, params: str) -> bytes:
        return encode_bx(self._scene(), self._options(params))

    def _bx2(self, params: str) -> bytes:
        asked = gbf.parse_request(params)
        return gbf.encode(self._scene(), asked, self._frame, self._ticks * 1_000_000_000 // FRAME_HZ)

    def _options(self, params: str) -> int:
        """Reply options; none asked for are transforms."""
        if self.error_reply is not None:
            raise CommandRefused(self.error_reply)
        if params and not _OPTIONS.fullmatch(params):
            raise CommandRefused(0x07)
        options = int(params or "0001", 16)
        if not options or options & ~ALL_OPTIONS:
            raise CommandRefused(0x23)
        return options

    def _scene(self) -> Scene:
        return Scene(self._readings(), self.strays, self._system_status())

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
    if f"{crc16_arc(line[:-4]):04X}" != text[-4:].upper():
        raise CommandRefused(0x04)
    return name, text[len(name) + 1 : -4]
