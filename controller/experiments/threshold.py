"""The subject's pain threshold: force rises slowly until the subject stops it; the force then is the answer."""

from pathlib import Path

import numpy as np

from controller.experiments import tracked
from controller.experiments.recorded import Recorded
from controller.experiments.references import Ramp
from controller.loop.steps import Program
from controller.supervisor import Supervisor, stop_error
from rig.config.table import parse
from rig.config.wiring import Wiring
from rig.errors import UsageError
from rig.recording.reader import read_recording
from rig.results.tracking import THRESHOLD, Threshold
from rig.tissue.model import Model

PAIN = "pain_stop"
BASE_N = 0.5  # contact without doubt, and a tenth of the lowest pain thresholds of limbs
BEFORE_NS = 50_000_000  # fifty samples have a seventh of one's noise; at 0.5 N/s force rises by 0.025 N in it


def plan(up_to_N: float, rate_N_s: float, model: Model, wiring: Wiring) -> Program:
    """The ramp, checked against model and limits: the present pain threshold is never passed to find a new one."""
    if not up_to_N > BASE_N:
        raise UsageError(f"--up-to {up_to_N:g} N must be above the {BASE_N:g} N at which the ramp begins")
    values = {"force_N": up_to_N, "base_N": BASE_N, "rate_N_s": rate_N_s, "hold_s": 0.5}
    return tracked.plan_reference(parse(Ramp, values, "--up-to or --rate").reference(), model, wiring)


def run(bench: Supervisor, program: Program, up_to_N: float, folder: Path, model: str) -> Threshold:
    """Plays the ramp into a recording, the answer beside it; any stop but the subject's own raises SafetyStop."""
    done = tracked.recorded_run(bench, program, folder, model)
    if done.outcome.stopped and done.outcome.outcome != PAIN:
        raise stop_error(done.outcome)
    found = Threshold(force_N=force_at_stop(done), up_to_N=up_to_N, recording=done.file.name)
    found.write(folder / f"{done.file.stem}.{THRESHOLD}")
    return found


def force_at_stop(done: Recorded) -> float | None:
    """Mean force [N] over the 50 ms before the subject's stop; None without one."""
    recording = read_recording(done.file)
    stops = [event.capture_ns for event in recording.events if event.code == PAIN]
    if not stops:
        return None
    loop = recording.tables["loop"]
    before = (loop["capture_ns"] <= stops[0]) & (loop["capture_ns"] > stops[0] - BEFORE_NS)
    return float(np.mean(loop["force_N"][before]))
