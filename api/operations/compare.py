"""Jumps of force on several subjects, each learnt by indentation first; simulated by other laws too, for comparison."""

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path

from controller.experiments import capture, comparison, tracked, tracking
from controller.experiments.comparison import compared_run, study_levels
from controller.experiments.recorded import Recorded
from controller.experiments.references import Reference
from controller.law import synthesis
from controller.law.axis_response import rates_of, response_of
from controller.law.synthesis import Span
from controller.loop.steps import Program
from controller.operation import Operation
from controller.safety.table import BY_PERSON
from controller.simulated.alternatives.alternative_runs import BenchRun, simulated_runs
from controller.supervisor import Supervisor, stop_error
from rig.config.protocol import Indentation
from rig.config.wiring import Wiring
from rig.errors import DataError, DeviceError, SafetyStop, UsageError
from rig.recording.files import write_text
from rig.recording.reader import read_recording
from rig.recording.sessions import open_session
from rig.report.compared_figure import comparison_figure
from rig.report.drawing import svg
from rig.results.tables import run_table
from rig.results.tracking import ComparedRun, CompareResult, Jump
from rig.tissue.model import Model, load_model
from rig.tissue.study import model_of, study_session

LEARNING = Indentation(
    name="learning", speeds_mm_s=(5.0, 15.0, 30.0), trials=1, depth_mm=14.0, air_dwell_s=0.3, approach_speed_mm_s=15.0,
    hold_s=0.1, retract_speed_mm_s=20.0, clearance_mm=3.0, rest_s=0.1, force_limit_N=11.5,
)  # fmt: skip
LEARNT_N = 10.3
# What stops a run where the computer, and not the law, was late; such a run is done again.
STALLED = ("axis_lost", "force_lost", "tracker_lost", "loop_overrun")
ATTEMPTS = 3
MIDDLING_RAD_S = 20.0, 60.0, 180.0  # k / B of the five subjects is 10 to 500 rad/s


@dataclass(frozen=True)
class Comparison:
    """``subjects`` name whose tissue each has, ``breathing`` is in mm and Hz, ``bench`` runs with a subject on it."""

    wiring: Wiring
    out: Path
    subjects: Mapping[str, str]
    reference: Reference
    bench: Callable[[str], AbstractContextManager[Supervisor]]
    breathing: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    # Called with what the benches gave, before a simulation that may fail or be cancelled.
    keep: Callable[[CompareResult], object] = lambda _: None

    def model_file(self, subject: str) -> Path:
        """Where the model learnt of the subject's tissue is kept."""
        return self.out / f"{self.subjects[subject]}.json"

    def learning_folder(self, subject: str) -> Path:
        """The session it is learnt from."""
        return self.out / f"learn-{self.subjects[subject]}"


def refuse_comparison(wanted: Comparison) -> None:
    """Raises UsageError, before any bench is started, for what would only be refused once a subject is learnt."""
    wiring = wanted.wiring
    _refuse_strong(max(wanted.reference.forces_N), wiring)
    tracking.refuse_beyond_bench(wanted.reference, wiring)
    # Where no law holds the middle of the subjects' tissue, none holds theirs.
    synthesis.constants(response_of(wiring), rates_of(wiring), Span(MIDDLING_RAD_S, (1.0,) * len(MIDDLING_RAD_S)))
    capture.check(LEARNING, wiring)
    for subject in wanted.subjects:
        if wanted.model_file(subject).exists():
            load_model(wanted.model_file(subject))
        else:
            capture.refuse_used(wanted.learning_folder(subject))


def _refuse_strong(force_N: float, wiring: Wiring) -> None:
    for limit_N, whose in ((LEARNT_N, "what the subjects are learnt to"), (wiring.force_limit_N, "the force limit")):
        if force_N > limit_N:
            raise UsageError(f"--force: {force_N:g} N is above {whose}, {limit_N:g} N")


def comparison_operation(wanted: Comparison) -> Operation:
    """The operation that ``compare`` is to report to."""
    return Operation("compare", total=2 * len(wanted.subjects), unit="runs")


def compare(operation: Operation, wanted: Comparison) -> CompareResult:
    """Learns every subject and tracks on it; what a stall of the computer stopped is done again.

    Raises SafetyStop where a person stops a run, or a limit the learning: nothing moves after that.
    """
    refuse_comparison(wanted)
    runs: list[ComparedRun] = []
    models: dict[str, Model] = {}
    programs: dict[str, Program] = {}
    for subject in wanted.subjects:
        operation.step(f"learning {subject}", len(runs))
        models[subject] = _learnt(operation, wanted, subject)
        operation.step(f"tracking on {subject}", len(runs))
        runs.append(_tracked(operation, wanted, subject, models[subject], programs))
        operation.say("  ".join([*run_table([runs[-1]]).rows[0], runs[-1].stopped]).rstrip())
    asked = [
        BenchRun(name, wanted.subjects[name], models[name], of, wanted.breathing.get(name))
        for name, of in programs.items()
    ]
    learnt = {name: {one.name: one.value for one in model.law.parameters} for name, model in models.items()}
    found = CompareResult(reference=wanted.reference.name, models=learnt, runs=tuple(runs))
    _draw(wanted, found)
    wanted.keep(found)
    refused: dict[str, str] = {}
    simulated = tuple(simulated_runs(operation, asked, rates_of(wanted.wiring), len(runs), refused))
    found = found.model_copy(update={"alternatives": simulated, "not_simulated": refused})
    _draw(wanted, found)
    return found


def _draw(wanted: Comparison, found: CompareResult) -> None:
    write_text(wanted.out / "comparison.svg", svg(comparison_figure(found.runs, found.alternatives)))


def _learnt(operation: Operation, wanted: Comparison, subject: str) -> Model:
    """The model `rig fit` makes of an indentation of this subject, breath held; kept beside the runs."""
    file = wanted.model_file(subject)
    if file.exists():
        return load_model(file)
    session = open_session(_indented(operation, wanted, subject))
    model = model_of(study_session(session), "index", session.info.subject)
    model.save(file)
    return model


def _indented(operation: Operation, wanted: Comparison, subject: str, attempt: int = 1) -> Path:
    """The session of the indentation; one that a stall of the computer stopped is kept, and done again beside it."""
    folder = wanted.learning_folder(subject)
    folder = folder if attempt == 1 else folder.with_name(f"{folder.name}-{attempt}")
    try:
        with wanted.bench(wanted.subjects[subject]) as bench:
            capture.capture(bench, LEARNING, folder, Operation("learn"))
    except (SafetyStop, DeviceError) as cause:
        stalled = isinstance(cause, DeviceError) or cause.code in STALLED
        if not stalled or attempt == ATTEMPTS:
            raise
        operation.say(f"{folder.name}: {cause}; once more")
        return _indented(operation, wanted, subject, attempt + 1)
    return folder


def _tracked(
    operation: Operation, wanted: Comparison, subject: str, model: Model, programs: dict[str, Program], attempt: int = 1
) -> ComparedRun:
    """One run on a bench of its own; what a stall of the computer stopped is said, and done again.

    ``programs`` is given what was played, planned by the axis that answered.
    """
    try:
        with wanted.bench(subject) as bench:
            try:
                program = tracked.plan_reference(wanted.reference, model, bench.wiring)
            except UsageError as refusal:
                return compared_run(subject, (), (), str(refusal))
            programs[subject] = program
            done = tracked.recorded_run(bench, program, wanted.out / subject, str(wanted.model_file(subject)))
    except DeviceError as cause:
        found, stalled = compared_run(subject, (), (), str(cause)), True
    else:
        if done.outcome.outcome in BY_PERSON:
            raise stop_error(done.outcome)
        jumps = _jumps(done)
        found = compared_run(subject, jumps, study_levels(jumps, model), done.outcome.cause)
        stalled = done.outcome.outcome in STALLED
    if not stalled or attempt == ATTEMPTS:
        return found
    operation.say(f"{subject}: {found.stopped}; once more")
    return _tracked(operation, wanted, subject, model, programs, attempt + 1)


def _jumps(done: Recorded) -> tuple[Jump, ...]:
    """What the recording shows; a run that was stopped may have been so before its first jump."""
    loop = read_recording(done.file).tables["loop"]
    try:
        return comparison.jumps(loop["capture_ns"] * 1e-9, loop["reference_N"], loop["force_N"], loop["mode"])
    except DataError:
        if done.outcome.stopped:
            return ()
        raise
