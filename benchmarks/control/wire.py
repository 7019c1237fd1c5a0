"""Law and tuned constant on the mock bench: its processes, devices and wire protocols, each beside its simulation.

Bench and simulation play the same reference and are judged by the same function, from the force sensed. Every part has
a bench of its own and stands in the file as one line, so that a run that was cut short goes on where it ended.
"""

import os
import tempfile
import time
from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from api.cli.mock_bench import bench_for
from benchmarks.control import alternative_process, laws, wire_programs
from benchmarks.control.cases import DT_S, LIMB_MM, Asked, Followed, follow, swing
from benchmarks.control.laws import CONSTANTS, LAW
from benchmarks.control.motion import Column
from benchmarks.control.plants import FOLDER, PLANT, SUBJECTS, limb_of, model_of
from benchmarks.control.wire_programs import SWING_HZ, Kind
from controller.experiments import tracked
from controller.law.axis_response import rates_of
from controller.loop.modes import Mode
from controller.loop.steps import Program, TrackForce
from controller.simulated.alternatives.alternative_laws import tuning_for
from controller.simulated.alternatives.alternative_tuning import DRIFTS_RAD_S
from controller.supervisor import LOOP_MODULE, Supervisor
from mock_devices.parameters import load_parameters
from rig.config.table import Table
from rig.config.wiring import Wiring
from rig.errors import RigError
from rig.recording.reader import read_recording

CONSTANT, BEST_AT_CONTACT = "constant", "constant, no drift"
Round = tuple[Kind, Sequence[float], Sequence[str]]
LIMB: Round = ("limb", (1.0,), (LAW, CONSTANT))
# Subject by subject, so that a run that was cut short has the whole of some.
OTHERS: Sequence[Round] = (
    ("contact", (1.0,), (LAW, CONSTANT, BEST_AT_CONTACT)), ("low jumps", (0.5, 2.0), (LAW, CONSTANT)),
    ("jumps", (0.5, 2.0), (LAW, CONSTANT)),
)  # fmt: skip
# Half as stiff, the soft subject has 10 N at 15.4 mm, and a jump passes it by a twentieth.
DEPTH_MM = 18.0
TRIES = 2  # a computer that others use stalls now and then, and the bench stops for it


class Part(NamedTuple):
    """One run: what is played, on whose tissue, how many times as stiff as the model, by which law."""

    kind: Kind
    subject: str
    stiffness: float
    law: str
    seed: int


class Wired(Table):
    """One number of a part on the bench, and of the simulation."""

    case: str
    bench: float
    simulated: float


class WiredPart(Table):
    """A part as it stands in the file; ``missed`` are slots of the loop that came too late."""

    part: Part
    found: tuple[Wired, ...]
    missed: int


def parts(seeds: int) -> Iterator[Part]:
    """All, the limb that moves first, on every subject."""
    for seed in range(1, 1 + seeds):
        rounds = [(subject, LIMB) for subject in SUBJECTS] + list(product(SUBJECTS, OTHERS))
        for subject, (kind, stiffness, names) in rounds:
            for factor, law in product(stiffness, names):
                yield Part(kind, subject, factor, law, seed)


def measure(file: Path, minutes: float, seeds: int) -> list[WiredPart]:
    """What is in ``file``, after all that is lacking there and begins within ``minutes`` was added."""
    began = time.monotonic()
    known = read(file)
    # Identified once for the whole file, by the computer that runs it.
    os.environ["XDG_STATE_HOME"] = str(file.resolve().with_suffix(".state"))
    for part in parts(seeds):
        if part in {one.part for one in known}:
            continue
        if time.monotonic() - began > 60 * minutes:
            break
        known.append(measured(part))
        print(known[-1].model_dump_json(), flush=True)
        with file.open("a") as lines:
            lines.write(known[-1].model_dump_json() + "\n")
    return known


def read(file: Path) -> list[WiredPart]:
    """The parts that ``file`` holds; none where there is none."""
    return [WiredPart.model_validate_json(line) for line in file.read_text().splitlines()] if file.exists() else []


def measured(part: Part) -> WiredPart:
    """One part on the bench and in the simulation; what a stall stopped is done again."""
    for again in reversed(range(TRIES)):
        try:
            program, asked, force_N, missed = on_bench(part)
        except RigError as error:
            if not again:
                raise
            print(f"{part}: {error}; once more", flush=True)
        else:
            break
    on_wire = wire_programs.judge(part.kind, part.stiffness, asked, force_N)
    simulated = wire_programs.judge(part.kind, part.stiffness, *in_simulation(part, program))
    found = [Wired(case=case, bench=value, simulated=simulated[case]) for case, value in on_wire.items()]
    return WiredPart(part=part, found=tuple(found), missed=missed)


def on_bench(part: Part) -> tuple[Program, Asked, Column, int]:
    """The program, what it asked for and the force sensed, each a millisecond apart, and slots missed."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        wiring = wiring_of(part, folder)
        module = LOOP_MODULE if part.law == LAW else alternative_process.MODULE
        with bench_for(wiring) as (live, _):
            program = with_law(part, wire_programs.program(part.kind, model_of(part.subject), live), live)
            with Supervisor(live, loop_module=module) as bench:
                done = tracked.recorded_run(bench, program, folder / "session", part.subject)
        if done.outcome.stopped:
            raise RigError(done.outcome.cause)
        loop = read_recording(done.file).tables["loop"]
    on = loop[(loop["mode"] == Mode.CONTACT) & np.isfinite(loop["reference_N"])]
    missed = int(loop["missed"][-1] - loop["missed"][0])
    return program, *_by_milliseconds(on["capture_ns"] * 1e-9, on["reference_N"], on["force_N"]), missed


def wiring_of(part: Part, folder: Path) -> Wiring:
    """The built-in mock bench with the subject's tissue, its limb swinging where the part says so."""
    tissue = load_parameters(FOLDER / f"{part.subject}.toml").tissue
    told = {"a_N_mm": part.stiffness * tissue.a_N_mm, "b_per_mm": tissue.b_per_mm}
    lines = [f"{name} = {value!r}" for name, value in (told | {"damping_N_s_mm": tissue.damping_N_s_mm}).items()]
    (folder / "subject.toml").write_text("\n".join(["[tissue]", *lines]) + "\n")
    swings = f"surface_motion.amplitude_mm={LIMB_MM}", f"surface_motion.frequency_Hz={SWING_HZ}"
    hidden = swings if part.kind == "limb" else ()
    mock = {"parameters": folder / "subject.toml", "hide": hidden}
    return Wiring.model_validate({"mock": mock, "limits": {"depth_mm": DEPTH_MM}})


def with_law(part: Part, program: Program, wiring: Wiring) -> Program:
    """The program as it is for the law; for a constant with its numbers, tuned on this bench's own axis."""
    if part.law == LAW:
        return program
    tracks = [step for step in program.steps if isinstance(step, TrackForce)]
    drifts = (0.0,) if part.law == BEST_AT_CONTACT else DRIFTS_RAD_S
    tuning = tuning_for(tracks[:1], rates_of(wiring), "constant", drifts)
    numbers = {
        "crossover_rad_s": tuning.integral, "lead_s": tuning.lead_s, "drift_rad_s": tuning.drift_rad_s,
    }  # fmt: skip
    steps = [step.model_copy(update=numbers) if isinstance(step, TrackForce) else step for step in program.steps]
    return program.model_copy(update={"steps": tuple(steps)})


def in_simulation(part: Part, program: Program) -> tuple[Asked, Column]:
    """The same reference, by the same law as it is for the simulated axis."""
    law = laws.shaped(part.subject, PLANT) if part.law == LAW else CONSTANTS[part.law](part.subject, PLANT)
    line, gap_mm = wire_programs.simulated_line(part.kind, program)

    def surface_mm(time_s: Column) -> Column:
        return swing(time_s, LIMB_MM, SWING_HZ) if part.kind == "limb" else np.full_like(time_s, gap_mm)

    limb = limb_of(model_of(part.subject), part.stiffness)
    asked, found = follow(Followed(line, surface_mm, limb), law, part.seed)
    return asked, found.sensed_N


def _by_milliseconds(time_s: Column, reference_N: Column, force_N: Column) -> tuple[Asked, Column]:
    """Rows of the loop on a grid: a slot that was missed has the row before it, time out of contact is left out."""
    gaps_s = np.diff(time_s, prepend=time_s[0] - DT_S)
    gaps_s[gaps_s > wire_programs.APART_S] = DT_S
    own_s = np.cumsum(gaps_s)
    grid_s = np.arange(own_s[0], own_s[-1], DT_S)
    at = np.searchsorted(own_s, grid_s, side="right") - 1
    return Asked(grid_s, reference_N[at]), force_N[at]
