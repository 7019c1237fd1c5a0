"""How true the capture times are: `python -m benchmarks.clock [--seconds 20]`; the last line is one JSON object.

A mock bench with that sensor tells when each sample was really taken, on this computer's monotonic clock. Both serial
force sensors are read by their drivers in the loop's own cyclic executive, a millisecond a cycle, in step with the
sensor where its rate allows it and with the loop's priority where that is granted, idle and with a busy process for
each core. No second is left out for settling. For comparison: how late samples arrive, and arrival less the delay that
is known, which is what there would be without a clock map.
"""

import argparse
import contextlib
import json
import multiprocessing
import os
import struct
import sys
import time
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from api.cli.mock_bench import bench_process
from benchmarks.about import head
from controller.devices.drivers import open_force
from controller.loop.executive import Cycle, Executive, sleep_then_spin
from controller.loop.phase_lock import PhaseLock
from controller.loop.realtime import acquire, spin_ns
from drivers.robotiq.codec import FRAME_NS, to_counts
from drivers.roles import ForceSensor
from mock_devices.control import BenchControl
from rig.channels import ForceSample
from rig.config.products.registry import FORCE_SENSORS
from rig.config.wiring import Loop, Wiring

PERIOD_NS = round(1e9 / Loop().rate_Hz)
COLLECT_NS = 500_000_000
LIMIT_MS = 0.2
KNOWN_NS = {"bota-sensone": 0, "robotiq-ft300": FRAME_NS}
RUNS = tuple((product, load) for product in KNOWN_NS for load in ("idle", "loaded"))
# The first sample comes a moment after the sensor was started.
LEAST_SHARE = 0.9


@dataclass(frozen=True)
class Row:
    """One sensor under one load; times in ms, errors without their sign."""

    product: str
    load: str
    expected: int
    samples: int
    unmatched: int
    not_increasing: int
    error_p50: float
    error_p99: float
    error_max: float
    arrival_p50: float
    arrival_p99: float
    plain_p99: float


def mark(product: str, sample: ForceSample) -> int:
    """What stands in a sample and in the mock's own list of it, see ``BenchControl.sampled``."""
    if product == "bota-sensone":
        return sample.device_us
    return int.from_bytes(struct.pack("<6h", *to_counts(sample[4:10])), "little")


class Listening:
    """A loop's work that only reads: samples, and marks and times of all that were taken."""

    def __init__(self, sensor: ForceSensor, control: BenchControl, role: str, seconds: float) -> None:
        self.samples, self.taken = list[ForceSample](), list[tuple[int, int]]()
        self.phase = PhaseLock(PERIOD_NS, sensor.period_ns)
        self._sensor, self._control, self._role = sensor, control, role
        self._collect_ns = time.monotonic_ns()
        self._end_ns = self._collect_ns + round(seconds * 1e9)

    def catch_up(self, now_ns: int) -> None:
        """Of the tracker nothing is wanted."""

    def prepare(self, now_ns: int) -> None:
        """Asks twice a second what was taken, which may cost a cycle."""
        if now_ns >= self._collect_ns:
            self.taken += self._control.sampled(self._role)
            self._collect_ns = now_ns + COLLECT_NS

    def take_force(self, now_ns: int) -> None:
        """What the sensor said, for the phase too."""
        for sample in self._sensor.poll(now_ns):
            self.samples.append(sample)
            self.phase.observe(sample.capture_ns, sample.arrival_ns)

    def run_cycle(self, cycle: Cycle) -> bool:
        """Until the time is over, and then all that was taken."""
        going_on = cycle.wake_ns < self._end_ns
        while not going_on and (more := self._control.sampled(self._role)):
            self.taken += more
        return going_on


def truths_ns(product: str, samples: Sequence[ForceSample], taken: Sequence[tuple[int, int]]) -> list[int | None]:
    """When each sample was taken; None where the bench did not say so. Both go upwards in time."""
    waiting, found = deque(taken), list[int | None]()
    marks = {each for each, _ in taken}
    for sample in samples:
        wanted = mark(product, sample)
        while wanted in marks and waiting and waiting[0][0] != wanted:
            waiting.popleft()
        found.append(waiting.popleft()[1] if wanted in marks and waiting else None)
    return found


def row(product: str, load: str, expected: int, samples: Sequence[ForceSample], truth_ns: Sequence[int | None]) -> Row:
    """The figures of one run."""
    pairs = [(sample, true_ns) for sample, true_ns in zip(samples, truth_ns, strict=True) if true_ns is not None]
    error_ms = np.abs([(sample.capture_ns - true_ns) * 1e-6 for sample, true_ns in pairs])
    arrival_ms = np.array([(sample.arrival_ns - true_ns) * 1e-6 for sample, true_ns in pairs])
    plain_ms = np.abs(arrival_ms - KNOWN_NS[product] * 1e-6)
    backward = sum(late.capture_ns <= early.capture_ns for early, late in pairwise(samples))
    figures = [*percentiles(error_ms, 50, 99, 100), *percentiles(arrival_ms, 50, 99), *percentiles(plain_ms, 99)]
    return Row(product, load, expected, len(samples), len(samples) - len(pairs), backward, *figures)


def percentiles(values: NDArray[np.float64], *shares: float) -> list[float]:
    """Percentiles to a tenth of a microsecond."""
    return [round(float(np.percentile(values, share)), 4) for share in shares]


def measured(product: str, load: str, seconds: float, priority: int) -> Row:
    """One run on a bench of its own; takes the process' priority, and what it starts would inherit that."""
    kind = FORCE_SENSORS[product]
    assert kind.mock
    role = kind.mock.role
    with contextlib.ExitStack() as stack:
        _, endpoints = stack.enter_context(bench_process(Wiring.model_validate({"force": {"product": product}})))
        control = stack.enter_context(BenchControl(endpoints.control))
        config = kind(port=kind.mock.address(endpoints))
        sensor = stack.enter_context(contextlib.closing(open_force(config)))
        granted = acquire(priority)
        sensor.start()
        listening = Listening(sensor, control, role, seconds)
        Executive(sleep=sleep_then_spin(spin_ns(granted))).run(listening, listening.phase)
    samples = listening.samples
    return row(product, load, round(seconds * config.sampled_Hz), samples, truths_ns(product, samples, listening.taken))


def spin() -> None:
    """Keeps a core busy."""
    while True:
        pass


@contextlib.contextmanager
def busy(load: str) -> Iterator[None]:
    """A spinning process for each core, where ``load`` says so."""
    context = multiprocessing.get_context("spawn")
    cores = os.cpu_count() or 1
    workers = [context.Process(target=spin, daemon=True) for _ in range(cores if load == "loaded" else 0)]
    for worker in workers:
        worker.start()
    try:
        yield
        if not all(worker.is_alive() for worker in workers):
            raise SystemExit("a process of the load ended by itself")
    finally:
        for worker in workers:
            worker.kill()
            worker.join()


def alone() -> ProcessPoolExecutor:
    """A process for one run."""
    return ProcessPoolExecutor(1, multiprocessing.get_context("spawn"))


def main() -> int:
    """Prints a table and one JSON object; 1 where a 99th percentile of errors is not below 0.2 ms or samples lack."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.clock", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=20.0, help="of each of the four runs")
    parser.add_argument("--priority", type=int, default=Loop().priority, help="SCHED_FIFO priority to ask for; 0: none")
    options = parser.parse_args()
    rows = list[Row]()
    print(head("clock"))
    names = ("expected", "samples", "unmatched", "not_increasing", "error_p50", "error_p99", "error_max", "arrival_p50",
             "arrival_p99", "plain_p99")  # fmt: skip
    sys.stdout.write(f"{'times in ms':22}" + "".join(f"{name:>15}" for name in names) + "\n")
    for product, load in RUNS:
        with busy(load), alone() as process:
            rows.append(process.submit(measured, product, load, options.seconds, options.priority).result())
        figures = asdict(rows[-1])
        sys.stdout.write(f"{product + ', ' + load:22}" + "".join(f"{figures[name]:>15}" for name in names) + "\n")
        sys.stdout.flush()
    found = missed(rows)
    worst = max(each.error_p99 for each in rows)
    print("missed: " + ("; ".join(found) or "nothing"))
    told = {"error_p99_ms": worst, "limit_ms": LIMIT_MS, "ok": not found, "missed": found}
    print(json.dumps(told | {"runs": [asdict(each) for each in rows]}))
    return int(bool(found))


def missed(rows: Sequence[Row]) -> list[str]:
    """What was not reached, a sentence each."""
    runs = {(each.product, each.load) for each in rows}
    lacking = [f"{product}, {load}: was not measured" for product, load in RUNS if (product, load) not in runs]
    return lacking + [f"{each.product}, {each.load}: {said}" for each in rows for said in _missed_in(each)]


def _missed_in(run: Row) -> Iterator[str]:
    if run.samples < LEAST_SHARE * run.expected:
        yield f"{run.samples} of {run.expected} samples came"
    if run.unmatched:
        yield f"{run.unmatched} samples that the bench never took"
    if run.not_increasing:
        yield f"{run.not_increasing} capture times do not rise"
    if not run.error_p99 < LIMIT_MS:
        yield f"99 of 100 capture times off by up to {run.error_p99:g} ms, not below {LIMIT_MS:g} ms"


if __name__ == "__main__":
    sys.exit(main())
