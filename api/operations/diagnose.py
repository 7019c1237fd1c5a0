"""What a session shows of the simulation's errors, and what a protocol could show."""

from pathlib import Path

from api.operations.at_hand import at_hand
from api.operations.judged import Simulation
from api.operations.opening import opened
from controller.operation import Operation
from rig.config.protocol import Indentation
from rig.diagnosis.answers import Diagnosis
from rig.diagnosis.design import LIMB, check, limb_of
from rig.diagnosis.extended import extended_model
from rig.diagnosis.planting import with_tried_sizes
from rig.diagnosis.run import diagnose_session
from rig.errors import DataError, UsageError
from rig.intake.mapping import AxisFacts, DataMapping
from rig.progress import Progress
from rig.recording.files import make_folder, refuse_unwritable
from rig.results.check import check_result
from rig.results.diagnosis import FILE, MOCK_LIMB, MODEL, PICTURES, DiagnosisResult, ProtocolCheckResult
from rig.tissue.model import Model
from rig.trials.opening import AS_IT_IS, Opening, stated_mapping
from rig.trials.reading import trials_of


def diagnose(
    operation: Operation,
    place: Path,
    simulation: Simulation = "index",
    out: Path | None = None,
    opening: Opening = AS_IT_IS,
    reference: Path | None = None,
    detectability: bool = False,
) -> DiagnosisResult:
    """The diagnosis of what ``place`` holds, of a drive axis where its mapping says so; results go to ``out`` too.

    ``reference`` is a file of models of others, to be simulated beside that of the axis.
    With ``detectability`` causes not found are planted in the recordings, to see from what size they would have been.
    """
    if out is not None:
        refuse_unwritable(out / FILE)
    with at_hand(place, operation.step) as near:
        found = _found(near, simulation, opening, reference, detectability, operation.step)
    result = DiagnosisResult.model_validate(found)
    if out is not None:
        _write(operation, found, result, out)
    return result


def _found(
    place: Path, simulation: Simulation, opening: Opening, reference: Path | None, detectability: bool, tell: Progress
) -> Diagnosis:
    mapping = stated_mapping(place, opening.mapping)
    if mapping is not None and mapping.axis is not None:
        if detectability:
            raise UsageError(f"{place}: sizes are tried on indentations, not on an axis; leave out --detectability")
        return _of_axis(place, mapping, mapping.axis, opening.only, reference, tell)
    if reference is not None:
        raise UsageError(
            f"{opening.mapping or place}: no axis is there to simulate {reference} with; write [axis] into its mapping"
        )
    with opened(place, tell, opening) as session:
        session.refuse_axis()
        trials = trials_of(session)
        found = diagnose_session(trials, simulation, tell)
        return with_tried_sizes(found, trials, progress=tell) if detectability else found


def _of_axis(
    place: Path, mapping: DataMapping, facts: AxisFacts, only: str, reference: Path | None, tell: Progress
) -> Diagnosis:
    # The axis needs none of the tissue's machinery, and the tissue none of the axis'.
    from rig.diagnosis.axis_run import diagnose_axis  # noqa: PLC0415
    from rig.intake.axis import read_axis  # noqa: PLC0415
    from rig.simulation.servo import read_models  # noqa: PLC0415

    models = read_models(reference) if reference else {}
    return diagnose_axis(
        read_axis(place, mapping, only), mapping.session.id or place.resolve().name, facts, models, tell
    )


def _write(operation: Operation, found: Diagnosis, result: DiagnosisResult, out: Path) -> None:
    """``diagnosis.json``, pictures, and the extended model where there is one."""
    from rig.report.diagnosis_figures import pictures  # noqa: PLC0415 - matplotlib takes a second to load
    from rig.report.drawing import save_figure  # noqa: PLC0415

    for old in (out / MODEL, *(out / f"{name}{kind}" for name in PICTURES for kind in (".svg", ".png"))):
        old.unlink(missing_ok=True)
    figures = pictures(found)
    make_folder(out)
    for name, figure in figures.items():
        save_figure(figure, out, name)
    result.write(out / FILE)
    operation.say(f"pictures and {FILE} are in {out}" if figures else f"{out / FILE} is written")
    if found.search is not None and found.simulation != "axis":
        try:
            model = extended_model(found)
        except DataError as error:
            operation.say(f"no {MODEL}: {error}")
            return
        model.save(out / MODEL)
        what = "extended model" if model.effects else "simulation's own model, with nothing added,"
        operation.say(f"{out / MODEL} is the {what} for rig track, simulate and fit --with")
        operation.say(*(f"  {effect.name}: {effect.used}" for effect in model.effects))


def check_protocol(
    operation: Operation,
    protocol: Indentation,
    tracker: bool,
    rate_Hz: float,
    out: Path | None = None,
    tissue: Model | None = None,
) -> ProtocolCheckResult:
    """Which causes ``protocol`` can show on ``tissue``; with ``out`` the picture of those confused is drawn there."""
    operation.step("laying out the protocol", 0.0)
    limb = LIMB if tissue is None else limb_of(tissue, protocol.depth_mm)
    found = check(protocol, tracker, rate_Hz, limb)
    if out is not None:
        from rig.report.drawing import save_figure  # noqa: PLC0415
        from rig.report.evidence_figures import confusability_figure  # noqa: PLC0415 - matplotlib takes a second

        make_folder(out)
        save_figure(confusability_figure(found.names, found.confusion), out, "confusability")
    return check_result(found, MOCK_LIMB if tissue is None else f"{tissue.law.name} of {tissue.data.session}")
