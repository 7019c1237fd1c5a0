"""The object dictionary of the mock drive: defaults, access, ranges, and the rules for PDO parameters.

Plain values stand in ``values``; ``live`` objects are asked when read; ``hooks`` are called after a write was stored,
and may refuse it by raising SdoAbort, which puts the former value back.
"""

from collections import defaultdict
from collections.abc import Callable

from drivers.epos4.objects import DISABLED, MAX_MAPPED, TEXT, Entry
from mock_devices.canopen.sdo_server import SdoAbort
from mock_devices.cia402.table import Key, ObjectTable

WRITE_ONLY, READ_ONLY, NO_OBJECT, NOT_MAPPABLE, TOO_LONG = (
    0x06010001, 0x06010002, 0x06020000, 0x06040041, 0x06040042
)  # fmt: skip
WRONG_LENGTH, NO_SUB, OUT_OF_RANGE = 0x06070010, 0x06090011, 0x06090030
NOT_STORED, WRONG_STATE = 0x08000020, 0x08000022
SIGNATURES = {(0x1010, 1): 0x65766173, (0x1011, 1): 0x64616F6C}
"""What must be written to store or restore parameters: ``save`` and ``load``."""
TYPES = frozenset((*range(241), 253, 255))


class Dictionary:
    """Objects of node ``node`` by index and sub-index, of the kind that ``table`` says."""

    def __init__(self, node: int, table: ObjectTable) -> None:
        self.table = table
        self.objects = table.objects
        self.values: defaultdict[Key, int] = defaultdict(int)  # an object it does not have counts as 0
        self.live: dict[Key, Callable[[], int]] = {}
        self.hooks: dict[Key, Callable[[int], None]] = {}
        self.pdo_changed: Callable[[], None] = lambda: None
        self._node = node
        self.reset()

    def reset(self, first: int = 0, last: int = 0xFFFF) -> None:
        """Defaults for the objects from index ``first`` to ``last``."""
        for key, entry in self.objects.items():
            if first <= key[0] <= last and isinstance(entry.default, int):
                default = self.table.delivered.get(key, entry.default)
                self.values[key] = default + (self._node if entry.by_node else 0)

    def value(self, index: int, sub: int = 0) -> int:
        """The value of a known object now."""
        key = (index, sub)
        return self.live[key]() if key in self.live else self.values[key]

    def read(self, index: int, sub: int) -> bytes:
        """What an SDO upload gets; raises SdoAbort."""
        entry = self._entry(index, sub)
        if entry.access == "wo":
            raise SdoAbort(WRITE_ONLY)
        if entry.kind == TEXT:
            return self.table.texts.get((index, sub), "").encode()
        return entry.pack(self.value(index, sub))

    def write(self, index: int, sub: int, data: bytes) -> None:
        """What an SDO download does; raises SdoAbort."""
        entry = self._entry(index, sub)
        if entry.access in ("ro", "ro+", "const"):
            raise SdoAbort(READ_ONLY)
        value = entry.unpack(data)
        if value is None:
            raise SdoAbort(WRONG_LENGTH)
        self.put(entry, value)

    def put(self, entry: Entry, value: int) -> None:
        """Stores a value of the right type, if range and rules allow it; raises SdoAbort."""
        self._check(entry, value)
        key = (entry.index, entry.sub)
        former, self.values[key] = self.values[key], value
        try:
            if key in self.hooks:
                self.hooks[key](value)
        except SdoAbort:
            self.values[key] = former
            raise
        if 0x1400 <= entry.index < 0x1C00:
            self.pdo_changed()

    def _entry(self, index: int, sub: int) -> Entry:
        try:
            return self.objects[index, sub]
        except KeyError:
            raise SdoAbort(NO_SUB if (index, 0) in self.objects else NO_OBJECT) from None

    def _check(self, entry: Entry, value: int) -> None:
        if (entry.low is not None and value < entry.low) or (entry.high is not None and value > entry.high):
            raise SdoAbort(OUT_OF_RANGE)
        if entry.index == 0x6098 and value not in self.table.homing_methods:
            raise SdoAbort(OUT_OF_RANGE)
        if (entry.index, entry.sub) in SIGNATURES and value != SIGNATURES[entry.index, entry.sub]:
            raise SdoAbort(NOT_STORED)
        if 0x1400 <= entry.index < 0x1600 or 0x1800 <= entry.index < 0x1A00:
            self._check_parameters(entry, value)
        elif 0x1600 <= entry.index < 0x1800 or 0x1A00 <= entry.index < 0x1C00:
            self._check_mapping(entry, value)

    def _check_parameters(self, entry: Entry, value: int) -> None:
        old = self.values[entry.index, entry.sub]
        if entry.sub == 1 and not (value | old) & DISABLED and value != old:
            raise SdoAbort(OUT_OF_RANGE)
        if entry.sub == 2 and value not in TYPES and value != entry.default:
            raise SdoAbort(OUT_OF_RANGE)
        if entry.sub == 3 and self._enabled(entry.index):
            raise SdoAbort(WRONG_STATE)

    def _check_mapping(self, entry: Entry, value: int) -> None:
        if self._enabled(entry.index - 0x200) or (entry.sub and self.values[entry.index, 0]):
            raise SdoAbort(WRONG_STATE)
        if entry.sub == 0:
            self._check_total(entry.index, value)
        elif value:
            self._check_mappable(value, receive=entry.index < 0x1800)

    def _check_total(self, mappings: int, count: int) -> None:
        mapped = [self.values[mappings, sub] for sub in range(1, min(count, MAX_MAPPED) + 1)]
        if sum(entry & 0xFF for entry in mapped) > 64:
            raise SdoAbort(TOO_LONG)
        if not all(mapped):
            raise SdoAbort(NOT_MAPPABLE)

    def _check_mappable(self, value: int, receive: bool) -> None:
        entry = self.objects.get((value >> 16, value >> 8 & 0xFF))
        allowed = "rw+" if receive else "ro+"
        if entry is None or entry.access != allowed or entry.size * 8 != value & 0xFF:
            raise SdoAbort(NOT_MAPPABLE)

    def _enabled(self, parameters: int) -> bool:
        return not self.values[parameters, 1] & DISABLED
