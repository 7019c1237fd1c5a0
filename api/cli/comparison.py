"""`rig track --table`: every choice of gains on simulated subjects, each learnt first by indentation and fit."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import mock_devices
from api.cli import live
from api.cli.output import console, say, show
from api.cli.stage import bench_for
from controller.experiments import capture, comparison, tracked, tracking
from controller.experiments.comparison import compared_run
from controller.experiments.recorded import Recorded
from controller.experiments.references import Reference, Stairs
from controller.law.gains import Choice, pi_gains
from controller.loop.steps import Program
from controller.operation import Operation
from rig.config.protocol import Indentation
from rig.config.table import parse
from rig.config.wiring import Wiring
from rig.errors import DataError, DeviceError, SafetyStop, UsageError
from rig.recording.reader import read_recording
from rig.recording.sessions import open_session
from rig.report.control_figures import comparison_figure
from rig.report.drawing import svg
from rig.results.tables import run_table
from rig.results.tracking import ComparedRun, CompareResult, Jump
from rig.tissue.model import Model, load_model
from rig.tissue.study import model_of, study_session

SUBJECTS = Path(mock_devices.__file__).parent / "subjects"
BREATHING = "breathing"
BREATHES = ("surface_motion.amplitude_mm=1.5", "surface_motion.frequency_Hz=0.25")
ALL = (*sorted(path.stem for path in SUBJECTS.glob("*.toml")), BREATHING)
LEARNING = Indentation(
    name="learning", speeds_mm_s=(5.0, 15.0, 30.0), trials=1, depth_mm=14.0, air_dwell_s=0.3, approach_speed_mm_s=15.0,
    hold_s=0.1, retract_speed_mm_s=20.0, clearance_mm=3.0, rest_s=0.1, force_limit_N=11.5,
)  # fmt: skip
LEARNT_N = 10.3
# What stops a run where the computer, and not the gains, was late; such a run is done again.
STALLED = ("axis_lost", "force_lost", "tracker_lost", "loop_overrun")
ATTEMPTS = 3


def compare(
    wiring: Wiring, out: Path, subjects: Sequence[str], choices: Sequence[Choice], reference: Reference
) -> CompareResult:
    """Runs all of it on mock benches, prints the table, and returns its JSON."""
    check(wiring, out, subjects, reference)
    runs: list[ComparedRun] = []
    models: dict[str, dict[str, float]] = {}
    for subject in subjects:
        model = learnt(wiring, out, subject)
        models[subject] = {parameter.name: parameter.value for parameter in model.law.parameters}
        for run in _on_subject(wiring, out, subject, model, choices, reference):
            runs.append(run)
            say(["  ".join([*run_table([run]).rows[0], run.stopped]).rstrip()])
    show(run_table(runs, reference.name))
    _draw(runs, out)
    return CompareResult(reference=reference.name, models=models, runs=tuple(runs))


def check(wiring: Wiring, out: Path, subjects: Sequence[str], reference: Reference) -> None:
    """Raises UsageError, before any bench is started, for what would only be refused once a subject is learnt."""
    if wiring.mock.parameters or wiring.mock.hide or not wiring.uses_mock:
        raise UsageError("--table brings its own subjects: use it with ports `mock` and without mock parameters")
    unknown = [name for name in subjects if name not in ALL]
    if unknown:
        raise UsageError(f"--subjects {unknown[0]}: there are {', '.join(ALL)}")
    _refuse_strong(max(reference.forces_N), wiring)
    tracking.refuse_beyond_bench(reference, wiring)
    # Without damping, which only helps, whether a law exists does not depend on stiffness: one tissue speaks for all.
    pi_gains(1.0, 0.0, tracking.design_for(wiring))
    capture.check(LEARNING, wiring)
    for subject in subjects:
        if _model_file(out, subject).exists():
            load_model(_model_file(out, subject))
        else:
            capture.refuse_used(_learning_folder(out, subject))


def _refuse_strong(force_N: float, wiring: Wiring) -> None:
    for limit_N, whose in ((LEARNT_N, "what the subjects are learnt to"), (wiring.force_limit_N, "the force limit")):
        if force_N > limit_N:
            raise UsageError(f"--force: {force_N:g} N is above {whose}, {limit_N:g} N")


def _who(subject: str) -> str:
    """Whose tissue it is: the breathing subject is the average one."""
    return "average" if subject == BREATHING else subject


def _model_file(out: Path, subject: str) -> Path:
    return out / f"{_who(subject)}.json"


def _learning_folder(out: Path, subject: str) -> Path:
    return out / f"learn-{_who(subject)}"


def _draw(runs: Sequence[ComparedRun], out: Path) -> None:
    subjects, choices = dict.fromkeys(run.subject for run in runs), dict.fromkeys(run.gains for run in runs)
    found = {(run.subject, run.gains): run.worst.model_dump() for run in runs}

    def heights(figure: str) -> dict[str, list[float]]:
        return {choice: [_height(found[subject, choice][figure]) for subject in subjects] for choice in choices}

    picture = comparison_figure(list(subjects), heights("overshoot_percent"), heights("settling_s"))
    (out / "comparison.svg").write_text(svg(picture))
    console.print(f"comparison.svg is in {out}", highlight=False)


def _height(value: float | None) -> float:
    return math.nan if value is None else value


def bench_of(wiring: Wiring, subject: str) -> Wiring:
    """The mock bench with this subject on it; the breathing one is the average subject, whose surface moves."""
    hidden = BREATHES if subject == BREATHING else ()
    mock = wiring.mock.model_copy(update={"parameters": SUBJECTS / f"{_who(subject)}.toml", "hide": hidden})
    return wiring.model_copy(update={"mock": mock})


def learnt(wiring: Wiring, out: Path, subject: str) -> Model:
    """The model `rig fit` makes of an indentation of this subject, breath held; kept in ``out``."""
    file = _model_file(out, subject)
    if file.exists():
        return load_model(file)
    session = open_session(_indented(wiring, out, subject))
    model = model_of(study_session(session), "index", session.info.subject)
    model.save(file)
    return model


def _indented(wiring: Wiring, out: Path, subject: str, attempt: int = 1) -> Path:
    """The session of the indentation; one that a stall of the computer stopped is kept, and done again beside it."""
    folder = _learning_folder(out, subject)
    folder = folder if attempt == 1 else folder.with_name(f"{folder.name}-{attempt}")
    try:
        with bench_for(bench_of(wiring, _who(subject))) as (plugged, _), live.connected(plugged) as bench:
            capture.capture(bench, LEARNING, folder, Operation("learn"))
    except (SafetyStop, DeviceError) as cause:
        if attempt == ATTEMPTS:
            raise
        console.print(f"{folder.name}: {cause}; once more", highlight=False)
        return _indented(wiring, out, subject, attempt + 1)
    return folder


def _on_subject(
    wiring: Wiring, out: Path, subject: str, model: Model, choices: Sequence[Choice], reference: Reference
) -> Iterator[ComparedRun]:
    for choice in choices:
        try:
            program = tracked.plan_reference(reference, model, wiring, choice)
        except UsageError as refusal:
            yield compared_run(subject, choice, (), str(refusal))
        else:
            yield _tracked(wiring, out, subject, choice, program)


def _tracked(
    wiring: Wiring, out: Path, subject: str, choice: Choice, program: Program, attempt: int = 1
) -> ComparedRun:
    """One run on a bench of its own; what a stall of the computer stopped is said, and done again."""
    try:
        with bench_for(bench_of(wiring, subject)) as (plugged, _), live.connected(plugged) as bench:
            done = tracked.recorded_run(bench, program, out / subject, str(_model_file(out, subject)))
    except DeviceError as cause:
        found, stalled = compared_run(subject, choice, (), str(cause)), True
    else:
        found = compared_run(subject, choice, _jumps(done), done.outcome.cause)
        stalled = done.outcome.outcome in STALLED
    if not stalled or attempt == ATTEMPTS:
        return found
    console.print(f"{subject}  {choice}: {found.stopped}; once more", highlight=False)
    return _tracked(wiring, out, subject, choice, program, attempt + 1)


def _jumps(done: Recorded) -> tuple[Jump, ...]:
    """What the recording shows; a run that was stopped may have been so before its first jump."""
    loop = read_recording(done.file).tables["loop"]
    try:
        return comparison.jumps(loop["capture_ns"] * 1e-9, loop["reference_N"], loop["force_N"], loop["mode"])
    except DataError:
        if done.outcome.stopped:
            return ()
        raise


def stairs(forces: str, each_s: float) -> Reference:
    """``1,10`` as jumps of 1 N from the first to the last; raises UsageError where that makes no jump to judge."""
    levels = tracked.forces(forces)
    if len(levels) != 2 or abs(levels[1] - levels[0]) < Stairs.model_fields["step_N"].default:
        raise UsageError(
            f"--force {forces}: --table compares jumps of 1 N; give the first and the last force, at least 1 N apart,"
            " for example 1,10"
        )
    if not each_s > comparison.STEADY_S + comparison.REMAINS_S:
        least_s = comparison.STEADY_S + comparison.REMAINS_S
        raise UsageError(f"--seconds {each_s:g}: each jump needs more than {least_s:g} s to be judged")
    values = {"from_N": levels[0], "to_N": levels[1], "each_s": each_s}
    return parse(Stairs, values, f"--force {forces}").reference()
