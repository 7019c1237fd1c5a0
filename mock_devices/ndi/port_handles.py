"""The port handles of the mock tracker: what is plugged in or loaded, initialised, enabled."""

from dataclasses import dataclass, field

IN_PORT, INITIALISED, ENABLED = 0x01, 0x10, 0x20
ROM_BYTES = 1024  # what sixteen PVWR of 64 bytes fill (Polaris API guide)
# What PHSR asks for: which status bits it looks at, and how they must be.
_SEARCHES = {"00": (0x00, 0x00), "01": (0x01, 0x00), "02": (0x11, 0x01), "03": (0x31, 0x11), "04": (0x20, 0x20)}


class CommandRefused(Exception):
    """The command ends in this ERROR code."""

    def __init__(self, code: int) -> None:
        super().__init__(f"ERROR{code:02X}")
        self.code = code


@dataclass
class Handle:
    """One port handle; ``tool`` is the index of the marker it follows, None for a definition without a marker."""

    number: int
    tool: int | None
    wired: bool
    rom: bytearray = field(default_factory=bytearray)
    initialised: bool = False
    enabled: bool = False

    @property
    def occupied(self) -> bool:
        """A tool is plugged in, or a definition has been written."""
        return self.wired or bool(self.rom)


class PortHandles:
    """At power-up each tool sits in a port of its own; further handles are asked for by PHRQ and filled by PVWR.

    INIT frees them. Where handles ``outlive_init``, definitions loaded since follow the tools in the order in which
    they were written, and those loaded before follow theirs too, as two handles with one definition do on the device.
    """

    def __init__(self, names: tuple[str, ...]) -> None:
        self._names = names
        self.unplugged: set[int] = set()
        self.outlive_init = False
        self.power_up()

    def power_up(self) -> None:
        """Forgets everything but what is plugged in."""
        self._handles = {index + 1: Handle(index + 1, index, wired=True) for index in range(len(self._names))}
        self._earlier: set[int] = set()

    def initialise_system(self) -> None:
        """INIT: what was loaded is freed; where it is not, definitions are counted anew."""
        if not self.outlive_init:
            self.power_up()
        self._earlier = set(self._handles)

    def tracked(self) -> list[Handle]:
        """What a TX or BX reply reports on, in order of handles."""
        return [handle for _, handle in sorted(self._handles.items()) if handle.enabled]

    def in_port(self, handle: Handle) -> bool:
        """Whether the handle's tool is there."""
        return handle.occupied and handle.tool not in self.unplugged

    def status(self, handle: Handle) -> int:
        """Port status bits."""
        bits = IN_PORT * self.in_port(handle) | INITIALISED * handle.initialised | ENABLED * handle.enabled
        return bits if self.in_port(handle) else 0

    def search(self, params: str) -> str:
        """PHSR: all handles, or those to be freed, initialised, enabled, or enabled already."""
        if (params or "00") not in _SEARCHES:
            raise CommandRefused(0x23)
        mask, value = _SEARCHES[params or "00"]
        found = [(number, self.status(handle)) for number, handle in sorted(self._handles.items())]
        listed = [f"{number:02X}{status:03X}" for number, status in found if status & mask == value]
        return f"{len(listed):02X}{''.join(listed)}"

    def request(self, params: str) -> str:
        """PHRQ: a new handle for a definition to be written."""
        if len(params) != 14:
            raise CommandRefused(0x07)
        free = [number for number in range(1, 0x19) if number not in self._handles]
        if not free:
            raise CommandRefused(0x2D)
        self._handles[free[0]] = Handle(free[0], None, wired=False)
        return f"{free[0]:02X}"

    def write(self, params: str) -> str:
        """PVWR: 64 bytes of a definition at an address."""
        handle = self._find(params)
        if len(params) != 2 + 4 + 128:
            raise CommandRefused(0x07)
        address, data = _hex(params[2:6]), _hex(params[6:]).to_bytes(64)
        if address + 64 > ROM_BYTES:
            raise CommandRefused(0x23)
        if handle.wired:
            raise CommandRefused(0x2F)
        if not handle.rom:
            handle.tool = self._next_tool()
        handle.rom = handle.rom.ljust(ROM_BYTES, b"\0")
        handle.rom[address : address + 64] = data
        return "OKAY"

    def _next_tool(self) -> int | None:
        mine = [handle for number, handle in self._handles.items() if number not in self._earlier]
        taken = {handle.tool for handle in mine if not handle.wired}
        return next((index for index in range(len(self._names)) if index not in taken), None)

    def initialise(self, params: str) -> str:
        """PINIT."""
        handle = self._find(params)
        if not self.in_port(handle):
            raise CommandRefused(0x0D)
        handle.initialised = True
        return "OKAY"

    def enable(self, params: str) -> str:
        """PENA: handle and tracking priority."""
        handle = self._find(params)
        if params[2:] not in ("S", "D", "B"):
            raise CommandRefused(0x09)
        if not handle.initialised:
            raise CommandRefused(0x0E)
        handle.enabled = True
        return "OKAY"

    def disable(self, params: str) -> str:
        """PDIS; refused for a tool pulled out, as a Polaris does."""
        handle = self._find(params)
        if not self.in_port(handle):
            raise CommandRefused(0x08)
        handle.enabled = False
        return "OKAY"

    def free(self, params: str) -> str:
        """PHF; a tool that stays plugged in is offered again, uninitialised, under the same handle."""
        handle = self._find(params)
        del self._handles[handle.number]
        self._earlier.discard(handle.number)
        if handle.wired and handle.tool not in self.unplugged:
            self._handles[handle.number] = Handle(handle.number, handle.tool, wired=True)
        return "OKAY"

    def describe(self, params: str) -> str:
        """PHINF: the basic block (0001), part number (0004) and port location (0020)."""
        handle = self._find(params)
        options = _hex(params[2:] or "0001")
        if options == 0 or options & ~0x0025:
            raise CommandRefused(0x23)
        if not self.in_port(handle):
            return "UNOCCUPIED"
        basic = f"02000000{'tissue-rig':<12}001{handle.number:08X}{self.status(handle):02X}"
        name = "" if handle.tool is None else self._names[handle.tool]
        place = f"{'':<10}{handle.number if handle.wired else 0:02d}00"
        return basic * (options & 1) + f"{name:<20.20}" * (options >> 2 & 1) + place * (options >> 5 & 1)

    def _find(self, params: str) -> Handle:
        number = _hex(params[:2])
        if number not in self._handles:
            raise CommandRefused(0x08)
        return self._handles[number]


def _hex(digits: str) -> int:
    """A number in either case, as the clients of the maker and of others write it."""
    if not digits or set(digits) - set("0123456789ABCDEFabcdef"):
        raise CommandRefused(0x07)
    return int(digits, 16)
