"""Whether a bench that stands still for a moment is taken for a broken one: `python -m benchmarks.stalls`.

The process of the simulated bench is suspended again and again, for longer than any real device may be silent, while
`rig capture` makes trials on settings that allow it; four minutes for eight captures. No answer is lost, all are late,
and that is all that is wrong: a capture that is stopped for a frozen axis, a wrong scale or a speed was stopped by
mistake. The force limit alone may stop one: it looks at how far the set-point is ahead, and that it really is.

Prints the head and the table of a page in docs/validation; the last line is a JSON object. Ends with 1 where a capture
was stopped by mistake.
"""

import argparse
import json
import random
import subprocess
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from benchmarks.about import head
from benchmarks.faults.acts import suspend
from controller.safety.table import TABLE
from mock_devices.testing.commands import RIG, served_bench
from rig.recording.files import write_text
from rig.recording.reader import read_recording

PROTOCOL = """
kind = "indentation"
speeds_mm_s = [30]
trials = 12
depth_mm = 6
air_dwell_s = 0.3
approach_speed_mm_s = 20
hold_s = 0.3
retract_speed_mm_s = 20
clearance_mm = 4
force_limit_N = 8
"""
# A bench may be silent for 1 s here (mock_devices.testing.commands.PATIENT), a real one for 50 ms.
STALL_S = 0.05, 0.2
EVERY_S = 1.5, 4.0
STARTING_S = 3.0
ALLOWED = frozenset({"force_limit"})


@dataclass(frozen=True)
class Capture:
    """One capture: how it ended, how often its bench stood still, the code of what stopped it, and in words."""

    exit_code: int
    stalls: int
    stopped: str
    said: str

    @property
    def mistaken(self) -> bool:
        """Whether something stopped it that was not there."""
        return self.exit_code != 0 and self.stopped not in ALLOWED


def main(arguments: Sequence[str] | None = None) -> int:
    """Prints head, table and one JSON object; 1 where a capture was stopped by mistake."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stalls", description=__doc__)
    parser.add_argument("--captures", type=int, default=8)
    parser.add_argument("--seed", type=int, default=1, help="of when the bench stands still, and for how long")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args(arguments)
    print(head("stalls", seed=str(options.seed)))
    draw = random.Random(options.seed)
    captures = [captured(draw) for _ in range(options.captures)]
    print(table(captures))
    mistaken = [asdict(one) for one in captures if one.mistaken]
    result = json.dumps({"ok": not mistaken, "captures": len(captures), "mistaken": mistaken})
    if options.json:
        write_text(options.json, result + "\n")
    print(result)
    return int(bool(mistaken))


def captured(draw: random.Random) -> Capture:
    """One capture on a bench of its own that stands still at random."""
    with served_bench("--seed", "1") as bench, tempfile.TemporaryDirectory() as folder:
        protocol, session = Path(folder) / "protocol.toml", Path(folder) / "session"
        write_text(protocol, PROTOCOL)
        command = [*RIG, "capture", str(protocol), "--out", str(session), *bench.settings()]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        stalls = stalled(process, bench.endpoints.pid, draw)
        said, _ = process.communicate()
        return Capture(process.returncode, stalls, stopped_for(session), said.strip().rpartition("\n")[2])


def stalled(process: "subprocess.Popen[str]", pid: int, draw: random.Random) -> int:
    """Suspends ``pid`` again and again while ``process`` runs; how often."""
    time.sleep(STARTING_S)
    count = 0
    while process.poll() is None:
        time.sleep(draw.uniform(*EVERY_S))
        suspend(pid, draw.uniform(*STALL_S))
        count += 1
    return count


def stopped_for(session: Path) -> str:
    """The code of the check that the newest recording says it was stopped for; empty where none did."""
    codes = {check.code for check in TABLE}
    newest = sorted(session.glob("*.mcap"))[-1:]
    said = [event.code for file in newest for event in read_recording(file).events]
    return next((code for code in reversed(said) if code in codes), "")


def table(captures: Sequence[Capture]) -> str:
    """As it stands in a page of docs/validation."""
    rows = [f"| {one.exit_code} | {one.stalls} | {one.stopped or 'nothing'} | {one.said[:120]} |" for one in captures]
    return "\n".join(("| exit code | stalls | stopped for | said |", "|---|---|---|---|", *rows))


if __name__ == "__main__":
    raise SystemExit(main())
