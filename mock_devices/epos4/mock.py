"""A maxon EPOS4 behind an SLCAN adapter: NMT, heartbeats both ways, emergency, SYNC, PDOs and SDOs of one node.

Behaviour follows CiA 301/402 and what is published of the EPOS4: errors of communication brake on the quick stop ramp
and end in fault (object 6007), the node then leaves Operational (object 1029); PDOs have neither event timer nor sub 4.
"""

import struct
from collections import deque
from collections.abc import Callable

from drivers.can.slcan import CanFrame
from drivers.canopen.nmt import EMERGENCY_ID, HEARTBEAT_ID, SDO_REQUEST_ID, SDO_RESPONSE_ID, SYNC, NmtCommand, NmtState
from drivers.epos4.faults import FAULTS, UNKNOWN
from drivers.epos4.objects import SENSOR_RESOLUTION, SERIAL
from mock_devices.can.bus_adapter import BusAdapter
from mock_devices.can.slcan_adapter import SlcanAdapter
from mock_devices.canopen.sdo_server import SdoServer
from mock_devices.cia402.table import ObjectTable
from mock_devices.epos4 import torque
from mock_devices.epos4.dictionary import Dictionary
from mock_devices.epos4.drive import Drive
from mock_devices.epos4.pdo import ProcessData
from mock_devices.epos4.table import EPOS4
from mock_devices.interfaces import NEVER_NS, AxisPlant
from mock_devices.wire import OnWire, Wire

MS = 1_000_000
BOOT_NS = 50 * MS
PROFILE_NS = MS
WATCH_NS = 10 * MS
LONGEST_STEP_NS = 20 * MS
SYNCS_KEPT = 10_000
HEARTBEAT_LOST = 0x8130
STRANGE_VENDOR, STRANGE_PRODUCT = 0x0000_024A, 0x0001_0002


class Epos4Mock(OnWire):
    """One drive on ``plant``, powered at ``start_ns``; its raw counter starts at 0 wherever the carriage stands.

    Failures of the device, plain attributes to be set at any time: ``silent`` neither hears nor sends anything;
    ``frozen`` repeats the position it had; ``wrong_identity`` has another maker and product; ``unguarded`` watches
    neither heartbeats nor software limits nor its following error. ``inject_fault(code)`` makes an error happen; a
    ``lasting`` one comes back at each reset until ``inject_fault(0)``. ``lead_astray(mm/s)`` falsifies set-points more
    and more on their way to the position loop.
    ``increments_per_mm`` is negative where increments shrink into the tissue.
    """

    name = "axis"

    def __init__(
        self,
        wire: Wire,
        plant: AxisPlant,
        start_ns: int,
        node: int = 1,
        increments_per_mm: float = 2000.0,
        increments_per_rev: float = 10_000.0,
        clock_ns: Callable[[], int] | None = None,
        number: int = int(SERIAL.default),
        table: ObjectTable = EPOS4,
        speed_unit: float = 0.0,
        adapter: BusAdapter | None = None,
    ) -> None:
        super().__init__(wire)
        self.serial_number = f"{number:08X}"
        self.silent = self.wrong_identity = False
        self.node = node
        self.nmt = NmtState.BOOT_UP
        self.dictionary = Dictionary(node, table)
        self.drive = Drive(plant, self.dictionary, self._report, increments_per_mm, increments_per_rev, speed_unit)
        self._plant = plant
        self._adapter = adapter or SlcanAdapter(wire)
        self._sdo = SdoServer(self.dictionary.read, self.dictionary.write)
        self._pdo = ProcessData(self.dictionary, self._send, self.drive.fault)
        self._frozen_at: int | None = None
        self._error_register = self._error_code = 0
        self._boot_due_ns = start_ns + BOOT_NS
        self._beat_due_ns = self._motion_due_ns = NEVER_NS
        self._moved_ns = start_ns
        self._now_ns = start_ns
        self._consumed: dict[int, int] = {}
        self._scale, self._astray_per_s, self._astray_since_ns = increments_per_mm, 0.0, start_ns
        self.synced_ns: deque[int] = deque(maxlen=SYNCS_KEPT)
        """When SYNCs were taken, by ``clock_ns`` where there is one; whoever wants them takes them out."""
        self._clock_ns = clock_ns
        self._connect()
        self.dictionary.live[SENSOR_RESOLUTION.index, SENSOR_RESOLUTION.sub] = lambda: round(increments_per_rev)

    @property
    def unguarded(self) -> bool:
        """Whether its own watch over heartbeats, software limits and following error does nothing."""
        return self.drive.unguarded

    @unguarded.setter
    def unguarded(self, unguarded: bool) -> None:
        self.drive.unguarded = unguarded

    @property
    def frozen(self) -> bool:
        """Whether the position it reports stands still."""
        return self._frozen_at is not None

    @frozen.setter
    def frozen(self, frozen: bool) -> None:
        self._frozen_at = self.drive.position if frozen else None

    @property
    def due_ns(self) -> int:
        """The next of: end of boot-up, heartbeat to send, heartbeat missed, step of a profile."""
        return min(self._boot_due_ns, self._beat_due_ns, self._motion_due_ns, *self._consumed.values())

    def endpoints(self) -> dict[str, str]:
        """Kind of port to address."""
        return {"slcan": self._wire.endpoint}

    def inject_fault(self, code: int, lasting: bool = False) -> None:
        """Makes error ``code`` happen; 0 only removes a lasting cause."""
        self.drive.cause = code if lasting else 0
        if code:
            self.drive.fault(code)
            self._schedule()
            self._adapter.flush()

    def lead_astray(self, speed_mm_s: float) -> None:
        """From now on set-points run away from those that were sent, until 0."""
        self._astray_per_s, self._astray_since_ns = speed_mm_s * self._scale, self._now_ns

    def restart(self) -> None:
        """Loses its power for a moment: no torque, no reference, and settings as from the factory."""
        self._restart(whole=True)
        self._schedule()

    def receive(self, now_ns: int) -> None:
        """Takes what the client sent, and answers."""
        self._now_ns = now_ns
        for frame in self._adapter.receive():
            if not (self.silent or frame.extended or frame.remote):
                self._take(frame)
        self._settle()

    def tick(self, now_ns: int) -> None:
        """Does what is due."""
        self._now_ns = now_ns
        if now_ns >= self._boot_due_ns:
            self._booted()
        if now_ns >= self._beat_due_ns:
            self._beat()
        if any(now_ns >= deadline for deadline in self._consumed.values()):
            self.receive(now_ns)
            self._check_heartbeats()
        if now_ns >= self._motion_due_ns:
            self.drive.tick(min(now_ns - self._moved_ns, LONGEST_STEP_NS) / 1e9)
            self._moved_ns = now_ns
            self._motion_due_ns = NEVER_NS
        self._settle()

    def _settle(self) -> None:
        if self.nmt is NmtState.OPERATIONAL:
            self._pdo.send_changes(self._now_ns)
        self._schedule()
        self._adapter.flush()

    def _schedule(self) -> None:
        """A profile wants a step each millisecond, a held position is only watched."""
        if not self.drive.powered:
            self._motion_due_ns = NEVER_NS
            return
        due_ns = self._now_ns + (PROFILE_NS if self.drive.moving else WATCH_NS)
        if due_ns < self._motion_due_ns:
            self._moved_ns = self._now_ns
            self._motion_due_ns = due_ns

    def _take(self, frame: CanFrame) -> None:
        can_id, data = frame.can_id, frame.data
        if can_id == SYNC.can_id:
            if self.nmt is NmtState.OPERATIONAL:
                self.synced_ns.append(self._clock_ns() if self._clock_ns else self._now_ns)
                self._pdo.sync()
        elif can_id in self._pdo.rpdos:
            if self.nmt is NmtState.OPERATIONAL:
                self.drive.astray = self._astray_per_s * (self._now_ns - self._astray_since_ns) * 1e-9
                self._pdo.take(can_id, data)
        elif can_id == SDO_REQUEST_ID + self.node:
            if self.nmt in (NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL):
                self._send(SDO_RESPONSE_ID + self.node, self._sdo.answer(data))
        elif can_id == 0x000:
            if len(data) == 2 and data[1] in (0, self.node):
                self._command(data[0])
        elif can_id > HEARTBEAT_ID and len(data) == 1:
            self._heard(can_id - HEARTBEAT_ID)

    def _send(self, can_id: int, data: bytes) -> None:
        if data and not self.silent:
            self._adapter.send(can_id, data, self._now_ns)

    # NMT and heartbeats

    def _command(self, command: int) -> None:
        states = {
            NmtCommand.START: NmtState.OPERATIONAL,
            NmtCommand.STOP: NmtState.STOPPED,
            NmtCommand.ENTER_PRE_OPERATIONAL: NmtState.PRE_OPERATIONAL,
        }
        if self.nmt is NmtState.BOOT_UP:
            return
        if command in (NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION):
            self._restart(command == NmtCommand.RESET_NODE)
        elif command in tuple(states):
            self._enter(states[NmtCommand(command)])

    def _enter(self, state: NmtState) -> None:
        self.nmt = state
        self.drive.remote = state is NmtState.OPERATIONAL
        self._pdo.forget()

    def _restart(self, whole: bool) -> None:
        self.dictionary.reset(0, 0xFFFF if whole else 0x1FFF)
        self._enter(NmtState.BOOT_UP)
        self._error_register = self._error_code = 0
        self._consumed.clear()
        self._beat_due_ns = NEVER_NS
        self._boot_due_ns = self._now_ns + BOOT_NS
        if whole:
            self.drive.restart()
        self._pdo.compile()

    def _booted(self) -> None:
        self._boot_due_ns = NEVER_NS
        self._send(HEARTBEAT_ID + self.node, bytes((NmtState.BOOT_UP,)))
        self._enter(NmtState.PRE_OPERATIONAL)

    def _beat(self) -> None:
        period_ns = self.dictionary.values[0x1017, 0] * MS
        late = (self._now_ns - self._beat_due_ns) // period_ns
        self._beat_due_ns += (late + 1) * period_ns
        if self.nmt is not NmtState.BOOT_UP:
            self._send(HEARTBEAT_ID + self.node, bytes((self.nmt,)))

    def _heard(self, node: int) -> None:
        """Watching a producer starts with its first heartbeat (CiA 301, object 1016)."""
        for sub in (1, 2):
            entry = self.dictionary.values[0x1016, sub]
            if entry >> 16 & 0x7F == node and entry & 0xFFFF:
                self._consumed[sub] = self._now_ns + (entry & 0xFFFF) * MS

    def _check_heartbeats(self) -> None:
        lost = [sub for sub, deadline_ns in self._consumed.items() if self._now_ns >= deadline_ns]
        for sub in lost:
            del self._consumed[sub]
        if lost and not self.unguarded:
            self.drive.fault(HEARTBEAT_LOST)
            self._leave_operational()

    def _leave_operational(self) -> None:
        behaviour = self.dictionary.values[0x1029, 1]
        if behaviour == 2:
            self._enter(NmtState.STOPPED)
        elif behaviour == 0 and self.nmt is NmtState.OPERATIONAL:
            self._enter(NmtState.PRE_OPERATIONAL)

    def _report(self, code: int) -> None:
        """An error goes into the history and out as an emergency message; 0 says it was reset."""
        values = self.dictionary.values
        self._error_code = code
        self._error_register = FAULTS.get(code, UNKNOWN).register if code else 0
        if code:
            for sub in (5, 4, 3, 2):
                values[0x1003, sub] = values[0x1003, sub - 1]
            values[0x1003, 1] = code
            values[0x1003, 0] = min(values[0x1003, 0] + 1, 5)
        if self.nmt in (NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL):
            self._send(EMERGENCY_ID + self.node, struct.pack("<HB5x", code, self._error_register))

    # The dictionary's live side

    def _connect(self) -> None:
        drive, plant, values = self.drive, self._plant, self.dictionary.values
        self.dictionary.live.update(
            {
                (0x1001, 0): lambda: self._error_register,
                (0x1018, 1): lambda: STRANGE_VENDOR if self.wrong_identity else values[0x1018, 1],
                (0x1018, 2): lambda: STRANGE_PRODUCT if self.wrong_identity else values[0x1018, 2],
                (0x1018, 4): lambda: int(self.serial_number, 16),
                (0x30D1, 1): lambda: drive.current_mA,
                (0x30D1, 2): lambda: drive.current_mA,
                (0x30D2, 1): lambda: torque.per_mille(values, drive.current_mA),
                (0x30D3, 1): lambda: drive.rpm,
                (0x3141, 1): lambda: int(plant.at_reference),
                (0x603F, 0): lambda: self._error_code,
                (0x6041, 0): lambda: drive.status,
                (0x6061, 0): lambda: drive.mode,
                (0x6062, 0): lambda: drive.demand,
                (0x6064, 0): lambda: drive.position if self._frozen_at is None else self._frozen_at,
                (0x606B, 0): lambda: drive.rpm,
                (0x606C, 0): lambda: drive.rpm,
                (0x6077, 0): lambda: torque.per_mille(values, drive.current_mA),
                (0x6078, 0): lambda: round(1000 * drive.current_mA / max(values[0x6075, 0], 1)),
                (0x60F4, 0): lambda: drive.following_error,
                (0x60FD, 0): lambda: int(plant.at_reference),
            }
        )
        self.dictionary.hooks.update(
            {
                (0x1003, 0): self._clear_history,
                (0x1017, 0): self._set_producer,
                (0x1016, 1): lambda _: self._forget_producer(1),
                (0x1016, 2): lambda _: self._forget_producer(2),
                (0x3001, 2): self._set_current_limit,
                (0x6073, 0): lambda share: self._set_current_limit(share * values[0x6075, 0] // 1000),
                (0x6040, 0): drive.control,
                (0x6060, 0): drive.set_mode,
                (0x607A, 0): drive.set_target,
            }
        )
        self.dictionary.pdo_changed = self._pdo.compile
        self._pdo.compile()

    def _clear_history(self, _count: int) -> None:
        for sub in range(1, 6):
            self.dictionary.values[0x1003, sub] = 0

    def _forget_producer(self, sub: int) -> None:
        self._consumed.pop(sub, None)

    def _set_producer(self, period_ms: int) -> None:
        self._beat_due_ns = self._now_ns + period_ms * MS if period_ms else NEVER_NS

    def _set_current_limit(self, limit_mA: int) -> None:
        self._plant.current_limit_A = limit_mA / 1000
