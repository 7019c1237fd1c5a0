"""`rig verify`, `rig repair`, `rig import`, `rig export` as typed by a person."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
import typer
from typer.testing import CliRunner, Result

from api.cli import records
from rig.errors import CheckFailed, DataError, UsageError, WriteFailed
from rig.recording.sessions import open_session, write_session
from rig.report.page import write_report
from tests.rig.recording import tampered
from tests.rig.recording.measured import measured, write

app = typer.Typer(rich_markup_mode=None)
for name, command in (
    ("verify", records.verify),
    ("repair", records.repair),
    ("import", records.import_),
    ("export", records.export_),
):
    app.command(name)(command)


def rig(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture
def source(tmp_path: Path) -> Path:
    return measured(tmp_path / "measured")


@pytest.fixture
def session(source: Path, tmp_path: Path) -> Path:
    out = tmp_path / "session"
    assert rig("import", source, "--out", out).exit_code == 0
    return out


@pytest.mark.parametrize("command", ["verify", "repair", "import", "export"])
def test_help_ends_with_an_example(command: str) -> None:
    result = rig(command, "--help")
    assert result.exit_code == 0
    assert f"Example: rig {command} " in result.output


def test_import_prints_a_table_and_writes_its_result(source: Path, tmp_path: Path) -> None:
    result = rig("import", source, "--out", tmp_path / "out", "--json", tmp_path / "result.json")
    assert result.exit_code == 0
    assert "trial_02" in result.output
    written = json.loads((tmp_path / "result.json").read_text())
    assert written.pop("came_in") == json.loads((tmp_path / "out" / "what-came-in.json").read_text())
    assert written == {
        "version": 1,
        "session": str(tmp_path / "out"),
        "recordings": 2,
        "samples": {"force": 6, "axis": 6, "marker": 3},
        "remarks": [],
    }


def test_a_mapping_may_stand_anywhere(source: Path, tmp_path: Path) -> None:
    mapping = (source / "mapping.toml").rename(tmp_path / "mine.toml")
    assert rig("import", source, "--out", tmp_path / "out", "--mapping", mapping).exit_code == 0
    assert open_session(tmp_path / "out").trials[0].peak_force_N == 1.5


def test_the_peak_of_a_pull_is_shown_with_its_sign_wherever_a_peak_is(tmp_path: Path) -> None:
    rows = "".join(f"0.{k},{2 * k},{k}\n" for k in range(8))
    source = write(tmp_path / "in", {"a.csv": "Test type,Tension\n\nTime (s),Travel (mm),Force (N)\n" + rows})
    result = rig("import", source, "--out", tmp_path / "out")
    assert result.exit_code == 0, result.exception
    assert "-7.00" in result.output
    session = open_session(tmp_path / "out")
    assert session.trials[0].peak_force_N == -7.0
    write_report(session, tmp_path / "report.html")
    assert ">-7.00<" in (tmp_path / "report.html").read_text()


def test_without_a_mapping_one_is_proposed_saved_and_used(tmp_path: Path) -> None:
    rows = "".join(f"0.{k},{k},{2 * k}\n" for k in range(8))
    source = write(tmp_path / "in", {"a.csv": "time_s,Force,x_mm\n" + rows})
    refused = rig("import", source, "--out", tmp_path / "out").exception
    assert isinstance(refused, UsageError)
    line = 'columns.force = { column = "Force", positive = "compression", unit = "N" }'
    assert f"give the line {line} and the line columns.position = " not in str(refused)
    assert f"give the line {line} in" in str(refused)
    assert "# open: a.csv: force ('Force', 0 to 7) has no unit" in (tmp_path / "out.toml").read_text()
    assert "was proposed before" in str(rig("import", source, "--out", tmp_path / "out").exception)
    (tmp_path / "out.toml").unlink()
    taken = rig("import", source, "--out", tmp_path / "out", "--yes")
    assert taken.exit_code == 0, taken.exception
    assert "as if pressed" in taken.output
    assert open_session(tmp_path / "out").trials[0].peak_force_N == 7.0
    again = rig("import", source, "--out", tmp_path / "again", "--mapping", tmp_path / "out.toml")
    assert again.exit_code == 0


def test_folders_of_one_name_have_proposals_of_their_own_and_each_is_used_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write(tmp_path, {"data.toml": "mine = 1\n"})
    places = [tmp_path / name / "data" for name in ("first", "second")]
    for place in places:
        write(place, {"a.csv": "time_s,force_N,depth_mm\n" + "".join(f"0.{k},{k},{2 * k}\n" for k in range(8))})
    used = [records.mapping_for(place, None, Path(place.stem), yes=True) for place in (*places, places[0])]
    assert used == [Path("data-2.toml"), Path("data-3.toml"), Path("data-2.toml")]
    assert (tmp_path / "data.toml").read_text() == "mine = 1\n"


def test_a_proposal_that_is_used_again_is_shown_with_what_it_doubts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = "".join(f"0.{k},{k},{2 * k},{2 * k}\n" for k in range(8))
    place = write(tmp_path / "data", {"a.csv": f"time_s,force_N,depth_mm,gap_mm\n{rows}"})
    said = []
    for _ in range(2):
        records.mapping_for(place, None, tmp_path / "out", yes=True)
        said.append(" ".join(capsys.readouterr().out.split()))
    assert "is used; remove it for a new proposal" in said[1]
    assert all("it may be 'gap_mm'" in text for text in said)


NAMELESS = "time_s,a,depth_mm,b\n" + "".join(f"0.{k},{k / 3},{2 * k},{-k / 7}\n" for k in range(10))


def test_a_column_no_name_tells_is_asked_for_and_never_guessed(tmp_path: Path) -> None:
    source = write(tmp_path / "in", {"a.csv": NAMELESS})
    line = 'give the line columns.force = { column = "?", unit = "?" } in'
    for options, why in (
        ([], "no terminal to answer at"),
        (["--yes"], "no answer is clearly the best, so --yes takes"),
    ):
        refused = rig("import", source, "--out", tmp_path / "out", *options).exception
        assert isinstance(refused, UsageError) and refused.exit_code == 2
        assert "a.csv: no name tells which column is the force; it may be a (no unit, 0 to 3, moves); b" in str(refused)
        assert why in str(refused) and line in str(refused)
        assert not (tmp_path / "out").exists()
        text = (tmp_path / "out.toml").read_text()
        (tmp_path / "out.toml").unlink()
    given, mine = line.removeprefix("give the line ").removesuffix(" in"), tmp_path / "mine.toml"
    mine.write_text(text + given)
    assert "this is still open" in str(rig("import", source, "--out", tmp_path / "out", "--mapping", mine).exception)
    mine.write_text(text + given.replace('column = "?"', 'column = "a"').replace('unit = "?"', 'unit = "N"'))
    mended = rig("import", source, "--out", tmp_path / "out", "--mapping", mine)
    assert mended.exit_code == 0, mended.exception
    assert open_session(tmp_path / "out").trials[0].peak_force_N == pytest.approx(3.0)


def test_on_a_terminal_it_is_asked_until_the_answer_is_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("api.cli.asking.sys", SimpleNamespace(stdin=SimpleNamespace(isatty=lambda: True)))
    source = write(tmp_path / "in", {"a.csv": NAMELESS})
    result = CliRunner().invoke(app, ["import", str(source), "--out", str(tmp_path / "out")], input="c N\nb mN\n")
    assert result.exit_code == 0, result.exception
    assert "'c N' is none of the columns" in result.output
    assert open_session(tmp_path / "out").trials[0].peak_force_N == pytest.approx(9 / 7e3)


def test_bad_files_are_wrong_use(source: Path, tmp_path: Path) -> None:
    (source / "trial_01" / "force.csv").write_text("time_s,force_N\n0,1\n1,abc\n")
    error = rig("import", source, "--out", tmp_path / "out").exception
    assert isinstance(error, DataError)
    assert error.exit_code == 2
    assert not (tmp_path / "out").exists()


def test_a_whole_session_verifies(session: Path, tmp_path: Path) -> None:
    result = rig("verify", session, "--json", tmp_path / "result.json")
    assert result.exit_code == 0
    assert result.output.count("complete") == 5
    values = json.loads((tmp_path / "result.json").read_text())
    assert (values["ok"], values["remarks"]) == (True, [])
    force = values["recordings"]["trial_01"]["streams"]["force"]
    assert (force["samples"], force["missing"], force["dropped"]) == (3, 0, 0)
    assert force["rate_Hz"] == pytest.approx(1000)
    assert values["recordings"]["trial_01"]["streams"]["loop"]["rate_Hz"] is None


def test_a_cut_recording_fails_the_check_and_the_result_is_written_all_the_same(session: Path, tmp_path: Path) -> None:
    path = session / "trial_02.mcap"
    path.write_bytes(path.read_bytes()[:-100])
    result = rig("verify", session, "--json", tmp_path / "result.json")
    assert isinstance(result.exception, CheckFailed)
    assert "1 of 2 recordings are not complete (trial_02)" in str(result.exception)
    assert "trial_02.mcap: incomplete" in result.output
    values = json.loads((tmp_path / "result.json").read_text())
    assert not values["ok"]
    assert values["recordings"]["trial_02"]["state"] == "incomplete"
    assert values["recordings"]["trial_01"]["ok"]


def test_a_missing_recording_fails_the_check(session: Path) -> None:
    (session / "trial_02.mcap").unlink()
    error = rig("verify", session).exception
    assert isinstance(error, CheckFailed)
    assert "trial trial_02: its recording trial_02.mcap is missing" in str(error)


@pytest.mark.parametrize(
    ("plant", "sentence"),
    [
        (tampered.swap, "trial_01.mcap: was recorded as trial_02 of session"),
        (tampered.copy, "trial_02.mcap: was recorded as trial_01 of session"),
        (tampered.rewrite, "trial_01.mcap: was changed after it was closed"),
        (tampered.edit_list, "session.json: was changed after the program wrote it"),
    ],
)
def test_a_swapped_copied_or_edited_file_fails_the_check_though_each_is_whole(
    session: Path, tmp_path: Path, plant: Callable[[Path], None], sentence: str
) -> None:
    plant(session)
    result = rig("verify", session, "--json", tmp_path / "result.json")
    assert isinstance(result.exception, CheckFailed) and result.exception.exit_code == 1
    assert sentence in str(result.exception) and sentence in result.output
    values = json.loads((tmp_path / "result.json").read_text())
    assert values["ok"] is False
    assert [recording["ok"] for recording in values["recordings"].values()] == [True, True]
    assert any(remark.startswith(sentence) for remark in values["remarks"])


def test_the_quality_of_a_trial_is_said_and_is_no_matter_of_completeness(session: Path, tmp_path: Path) -> None:
    info = open_session(session).info
    spoilt = replace(info.trials[0], quality="bad", reasons=("the loop missed of its cycles 40 % (good up to 5 %)",))
    write_session(session, replace(info, trials=(spoilt, *info.trials[1:])))
    result = rig("verify", session, "--json", tmp_path / "result.json")
    assert result.exit_code == 0
    assert f"{spoilt.name}: quality bad; the loop missed of its cycles 40 % (good up to 5 %)" in result.output
    recordings = json.loads((tmp_path / "result.json").read_text())["recordings"]
    assert recordings[spoilt.name]["quality"] == "bad" and len(recordings[spoilt.name]["reasons"]) == 1
    assert recordings[info.trials[1].name]["quality"] == ""


def test_one_recording_can_be_verified(session: Path) -> None:
    assert rig("verify", session / "trial_01.mcap").exit_code == 0


def test_a_place_without_session_is_wrong_use(tmp_path: Path) -> None:
    assert isinstance(rig("verify", tmp_path / "none").exception, UsageError)


def test_repair_makes_a_recording_that_verifies(session: Path, tmp_path: Path) -> None:
    path = session / "trial_02.mcap"
    path.write_bytes(path.read_bytes()[:-100])
    result = rig("repair", path, "--out", tmp_path / "good.mcap", "--json", tmp_path / "result.json")
    assert result.exit_code == 0
    assert "complete, as repaired from trial_02.mcap" in result.output
    assert json.loads((tmp_path / "result.json").read_text())["state"] == "complete"
    assert rig("verify", tmp_path / "good.mcap").exit_code == 0


def test_export_writes_every_format_or_the_ones_asked_for(session: Path, tmp_path: Path) -> None:
    result = rig("export", session, "--out", tmp_path / "all", "--json", tmp_path / "result.json")
    assert result.exit_code == 0
    assert sorted(path.name for path in (tmp_path / "all").iterdir()) == ["csv", "parquet", "session.h5", "session.mat"]
    assert json.loads((tmp_path / "result.json").read_text())["written"]["hdf5"] == str(tmp_path / "all" / "session.h5")
    assert rig("export", session, "--out", tmp_path / "some", "--format", "mat,CSV").exit_code == 0
    assert sorted(path.name for path in (tmp_path / "some").iterdir()) == ["csv", "session.mat"]
    error = rig("export", session, "--out", tmp_path / "more", "--format", "xlsx").exception
    assert isinstance(error, UsageError)
    assert str(error) == "--format xlsx: unknown; there are csv, parquet, hdf5, mat"
    assert not (tmp_path / "more").exists()


def test_export_into_a_file_is_one_sentence(session: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    error = rig("export", session, "--out", tmp_path / "file").exception
    assert isinstance(error, WriteFailed)
    assert "cannot be made: File exists" in str(error)
