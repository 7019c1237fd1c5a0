"""ATI Net F/T: six channels as counts over UDP (RDT), what a count is over HTTP (`netftapi2.xml`).

A request is eight bytes, a record 36, all big-endian, as in the maker's manual 9620-05-NET FT. The stream goes on until
it is stopped, whoever listens; a request from elsewhere takes it over. UDP's own checksum keeps damaged records away;
what is lost shows in the RDT sequence. The F/T sequence counts the sensor's internal clock, 7,000 a second.
"""

import contextlib
import http.client
import math
import re
import select
import struct
import time
import urllib.request
from collections.abc import Callable, Sequence
from typing import ClassVar, Literal, NamedTuple

from pydantic import Field

from drivers.roles import Identity, LinkCounters
from drivers.udp_port import UdpPort, udp_address
from rig.channels import ForceSample
from rig.config.products.roles import ForceProduct, MockPort
from rig.errors import DeviceError, UsageError
from rig.timing import ClockMap, Unwrapper

RDT_PORT, HTTP_PORT = 49152, 80
INTERNAL_HZ = 7000
REQUEST, RECORD = struct.Struct(">HHI"), struct.Struct(">IIIiiiiii")
HEADER, STOP, STREAM = 0x1234, 0, 2
# A web page of an embedded processor on the same switch; ATI's own example waits two seconds.
HTTP_S = 2.0
# The slowest stream, 10 Hz, then brings its first record; a request that was lost is repeated.
FIRST_RECORD_S, TRIES = 0.5, 3
NEWTON = {"N": 1.0, "kN": 1e3, "lbf": 4.4482216152605, "klbf": 4448.2216152605, "kgf": 9.80665}
NEWTON_METRE = {
    "Nm": 1.0,
    "N-m": 1.0,
    "Nmm": 1e-3,
    "kNm": 1e3,
    "lbf-in": 0.1129848290276167,
    "lbf-ft": 1.3558179483314004,
}


class NetFtWiring(ForceProduct):
    """An ATI Net F/T behind its Net Box: records by UDP at the port, its settings by HTTP at the same host."""

    driver: ClassVar[str] = "rig_netft.netft:open_sensor"
    mock: ClassVar[MockPort | None] = MockPort("rig_netft.mock:make", "netft", "udp", "udp://")
    advice: ClassVar[str] = (
        "its power, the network, force.port (udp://HOST:49152), and that no other client takes its stream"
    )
    # Gamma SI-130-10, its smallest channel; the sensors of this family differ: yours has a data sheet.
    range_N: ClassVar[float] = 130.0
    range_N_m: ClassVar[float] = 10.0

    product: Literal["ati-netft"] = Field(default="ati-netft", description="what stands on the bench")
    rate_Hz: float = Field(default=1000, ge=10, le=INTERNAL_HZ, description="records a second; it gives 7000 / n")
    http_port: int = Field(
        default=0, ge=0, le=65535, description="of its web page; 0: 80, and that of RDT where this is not 49152"
    )

    @property
    def sampled_Hz(self) -> float:
        """The next rate above the one asked for that divides its internal clock."""
        return INTERNAL_HZ / (INTERNAL_HZ // self.rate_Hz)


class Scale(NamedTuple):
    """Newton and newton metre of one count, and who the sensor is."""

    N: float
    N_m: float
    identity: Identity


class Record(NamedTuple):
    """One record: numbers of packet and of internal clock, status (0: healthy), and counts of six channels."""

    rdt: int
    tick: int
    status: int
    counts: tuple[int, ...]


def request(command: int, count: int = 0) -> bytes:
    """Asks for ``count`` records, 0 for all there will be."""
    return REQUEST.pack(HEADER, command, count)


def parse(datagram: bytes) -> Record | None:
    """The record in a datagram; None where it has another length."""
    if len(datagram) != RECORD.size:
        return None
    rdt, tick, status, *counts = RECORD.unpack(datagram)
    return Record(rdt, tick, status, tuple(counts))


def scale_of(page: str, product: str) -> Scale:
    """What `netftapi2.xml` says; raises DeviceError where a unit is unknown or a count missing."""
    said = dict(re.findall(r"<(\w+)>([^<]*)</\1>", page))
    try:
        per_N = float(said["cfgcpf"]) / NEWTON[said["scfgfu"]]
        per_N_m = float(said["cfgcpt"]) / NEWTON_METRE[said["scfgtu"]]
        if not (0 < per_N < math.inf and 0 < per_N_m < math.inf):
            raise ValueError(f"{per_N:g} counts for 1 N and {per_N_m:g} for 1 N m")
        return Scale(
            1 / per_N,
            1 / per_N_m,
            Identity(said.get("prodname", "Net F/T"), said["cfgcalsn"], said.get("mfgdigver", "")),
        )
    except (KeyError, ValueError, ZeroDivisionError) as error:
        raise DeviceError(
            f"{product}: netftapi2.xml says no {error} it could be read by; set its units to N and Nm on its web page"
        ) from error


class NetFt:
    """Owns ``port`` until ``close``. ``page`` gets a page of the sensor's web server."""

    def __init__(
        self, port: UdpPort, config: NetFtWiring, page: Callable[[str], str], now: Callable[[], int] = time.monotonic_ns
    ) -> None:
        self.counters, self.next_seq = LinkCounters(), 0
        self.identity = Identity(config.product, "", "")
        self.period_ns = round(1e9 / config.sampled_Hz)
        self._port, self._config, self._page, self._now = port, config, page, now
        self._clock = ClockMap(round(config.latency_ms * 1e6))
        self._first: list[bytes] = []
        self._restart()

    def _restart(self) -> None:
        self._rdt, self._ticks = Unwrapper(32), Unwrapper(32)
        self._last_rdt: int | None = None
        self._clock.restart()

    def start(self) -> None:
        """Asks who it is and what a count is, sets its rate, and starts its records."""
        product = self._config.product
        self._page(f"comm.cgi?comrdte=1&comrdtrate={math.floor(self._config.sampled_Hz)}")
        self._scale = scale_of(self._page("netftapi2.xml"), product)
        self.identity = self._scale.identity
        self._port.write(request(STOP))
        for _ in range(TRIES):
            list(self._port.datagrams())
            self._port.write(request(STREAM))
            if select.select([self._port], [], [], FIRST_RECORD_S)[0]:
                self._restart()
                return
        raise DeviceError(
            f"{product} at {self._port.address}: no record within {TRIES * FIRST_RECORD_S:g} s of {TRIES} requests,"
            " though its web page answers; check that RDT is enabled there and that no firewall keeps UDP away"
        )

    def fileno(self) -> int:
        """Descriptor that turns readable when a record has come."""
        return self._port.fileno()

    def poll(self, now_ns: int) -> Sequence[ForceSample]:
        """Samples since the last call."""
        records = [record for record in map(self._heard, self._port.datagrams()) if record]
        arrival_ns = max(now_ns, self._now())
        ticks = [(self._ticks(record.tick), record) for record in records]
        devices_ns = [tick * 1_000_000_000 // INTERNAL_HZ for tick, _ in ticks]
        for device_ns in devices_ns:
            self._clock.observe(device_ns, arrival_ns)
        captures_ns = self._clock.captures(devices_ns, arrival_ns)
        return [
            self._sample(record, device_ns // 1000, capture_ns, arrival_ns)
            for (_, record), device_ns, capture_ns in zip(ticks, devices_ns, captures_ns, strict=True)
        ]

    def _heard(self, datagram: bytes) -> Record | None:
        """A record that is new; the others are counted."""
        record = parse(datagram)
        if record is None:
            self.counters.discarded_bytes += len(datagram)
            return None
        number = self._rdt(record.rdt)
        step = 1 if self._last_rdt is None else number - self._last_rdt
        if step <= 0:  # twice, or overtaken by one that was sent later
            self.counters.repeated += 1
            return None
        self._last_rdt = number
        self.counters.frames += 1
        self.counters.device_lost += step - 1
        return record

    def _sample(self, record: Record, device_us: int, capture_ns: int, arrival_ns: int) -> ForceSample:
        self.next_seq += 1
        fx_N, fy_N, fz_N = (count * self._scale.N for count in record.counts[:3])
        mx_N_m, my_N_m, mz_N_m = (count * self._scale.N_m for count in record.counts[3:])
        valid = int(record.status == 0)
        return ForceSample(
            self.next_seq - 1, capture_ns, arrival_ns, device_us,
            fx_N, fy_N, fz_N, mx_N_m, my_N_m, mz_N_m, math.nan, record.status, valid,
        )  # fmt: skip

    def close(self) -> None:
        """Stops the stream, which would go on without a listener, and gives the port back."""
        with contextlib.suppress(DeviceError):
            self._port.write(request(STOP))
        self._port.close()


def page_of(host: str, port: int, product: str) -> Callable[[str], str]:
    """What gets a page from the sensor's web server, within two seconds."""

    def page(name: str) -> str:
        url = f"http://{host}:{port}/{name}"
        try:
            with urllib.request.urlopen(url, timeout=HTTP_S) as answer:
                return str(answer.read().decode("utf-8", "replace"))
        except (OSError, http.client.HTTPException) as error:
            raise DeviceError(
                f"{product}: {url} does not answer ({error}); check its power, cable and force.port"
            ) from error

    return page


def open_sensor(config: NetFtWiring) -> NetFt:
    """The sensor at the configured port, not yet started."""
    if not config.port.startswith("udp://"):
        raise UsageError(f"force.port {config.port}: an {config.product} is at udp://HOST:{RDT_PORT}")
    host, port = udp_address(config.port)
    http_port = config.http_port or (HTTP_PORT if port == RDT_PORT else port)
    return NetFt(UdpPort(host, port, largest=RECORD.size + 64), config, page_of(host, http_port, config.product))
