"""What each kind of job does is what its command does: same work, same result, results where they belong."""

import json
import shutil
from pathlib import Path

import pytest

from api.http.jobs import work_recordings, work_science
from api.http.jobs.params import (
    DataPlace,
    DiagnoseParams,
    ExportParams,
    FitParams,
    ForceOverTime,
    ImportParams,
    ModelRef,
    ProposeParams,
    ProtocolCheckParams,
    RepairParams,
    SimulateParams,
    VerifyParams,
)
from api.http.jobs.places import Places
from api.http.jobs.references import reference_of
from api.http.jobs.worker import Desk
from controller.experiments.references import parse_reference
from controller.operation import Cancelled, Operation
from mock_devices.testing.made.synthetic import Bench, write_made_session
from mock_devices.testing.models import index_model
from rig.config.wiring import Wiring
from rig.errors import UsageError
from rig.recording.export import Format
from rig.recording.sessions import open_session
from rig.results.fit import FitResult
from rig.tissue.model import load_model
from tests.rig.recording.measured import measured

UPLOAD = "0a1b2c3d4e5f"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    cycles = Bench(rate_Hz=500.0).cycles(trials=2, speeds_mm_s=(5.0, 20.0))
    return write_made_session(tmp_path_factory.mktemp("made") / "session", cycles)


@pytest.fixture
def desk(tmp_path: Path, made: Path) -> Desk:
    """Over a folder with one session, one upload and one protocol."""
    for folder in ("sessions", "protocols", "uploads"):
        (tmp_path / folder).mkdir()
    shutil.copytree(made, tmp_path / "sessions" / "first")
    measured(tmp_path / "uploads" / UPLOAD)
    (tmp_path / "protocols" / "p.toml").write_text('kind = "indentation"\ndepth_mm = 8\n')
    places = Places(*(tmp_path / name for name in ("sessions", "protocols", "uploads", "files")))
    return Desk(places, Wiring(), ask=pytest.fail)


def run() -> Operation:
    return Operation("job")


def files_in(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def test_a_fit_of_one_session_stays_in_it_and_of_several_is_the_jobs_own(desk: Desk) -> None:
    first = desk.places.sessions / "first"
    found = work_science.fit(run(), FitParams(sessions=["first"], known={}), desk)
    assert found == FitResult.read(first / "fit" / "fit.json") and load_model(first / "fit" / "model.json")
    shutil.copytree(first, first.with_name("second"))
    both = work_science.fit(run(), FitParams(sessions=["first", "second"], laws=["fung"], model="fung"), desk)
    assert {"index", "constant", "fung"} <= set(both.laws)
    assert (
        "model.json" in files_in(desk.places.files) and load_model(desk.places.files / "model.json").law.name == "fung"
    )


def test_the_progress_of_a_fit_with_a_lattice_is_a_share_and_a_cancel_reaches_it(desk: Desk) -> None:
    outer, shares = run(), list[float]()
    outer.watch = lambda now: shares.append(now.done)
    inner = work_science.relayed(Operation("fit", total=4), outer)
    inner.step("laws", 1.0)
    inner.say("three laws")
    inner.step("lattice", 3.0)
    assert shares[0] == 0.25 and shares[-1] == 0.75 and outer.progress.log == ("three laws",)
    outer.cancel()
    with pytest.raises(Cancelled, match="cancelled before: the last"):
        inner.step("the last", 4.0)


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"laws": ["none"]}, "none"),
        ({"known": {"thickness_mm": 25.0}}, "thickness_mm=25: the laws compared have"),
        ({"lattice": {"block": "9x9"}}, "write vertices in x, y and z"),
    ],
)
def test_what_a_fit_cannot_do_is_one_sentence(desk: Desk, asked: dict[str, object], said: str) -> None:
    with pytest.raises(UsageError, match=said):
        work_science.fit(run(), FitParams.model_validate({"sessions": ["first"], **asked}), desk)


def test_a_protocol_is_checked_on_the_tissue_of_a_session(desk: Desk) -> None:
    model = desk.places.sessions / "first" / "fit" / "model.json"
    model.parent.mkdir()
    index_model(0.12, 0.22, 0.01).save(model)
    asked = ProtocolCheckParams(protocol="p", model=ModelRef(session="first"), tracker=False)
    found = work_science.protocol_check(run(), asked, desk)
    assert "index" in found.tissue and any(name.startswith("confusability") for name in files_in(desk.places.files))


def test_a_simulation_follows_points_as_it_follows_the_same_reference(desk: Desk) -> None:
    model = desk.places.sessions / "first" / "fit" / "model.json"
    model.parent.mkdir()
    index_model(0.12, 0.22, 0.01).save(model)
    ref, ramp = ModelRef(session="first"), parse_reference("ramp:2")
    points = [[t + 7.0, force] for t, force in zip(ramp.times_s, ramp.forces_N, strict=True)]
    named = work_science.simulate(run(), SimulateParams(model=ref, reference="ramp:2"), desk)
    drawn = work_science.simulate(run(), SimulateParams(model=ref, points=points), desk)
    assert drawn.duration_s == pytest.approx(named.duration_s)
    assert drawn.peak_force_N == pytest.approx(named.peak_force_N)
    assert {"simulation.svg", "bode.svg"} <= files_in(desk.places.files)


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (ForceOverTime(reference="csv:/etc/passwd"), "names a file of another computer; send its rows as points"),
        (ForceOverTime(reference="dance:3"), "'dance' is none of step, ramp"),
        (ForceOverTime(points=[[0.0, 1.0]]), "a reference has 2 or more, not 1"),
        (ForceOverTime(points=[[0.0, 1.0], [1.0, 2.0], [1.0, 3.0]]), "1 s of point 3 does not come after 1 s"),
    ],
)
def test_a_reference_that_is_none_is_one_sentence(asked: ForceOverTime, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        reference_of(asked)


def test_an_upload_is_proposed_for_and_imported_with_its_mapping(desk: Desk) -> None:
    found = work_recordings.propose_mapping(run(), ProposeParams(upload=UPLOAD), desk)
    assert {"force", "position"} <= {column.quantity for column in found.columns} | {"position"}
    assert "tables" in found.mapping or found.questions
    made = work_recordings.import_upload(run(), ImportParams(upload=UPLOAD, session="new"), desk)
    assert (desk.places.sessions / "new" / "session.json").is_file() and made.recordings > 0
    with pytest.raises(UsageError, match="session new exists"):
        work_recordings.import_upload(run(), ImportParams(upload=UPLOAD, session="new"), desk)


def test_a_mapping_that_is_sent_counts_before_that_of_the_files(desk: Desk) -> None:
    asked = ImportParams(upload=UPLOAD, session="new", mapping="this is = no mapping")
    with pytest.raises(UsageError, match=r"mapping\.toml"):
        work_recordings.import_upload(run(), asked, desk)
    assert not (desk.places.sessions / "new").exists()


def test_results_of_an_upload_are_the_jobs_own_and_the_upload_stays_as_it_was(desk: Desk) -> None:
    before = files_in(desk.places.uploads)
    work_recordings.report(run(), DataPlace(upload=UPLOAD), desk)
    work_recordings.export(run(), ExportParams(upload=UPLOAD, formats=["csv"]), desk)
    assert "report.html" in files_in(desk.places.files)
    assert any(name.startswith("csv/") for name in files_in(desk.places.files))
    assert files_in(desk.places.uploads) == before


@pytest.mark.parametrize("form", ["csv", "parquet", "hdf5"])
@pytest.mark.parametrize("name", ["{root}/planted", "../../planted", "..", ""])
def test_a_trial_whose_name_leads_out_of_an_upload_is_known_by_its_file(desk: Desk, form: Format, name: str) -> None:
    root = desk.places.sessions.parent
    shutil.copytree(desk.places.sessions / "first", upload := desk.places.uploads / "00000000000a")
    listed = json.loads((upload / "session.json").read_text())
    first = listed["trials"][0]
    named, first["name"] = first["name"], name.format(root=root)
    (upload / "session.json").write_text(json.dumps(listed))
    before = files_in(root)
    work_recordings.export(run(), ExportParams(upload=upload.name, formats=[form]), desk)
    assert {name.partition("/")[0] for name in files_in(root) - before} == {"files"}
    assert open_session(upload).trials[0].name == named == Path(first["file"]).stem


def test_a_repair_leaves_the_session_as_it_was_recorded(desk: Desk) -> None:
    first = desk.places.sessions / "first"
    trial = next(first.glob("*.mcap"))
    trial.write_bytes(trial.read_bytes()[:-200])
    before = {path: path.read_bytes() for path in first.iterdir()}
    assert not work_recordings.verify(run(), VerifyParams(session="first"), desk).ok
    work_recordings.repair(run(), RepairParams(session="first", recording=trial.stem), desk)
    assert {path: path.read_bytes() for path in first.iterdir()} == before
    assert files_in(desk.places.files) == {trial.name}
    one = work_recordings.verify(run(), VerifyParams(session="first", recording=trial.name), desk)
    assert list(one.recordings) == [trial.stem]


def test_a_diagnosis_that_needs_an_axis_says_so(desk: Desk) -> None:
    asked = DiagnoseParams(session="first", reference="x = 1")
    with pytest.raises(UsageError, match="no axis is there to simulate"):
        work_science.diagnose(run(), asked, desk)
