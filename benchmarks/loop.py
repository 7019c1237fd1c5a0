"""How punctual the loop is: `python -m benchmarks.loop [--seconds 10] [--rounds 2] [--json FILE]`.

The real loop runs on the mock bench behind `rig serve`, pressing and recording; `cyclictest` (Debian: rt-tests) runs on
the loop's core at the same rate and policy, one priority above, so that it sees the machine and not the loop. Phases
alternate, idle and with the HTTP interface under load (Debian: wrk), in one run. What counts are the
ratios. The table and the JSON are written after every round: a run may be ended with Ctrl-C at any time. The last line
is one JSON object.

Sensor to drive: from the moment at which the mock sensor took a sample to the moment at which the mock drive's process
has the SYNC and set-point made from it, both on the mock bench's clock, which is this computer's monotonic one.
"""

import argparse
import contextlib
import json
import math
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.client import HTTPConnection
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np
from numpy.typing import NDArray

from benchmarks.sensor_to_drive import chain_us, delays_us
from mock_devices.control import BenchControl
from mock_devices.testing.access import bearer
from mock_devices.testing.commands import RIG, ROOT, ServedBench, served_bench
from rig.channels import AXIS
from rig.config.wiring import Loop
from rig.recording.files import write_text
from rig.recording.reader import read_recording

PORT = 8123
CLIENTS = 4
TOO_MANY = 429
SETTLING_S = 1.0
# What a press takes besides its hold: homing is over, the rest is rest, approach and retraction.
PRESS_S = 10.0
COLLECT_S = 0.25
Summary = dict[str, float | None]
LEASE = {"holder": "benchmarks.loop", "ttl_s": 30.0}
PROTOCOL = (
    'kind = "indentation"\nspeeds_mm_s = [20]\ntrials = 1\ndepth_mm = 6\nair_dwell_s = 0.2\napproach_speed_mm_s = 20\n'
    "hold_s = {hold_s}\nretract_speed_mm_s = 20\nclearance_mm = 4\nforce_limit_N = 12\n"
)


@dataclass
class Load:
    """What was measured under one load; times in us."""

    wake_us: list[float] = field(default_factory=list)
    execution_us: list[float] = field(default_factory=list)
    to_drive_us: list[float] = field(default_factory=list)
    sensor_to_drive_us: list[float] = field(default_factory=list)
    answered_us: list[float] = field(default_factory=list)
    cycles: int = 0
    missed: int = 0
    reference_us: list[float] = field(default_factory=list)
    requests: int = 0
    busy_s: float = 0.0
    spoilt: int = 0


class Service:
    """`rig serve` in a process of its own, asked over HTTP."""

    def __init__(self, bench: ServedBench, folder: Path, hold_s: float) -> None:
        (folder / "protocols").mkdir()
        (folder / "protocols" / "hold.toml").write_text(PROTOCOL.format(hold_s=hold_s))
        command = [*RIG, "serve", "--port", str(PORT), "--sessions", str(folder / "sessions"), "--protocols",
                   str(folder / "protocols"), *bench.settings()]  # fmt: skip
        self._process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
        self.folder = folder
        self._headers: dict[str, str] = bearer()
        assert self._process.stdout and self._process.stdout.readline()
        self._headers |= {"X-Control-Lease": self.ask("POST", "/control/lease", LEASE)["lease_id"]}

    def ask(self, method: str, path: str, body: object = None) -> Any:
        """One request, again where the load has used up what a client may ask; its JSON."""
        while (answer := self._answer(method, path, body))[0] == TOO_MANY:
            time.sleep(0.1)
        assert answer[0] < 400, answer[1]
        return answer[1]

    def _answer(self, method: str, path: str, body: object) -> tuple[int, Any]:
        connection = HTTPConnection("127.0.0.1", PORT, timeout=60)
        text = None if body is None else json.dumps(body)
        connection.request(
            method,
            "/api/v1" + path,
            text,
            {"Content-Type": "application/json", "Idempotency-Key": uuid4().hex, **self._headers},
        )
        reply = connection.getresponse()
        content = json.loads(reply.read())
        connection.close()
        return reply.status, content

    def press(self, name: str) -> Path | None:
        """Runs the protocol into session ``name`` to its end; the recording, or None where it was stopped."""
        job = self.ask("POST", "/jobs", {"kind": "capture", "params": {"protocol": "hold", "session": name}})["id"]
        while self.ask("GET", f"/jobs/{job}")["state"] == "running":
            self.ask("PUT", "/control/lease")
            time.sleep(0.5)
        ended = self.ask("GET", f"/jobs/{job}")
        if ended["state"] == "succeeded":
            return self.folder / "sessions" / name / "trial_001.mcap"
        print(f"{name}: {ended['message']}", file=sys.stderr)
        self.ask("POST", "/estop/reset")
        return None

    def close(self) -> None:
        """Ends it."""
        self._process.terminate()
        self._process.wait(30)


def served(said: str) -> int:
    """Requests that were answered as asked, of what wrk says at its end."""
    whole = int(next(line for line in said.splitlines() if "requests in" in line).split()[0])
    refused = next((line for line in said.splitlines() if "Non-2xx" in line), ": 0")
    return whole - int(refused.rpartition(":")[2])


@contextmanager
def hammered(load: Load, seconds: float) -> Iterator[None]:
    """CLIENTS connections that ask for the bench's state without pause for ``seconds``; 0: none."""
    began = time.monotonic()
    (credential,) = (f"{name}: {value}" for name, value in bearer().items())
    command = ["wrk", "-t1", f"-c{CLIENTS}", f"-d{math.ceil(seconds)}s", "-H", credential,
               f"http://127.0.0.1:{PORT}/api/v1/rig"]  # fmt: skip
    client = subprocess.Popen(command, stdout=subprocess.PIPE, text=True) if seconds else None
    try:
        yield
    finally:
        if client:
            client.send_signal(signal.SIGINT)
            out, _ = client.communicate(timeout=30)
            load.requests += served(out)
            load.busy_s += time.monotonic() - began


class Arrivals:
    """Collects when the sensor took its samples and the drive its SYNCs, over a connection of its own."""

    def __init__(self, address: str) -> None:
        self.found_ns: list[int] = []
        self.taken: list[tuple[int, int]] = []
        self._control = BenchControl(address)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._collect)
        self._thread.start()

    def _collect(self) -> None:
        while not self._over.wait(COLLECT_S):
            self.found_ns += self._control.synced_ns()
            self.taken += self._control.sampled("force")

    def close(self) -> None:
        """Ends it."""
        self._over.set()
        self._thread.join()
        self._control.close()


def take(load: Load, recording: Path, arrivals: Arrivals) -> None:
    """Adds what the recording's streams say, and when the devices say it was."""
    tables = read_recording(recording).tables
    loop, axis = tables["loop"], tables[AXIS.name]
    loop = loop[loop["capture_ns"] > loop["capture_ns"][0] + SETTLING_S * 1e9]
    axis = axis[axis["capture_ns"] >= loop["capture_ns"][0]]
    load.wake_us += (loop["wake_latency_ns"] / 1000).tolist()
    load.execution_us += (loop["execution_ns"] / 1000).tolist()
    load.answered_us += ((axis["arrival_ns"] - axis["capture_ns"]) / 1000).tolist()
    load.to_drive_us += delays_us(axis["capture_ns"], arrivals.found_ns)
    chained = {"force": tables["force"], "loop": loop, "axis": axis}
    load.sensor_to_drive_us += chain_us(chained, arrivals.taken, arrivals.found_ns)
    load.cycles += int(loop["cycle"][-1] - loop["cycle"][0]) + 1
    load.missed += int(loop["missed"][-1] - loop["missed"][0])


def cyclictest(load: Load, seconds: float, core: int, priority: int, folder: Path) -> None:
    """Adds cyclictest's histogram, expanded."""
    file = folder / "cyclictest.json"
    command = ["cyclictest", "-q", "-t1", f"-a{core}", f"-p{priority}", "-i1000", f"-D{round(seconds)}s", "-h20000",
               "--mlockall", f"--json={file}"]  # fmt: skip
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    histogram = json.loads(file.read_text())["thread"]["0"]["histogram"]
    for latency_us, count in histogram.items():
        load.reference_us += [float(latency_us)] * int(count)


def summary(load: Load, period_us: float) -> Summary:
    """Percentiles, shares and ratios."""

    def at(values: list[float] | NDArray[np.float64], percent: float) -> float | None:
        return round(float(np.percentile(values, percent)), 1) if len(values) else None

    def ratio(ours: float | None, theirs: float | None) -> float | None:
        return round(ours / theirs, 2) if ours is not None and theirs else None

    late = [latency for latency in load.reference_us if latency > period_us]
    wake = {percent: at(load.wake_us, percent) for percent in (50, 99, 99.9)}
    reference = {percent: at(load.reference_us, percent) for percent in (50, 99, 99.9)}
    execution = at(load.execution_us, 99)
    return {
        "wake p50 us": wake[50],
        "wake p99 us": wake[99],
        "cyclictest p50 us": reference[50],
        "cyclictest p99 us": reference[99],
        "wake p50 / cyclictest": ratio(wake[50], reference[50]),
        "wake p99 / cyclictest": ratio(wake[99], reference[99]),
        "wake p99.9 / cyclictest": ratio(wake[99.9], reference[99.9]),
        "execution p50 us": at(load.execution_us, 50),
        "execution p99 us": execution,
        "execution p99 / period": ratio(execution, period_us),
        "sensor to drive p50 us": at(load.sensor_to_drive_us, 50),
        "sensor to drive p99 us": at(load.sensor_to_drive_us, 99),
        "SYNC to drive p50 us": at(load.to_drive_us, 50),
        "SYNC to drive p99 us": at(load.to_drive_us, 99),
        "SYNC to its answer read p50 us": at(load.answered_us, 50),
        "SYNC to its answer read p99 us": at(load.answered_us, 99),
        "missed cycles %": round(100 * load.missed / load.cycles, 3) if load.cycles else None,
        "cyclictest over a cycle %": round(100 * len(late) / len(load.reference_us), 3) if load.reference_us else None,
        "presses stopped by a stall": load.spoilt,
        "HTTP requests per s": round(load.requests / load.busy_s, 1) if load.busy_s else None,
    }


def measure(seconds: float, rounds: int, report: Callable[[dict[str, Summary]], None]) -> None:
    """Alternates loop and cyclictest, idle and under HTTP load, and reports after every round."""
    settings, loads = Loop(), {"idle": Load()}
    if shutil.which("wrk"):
        loads["http"] = Load()
    else:
        print("wrk is not here (Debian: apt install wrk): no load over HTTP", file=sys.stderr)
    if shutil.which("cyclictest") is None:
        print("cyclictest is not here (Debian: apt install rt-tests): no ratios", file=sys.stderr)
    with (
        tempfile.TemporaryDirectory() as name, served_bench("--seed", "1") as bench,
        contextlib.closing(Service(bench, Path(name), seconds)) as service,
    ):  # fmt: skip
        for turn in range(rounds):
            for kind, load in loads.items():
                phase(bench, service, load, f"{kind}-{turn}", seconds, PRESS_S + seconds if kind == "http" else 0.0)
            report({kind: summary(load, 1e6 / settings.rate_Hz) for kind, load in loads.items()})


def phase(bench: ServedBench, service: Service, load: Load, name: str, seconds: float, hammered_s: float) -> None:
    """One press with its recording, then cyclictest, under one load."""
    with hammered(load, hammered_s), contextlib.closing(Arrivals(bench.endpoints.control)) as arrivals:
        recording = service.press(name)
    if recording:
        take(load, recording, arrivals)
    else:
        load.spoilt += 1
    if shutil.which("cyclictest"):
        with hammered(load, seconds if hammered_s else 0.0):
            cyclictest(load, seconds, max(os.sched_getaffinity(0)), Loop().priority + 1, service.folder)


def say(found: dict[str, Summary]) -> None:
    """The table, for people."""
    print(f"{'':38}" + "".join(f"{kind:>12}" for kind in found))
    for row in next(iter(found.values())):
        cells = ("--" if value is None else f"{value:g}" for value in (column[row] for column in found.values()))
        print(f"{row:38}" + "".join(f"{cell:>12}" for cell in cells), flush=True)


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.loop", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=10.0, help="of each phase")
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()

    said: dict[str, Summary] = {}

    def report(found: dict[str, Summary]) -> None:
        say(found)
        said.update(found)
        if options.json:
            write_text(options.json, json.dumps(found, indent=2) + "\n")

    with contextlib.suppress(KeyboardInterrupt):
        measure(options.seconds, options.rounds, report)
    print(json.dumps(said))


if __name__ == "__main__":
    main()
