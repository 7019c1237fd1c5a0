"""Every fault at random moments in contact: `python -m benchmarks.faults [--trials 20] [--only axis.cut ...]`.

With `--json FILE` every trial is written as soon as it is done, and trials that FILE holds already are not done again:
a campaign may be ended at any time (or by `--minutes`) and gone on with later. Its moments depend on seed, fault and
number alone.

Each trial has a fresh bench and loop, presses 1 to 3 N with the force loop while recording, and brings one fault about
at a random moment. Printed per fault: how long until the loop noticed, the largest true force and by how much it went
over the limit, how it ended, what the recording lost. Noticed is what comes first: the loop's own stop, or the drive
taking its torque away by itself. A trial is unsafe if force went over the limit, or if the tip still moves afterwards.
"""

import argparse
import contextlib
import json
import math
import os
import random
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from api.cli.stage import plugged
from controller.experiments import tracked
from controller.experiments.references import named
from controller.steps import Program
from controller.supervisor import Supervisor
from mock_devices.control import BenchControl
from mock_devices.faults import Value
from rig.config.table import merged, parse
from rig.config.wiring import Wiring
from rig.errors import DeviceError, RigError, UsageError
from rig.recording.files import write_text
from rig.recording.reader import read_recording
from tests.controller.models import index_model
from tests.system.stage import Stage, children, stage

MODEL = index_model(0.12, 0.22, 0.01, force_N=11.0)
PRESSES = named("press:2,base_N=1,frequency_Hz=1,duration_s=5")
LATEST_S = 2.5
# Every limit of a real bench is stated, so that none is as patient as a mock device gets it; only missed samples are
# counted by age, because the bench is a process of the same computer.
WIRING = parse(Wiring, merged(Wiring().model_dump(mode="json"), ["loop.missed_periods=0"]), "the campaign")
REST_S, STILL_MM = 0.3, 0.03
ATTEMPTS = 5
TURN_NS = 2_000_000
# Faults that need another value than their own default to show while the bench runs.
VALUES: dict[str, Value] = {"axis.lasting_error": 0x2310, "axis.error": 0x2310, "tracker.missing": 1}
START_ONLY = ("wrong_identity", "refuse", "mute_start", "refuse_stream", "deaf", "heal")

Act = Callable[[Stage, Supervisor], None]


@dataclass(frozen=True)
class Trial:
    """What one fault did once; times in s from the fault, forces are the tissue's own."""

    fault: str
    number: int
    moment_s: float
    detected_s: float | None
    cause: str
    peak_N: float
    over_N: float
    end: str
    unsafe: str
    dropped: int
    complete: bool


class Spoilt(RigError):
    """The run had ended before its fault: the computer stalled, or the moment came too late."""


class Watcher:
    """Polls true force and the drive's torque beside the run, over a connection of its own."""

    def __init__(self, address: str) -> None:
        self.peak_N = 0.0
        self.unpowered_ns: int | None = None
        self._over = threading.Event()
        self._control = BenchControl(address)
        self._thread = threading.Thread(target=self._watch)
        self._thread.start()

    def _watch(self) -> None:
        while not self._over.wait(0.001):
            now = self._control.get("tip.force_N", "axis.powered")
            self.peak_N = max(self.peak_N, float(now["tip.force_N"]))
            if now["axis.powered"]:
                self.unpowered_ns = None
            elif self.unpowered_ns is None:
                self.unpowered_ns = time.monotonic_ns()

    def close(self) -> None:
        """Ends it."""
        self._over.set()
        self._thread.join()
        self._control.close()


def faults(control: BenchControl) -> dict[str, Act]:
    """All faults of the bench that can happen while it runs, and those of our own processes, limb and computer."""
    found: dict[str, Act] = {}
    for device, kinds in control.faults().items():
        if device == "force_modbus":
            continue
        for kind in kinds:
            if kind not in START_ONLY:
                found[f"{device}.{kind}"] = _device_fault(device, kind)
    return found | {
        "tracker.arm_hidden": lambda bench, _: _set(bench, "tracker.arm_in_view", False),
        "limb.stiffens": lambda bench, _: _set(bench, "tissue.stiffness_scale", 5.0),
        "limb.goes": lambda bench, _: _set(bench, "tissue.present", False),
        "limb.moves": lambda bench, _: _set(bench, "surface.position_mm", 35.0),
        "loop.killed": lambda _, rig: os.kill(rig.loop_pid, signal.SIGKILL),
        "recorder.killed": lambda _, __: _kill_recorder(),
        "operator.estop": lambda _, rig: rig.estop(),
        "operator.stop": lambda _, rig: rig.stop(),
        "operator.pain": lambda _, rig: rig.pain(),
        "operator.silent": lambda _, rig: setattr(rig, "attended", lambda: False),
    }  # fmt: skip


def _device_fault(device: str, kind: str) -> Act:
    value = VALUES.get(f"{device}.{kind}")
    return lambda bench, _: bench.control.fault(device, kind, value)


def _kill_recorder() -> None:
    for pid in children(os.getpid(), "rig.recording.recorder"):
        os.kill(pid, signal.SIGKILL)


def _set(bench: Stage, name: str, value: Value) -> None:
    bench.control.set({name: value})


def trial(fault: str, act: Act, number: int, seed: int, folder: Path) -> Trial:
    """One run with one fault, at the moment that seed, fault and number say."""
    moment_s = random.Random(f"{seed} {fault} {number}").uniform(0.0, LATEST_S)
    with stage("--seed", str(seed + number)) as bench:
        wiring = plugged(WIRING, bench.endpoints)
        program = tracked.plan_reference(PRESSES, MODEL, wiring)
        with Supervisor(wiring) as rig, contextlib.closing(Watcher(bench.endpoints["control"])) as watcher:
            ended: list[str] = []
            runner = threading.Thread(target=_run, args=(rig, program, folder, ended))
            runner.start()
            _wait(lambda: rig.status.get("mode") == "contact" or bool(ended), 30)
            time.sleep(moment_s)
            spoilt = bool(ended)
            happened_ns = time.monotonic_ns()
            if not spoilt:
                act(bench, rig)
            runner.join()
            end, unsafe = _end(bench)
    if spoilt:
        raise Spoilt(ended[0])
    seen = Trial(fault, number, round(moment_s, 3), None, ended[0], watcher.peak_N, 0.0, end, unsafe, 0, True)
    return _judged(seen, happened_ns, watcher.unpowered_ns, folder)


def _run(rig: Supervisor, program: Program, folder: Path, ended: list[str]) -> None:
    try:
        done = tracked.recorded_run(rig, program, folder, "")
        ended.append(done.outcome.cause or "complete")
    except RigError as error:
        ended.append(str(error))


def _wait(condition: Callable[[], bool], timeout_s: float) -> None:
    deadline = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > deadline:
            raise UsageError(f"the bench was not in contact within {timeout_s:g} s")
        time.sleep(0.005)


def _end(bench: Stage) -> tuple[str, str]:
    """Where it ended, and what is unsafe about it."""
    time.sleep(0.2)
    before_mm = bench.control.number("tip.position_mm")
    time.sleep(REST_S)
    now = bench.control.get("tip.position_mm", "tip.force_N", "axis.powered")
    moved_mm = abs(float(now["tip.position_mm"]) - before_mm)
    place = "free" if float(now["tip.force_N"]) == 0 else "stopped in contact"
    place += ", powered" if now["axis.powered"] else ", braked"
    return place, f"still moves, {moved_mm:.2f} mm in {REST_S:g} s" if moved_mm > STILL_MM else ""


def _judged(seen: Trial, happened_ns: int, unpowered_ns: int | None, folder: Path) -> Trial:
    """What was seen from outside, with what the recording says of it."""
    recording = read_recording(folder / "track_001.mcap")
    # An event carries the time at which its turn of the loop began, which may be just before what it answers.
    stops = [event for event in recording.events if event.level >= 30 and event.capture_ns > happened_ns - TURN_NS]
    first_ns = [*(event.capture_ns for event in stops[:1]), *([unpowered_ns] if unpowered_ns else [])]
    over_N = max(0.0, seen.peak_N - WIRING.force_limit_N)
    unsafe = "; ".join(part for part in (seen.unsafe, f"{over_N:.2f} N over the limit" if over_N else "") if part)
    loop = recording.tables["loop"]
    return replace(
        seen,
        detected_s=max(min(first_ns) - happened_ns, 0) * 1e-9 if first_ns else None,
        cause=stops[0].code if stops else seen.cause,
        over_N=over_N,
        unsafe=unsafe,
        dropped=int(np.sum(np.diff(loop["seq"]) - 1)) if len(loop) > 1 else 0,
        complete=recording.complete and not recording.damage,
    )


def known_faults() -> dict[str, Act]:
    """All there are, asked of a bench."""
    with stage("--seed", "1") as bench:
        return faults(bench.control)


def missing(faults: Sequence[str], trials: int, done: Sequence[Trial]) -> list[tuple[str, int]]:
    """What is not among ``done``: every fault once before any comes a second time, so that an end leaves none out."""
    over = {(one.fault, one.number) for one in done}
    return [(fault, number) for number in range(trials) for fault in faults if (fault, number) not in over]


def _repeated(fault: str, act: Act, number: int, seed: int) -> Trial:
    """A trial whose run lives to see its fault; those that do not are said on stderr and done again."""
    for _ in range(ATTEMPTS):
        try:
            with tempfile.TemporaryDirectory() as name:
                return trial(fault, act, number, seed, Path(name) / "session")
        except (Spoilt, DeviceError) as cause:
            print(f"{fault}: ended before its fault: {cause}", file=sys.stderr)
    raise UsageError(f"{fault}: {ATTEMPTS} runs ended before their fault: is the computer busy?")


HEADER = (
    f"{'fault':22}{'trials':>7}{'noticed':>8}{'median s':>10}{'max s':>8}{'peak N':>8}{'over N':>8}{'lost':>6}  end"
)


def line(done: Sequence[Trial]) -> str:
    """One row of the table."""
    times = [one.detected_s for one in done if one.detected_s is not None]
    middle, longest = (f"{np.median(times):.3f}", f"{max(times):.3f}") if times else ("--", "--")
    ends = ", ".join(sorted({f"{one.cause}: {one.end}" for one in done}))
    unsafe = [one.unsafe for one in done if one.unsafe]
    marked = f"  UNSAFE {len(unsafe)}: {unsafe[0]}" if unsafe else ""
    return (
        f"{done[0].fault:22}{len(done):7}{len(times):8}{middle:>10}{longest:>8}{max(one.peak_N for one in done):8.2f}"
        f"{max(one.over_N for one in done):8.2f}{sum(one.dropped for one in done):6}  {ends}{marked}"
    )


def read(file: Path | None) -> list[Trial]:
    """The trials in ``file``; raises UsageError where it holds something else."""
    if file is None or not file.exists():
        return []
    try:
        return [Trial(**one) for one in json.loads(file.read_text())]
    except (TypeError, ValueError) as error:
        raise UsageError(f"{file}: holds no trials of this benchmark ({error}); give another file") from error


def run(options: argparse.Namespace) -> list[Trial]:
    """Runs what is missing, writes each trial as soon as it is done, and prints a line for every fault."""
    done, known = read(options.json), known_faults()
    unknown = [name for name in options.only if name not in known]
    if unknown:
        raise UsageError(f"--only {unknown[0]}: there are {', '.join(known)}")
    acts = {name: act for name, act in known.items() if name in options.only or not options.only}
    until_s = time.monotonic() + 60 * options.minutes
    for fault, number in missing(list(acts), options.trials, done):
        if time.monotonic() > until_s:
            break
        done.append(_repeated(fault, acts[fault], number, options.seed))
        if options.json:
            write_text(options.json, json.dumps([asdict(each) for each in done], indent=2) + "\n")
    print(HEADER)
    for fault in acts:
        mine = [one for one in done if one.fault == fault]
        if mine:
            print(line(mine))
    return done


def main() -> int:
    """Runs and prints; 1 where any trial ended unsafe. A recorder that was killed leaves an open, readable file."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.faults", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--only", nargs="*", default=[], help="faults by name, for example axis.cut")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=math.inf, help="ends after the trial under way then")
    parser.add_argument("--json", type=Path, help="every trial; those it holds already are not done again")
    options = parser.parse_args()
    try:
        everything = run(options)
    except RigError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    unsafe = [one for one in everything if one.unsafe]
    broken = [one for one in everything if not one.complete]
    print(f"{len(everything)} trials, {len(unsafe)} unsafe ends, {len(broken)} recordings not closed or damaged")
    return 1 if unsafe else 0


if __name__ == "__main__":
    sys.exit(main())
