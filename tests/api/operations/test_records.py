"""Operations on recordings: what they return and say, and what is left where they are cancelled."""

from collections.abc import Callable
from pathlib import Path

import pytest

from api.operations import records
from controller.operation import Cancelled, Operation, Progress
from mock_devices.testing.made.synthetic import Bench, write_made_session
from rig.results.recorded import VerifyResult
from tests.rig.recording import tampered
from tests.rig.recording.measured import NOW, measured, run


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    cycles = Bench(rate_Hz=500.0).cycles(trials=1, speeds_mm_s=(5.0, 20.0))
    return write_made_session(tmp_path_factory.mktemp("made") / "session", cycles)


def test_a_session_is_verified_recording_by_recording(session: Path) -> None:
    operation, told = Operation("verify"), list[tuple[float, str]]()
    operation.watch = lambda now: told.append((now.done, now.message))
    found = records.verify(operation, session)
    names = ["trial_500.mcap", "trial_2000.mcap"]
    assert [message for _, message in told] == [*names, "the session's list of hashes"]
    assert [done for done, _ in told] == [0.0, 0.5, 1.0]
    assert list(found.recordings) == [name.removesuffix(".mcap") for name in names]
    assert VerifyResult.model_validate_json(found.model_dump_json()) == found


def test_what_is_no_recording_is_damaged_and_hides_no_other(session: Path, tmp_path: Path) -> None:
    alone = records.verify(Operation("verify"), session / "trial_500.mcap")
    assert list(alone.recordings) == ["trial_500"] and alone.remarks == ()
    copied = write_made_session(tmp_path / "copied", Bench(rate_Hz=500.0).cycles(trials=1, speeds_mm_s=(5.0, 20.0)))
    (copied / "trial_500.mcap").write_bytes(b"nothing of the kind")
    found = records.verify(Operation("verify"), copied)
    assert not found.ok
    assert [one.state for one in found.recordings.values()] == ["damaged", alone.recordings["trial_500"].state]


@pytest.mark.parametrize(
    ("plant", "sentence"),
    [
        (tampered.swap, "trial_02.mcap: was recorded as trial_01"),
        (tampered.copy, "trial_02.mcap: has the content of trial_01"),
        (tampered.rewrite, "trial_01.mcap: was changed after it was closed"),
    ],
)
def test_a_session_whose_files_are_not_those_it_was_closed_with_is_not_whole(
    tmp_path: Path, plant: Callable[[Path], None], sentence: str
) -> None:
    folder = run(measured(tmp_path / "measured")).folder
    assert records.verify(Operation("verify"), folder).ok
    plant(folder)
    found = records.verify(Operation("verify"), folder)
    assert not found.ok and all(one.ok for one in found.recordings.values())
    assert any(remark.startswith(sentence) for remark in found.remarks), found.remarks


def cancelled_once(message: str, name: str) -> Operation:
    """An operation that is cancelled as soon as it says ``message``."""
    operation = Operation(name)

    def watch(now: Progress) -> None:
        if now.message == message:
            operation.cancel()

    operation.watch = watch
    return operation


def test_a_repair_that_is_cancelled_among_the_samples_leaves_nothing(session: Path, tmp_path: Path) -> None:
    operation, out = cancelled_once("saving good samples", "repair"), tmp_path / "good.mcap"
    with pytest.raises(Cancelled, match="repair was cancelled before: saving good samples"):
        operation.run(lambda: records.repair(operation, session / "trial_500.mcap", out))
    assert 0 < operation.progress.done < 1
    assert not list(tmp_path.iterdir())
    whole = records.repair(Operation("repair"), session / "trial_500.mcap", out)
    assert whole.streams.keys() and out.exists()


@pytest.mark.parametrize(
    ("said", "next_"),
    [("trial_01: 3 samples", "trial_01: 6 samples"), ("trial_01: 6 samples", "trial_02: 3 samples")],
)
def test_an_import_that_is_cancelled_between_two_pieces_leaves_nothing(tmp_path: Path, said: str, next_: str) -> None:
    source, operation = measured(tmp_path / "measured"), cancelled_once(said, "import")
    with pytest.raises(Cancelled, match=f"import was cancelled before: {next_}"):
        operation.run(lambda: records.import_data(operation, source, source / "mapping.toml", tmp_path / "out", NOW))
    assert [path.name for path in tmp_path.iterdir()] == ["measured"]


def test_an_export_that_is_cancelled_makes_no_further_format(session: Path, tmp_path: Path) -> None:
    operation = cancelled_once("csv", "export")
    with pytest.raises(Cancelled, match="export was cancelled before: mat"):
        operation.run(lambda: records.export_session(operation, session, tmp_path / "out", ["csv", "mat"]))
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["csv"]
    assert operation.progress.log == (f"csv     {tmp_path / 'out' / 'csv'}",)
