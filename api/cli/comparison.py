"""`rig track --table`: every choice of gains on simulated subjects, each learnt first by indentation and fit."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import mock_devices
from api.cli.output import console, table
from api.cli.stage import bench_for
from controller.experiments import capture, comparison, tracked
from controller.experiments.comparison import HEADER, Jump, Run
from controller.experiments.recorded import Recorded
from controller.experiments.references import Reference, Stairs
from controller.gains import Choice
from controller.operation import Operation
from controller.supervisor import Supervisor
from rig.config.protocol import Indentation
from rig.config.wiring import Wiring
from rig.errors import DataError, UsageError
from rig.recording.reader import read_recording
from rig.recording.sessions import open_session
from rig.report.control_figures import comparison_figure
from rig.report.drawing import svg
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


def compare(
    wiring: Wiring, out: Path, subjects: Sequence[str], choices: Sequence[Choice], reference: Reference
) -> dict[str, object]:
    """Runs all of it on mock benches, prints the table, and returns its JSON."""
    if wiring.mock.parameters or wiring.mock.hide or not wiring.uses_mock:
        raise UsageError("--table brings its own subjects: use it with ports `mock` and without mock parameters")
    unknown = [name for name in subjects if name not in ALL]
    if unknown:
        raise UsageError(f"--subjects {unknown[0]}: there are {', '.join(ALL)}")
    runs: list[Run] = []
    models: dict[str, dict[str, float]] = {}
    for subject in subjects:
        model = learnt(wiring, out, subject)
        models[subject] = {parameter.name: parameter.value for parameter in model.law.parameters}
        for run in _on_subject(wiring, out, subject, model, choices, reference):
            runs.append(run)
            console.print("  ".join(cell for cell in comparison.rows([run])[0] if cell), highlight=False)
    console.print(table(HEADER, comparison.rows(runs), title=f"Worst of {reference.name}"))
    _draw(runs, out)
    return {"reference": reference.name, "models": models, "runs": [run.as_json() for run in runs]}


def _draw(runs: Sequence[Run], out: Path) -> None:
    subjects, choices = dict.fromkeys(run.subject for run in runs), dict.fromkeys(run.gains for run in runs)
    found = {(run.subject, run.gains): run.worst for run in runs}

    def heights(figure: str) -> dict[str, list[float]]:
        return {choice: [_height(found[subject, choice][figure]) for subject in subjects] for choice in choices}

    picture = comparison_figure(list(subjects), heights("overshoot_percent"), heights("settling_s"))
    (out / "comparison.svg").write_text(svg(picture))
    console.print(f"comparison.svg is in {out}", highlight=False)


def _height(value: float | None) -> float:
    return math.nan if value is None else value


def bench_of(wiring: Wiring, subject: str) -> Wiring:
    """The mock bench with this subject on it; the breathing one is the average subject, whose surface moves."""
    breathing = subject == BREATHING
    mock = wiring.mock.model_copy(
        update={
            "parameters": SUBJECTS / f"{'average' if breathing else subject}.toml",
            "hide": BREATHES if breathing else (),
        }
    )
    return wiring.model_copy(update={"mock": mock})


def learnt(wiring: Wiring, out: Path, subject: str) -> Model:
    """The model `rig fit` makes of an indentation of this subject, breath held; kept in ``out``."""
    who = "average" if subject == BREATHING else subject
    folder, file = out / f"learn-{who}", out / f"{who}.json"
    if file.exists():
        return load_model(file)
    with bench_for(bench_of(wiring, who)) as (live, _), Supervisor(live) as bench:
        capture.capture(bench, LEARNING, folder, Operation("learn"), lambda _: None)
    session = open_session(folder)
    model = model_of(study_session(session), "index", session.info.subject)
    model.save(file)
    return model


def _on_subject(
    wiring: Wiring, out: Path, subject: str, model: Model, choices: Sequence[Choice], reference: Reference
) -> Iterator[Run]:
    with bench_for(bench_of(wiring, subject)) as (live, _), Supervisor(live) as bench:
        for choice in choices:
            program = tracked.plan_reference(reference, model, live, choice)
            done = tracked.recorded_run(bench, program, out / subject, str(out / f"{subject}.json"))
            if done.outcome.stopped:
                bench.reset()
            yield Run(subject, choice, _jumps(done), done.outcome.cause)


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
    """``1,10`` as jumps of 1 N from the first to the last."""
    levels = tracked.forces(forces)
    return Stairs(from_N=levels[0], to_N=levels[-1], each_s=each_s).reference()
