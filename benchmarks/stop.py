"""How long a stop takes: `python -m benchmarks.stop [--presses 300] [--json FILE]`.

A real service over the mock bench; each press is a POST /estop on a connection of its own to the stop process, timed
from before the connection to the loop's confirmation. Phases in one run: nothing else going on; 50 streams, 200
requests a second of which every tenth lists the recordings, and bodies of a gigabyte being sent; the same to the
service's own POST /estop; and the service suspended. The client that presses has real-time priority where that is
granted: what counts is the stop, not how long a busy computer keeps a benchmark waiting.
"""

import argparse
import asyncio
import contextlib
import http.client
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.service.clients import watching
from mock_devices.testing.access import bearer, token
from mock_devices.testing.commands import RIG, ROOT, ServedBench, free_port, served_bench
from rig.recording.files import write_text

REQUESTS_HZ, LISTING_EVERY = 200, 10
BODY_BYTES, CHUNK = 1_000_000_000, 65_536
SETTLING_S = 2.0
GOAL_P99_MS = 20.0
# Between loop (50) and bench (10), and below the stop process (49).
CLIENT_PRIORITY = 20


def main() -> int:
    """Prints the table and one JSON object; 1 where the stop process' p99 under load is above the goal."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stop", description=__doc__)
    parser.add_argument("--presses", type=int, default=300)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--load", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.load:
        return put_under_load(options.load)
    with (
        served_bench("--seed", "1") as bench,
        tempfile.TemporaryDirectory() as folder,
        served(bench, Path(folder)) as service,
    ):
        found = measured(*service, options.presses)
    result = {name: summary(times) for name, times in found.items()}
    for name, row in result.items():
        print(f"{name:36s} {row['presses']:4.0f} presses  p50 {row['p50_ms']:7.2f} ms  p99 {row['p99_ms']:7.2f} ms"
              f"  worst {row['worst_ms']:7.2f} ms  not confirmed {row['not_confirmed']:.0f}")  # fmt: skip
    if options.json:
        write_text(options.json, json.dumps(result, indent=2) + "\n")
    print(json.dumps(result))
    return int(not result["stop process, under load"]["p99_ms"] < GOAL_P99_MS)


@contextlib.contextmanager
def served(bench: ServedBench, folder: Path) -> Iterator[tuple[int, int, int]]:
    """The service: its process, its port and the stop process' port."""
    port = free_port()
    command = [*RIG, "serve", "--port", str(port), "--sessions", str(folder), "--protocols", str(ROOT / "examples")]
    process = subprocess.Popen(
        [*command, *bench.settings("stop.port=0", "loop.lease_s=0")], cwd=ROOT, stdout=subprocess.PIPE
    )
    try:
        yield process.pid, port, _stop_port(port)
    finally:
        os.kill(process.pid, signal.SIGCONT)
        process.terminate()
        process.communicate(timeout=60)


def _stop_port(port: int) -> int:
    """The stop process' port, once the bench is ready: before that, a stop ends the start."""
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        with contextlib.suppress(OSError):
            if _asked(port, "/api/v1/rig")["ready"]:
                return int(_asked(port, "/api/v1/info")["stop_port"])
        time.sleep(0.1)
    raise SystemExit("the bench was not ready within 60 s")


def _asked(port: int, path: str) -> dict[str, int]:
    client = http.client.HTTPConnection("127.0.0.1", port, timeout=5)
    client.request("GET", path, headers=bearer())
    found: dict[str, int] = json.loads(client.getresponse().read())
    return found


def measured(pid: int, port: int, stop_port: int, presses: int) -> dict[str, list[float]]:
    """Times of every phase in ms; infinite where it was not confirmed."""
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(CLIENT_PRIORITY))
    found = {"stop process, no load": pressed(stop_port, "/estop", presses)}
    found["service, no load"] = pressed(port, "/api/v1/estop", presses)
    load = subprocess.Popen([sys.executable, "-m", "benchmarks.stop", "--load", str(port)], cwd=ROOT)
    try:
        time.sleep(SETTLING_S)
        found["stop process, under load"] = pressed(stop_port, "/estop", presses)
        found["service, under load"] = pressed(port, "/api/v1/estop", presses // 5)
        os.kill(pid, signal.SIGSTOP)
        found["stop process, service suspended"] = pressed(stop_port, "/estop", presses // 3)
    finally:
        os.kill(pid, signal.SIGCONT)
        load.kill()
        load.wait()
    return found


def pressed(port: int, path: str, presses: int) -> list[float]:
    """Presses one after another, 20 ms between them."""
    times_ms = []
    for _ in range(presses):
        began = time.perf_counter()
        confirmed = _confirmed(port, path)
        times_ms.append((time.perf_counter() - began) * 1e3 if confirmed else float("inf"))
        time.sleep(0.02)
    return times_ms


def _confirmed(port: int, path: str) -> bool:
    client = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    try:
        client.request("POST", path)
        answer = client.getresponse()
        answer.read()
        return answer.status == 200
    except OSError:
        return False
    finally:
        client.close()


def summary(times_ms: list[float]) -> dict[str, float]:
    """Of one phase; what was not confirmed counts as the slowest."""
    confirmed = [value for value in times_ms if np.isfinite(value)]
    ordered = np.sort(times_ms)
    return {
        "presses": len(times_ms),
        "p50_ms": round(float(np.percentile(ordered, 50, method="higher")), 3),
        "p99_ms": round(float(np.percentile(ordered, 99, method="higher")), 3),
        "worst_ms": round(max(confirmed, default=float("inf")), 3),
        "not_confirmed": len(times_ms) - len(confirmed),
    }


def put_under_load(port: int) -> int:
    """Streams, requests, listings and bodies, until it is killed."""
    # Started by the client that presses, whose priority is not for the load.
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    threading.Thread(target=_send_bodies, args=(port,), daemon=True).start()
    for _ in range(4):
        threading.Thread(target=_ask, args=(port, REQUESTS_HZ / 4), daemon=True).start()
    asyncio.run(watching(port, token()))
    return 0


def _head(line: str, port: int, more: str = "") -> bytes:
    known = "".join(f"{name}: {value}\r\n" for name, value in bearer().items())
    return f"{line} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n{known}{more}\r\n".encode()


def _send_bodies(port: int) -> None:
    head = _head("POST /api/v1/jobs", port, f"Content-Length: {BODY_BYTES}\r\n")
    while True:
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 5) as client:
            client.sendall(head)
            for _ in range(BODY_BYTES // CHUNK):
                client.sendall(b"x" * CHUNK)
        time.sleep(0.01)


def _ask(port: int, rate_Hz: float) -> None:
    number, due = 0, time.monotonic()
    while True:
        number, due = number + 1, due + 1 / rate_Hz
        time.sleep(max(due - time.monotonic(), 0.0))
        path = "/api/v1/recordings" if number % LISTING_EVERY == 0 else "/api/v1/rig"
        with contextlib.suppress(OSError, http.client.HTTPException):
            client = http.client.HTTPConnection("127.0.0.1", port, timeout=5)
            client.request("GET", path, headers=bearer())
            client.getresponse().read()
            client.close()


if __name__ == "__main__":
    sys.exit(main())
