"""How long a stop takes: `python -m benchmarks.stop [--presses 1000] [--json FILE]`, in two to three minutes.

A real service over the mock bench; each press is a POST /estop on a connection of its own to the stop process, timed
from before the connection to the loop's confirmation. Phases in one run: nothing else going on; 50 streams, 200
requests a second of which every tenth lists the recordings, and a body of a gigabyte begun each second; the same to
the service's own POST /estop; and the service suspended. The client that presses has real-time priority where that is
granted: what counts is the stop, not how long a busy computer keeps a benchmark waiting.

Every press has to be confirmed, the 99th percentile of each phase to be below 20 ms, and the load to be there: what
did not come shows nothing. Prints the head and the table of a page in docs/validation; the last line is a JSON object.
"""

import argparse
import contextlib
import http.client
import json
import multiprocessing
import os
import signal
import socket
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from multiprocessing.sharedctypes import Synchronized
from pathlib import Path

import numpy as np

from benchmarks.about import head
from benchmarks.service.clients import LIVE, REQUESTS_HZ
from benchmarks.service.load import Clients
from controller.loop.realtime import promptly
from mock_devices.testing.access import bearer
from mock_devices.testing.commands import ROOT, served_bench
from mock_devices.testing.service import ServedRig
from rig.recording.files import write_text

BODY_BYTES, CHUNK = 1_000_000_000, 65_536
# The clients start at low priority: a minute is enough on a computer that has time for them at all.
LOOK_S, SETTLING_S, SUSPENDING_S = 2.0, 60.0, 0.5
GOAL_P99_MS = 20.0
BODY_EACH_S = 1.0
# One of a hundred: of fewer presses the 99th percentile is none.
FEWEST_PRESSES = 100
# Of 200 offered: a phase may end in between.
LEAST_SERVED_HZ = 0.95 * REQUESTS_HZ
# As long as a press is waited for; one that is not confirmed counts as this.
GIVEN_UP_MS = 10_000.0
# Between loop (50) and bench (10), and below the stop process (49).
CLIENT_PRIORITY = 20
# By name, and what the load has to do meanwhile.
PHASES = {
    "stop process, no load": "",
    "service, no load": "",
    "stop process, under load": "served",
    "service, under load": "served",
    "stop process, service suspended": "suspended",
}


@dataclass(frozen=True)
class Stops:
    """Presses of one phase; one that was not confirmed counts as the slowest."""

    presses: int
    p50_ms: float
    p99_ms: float
    worst_ms: float
    not_confirmed: int


@dataclass(frozen=True)
class Load:
    """What the load got during a phase: answers of 200, streams that brought something and did not end, and others."""

    served_Hz: float = 0.0
    live: int = 0
    ended: int = 0
    bodies: int = 0


@dataclass(frozen=True)
class Phase:
    """One phase, by its name in ``PHASES``."""

    name: str
    stops: Stops
    load: Load = Load()


def main() -> int:
    """Prints head, table and one JSON object; 1 where a goal is missed or the load was not there."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stop", description=__doc__)
    parser.add_argument("--presses", type=int, default=1000, help="of each phase")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    with promptly(CLIENT_PRIORITY):
        granted = os.sched_getscheduler(0) == os.SCHED_FIFO
    print(head("stop", **{"presses at": f"SCHED_FIFO {CLIENT_PRIORITY}" if granted else "normal priority"}))
    with served_bench("--seed", "1") as bench, tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        folders: list[str | Path] = ["--sessions", place, "--protocols", ROOT / "examples"]
        rig = ServedRig(bench, place, [*folders, *bench.settings("stop.port=0", "loop.lease_s=0")])
        try:
            phases = list(measured(rig, options.presses))
        finally:
            rig.running.process.terminate()
            rig.running.end()
    print(table(phases))
    found = missed(phases)
    print("missed: " + ("; ".join(found) or "nothing"))
    result = json.dumps({"ok": not found, "missed": found, "phases": [asdict(phase) for phase in phases]})
    if options.json:
        write_text(options.json, result + "\n")
    print(result)
    return int(bool(found))


def measured(rig: ServedRig, presses: int) -> Iterator[Phase]:
    """Every phase, in the order of ``PHASES``."""
    names, own, service = iter(PHASES), (rig.stop_port, "/estop"), (rig.port, "/api/v1/estop")
    for where in (own, service):
        yield Phase(next(names), summary(pressed(*where, presses)))
    with Loading(rig.port) as loading:
        await_load(loading)
        for where in (own, service):
            yield beside(loading, next(names), *where, presses)
        with suspended(rig.running.process.pid):
            yield beside(loading, next(names), *own, presses)


@contextlib.contextmanager
def suspended(pid: int) -> Iterator[None]:
    """The process stands still, and what it had answered before has been read."""
    os.kill(pid, signal.SIGSTOP)
    try:
        time.sleep(SUSPENDING_S)
        yield
    finally:
        os.kill(pid, signal.SIGCONT)


class Loading:
    """Streams and requests of `benchmarks.service.clients`, and bodies of a gigabyte, until the block ends."""

    def __init__(self, port: int) -> None:
        context = multiprocessing.get_context("spawn")
        self._clients = Clients(port)
        self._bodies = context.Value("L", 0)
        self._sender = context.Process(target=send_bodies, args=(port, bearer(), self._bodies), daemon=True)
        self._sender.start()

    def __enter__(self) -> "Loading":
        return self

    def __exit__(self, *_: object) -> None:
        self._sender.kill()
        self._sender.join()
        with self._clients:
            pass

    def counted(self) -> dict[str, float]:
        """What came since the start; of the clients nothing where their process has ended."""
        return self._clients.counted() | {"bodies": self._bodies.value}


def await_load(loading: Loading) -> None:
    """Until the load is there, or has had time enough; each phase says what it got."""
    end_s = time.monotonic() + SETTLING_S
    before, load = loading.counted(), Load()
    while time.monotonic() < end_s and not (load.served_Hz >= LEAST_SERVED_HZ and load.live == LIVE):
        time.sleep(LOOK_S)
        after = loading.counted()
        before, load = after, came(before, after)


def beside(loading: Loading, name: str, port: int, path: str, presses: int) -> Phase:
    """A phase beside the load."""
    before = loading.counted()
    stops = summary(pressed(port, path, presses))
    return Phase(name, stops, came(before, loading.counted()))


def came(before: Mapping[str, float], after: Mapping[str, float]) -> Load:
    """What came between two counts; where the clients' process has ended, all streams ended with it."""
    if "served" not in after:
        return Load(ended=LIVE)
    more = {name: after[name] - before[name] for name in ("served", "seconds", "bodies")}
    return Load(
        round(more["served"] / more["seconds"], 1), int(after["heard"]), int(after["ended"]), int(more["bodies"])
    )


def pressed(port: int, path: str, presses: int) -> list[float]:
    """Times in ms of presses one after another, 20 ms between them."""
    times_ms = []
    with promptly(CLIENT_PRIORITY):
        for _ in range(presses):
            began = time.perf_counter()
            confirmed = _confirmed(port, path)
            times_ms.append((time.perf_counter() - began) * 1e3 if confirmed else GIVEN_UP_MS)
            time.sleep(0.02)
    return times_ms


def _confirmed(port: int, path: str) -> bool:
    client = http.client.HTTPConnection("127.0.0.1", port, timeout=GIVEN_UP_MS / 1e3)
    try:
        client.request("POST", path)
        answer = client.getresponse()
        answer.read()
        return answer.status == 200
    except (OSError, http.client.HTTPException):
        return False
    finally:
        client.close()


def summary(times_ms: Sequence[float]) -> Stops:
    """Of the presses of one phase."""
    p50_ms, p99_ms, worst_ms = (float(np.percentile(times_ms, share, method="higher")) for share in (50, 99, 100))
    lost = sum(time_ms >= GIVEN_UP_MS for time_ms in times_ms)
    return Stops(len(times_ms), round(p50_ms, 3), round(p99_ms, 3), round(worst_ms, 3), lost)


def missed(phases: Sequence[Phase]) -> list[str]:
    """What was not reached, a sentence each; a load that was not there is as bad as a stop that took too long."""
    lacking = [f"{name}: was not measured" for name in PHASES if name not in {phase.name for phase in phases}]
    return lacking + [f"{phase.name}: {said}" for phase in phases for said in (*_slow(phase), *_unloaded(phase))]


def _slow(phase: Phase) -> Iterator[str]:
    stops = phase.stops
    if stops.presses < FEWEST_PRESSES:
        yield f"{stops.presses} presses, at least {FEWEST_PRESSES} are needed for a 99th percentile"
    if stops.not_confirmed:
        yield f"{stops.not_confirmed} of {stops.presses} presses were not confirmed"
    if not stops.p99_ms < GOAL_P99_MS:
        yield f"99 of 100 presses within {stops.p99_ms:g} ms, not within {GOAL_P99_MS:g} ms"


def _unloaded(phase: Phase) -> Iterator[str]:
    load, asked = phase.load, PHASES.get(phase.name)
    if asked and load.ended:
        yield f"{load.ended} of {LIVE} streams ended"
    if asked == "served":
        if not load.served_Hz >= LEAST_SERVED_HZ:
            yield f"{load.served_Hz:g} requests a second were served, not {LEAST_SERVED_HZ:g}"
        if load.live < LIVE:
            yield f"{load.live} of {LIVE} streams brought something all the time"
        if not load.bodies:
            yield "no large body was sent"
    if asked == "suspended" and (load.served_Hz or load.live):
        yield "the service answered: it was not suspended"


def table(phases: Sequence[Phase]) -> str:
    """As a page has it."""
    names = ["presses", "p50, ms", "p99, ms", "worst, ms", "not confirmed", "served/s", "live", "ended", "bodies begun"]
    rows = [[phase.name, *asdict(phase.stops).values(), *asdict(phase.load).values()] for phase in phases]
    lines = [["pressed at", *names], ["---"] * (len(names) + 1), *rows]
    return "\n".join(f"| {' | '.join(str(cell) for cell in line)} |" for line in lines)


def send_bodies(port: int, known: Mapping[str, str], begun: "Synchronized[int]") -> None:
    """Bodies of a gigabyte one after another, as far as they are let, until it is killed."""
    headers = {"Host": f"127.0.0.1:{port}", "Content-Length": str(BODY_BYTES), **known}
    lines = "".join(f"{name}: {value}\r\n" for name, value in headers.items())
    while True:
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 5) as client:
            client.sendall(f"POST /api/v1/jobs HTTP/1.1\r\n{lines}\r\n".encode())
            begun.value += 1
            for _ in range(BODY_BYTES // CHUNK):
                client.sendall(b"x" * CHUNK)
        time.sleep(BODY_EACH_S)


if __name__ == "__main__":
    sys.exit(main())
