"""`import rig` as a notebook uses it: light to import, tables with units, and the answers that the commands give."""

import gc
import inspect
import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.text import Text
from typer.testing import CliRunner

import rig
from api.cli.app import build
from mock_devices.testing.made.synthetic import FOREARM, Bench, write_made_session
from rig.errors import DataError, UsageError
from rig.intake.mapping import MAPPING_FILE
from rig.notebook import SessionData
from rig.recording.reader import read_recording
from rig.tissue.model import load_model
from tests.rig.recording.measured import pressed


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session of two trials at two speeds."""
    cycles = Bench(rate_Hz=500.0).cycles(trials=2, speeds_mm_s=(5.0, 20.0))
    return write_made_session(tmp_path_factory.mktemp("made") / "session", cycles)


@pytest.fixture(scope="module")
def session(folder: Path) -> SessionData:
    return rig.open(str(folder))


def test_importing_it_loads_neither_numerics_nor_drawing() -> None:
    code = "import sys, rig; print(*{name.partition('.')[0] for name in sys.modules})"
    loaded = set(
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    )
    assert not loaded & {"numpy", "pyarrow", "pandas", "matplotlib", "scipy", "numba", "pydantic", "mcap"}


def test_all_that_is_public_is_there_with_a_docstring_and_types() -> None:
    assert set(rig.__all__) <= set(dir(rig))
    for name in set(rig.__all__) - {"__version__"}:
        public = getattr(rig, name)
        assert public.__doc__, name
        methods = inspect.getmembers(public, inspect.isfunction) if inspect.isclass(public) else [(name, public)]
        for _, method in methods:
            if not method.__name__.startswith("_"):
                assert method.__doc__, method
                assert "return" in method.__annotations__, method
    with pytest.raises(AttributeError, match=r"no attribute 'session'"):
        rig.session  # noqa: B018


def test_a_folder_without_a_session_is_said(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=str(tmp_path)):
        rig.open(tmp_path)


def test_files_of_others_are_opened_by_a_mapping_and_last_as_long_as_they_are_used(tmp_path: Path) -> None:
    cycles = Bench(rate_Hz=100.0).cycles(trials=1, speeds_mm_s=(5.0, 20.0))
    source = pressed(tmp_path / "in", cycles)
    mapping = (source / MAPPING_FILE).rename(tmp_path / "mine.toml")
    opened = rig.open(source, mapping, only="*_1")
    assert opened.folder == source and [trial.name for trial in opened] == ["trial_1"]
    trial, made = opened.trials[0], opened._session.folder
    del opened
    gc.collect()
    assert trial.arrow().num_rows == len(cycles[1].force_N)
    del trial
    gc.collect()
    assert not made.exists() and not list(source.rglob("*.mcap"))


def test_trials_are_one_row_each_with_units(session: SessionData) -> None:
    table = session.arrow()
    assert table.column("name").to_pylist() == [trial.name for trial in session]
    assert table.column("speed_mm_s").to_pylist() == [5.0, 5.0, 20.0, 20.0]
    assert table.schema.field("peak_force_N").metadata[b"unit"] == b"N"
    assert session.name in repr(session)
    assert session.trial(session.trials[1].name) is session.trials[1]
    with pytest.raises(UsageError, match=r"no trial other"):
        session.trial("other")


def test_a_stream_is_what_the_recording_holds(session: SessionData, folder: Path) -> None:
    trial = session.trials[0]
    held = read_recording(folder / f"{trial.name}.mcap").tables["force"]
    table = trial.arrow("force")
    assert "force" in trial.streams and "axis" in trial.streams and "marker" not in trial.streams
    np.testing.assert_array_equal(table.column("fz_N").to_numpy(), held["fz_N"])
    assert table.schema.field("capture_ns").metadata[b"unit"] == b"ns"
    with pytest.raises(UsageError, match=r"no stream 'pressure'; choose one of force, axis"):
        trial.arrow("pressure")


def test_loading_counts_from_contact_and_zero(session: SessionData) -> None:
    table = session.trials[0].loading()
    depth_mm, force_N = (table.column(name).to_numpy() for name in ("depth_mm", "force_N"))
    deep = depth_mm > 2.0
    true_N = FOREARM(depth_mm, np.full(len(depth_mm), 5.0))
    np.testing.assert_allclose(force_N[deep], true_N[deep], rtol=0.1)
    assert table.schema.metadata[b"trial"].decode() == session.trials[0].name
    assert float(table.schema.metadata[b"contact_mm"]) > 0
    assert {field.metadata[b"unit"] for field in table.schema} == {b"s", b"mm", b"N", b"mm/s"}


def test_segments_are_what_the_tip_did(session: SessionData) -> None:
    table = session.trials[0].segments()
    kinds, start_s, end_s = (table.column(name).to_pylist() for name in ("kind", "start_s", "end_s"))
    # A touch, whose way into the tissue ends in a turn, then the stroke with a hold of 0.3 s.
    assert kinds[-5:] == ["air", "loading", "hold", "unloading", "air"]
    assert end_s[-3] - start_s[-3] == pytest.approx(0.3, abs=0.02)
    assert start_s[-4] - end_s[-4] == pytest.approx(-8.0 / 5.0, abs=0.1), "8 mm at 5 mm/s"
    assert all(earlier <= later for earlier, later in zip(end_s, start_s[1:], strict=False))
    assert table.schema.field("start_s").metadata[b"unit"] == b"s"


def test_data_frames_carry_units(session: SessionData) -> None:
    frame = session.trials[0].pandas("axis")
    assert frame.attrs["units"]["position_mm"] == "mm"
    assert len(frame) == session.trials[0].arrow("axis").num_rows
    assert session.pandas().attrs["units"]["speed_mm_s"] == "mm/s"


def test_without_pandas_one_sentence_says_what_to_do(session: SessionData, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(UsageError, match=r"pandas is not installed: pip install 'tissue-rig\[pandas\]'"):
        session.pandas()


def test_the_fit_is_that_of_the_command(session: SessionData, folder: Path, tmp_path: Path) -> None:
    arguments = ["fit", str(folder), "--laws", "fung", "--known", "damping_N_s_mm=0.01", "--out", str(tmp_path)]
    ran = CliRunner().invoke(build("fit"), arguments, catch_exceptions=False)
    assert ran.exit_code == 0, ran.output
    saved = json.loads((tmp_path / "fit.json").read_text())
    found = session.fit(laws=["fung"], known={"damping_N_s_mm": 0.01})
    assert json.loads(found.model_dump_json()) | {"model": saved["model"]} == saved
    assert found.laws["index"].parameters["damping_N_s_mm"].known


def test_a_known_parameter_that_no_law_has_is_refused(session: SessionData) -> None:
    with pytest.raises(UsageError, match=r"damping_N_s=0.01: the laws compared have k_N_mm"):
        session.fit(known={"damping_N_s": 0.01})
    with pytest.raises(UsageError, match=r"takes 1e-06 to 10000 N/mm"):
        session.fit(known={"k_N_mm": -1.0})


def test_the_model_is_one_that_can_be_saved_and_controlled_with(session: SessionData, tmp_path: Path) -> None:
    session.model("index").save(tmp_path / "model.json")
    law = load_model(tmp_path / "model.json").law
    assert float(law.force(5.0)) == pytest.approx(0.12 * 5.0 * math.exp(0.22 * 5.0), rel=0.05)


def test_the_picture_shows_each_law_that_was_compared(session: SessionData) -> None:
    figure = session.plot(laws=["fung"])
    texts = " ".join(text.get_text() for text in figure.findobj(Text) if isinstance(text, Text))
    assert all(name in texts for name in ("constant", "index", "fung")), texts


def test_a_fit_is_made_once_for_results_and_pictures(session: SessionData, monkeypatch: pytest.MonkeyPatch) -> None:
    session.fit()
    monkeypatch.setattr("rig.notebook.study_session", None)
    session.plot()
    assert session.fit().closest


def test_the_diagnosis_of_too_few_trials_says_so(tmp_path: Path) -> None:
    """A whole one is made by the notebook of the tutorial, which is run too."""
    cycles = Bench(rate_Hz=500.0).cycles(trials=1, speeds_mm_s=(5.0,))
    found = rig.open(write_made_session(tmp_path / "one", cycles)).diagnose()
    assert (found.verdict, found.recordings) == ("not judged", 1)
    assert found.statement.startswith("Nothing could be judged: 1 recording of one")
