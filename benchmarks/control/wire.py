"""The law on the mock bench, over the wire: `rig track` on a limb that moves, beside what the simulation says."""

import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from benchmarks.control.cases import FORCES_N, LIMB_MM
from benchmarks.control.laws import LAW
from benchmarks.control.plants import FOLDER, model_of
from benchmarks.control.scores import Score, by_subject

SUBJECTS = ("average", "firm")
SECONDS, PATIENCE_S = 5.0, 110.0
MOTION_HZ = 2.0


class Wired(NamedTuple):
    """Rms error [N] at one force, on the bench and in the simulation."""

    subject: str
    force_N: float
    bench_N: float
    simulated_N: float


def confirm(scores: Sequence[Score]) -> list[Wired]:
    """Prints and returns both errors at each force and subject."""
    found = [one for subject in SUBJECTS for one in _on(subject, scores)]
    for one in found:
        ratio = one.bench_N / one.simulated_N
        print(
            f"over the wire, {one.subject}, {one.force_N:g} N: {1000 * one.bench_N:.1f} mN, simulated"
            f" {1000 * one.simulated_N:.1f} mN ({ratio:.2f} times)"
        )
    return found


def _on(subject: str, scores: Sequence[Score]) -> list[Wired]:
    with tempfile.TemporaryDirectory() as folder:
        errors_N = tracked(subject, Path(folder))
    simulated = [by_subject(scores, LAW, [f"limb 2 Hz, {force_N:g} N"])[subject] for force_N in FORCES_N]
    return [
        Wired(subject, force_N, bench_N, simulated_N)
        for force_N, bench_N, simulated_N in zip(FORCES_N, errors_N, simulated, strict=True)
    ]


def tracked(subject: str, folder: Path) -> list[float]:
    """Rms error [N] at each force of FORCES_N, as `rig track` found it."""
    model, result = folder / "model.json", folder / "result.json"
    model_of(subject).save(model)
    hidden = [f"surface_motion.amplitude_mm={LIMB_MM}", f"surface_motion.frequency_Hz={MOTION_HZ}"]
    command = [
        str(Path(sys.executable).with_name("rig")), "track", "--model", str(model),
        "--force", ",".join(f"{force_N:g}" for force_N in FORCES_N), "--seconds", f"{SECONDS:g}",
        "--out", str(folder / "session"), "--json", str(result),
        "--set", f"mock.parameters={json.dumps(str(FOLDER / f'{subject}.toml'))}",
        "--set", f"mock.hide={json.dumps(hidden)}",
    ]  # fmt: skip
    subprocess.run(command, check=True, timeout=PATIENCE_S, cwd=folder)
    return [plateau["rms_error_N"] for plateau in json.loads(result.read_text())["levels"]]
