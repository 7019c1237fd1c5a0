"""The mock drive's process data: PDO parameters of the dictionary turned into what is needed at each SYNC."""

import struct
from collections.abc import Callable
from typing import NamedTuple

from drivers.epos4.objects import DISABLED, Entry
from mock_devices.canopen.sdo_server import SdoAbort
from mock_devices.epos4.dictionary import Dictionary
from mock_devices.interfaces import NEVER_NS

INHIBIT_UNIT_NS = 100_000
RPDOS, TPDOS = range(0x1400, 0x1404), range(0x1800, 0x1804)
LAST_SYNCHRONOUS, ON_REQUEST = 240, 253  # transmission types of CiA 301: up to it by SYNC, at 253 by remote frame
BAD_PARAMETER, TOO_SHORT = 0x6320, 0x8210


class Rpdo(NamedTuple):
    """A received PDO: how to take it apart and where its values go; ``synchronous`` ones wait for the SYNC."""

    layout: struct.Struct
    stores: tuple[Callable[[int], None], ...]
    synchronous: bool


class Tpdo(NamedTuple):
    """A sent PDO; ``every`` counts SYNCs, 0 means on change, at most once in ``inhibit_ns``."""

    cob_id: int
    layout: struct.Struct
    loads: tuple[Callable[[], int], ...]
    every: int
    inhibit_ns: int

    def data(self) -> bytes:
        """Its bytes now."""
        return self.layout.pack(*[load() for load in self.loads])


class ProcessData:
    """PDOs of one node; ``send`` takes identifier and bytes, ``fail`` is told error codes of received PDOs."""

    def __init__(self, dictionary: Dictionary, send: Callable[[int, bytes], None], fail: Callable[[int], None]) -> None:
        self.rpdos: dict[int, Rpdo] = {}
        self._dictionary = dictionary
        self._send = send
        self._fail = fail
        self._waiting: dict[int, bytes] = {}
        self._on_sync: list[Tpdo] = []
        self._on_change: list[Tpdo] = []
        self._sent: dict[int, tuple[int, bytes]] = {}
        self._syncs = 0

    def forget(self) -> None:
        """Nothing is waiting for a SYNC, and every PDO sent on change is new."""
        self._waiting.clear()
        self._sent.clear()

    def compile(self) -> None:
        """Takes the PDO parameters as they are now."""
        values = self._dictionary.values
        self.forget()
        self.rpdos = {values[index, 1] & 0x7FF: self._rpdo(index) for index in RPDOS if not values[index, 1] & DISABLED}
        tpdos = [
            self._tpdo(index)
            for index in TPDOS
            if not values[index, 1] & DISABLED and values[index + 0x200, 0] and values[index, 2] != ON_REQUEST
        ]
        self._on_sync = [tpdo for tpdo in tpdos if tpdo.every]
        self._on_change = [tpdo for tpdo in tpdos if not tpdo.every]

    def sync(self) -> None:
        """Set-points that waited become effective, actual values go out."""
        self._syncs += 1
        for can_id, data in self._waiting.items():
            self._store(self.rpdos[can_id], data)
        self._waiting.clear()
        for tpdo in self._on_sync:
            if self._syncs % tpdo.every == 0:
                self._send(tpdo.cob_id, tpdo.data())

    def take(self, can_id: int, data: bytes) -> None:
        """A received PDO whose identifier is one of ``rpdos``."""
        rpdo = self.rpdos[can_id]
        if len(data) < rpdo.layout.size:
            self._fail(TOO_SHORT)
        elif rpdo.synchronous:
            self._waiting[can_id] = data
        else:
            self._store(rpdo, data)

    def send_changes(self, now_ns: int) -> None:
        """PDOs of type 255: what is different from the last time, not more often than the inhibit time allows."""
        for tpdo in self._on_change:
            data = tpdo.data()
            sent_ns, before = self._sent.get(tpdo.cob_id, (-NEVER_NS, b""))
            if data != before and now_ns - sent_ns >= tpdo.inhibit_ns:
                self._sent[tpdo.cob_id] = (now_ns, data)
                self._send(tpdo.cob_id, data)

    def _store(self, rpdo: Rpdo, data: bytes) -> None:
        for store, value in zip(rpdo.stores, rpdo.layout.unpack_from(data), strict=True):
            store(value)

    def _rpdo(self, index: int) -> Rpdo:
        entries = self._mapped(index)
        synchronous = self._dictionary.values[index, 2] <= LAST_SYNCHRONOUS
        return Rpdo(_layout(entries), tuple(map(self._storer, entries)), synchronous)

    def _tpdo(self, index: int) -> Tpdo:
        values, entries = self._dictionary.values, self._mapped(index)
        kind = values[index, 2]
        # Type 0 is sent at a SYNC after a change; sending it at each SYNC is within what its receiver must accept.
        every = max(kind, 1) if kind <= LAST_SYNCHRONOUS else 0
        loads = tuple(map(self._loader, entries))
        return Tpdo(values[index, 1] & 0x7FF, _layout(entries), loads, every, values[index, 3] * INHIBIT_UNIT_NS)

    def _mapped(self, index: int) -> list[Entry]:
        values = self._dictionary.values
        names = [values[index + 0x200, sub] for sub in range(1, values[index + 0x200, 0] + 1)]
        return [self._dictionary.objects[name >> 16, name >> 8 & 0xFF] for name in names]

    def _storer(self, entry: Entry) -> Callable[[int], None]:
        def store(value: int) -> None:
            try:
                self._dictionary.put(entry, value)
            except SdoAbort:
                self._fail(BAD_PARAMETER)

        return store

    def _loader(self, entry: Entry) -> Callable[[], int]:
        key = (entry.index, entry.sub)
        values = self._dictionary.values
        return self._dictionary.live.get(key) or (lambda: values[key])


def _layout(entries: list[Entry]) -> struct.Struct:
    return struct.Struct("<" + "".join(entry.kind for entry in entries))
