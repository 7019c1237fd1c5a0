"""How punctual the loop is: `python -m benchmarks.loop [--seconds 10] [--rounds 2] [--json FILE]`.

The real loop runs on the mock bench behind `rig serve`, pressing and recording; `cyclictest` (Debian: rt-tests) runs on
the loop's core at the same rate and policy, one priority above, so that it sees the machine and not the loop. Phases
alternate, idle and with the HTTP interface under load, in one run. What counts are the ratios.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.client import HTTPConnection
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.channels import AXIS
from rig.config.wiring import Loop
from rig.recording.reader import read_recording
from tests.system.stage import RIG, ROOT, Stage, stage

PORT = 8123
CLIENTS = 4
SETTLING_S = 1.0
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
    answered_us: list[float] = field(default_factory=list)
    slots: int = 0
    missed: int = 0
    reference_us: list[float] = field(default_factory=list)
    requests: int = 0
    busy_s: float = 0.0


class Service:
    """`rig serve` in a process of its own, asked over HTTP."""

    def __init__(self, bench: Stage, folder: Path, hold_s: float) -> None:
        (folder / "protocols").mkdir()
        (folder / "protocols" / "hold.toml").write_text(PROTOCOL.format(hold_s=hold_s))
        command = [*RIG, "serve", "--port", str(PORT), "--sessions", str(folder / "sessions"), "--protocols",
                   str(folder / "protocols"), *bench.settings()]  # fmt: skip
        self._process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
        self.folder = folder
        self._lease: dict[str, str] = {}
        assert self._process.stdout and self._process.stdout.readline()
        self._lease = {"X-Control-Lease": self.ask("POST", "/control/lease", LEASE)["lease_id"]}

    def ask(self, method: str, path: str, body: object = None) -> Any:
        """One request; its JSON."""
        connection = HTTPConnection("127.0.0.1", PORT, timeout=60)
        text = None if body is None else json.dumps(body)
        connection.request(method, "/api/v1" + path, text, {"Content-Type": "application/json", **self._lease})
        reply = connection.getresponse()
        content = json.loads(reply.read())
        connection.close()
        assert reply.status < 400, content
        return content

    def press(self, name: str) -> Path:
        """Runs the protocol into session ``name`` to its end; the recording."""
        job = self.ask("POST", "/jobs", {"kind": "capture", "protocol": "hold", "session": name})["id"]
        while self.ask("GET", f"/jobs/{job}")["state"] == "running":
            self.ask("PUT", "/control/lease")
            time.sleep(0.5)
        return self.folder / "sessions" / name / "trial_001.mcap"

    def close(self) -> None:
        """Ends it."""
        self._process.terminate()
        self._process.wait(30)


@contextmanager
def hammered(load: Load, wanted: bool) -> Iterator[None]:
    """CLIENTS connections that ask for the bench's state without pause, where ``wanted``."""
    over = threading.Event()
    counts = [0] * CLIENTS

    def client(number: int) -> None:
        connection = HTTPConnection("127.0.0.1", PORT, timeout=60)
        while not over.is_set():
            connection.request("GET", "/api/v1/rig")
            connection.getresponse().read()
            counts[number] += 1
        connection.close()

    threads = [threading.Thread(target=client, args=(number,)) for number in range(CLIENTS if wanted else 0)]
    began = time.monotonic()
    for thread in threads:
        thread.start()
    try:
        yield
    finally:
        over.set()
        for thread in threads:
            thread.join()
        load.requests += sum(counts)
        load.busy_s += time.monotonic() - began


def take(load: Load, recording: Path) -> None:
    """Adds what the recording's loop and axis streams say."""
    tables = read_recording(recording).tables
    loop, axis = tables["loop"], tables[AXIS.name]
    loop = loop[loop["capture_ns"] > loop["capture_ns"][0] + SETTLING_S * 1e9]
    load.wake_us += (loop["wake_latency_ns"] / 1000).tolist()
    load.execution_us += (loop["execution_ns"] / 1000).tolist()
    load.answered_us += ((axis["arrival_ns"] - axis["capture_ns"]) / 1000).tolist()
    load.slots += int(loop["slot"][-1] - loop["slot"][0]) + 1
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


def summary(load: Load, period_us: float) -> dict[str, float | None]:
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
        "execution p99 / slot": ratio(execution, period_us),
        "command to drive's answer read p50 us": at(load.answered_us, 50),
        "command to drive's answer read p99 us": at(load.answered_us, 99),
        "missed slots %": round(100 * load.missed / load.slots, 3) if load.slots else None,
        "cyclictest over a slot %": round(100 * len(late) / len(load.reference_us), 3) if load.reference_us else None,
        "HTTP requests per s": round(load.requests / load.busy_s, 1) if load.busy_s else None,
    }


def measure(seconds: float, rounds: int) -> dict[str, dict[str, float | None]]:
    """Alternates loop and cyclictest, idle and under HTTP load."""
    settings, loads = Loop(), {"idle": Load(), "http": Load()}
    has_reference = shutil.which("cyclictest") is not None
    if not has_reference:
        print("cyclictest is not here (Debian: apt install rt-tests): no ratios", file=sys.stderr)
    core = max(os.sched_getaffinity(0))
    with tempfile.TemporaryDirectory() as name, stage("--seed", "1") as bench:
        service = Service(bench, Path(name), seconds)
        try:
            for turn in range(rounds):
                for kind, load in loads.items():
                    with hammered(load, kind == "http"):
                        take(load, service.press(f"{kind}-{turn}"))
                        if has_reference:
                            cyclictest(load, seconds, core, settings.priority + 1, Path(name))
        finally:
            service.close()
    return {kind: summary(load, 1e6 / settings.rate_Hz) for kind, load in loads.items()}


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.loop", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=10.0, help="of each phase")
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    found = measure(options.seconds, options.rounds)
    print(f"{'':38}" + "".join(f"{kind:>12}" for kind in found))
    for row in next(iter(found.values())):
        cells = ("--" if value is None else f"{value:g}" for value in (column[row] for column in found.values()))
        print(f"{row:38}" + "".join(f"{cell:>12}" for cell in cells))
    if options.json:
        options.json.write_text(json.dumps(found, indent=2) + "\n")


if __name__ == "__main__":
    main()
