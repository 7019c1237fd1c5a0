"""The service under load in contact: `python -m benchmarks.service [--minutes 10] [--presses 300] [--json FILE]`.

The mock bench, `rig serve` and the loop, which presses and holds for the whole time: once with nobody looking, once
with 50 live clients and 200 requests a second from a process of its own (`benchmarks.service.clients`). Lost samples
are those missing from either recording or from what live clients got; missed cycles are the recording's own count;
memory is what the service and its processes keep beyond what they share, from the first minute to the last; stops are
pressed at the stop process after the hold, while the load goes on. Beside both phases a process at idle priority keeps
each core from halting: a virtual computer's takes longer to wake than a request to answer, and what keeps a bench
computer's awake (`idle_cores`) does not reach it. Last line: one JSON object.
"""

import argparse
import contextlib
import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from benchmarks.service.clients import LIVE, REQUESTS_HZ
from benchmarks.service.load import Clients
from benchmarks.stop import pressed, summary
from mock_devices.testing.commands import served_bench
from mock_devices.testing.service import ServedRig
from rig.recording.files import write_text
from rig.recording.reader import Recording, read_recording
from rig.recording.verify import verdict_of

PROTOCOL = (
    'kind = "indentation"\nspeeds_mm_s = [20]\ntrials = 1\ndepth_mm = 6\nair_dwell_s = 0.2\napproach_speed_mm_s = 20\n'
    "hold_s = {hold_s}\nretract_speed_mm_s = 20\nclearance_mm = 4\nforce_limit_N = 12\n[quality]\nrepeats = 0\n"
)
# Homing is over; rest, touches and approach take some ten seconds before the tip holds.
SETTLING_NS = 15_000_000_000
MEMORY_EVERY_S = 2.0
FIRST_S = 60.0
ENDED = ("succeeded", "failed", "stopped", "cancelled", "interrupted")
BELOW = {"stop_p99_ms": 20.0, "rss_growth_MB": 20.0}
MISSED_MORE_PERCENT = 0.1
SERVED_SHARE = 0.95


SPIN = "import os\nos.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))\nwhile True: pass"


@contextlib.contextmanager
def awake() -> Iterator[None]:
    """Every core runs something, which gives way to whatever else wants it."""
    spinning = [subprocess.Popen([sys.executable, "-S", "-c", SPIN]) for _ in os.sched_getaffinity(0)]
    try:
        yield
    finally:
        for process in spinning:
            process.kill()
            process.wait()


@dataclass(frozen=True)
class Phase:
    """What one hold showed."""

    missed_percent: float
    lost: int
    faults: str
    growth_MB: float


class Memory:
    """Private memory of a process and its children, looked at while the block lasts."""

    def __init__(self, pid: int) -> None:
        self._pid, self._over = pid, threading.Event()
        self.seen: list[tuple[float, float]] = []
        self._thread = threading.Thread(target=self._look)

    def __enter__(self) -> "Memory":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def growth_MB(self, seconds: float) -> float:
        """From the end of the first minute to the last seconds; from the first third where there is no minute."""
        first_s = min(FIRST_S, seconds / 3)
        times, sizes = np.array(self.seen).T
        early = sizes[np.abs(times - first_s) <= max(first_s / 6, MEMORY_EVERY_S)]
        late = sizes[(times > seconds * 0.9) & (times <= seconds)]
        return float(np.median(late) - np.median(early))

    def _look(self) -> None:
        began = time.monotonic()
        while not self._over.wait(MEMORY_EVERY_S):
            self.seen.append((time.monotonic() - began, sum(private_MB(pid) for pid in family(self._pid))))


def family(pid: int) -> list[int]:
    """The process and all that came of it."""
    found = [pid]
    for parent in found:
        with contextlib.suppress(OSError):
            for task in Path(f"/proc/{parent}/task").iterdir():
                found += [int(child) for child in (task / "children").read_text().split()]
    return found


def private_MB(pid: int) -> float:
    """Memory that the process shares with no other; the ring between loop, recorder and service is not counted."""
    with contextlib.suppress(OSError, StopIteration):
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
        return float(next(line.split()[1] for line in lines if line.startswith("RssAnon:"))) / 1024
    return 0.0


def held(rig: ServedRig, name: str, seconds: float) -> Phase:
    """One press that holds for so long, into session ``name``."""
    lease = rig.lease()
    job = rig.ask("POST", "/jobs", {"kind": "capture", "params": {"protocol": "hold", "session": name}}, lease)["id"]
    with Memory(rig.running.process.pid) as memory:
        while (state := rig.ask("GET", f"/jobs/{job}"))["state"] not in ENDED:
            rig.ask("PUT", "/control/lease", lease=lease)
            time.sleep(2.0)
    rig.ask("DELETE", "/control/lease", lease=lease)
    if state["state"] != "succeeded":
        raise SystemExit(f"{name}: the hold was {state['state']}: {state['message']}")
    recording = read_recording(rig.folder / "sessions" / name / "trial_001.mcap")
    faults = [f"{stream} {count} {fault}" for stream, verdict in verdict_of(recording).streams.items()
              for fault, count in verdict.faults.items() if fault != "out of order"]  # fmt: skip
    lost = sum(
        sum(verdict.faults.values()) - verdict.out_of_order for verdict in verdict_of(recording).streams.values()
    )
    return Phase(missed_percent(recording), lost, "; ".join(faults) or "none", memory.growth_MB(seconds))


def missed_percent(recording: Recording) -> float:
    """Of the cycles while the tip held."""
    loop = recording.tables["loop"]
    loop = loop[loop["capture_ns"] > loop["capture_ns"][0] + SETTLING_NS]
    cycles = int(loop["cycle"][-1] - loop["cycle"][0]) + 1
    return 100.0 * int(loop["missed"][-1] - loop["missed"][0]) / cycles


def measured(minutes: float, presses: int) -> dict[str, float]:
    """Both phases and the stops."""
    with tempfile.TemporaryDirectory() as name, awake(), served_bench("--seed", "1") as bench:
        folder = Path(name)
        (folder / "protocols").mkdir()
        (folder / "protocols" / "hold.toml").write_text(PROTOCOL.format(hold_s=60 * minutes))
        folders: list[str | Path] = ["--sessions", folder / "sessions", "--protocols", folder / "protocols"]
        rig = ServedRig(bench, folder, [*folders, *bench.settings("stop.port=0", "loop.lease_s=0")])
        try:
            idle = held(rig, "idle", 60 * minutes)
            say("nobody looks", idle)
            with Clients(rig.port) as clients:
                loaded = held(rig, "loaded", 60 * minutes)
                stops = summary(pressed(rig.stop_port, "/estop", presses))
                load = clients.counted()
        finally:
            rig.running.process.terminate()
            rig.running.process.wait(60)
    say("50 live clients", loaded)
    print(f"clients: {json.dumps(load)}")
    print(f"stops:   {json.dumps(asdict(stops))}")
    return {
        "served_per_s": round(load["served"] / load["seconds"], 1),
        # A client that heard nothing at all lost at least one.
        "lost_samples": idle.lost + loaded.lost + load["lost_live"] + LIVE - load["heard"],
        "missed_percent": round(loaded.missed_percent, 3),
        "missed_percent_idle": round(idle.missed_percent, 3),
        "stop_p99_ms": stops.p99_ms,
        "rss_growth_MB": round(loaded.growth_MB, 1),
    }


def say(name: str, phase: Phase) -> None:
    """One line for people."""
    print(f"{name:16s} missed {phase.missed_percent:7.3f} %  lost in the recording: {phase.faults}"
          f"  memory {phase.growth_MB:+.1f} MB", flush=True)  # fmt: skip


def goals_missed(found: Mapping[str, float]) -> list[str]:
    """Figures that miss their goals. What is no number shows nothing, nor does a load that did not come."""
    more_percent = found["missed_percent"] - found["missed_percent_idle"]
    met = {name: found[name] < limit for name, limit in BELOW.items()} | {
        "lost_samples": found["lost_samples"] == 0,
        "served_per_s": found["served_per_s"] >= SERVED_SHARE * REQUESTS_HZ,
        "missed_percent": more_percent <= MISSED_MORE_PERCENT,
    }
    return sorted(name for name, good in met.items() if not good)


def main() -> int:
    """Prints both phases, then the object; 1 where a goal is missed."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.service", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("--minutes", type=float, default=10.0, help="that the tip holds, in each of two phases")
    parser.add_argument("--presses", type=int, default=300, help="of the stop")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    found = measured(options.minutes, options.presses)
    if options.json:
        write_text(options.json, json.dumps(found, indent=2) + "\n")
    missed = goals_missed(found)
    print(f"goals missed: {', '.join(missed) or 'none'}")
    print(json.dumps(found))
    return int(bool(missed))


if __name__ == "__main__":
    sys.exit(main())
