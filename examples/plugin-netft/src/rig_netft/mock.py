"""A simulated ATI Net F/T: records over UDP, settings over HTTP at the same port number, as one process serves both."""

import contextlib
import re
from collections.abc import Mapping

from mock_devices.devices import DeviceFactory
from mock_devices.faults.sensing import SENSOR_FAULTS
from mock_devices.faults.wires import FaultKind, faults_of, switching
from mock_devices.interfaces import NEVER_NS, SensorPlant
from mock_devices.parameters import Parameters
from mock_devices.played import MockDevice, number_of, served
from mock_devices.udp_wire import UdpWire
from mock_devices.wire import OnWire, TcpWire, Wire
from rig_netft.netft import HEADER, INTERNAL_HZ, RECORD, REQUEST, STOP, STREAM

COUNTS = 1_000_000
BIAS = 0x42
# Bit 31 of the status: something is wrong with what the record holds.
UNHEALTHY = 0x8000_0000
SERIAL = 27_462
LARGEST = 0x7FFF_FFFF
GET = re.compile(rb"GET /([\w.]+)(?:\?(\S*))? HTTP/1\.[01]\r\n")


class NetFtMock(OnWire):
    """The Net Box; ``silent``, ``frozen`` and ``invalid`` are its faults, ``pounds`` has it count in lbf."""

    name = "netft"

    def __init__(
        self, wire: Wire, web: Wire, plant: SensorPlant, start_ns: int, serial: int, latency_ms: float = 0.0
    ) -> None:
        super().__init__(wire)
        self.latency_ms = latency_ms
        self.serial_number = f"FT{serial}"
        self._web, self._plant, self._start_ns = web, plant, start_ns
        self.silent = self.frozen = self.invalid = self.pounds = False
        self._every = INTERNAL_HZ // 1000
        self._due_tick: int | None = None
        self._left = self._rdt = 0
        self._counts: tuple[int, ...] = (0,) * 6
        self._zero: tuple[int, ...] = (0,) * 6

    def endpoints(self) -> dict[str, str]:
        """Where records come from."""
        return {"udp": self._wire.endpoint}

    def filenos(self) -> list[int]:
        """Both sockets."""
        return [*self._wire.filenos(), *self._web.filenos()]

    @property
    def due_ns(self) -> int:
        """When the next record is sent."""
        return NEVER_NS if self._due_tick is None else self._start_ns + self._due_tick * 1_000_000_000 // INTERNAL_HZ

    def tick(self, now_ns: int) -> None:
        """Sends one record."""
        if self._due_tick is None:
            return
        if not self.silent:
            self._wire.write(self._record(self._due_tick))
        self._due_tick += self._every
        self._left -= 1
        if self._left == 0:
            self._due_tick = None

    def _record(self, tick: int) -> bytes:
        self._rdt += 1
        if not self.frozen:
            pairs = zip(self._measured(), self._zero, strict=True)
            self._counts = tuple(max(-LARGEST, min(now - zero, LARGEST)) for now, zero in pairs)
        status = UNHEALTHY if self.invalid or self._plant.overrange() else 0
        return RECORD.pack(self._rdt & 0xFFFF_FFFF, tick & 0xFFFF_FFFF, status, *self._counts)

    def _measured(self) -> tuple[int, ...]:
        unit_N = 4.4482216152605 if self.pounds else 1.0
        fx, fy, fz, *moments = self._plant.wrench()
        return tuple(round(value * COUNTS) for value in (fx / unit_N, fy / unit_N, fz / unit_N, *moments))

    def receive(self, now_ns: int) -> None:
        """Hears requests, and answers whoever asks for a page."""
        while data := self._wire.read():
            self._hear(data, now_ns)
        self._serve(self._web.read())

    def _hear(self, data: bytes, now_ns: int) -> None:
        if len(data) != REQUEST.size:
            return
        header, command, count = REQUEST.unpack(data)
        if header == HEADER and command == BIAS:
            self._zero = self._measured()
        if header != HEADER or command not in (STOP, STREAM):
            return
        self._left = count or -1
        self._rdt = 0
        now_tick = (now_ns - self._start_ns) * INTERNAL_HZ // 1_000_000_000
        self._due_tick = None if command == STOP else now_tick + 1

    def _serve(self, asked: bytes) -> None:
        found = GET.match(asked)
        if not found or not self._wire.filenos():  # without its cable it has no network at all
            return
        if found[1] == b"comm.cgi":
            self._set(found[2] or b"")
        body = self._page().encode()
        head = f"HTTP/1.0 200 OK\r\nContent-Type: text/xml\r\nContent-Length: {len(body)}\r\n\r\n".encode()
        self._web.write(head + body)

    def _set(self, query: bytes) -> None:
        rate = re.search(rb"comrdtrate=(\d+)", query)
        if rate:
            self._every = max(INTERNAL_HZ // max(int(rate[1]), 1), 1)

    def _page(self) -> str:
        unit = "lbf" if self.pounds else "N"
        return (
            f'<?xml version="1.0"?><netft><runstat>0x00000000</runstat><runrate>{INTERNAL_HZ}</runrate>'
            f"<cfgcalsn>{self.serial_number}</cfgcalsn><scfgfu>{unit}</scfgfu><scfgtu>Nm</scfgtu>"
            f"<cfgcpf>{COUNTS}</cfgcpf><cfgcpt>{COUNTS}</cfgcpt><comrdte>1</comrdte>"
            f"<comrdtrate>{INTERNAL_HZ // self._every}</comrdtrate>"
            "<mfgdigver>2.2.59</mfgdigver><prodname>Net F/T</prodname></netft>"
        )

    def close(self) -> None:
        """Cuts both."""
        self._wire.close()
        self._web.close()


NETFT_FAULTS: Mapping[str, FaultKind[NetFtMock]] = {
    "silent": FaultKind("sends no records", True, switching("silent")),
    "frozen": FaultKind("repeats the last counts", True, switching("frozen")),
    "invalid": FaultKind("sets the error bit of the status", True, switching("invalid")),
    "pounds": FaultKind("counts in pounds, and says so on its page", True, switching("pounds")),
}


def _ports() -> tuple[UdpWire, TcpWire]:
    """A port number that is free for both."""
    while True:
        udp = UdpWire()
        with contextlib.suppress(OSError):
            return udp, TcpWire(int(udp.endpoint.rpartition(":")[2]))
        udp.close()


def make(factory: DeviceFactory) -> list[MockDevice]:
    """The Net F/T in place of the bench's force sensor."""
    udp, web = _ports()
    wire, plant = factory.faulty(udp), factory.bench.force
    made_of = factory.bench.parameters.force
    serial = number_of(made_of, Parameters().force, SERIAL)
    mock = NetFtMock(wire, web, plant, factory.start_ns, serial, 1e3 * made_of.filter_s)
    return [served("netft", mock, wire, NETFT_FAULTS, faults_of(plant, SENSOR_FAULTS))]
