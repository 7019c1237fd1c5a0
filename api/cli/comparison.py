"""`rig track --table`: jumps of force on the simulated subjects."""

from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path

import mock_devices
from api.cli import live
from api.cli.computing import here
from api.cli.output import show, write_json
from api.operations.compare import Comparison, comparison_operation
from api.operations.compare import compare as work
from controller.experiments import comparison, tracked
from controller.experiments.references import Reference, Stairs
from controller.supervisor import Supervisor
from rig.config.table import parse
from rig.config.wiring import Wiring
from rig.errors import UsageError
from rig.results.compared_tables import alternatives_table
from rig.results.tables import run_table, study_table
from rig.results.tracking import CompareResult

SUBJECTS = Path(mock_devices.__file__).parent / "subjects"
BREATHING = "breathing"
BREATHES_MM_HZ = 1.5, 0.25
BREATHES = f"surface_motion.amplitude_mm={BREATHES_MM_HZ[0]}", f"surface_motion.frequency_Hz={BREATHES_MM_HZ[1]}"
ALL = (*sorted(path.stem for path in SUBJECTS.glob("*.toml")), BREATHING)


def compare(wiring: Wiring, out: Path, subjects: Sequence[str], reference: Reference, json_file: Path | None) -> None:
    """Runs all of it on mock benches; prints the tables, those of the benches before anything is simulated."""
    _refuse_subjects(wiring, subjects)
    whose = {subject: _who(subject) for subject in subjects}

    def keep(found: CompareResult) -> None:
        write_json(json_file, found)
        show(study_table(found.runs), run_table(found.runs, reference.name), f"comparison.svg is in {out}")

    breathing = {BREATHING: BREATHES_MM_HZ}
    wanted = Comparison(wiring, out, whose, reference, lambda one: _bench(wiring, one), breathing, keep)
    operation = comparison_operation(wanted)
    result = here(operation, lambda: work(operation, wanted))
    show(alternatives_table(result.alternatives))
    write_json(json_file, result)


def _refuse_subjects(wiring: Wiring, subjects: Sequence[str]) -> None:
    if wiring.mock.parameters or wiring.mock.hide or not wiring.uses_mock:
        raise UsageError("--table brings its own subjects: use it with ports `mock` and without mock parameters")
    unknown = [name for name in subjects if name not in ALL]
    if unknown:
        raise UsageError(f"--subjects {unknown[0]}: there are {', '.join(ALL)}")


def _who(subject: str) -> str:
    """Whose tissue it is: the breathing subject is the average one."""
    return "average" if subject == BREATHING else subject


def _bench(wiring: Wiring, subject: str) -> AbstractContextManager[Supervisor]:
    """The mock bench with this subject on it; the breathing one is the average subject, whose surface moves."""
    hidden = BREATHES if subject == BREATHING else ()
    mock = wiring.mock.model_copy(update={"parameters": SUBJECTS / f"{_who(subject)}.toml", "hide": hidden})
    return live.running(wiring.model_copy(update={"mock": mock}))


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
