"""From a silent port to a tracker that tracks: the conversation before the first frame.

Everything here waits, always with a deadline, and ends in DeviceError with one sentence where the device does not
follow. The order is the manual's: INIT, VER, COMM on a serial line, port handles (PHSR, PHF, PHRQ, PVWR, PINIT, PENA).
"""

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from drivers.ndi import codec, replies
from drivers.ports import Port, read_until
from drivers.roles import Identity
from rig.errors import DeviceError, UsageError

POWER_UP_BAUD = 9600
TRACKING_BAUD = 115200
_TO_115200 = "50000"
_TO_9600 = "00000"
# The manual gives the device 100 ms to change its speed after OKAY.
_COMM_SETTLE_S = 0.1
_REPLY_S = 2.0
# Wired tools are read out during PINIT, which took 2.6 s on an Aurora (IGSTK recording of 28 September 2005).
_SLOW_REPLY_S = 5.0
_PROBE_S = 1.0
_RESET_S = 3.0

ROM_BYTES = 1024
_ROM_CHUNK = 64
_ROM_MAGIC = b"NDI\0"
_ALL, _STALE, _UNINITIALISED, _NOT_ENABLED, _ENABLED = "00", "01", "02", "03", "04"


class Dialogue:
    """One command, one reply."""

    def __init__(self, port: Port, decoder: codec.ReplyDecoder, now: Callable[[], int]) -> None:
        self.port = port
        self.fast = self.tracking = False
        self.warnings: list[str] = []
        self._decoder = decoder
        self._now = now

    @property
    def serial(self) -> bool:
        """Whether there is a line with a speed."""
        return not self.port.address.startswith("tcp://")

    def ask(self, name: str, params: str = "", timeout_s: float = _REPLY_S) -> str:
        """The reply's text; raises DeviceError on silence, on bytes that are no reply, and on ERROR."""
        self.send(name, params)
        return self._checked(name, self.wait(name, timeout_s))

    def tell(self, name: str, params: str = "", timeout_s: float = _REPLY_S) -> None:
        """Waits for OKAY or WARNING; a late reply to an earlier command is passed over."""
        self.send(name, params)
        text = self._checked(name, self.wait(name, timeout_s, lambda text: text.startswith(("OKAY", "WARN", "ERROR"))))
        if replies.is_warning(text):
            self.warnings.append(f"{name}:{params}")

    def send(self, name: str, params: str = "") -> None:
        """Sends a command; what came unasked before it is dropped and counted."""
        self._decoder.feed(self.port.read())
        self._decoder.reset()
        self.port.write(codec.encode_command(name, params))

    def wait(self, name: str, timeout_s: float, accept: Callable[[str], bool] = bool) -> str:
        """The next text reply that is acceptable; raises DeviceError when the time is over."""
        deadline_ns = self._now() + round(timeout_s * 1e9)
        heard = 0
        while (left_ns := deadline_ns - self._now()) > 0:
            data = read_until(self.port, bool, left_ns / 1e9)
            heard += len(data)
            for reply in self._decoder.feed(data):
                if isinstance(reply, codec.TextReply) and accept(reply.text):
                    return reply.text
        raise DeviceError(f"{self.port.address}: {name} brought {_heard(heard)} within {timeout_s:g} s")

    def _checked(self, name: str, text: str) -> str:
        code = replies.parse_error(text)
        if code is not None:
            raise DeviceError(f"{self.port.address}: the tracker refused {name} ({replies.error_words(code)})")
        return text


def _heard(count: int) -> str:
    if count:
        return f"{count} bytes but no reply of an NDI tracker; check that no other device is on this port"
    return "no reply; check power, cable and the port's name"


def initialise(dialogue: Dialogue) -> None:
    """INIT; on a serial line the tracker may have been left at another speed, which a break undoes."""
    if not dialogue.serial:
        dialogue.tell("INIT", timeout_s=_SLOW_REPLY_S)
        return
    try:
        dialogue.tell("INIT", timeout_s=_PROBE_S)
    except DeviceError as error:
        if not (_reset(dialogue) or _answers_at_tracking_speed(dialogue)):
            raise error
        dialogue.tell("INIT", timeout_s=_SLOW_REPLY_S)


def _reset(dialogue: Dialogue) -> bool:
    dialogue.port.send_break()
    try:
        dialogue.wait("a serial break", _RESET_S, lambda text: text == "RESET")
    except DeviceError:
        return False
    return True


def _answers_at_tracking_speed(dialogue: Dialogue) -> bool:
    """For lines that lose a break, as adapters over a network do."""
    dialogue.port.set_baud(TRACKING_BAUD)
    try:
        dialogue.tell("INIT", timeout_s=_PROBE_S)
    except DeviceError:
        dialogue.port.set_baud(POWER_UP_BAUD)
        return False
    return True


def identify(dialogue: Dialogue) -> Identity:
    """Product, serial number and firmware by VER, and by GETINFO where the firmware has it."""
    text = dialogue.ask("VER", "0")
    version = replies.parse_version(text)
    if version is None:
        raise DeviceError(
            f"{dialogue.port.address}: VER answered {text[:60]!r}, which is no NDI position sensor; check the port"
        )
    dialogue.send("GETINFO", "Features.Firmware.Version")
    information = replies.parse_info(dialogue.wait("GETINFO", _REPLY_S))
    firmware = information.get("Features.Firmware.Version", version.freeze_tag)
    return Identity(version.product, version.serial, firmware, {"freeze_tag": version.freeze_tag})


def speed_up(dialogue: Dialogue) -> None:
    """On a serial line, 115200 baud: at 9600 a frame of two tools takes 0.1 s."""
    if dialogue.serial:
        dialogue.tell("COMM", _TO_115200)
        time.sleep(_COMM_SETTLE_S)
        dialogue.port.set_baud(TRACKING_BAUD)
        dialogue.fast = True


def read_roms(paths: Sequence[Path], tools: Sequence[str]) -> list[bytes]:
    """The tool definitions, 1024 bytes each; raises UsageError where a file is absent, foreign or too many."""
    if paths and len(paths) != len(tools):
        raise UsageError(
            f"tracker.roms: {len(paths)} files for {len(tools)} tools ({', '.join(tools)}); give one a tool"
        )
    return [_read_rom(path) for path in paths]


def _read_rom(path: Path) -> bytes:
    try:
        data = path.read_bytes()[:ROM_BYTES]
    except OSError as error:
        raise UsageError(f"{path}: the tool definition cannot be read: {error.strerror}") from error
    if not data.startswith(_ROM_MAGIC):
        raise UsageError(f"{path}: not a tool definition (it does not start with the letters NDI and a zero byte)")
    return data.ljust(ROM_BYTES, b"\0")


def load_tools(dialogue: Dialogue, roms: Sequence[bytes], tools: Sequence[str]) -> list[int]:
    """Enables the tools and gives their handles in the order of ``tools``."""
    # Definitions left by an earlier session would be tracked a second time beside the new ones.
    for port in _handles(dialogue, _ALL if roms else _STALE):
        dialogue.tell("PHF", f"{port.handle:02X}")
    loaded = [_load(dialogue, rom) for rom in roms]
    for port in _handles(dialogue, _UNINITIALISED):
        if not roms or port.handle in loaded:
            dialogue.tell("PINIT", f"{port.handle:02X}", _SLOW_REPLY_S)
    for port in _handles(dialogue, _NOT_ENABLED):
        dialogue.tell("PENA", f"{port.handle:02X}D")
    enabled = [port.handle for port in _handles(dialogue, _ENABLED)]
    handles = [handle for handle in loaded if handle in enabled] if roms else sorted(enabled)
    if len(handles) != len(tools):
        raise DeviceError(
            f"{dialogue.port.address}: {len(handles)} tools are enabled where the configuration names {len(tools)}"
            f" ({', '.join(tools)}); plug them in, or give tracker.roms"
        )
    return handles


def _handles(dialogue: Dialogue, kind: str) -> tuple[replies.PortHandle, ...]:
    text = dialogue.ask("PHSR", kind)
    handles = replies.parse_handles(text)
    if handles is None:
        raise DeviceError(f"{dialogue.port.address}: PHSR:{kind} answered {text[:60]!r}, which is no list of handles")
    return handles


def _load(dialogue: Dialogue, rom: bytes) -> int:
    text = dialogue.ask("PHRQ", "*********1****")
    handle = replies.parse_handle(text)
    if handle is None:
        raise DeviceError(f"{dialogue.port.address}: PHRQ answered {text[:60]!r}, which is no handle")
    for at in range(0, ROM_BYTES, _ROM_CHUNK):
        dialogue.tell("PVWR", f"{handle:02X}{at:04X}{rom[at : at + _ROM_CHUNK].hex().upper()}")
    return handle


def start_tracking(dialogue: Dialogue) -> None:
    """From here on the frame counter is read by BX or TX."""
    dialogue.tell("TSTART", timeout_s=_SLOW_REPLY_S)
    dialogue.tracking = True


def leave(dialogue: Dialogue, timeout_s: float) -> None:
    """Stops tracking and leaves a serial tracker at its power-up speed, for whoever comes next."""
    if dialogue.tracking:
        dialogue.tell("TSTOP", timeout_s=timeout_s)
    if dialogue.fast:
        dialogue.tell("COMM", _TO_9600, timeout_s)
