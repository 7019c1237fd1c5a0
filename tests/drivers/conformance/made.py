"""A sensor on a clock in the test's hand, with one defect or none: what the kit must say of each."""

import contextlib
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

from pydantic import Field

from drivers.roles import Identity, LinkCounters
from drivers.testing.under_test import AnyDevice, UnderTest
from rig.channels import ForceSample
from rig.config.products.roles import ForceProduct
from rig.errors import DeviceError

MS = 1_000_000


class MadeProduct(ForceProduct):
    """A sensor of 50 N at 200 Hz."""

    range_N = 50.0
    range_N_m = 1.0
    driver = "tests.drivers.conformance.made:MadeSensor"
    advice = "force.port"

    product: str = "made"
    rate_Hz: float = Field(default=200.0, description="samples a second")


@dataclass
class World:
    """Time, the load on the sensor, the faults of its wire, and what the driver does wrong."""

    defect: str = ""
    now_ns: int = 1_000_000_000
    load_N: float = 0.0
    faults: set[str] = field(default_factory=set)
    opened: int = 0

    def fault(self, kind: str, value: bool | float) -> None:
        if kind == "heal":
            self.faults.clear()
        elif value:
            self.faults.add(kind)
        else:
            self.faults.discard(kind)

    def wait(self, device: AnyDevice, seconds: float) -> bool:
        self.now_ns += round(seconds * 1e9)
        return not self.faults and self.defect != "deaf"

    def sleep(self, seconds: float) -> None:
        self.now_ns += round(seconds * 1e9)

    def put_on(self, load_N: float) -> None:
        self.load_N = load_N

    def subject(self) -> UnderTest:
        return UnderTest(
            MadeProduct(),
            lambda: MadeSensor(self),
            self.fault,
            damage=("drop", "corrupt"),
            load=self.put_on,
            now=lambda: self.now_ns,
            wait=self.wait,
            sleep=self.sleep,
        )


class MadeSensor:
    """Samples every 5 ms, arriving in twos; 3 N m and -1 N sideways."""

    def __init__(self, world: World) -> None:
        world.opened += 1
        self.world, self.counters, self.next_seq = world, LinkCounters(), 0
        self.identity, self.period_ns = Identity("", "", ""), 5 * MS
        self.fd = os.eventfd(0)
        self.due_ns, self.closed = world.now_ns, False
        self.polled_ns, self.dazed = world.now_ns, False

    def has(self, defect: str) -> bool:
        return self.world.defect == defect

    def start(self) -> None:
        serial = "" if self.has("nameless") else str(self.world.opened if self.has("another") else 7)
        self.identity = Identity("MADE", serial, "1")
        self.due_ns = self.world.now_ns

    def fileno(self) -> int:
        return self.fd

    def poll(self, now_ns: int) -> Sequence[ForceSample]:
        if self.closed:
            return self.closed_poll()
        self.world.now_ns += 3 * MS if self.has("blocks") else 0
        away_ns, self.polled_ns = now_ns - self.polled_ns, now_ns
        if self.has("impatient") and away_ns > 500 * MS:
            raise DeviceError("no answer for 0.5 s")
        self.dazed = self.dazed or (self.has("dazed") and away_ns > 500 * MS)
        step_ns = 2 * self.period_ns if self.has("slow") else self.period_ns
        samples = []
        while now_ns - self.due_ns >= 2 * step_ns:
            samples += [self.sample(self.due_ns, now_ns), self.sample(self.due_ns + step_ns, now_ns)]
            self.due_ns += 2 * step_ns
        return self.through_wire(samples)

    def through_wire(self, samples: list[ForceSample]) -> list[ForceSample]:
        faults = self.world.faults
        if "unplug" in faults and not self.has("never lost"):
            raise KeyError("unplugged") if self.has("lost oddly") else DeviceError("the line is gone")
        if "corrupt" in faults and samples:
            if self.has("breaks"):
                raise IndexError("list index out of range")
            self.counters.checksum_errors += not self.has("uncounted")
            if not self.has("believes"):
                return []
            return [sample._replace(fx_N=3e8) for sample in samples]
        if "drop" in faults and samples:
            self.counters.device_lost += 1
            return []
        return samples

    def sample(self, capture_ns: int, now_ns: int) -> ForceSample:
        if self.has("clockless"):
            capture_ns = now_ns
        elif self.has("back"):
            capture_ns -= 40 * MS * (self.next_seq % 50 == 49)
        elif self.has("ahead"):
            capture_ns = now_ns + MS
        self.next_seq += 2 if self.has("skips") else 1
        fz_N = -self.world.load_N * {"millinewton": 1000.0, "pounds": 0.2248, "sign": -1.0}.get(self.world.defect, 1.0)
        return ForceSample(self.next_seq - 1, capture_ns, now_ns, 0, -1.0, 0.0, fz_N, *(0.0,) * 3, 20.0, 0,
                           int(not (self.has("invalid") or self.dazed)))  # fmt: skip

    def closed_poll(self) -> list[ForceSample]:
        if self.has("closed oddly"):
            raise AttributeError("'NoneType' object has no attribute 'read'")
        raise DeviceError("closed")

    def close(self) -> None:
        if self.closed and self.has("once"):
            raise OSError("closed already")
        if not self.closed and not self.has("leaks"):
            os.close(self.fd)
        self.closed = True


@contextlib.contextmanager
def nothing_left(descriptors: Callable[[], set[str]]) -> Iterator[None]:
    """Closes what a leaking driver leaves."""
    before = descriptors()
    yield
    for left in descriptors() - before:
        with contextlib.suppress(OSError):
            os.close(int(left))
