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

# One damaged reply is the line's noise, three in a row are its state.
TRIES = 3
# Invalid command, too long, too short, wrong checksum: nothing was done.
_MISHEARD = (0x01, 0x02, 0x03, 0x04)
_INVALID_HANDLE, _WRONG_MODE = 0x08, 0x0C

ROM_BYTES = 1024  # of a tool definition: PVWR writes 64 bytes at addresses up to 03C0 (Polaris API guide)
_ROM_CHUNK = 64
_ROM_MAGIC = b"NDI\0"
_ALL, _STALE, _UNINITIALISED, _NOT_ENABLED, _ENABLED = "00", "01", "02", "03", "04"


class Dialogue:
    """One command, one reply; ``repeats`` counts what was said again."""

    def __init__(self, port: Port, decoder: codec.ReplyDecoder, now: Callable[[], int]) -> None:
        self.port = port
        self.fast = self.tracking = False
        self.loaded: list[int] = []
        self.repeats = 0
        self.warnings: list[str] = []
        self._decoder = decoder
        self._now = now

    @property
    def serial(self) -> bool:
        """Whether there is a line with a speed."""
        return not self.port.address.startswith("tcp://")

    def ask(self, name: str, params: str = "", timeout_s: float = _REPLY_S) -> str:
        """The reply's text; raises DeviceError on silence, on bytes that are no reply, and on ERROR."""
        return self.checked(name, self.exchange(name, params, timeout_s))

    def tell(self, name: str, params: str = "", timeout_s: float = _REPLY_S, already: int = 0) -> None:
        """Waits for OKAY or WARNING; a late reply to an earlier command is passed over.

        ``already`` is the ERROR code by which a repeated command says that it was obeyed the first time.
        """
        repeats = self.repeats
        text = self.exchange(name, params, timeout_s, _is_verdict)
        if self.repeats == repeats or replies.parse_error(text) != already:
            self.checked(name, text)
        if replies.is_warning(text):
            self.warnings.append(f"{name}:{params}")

    def exchange(
        self,
        name: str,
        params: str = "",
        timeout_s: float = _REPLY_S,
        accept: Callable[[str], bool] = bool,
        damaged: str = "",
    ) -> str:
        """The reply's text, be it ERROR; what is damaged on its way, there or back, is said again.

        ``damaged`` is what a damaged reply is taken for, where the command must not be said again.
        """
        for _ in range(TRIES - 1):
            try:
                text = self.once(name, params, timeout_s, accept)
            except Damaged:
                text = damaged
            if text and replies.parse_error(text) not in _MISHEARD:
                return text
            self.repeats += 1
        return self.once(name, params, timeout_s, accept)

    def once(
        self, name: str, params: str = "", timeout_s: float = _REPLY_S, accept: Callable[[str], bool] = bool
    ) -> str:
        """The reply to a command that is not said again; what came unasked before it is dropped and counted."""
        self._decoder.feed(self.port.read())
        self._decoder.reset()
        self.port.write(codec.encode_command(name, params))
        return self.wait(name, timeout_s, accept)

    def wait(self, name: str, timeout_s: float, accept: Callable[[str], bool] = bool) -> str:
        """The next text reply that is acceptable; raises Damaged, or DeviceError when the time is over."""
        deadline_ns = self._now() + round(timeout_s * 1e9)
        heard, damaged = 0, self._decoder.checksum_errors
        while (left_ns := deadline_ns - self._now()) > 0:
            data = read_until(self.port, bool, left_ns / 1e9)
            heard += len(data)
            for reply in self._decoder.feed(data):
                if isinstance(reply, codec.TextReply) and accept(reply.text):
                    return reply.text
            if self._decoder.checksum_errors > damaged:
                raise Damaged(
                    f"{self.port.address}: {name} brought {_heard(heard)} and a good checksum; check its shield"
                )
        raise DeviceError(f"{self.port.address}: {name} brought {_heard(heard)} within {timeout_s:g} s")

    def checked(self, name: str, text: str) -> str:
        """``text``, unless it is an ERROR, which is raised as DeviceError."""
        code = replies.parse_error(text)
        if code is not None:
            raise DeviceError(f"{self.port.address}: the tracker refused {name} ({replies.error_words(code)})")
        return text


class Damaged(DeviceError):
    """A reply came whose checksum is wrong."""


def _is_verdict(text: str) -> bool:
    """Whether a reply says how a command went, and is no late tracking data."""
    return text.startswith(("OKAY", "WARN", "ERROR"))


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
    information = replies.parse_info(dialogue.exchange("GETINFO", "Features.Firmware.Version"))
    firmware = information.get("Features.Firmware.Version", version.freeze_tag)
    return Identity(version.product, version.serial, firmware, {"freeze_tag": version.freeze_tag})


def speed_up(dialogue: Dialogue) -> None:
    """On a serial line, 115200 baud: at 9600 a frame of two tools takes 0.1 s."""
    if dialogue.serial:
        # Not to be said again where the reply is damaged: the tracker is at the new speed by then.
        dialogue.checked("COMM", dialogue.exchange("COMM", _TO_115200, accept=_is_verdict, damaged="OKAY"))
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
    _free(dialogue, _handles(dialogue, _STALE))
    present = _handles(dialogue, _ALL)
    if roms or len(present) > len(tools):
        # INIT keeps what an earlier session loaded and did not free: it would be tracked beside the tools named here.
        _free(dialogue, present)
    loaded = [_load(dialogue, rom) for rom in roms]
    if dialogue.repeats:
        # A handle asked for twice is one too many, and empty.
        _free(dialogue, _handles(dialogue, _STALE))
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
            f" ({', '.join(tools)}); {_remedy(len(handles) > len(tools))}"
        )
    return handles


def _remedy(too_many: bool) -> str:
    return "unplug the others, or name them in tracker.tools" if too_many else "plug them in, or give tracker.roms"


def _free(dialogue: Dialogue, ports: Sequence[replies.PortHandle]) -> None:
    for port in ports:
        dialogue.tell("PHF", f"{port.handle:02X}", already=_INVALID_HANDLE)


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
    dialogue.loaded.append(handle)
    for at in range(0, ROM_BYTES, _ROM_CHUNK):
        dialogue.tell("PVWR", f"{handle:02X}{at:04X}{rom[at : at + _ROM_CHUNK].hex().upper()}")
    return handle


def start_tracking(dialogue: Dialogue) -> None:
    """From here on the frame counter is read by BX or TX."""
    dialogue.tell("TSTART", timeout_s=_SLOW_REPLY_S, already=_WRONG_MODE)
    dialogue.tracking = True


def leave(dialogue: Dialogue, timeout_s: float) -> None:
    """Stops tracking, frees what was loaded, leaves a serial tracker at its power-up speed: for whoever comes next."""
    if dialogue.tracking:
        dialogue.exchange("TSTOP", "", timeout_s, _is_verdict)
    for handle in dialogue.loaded:
        dialogue.exchange("PHF", f"{handle:02X}", timeout_s, _is_verdict)
    if dialogue.fast:
        dialogue.once("COMM", _TO_9600, timeout_s, _is_verdict)
