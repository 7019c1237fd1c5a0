"""What stands above a table, or beside its vectors: who and what it is of, its rate, its units; and rows with words."""

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
from numpy.typing import NDArray

from rig.config.table import TomlTable, parse
from rig.errors import DataError
from rig.intake.mapping import DataMapping
from rig.intake.proposal import propose
from rig.intake.session import import_folder
from rig.recording.sessions import Session
from tests.rig.intake.instruments import PRESS, text
from tests.rig.intake.test_foreign import COUNT, FORCE_N, TIME_S, WAY_MM, came_in, check, lines
from tests.rig.recording.measured import NOW

HEAD = "Time (s),Position (mm),Force (N)\n"
# With a file of its own for each: the names of these say nothing.
PEOPLE = {"measurement_7": "P01", "measurement_9": "P02", "measurement_12": "P02"}


def press(number: int) -> str:
    """Rows of a specimen that is stiffer than the one before, since copies of a recording are left out."""
    return lines("{:.3f},{:.5f},{:.5f}", TIME_S, WAY_MM, stiffer_N(number))


def stiffer_N(number: int) -> NDArray[np.float64]:
    return np.asarray(FORCE_N * (1 + 0.1 * number))


def check_all(session: Session) -> None:
    forces_N = [session.recording(trial.name).tables["force"]["fz_N"] for trial in session.trials]
    assert forces_N == [pytest.approx(stiffer_N(number), abs=1e-4) for number in range(len(forces_N))]
    check(session, session.trials[0].name)


def labels(session: Session, name: str) -> list[str | None]:
    return [session.recording(trial.name).metadata["labels"].get(name) for trial in session.trials]


def with_people(folder: Path, line: str) -> None:
    for number, (file, who) in enumerate(PEOPLE.items()):
        (folder / f"{file}.csv").write_text(line.format(who) + "\n" + HEAD + press(number))


@pytest.mark.parametrize("line", [
    "Subject ID,{}", "Sample name: {}", "Probe Nr. = {}", "Specimen {}", '"Probe Nr. {}",,', "Sample #{}",
])  # fmt: skip
def test_the_specimen_is_who_stands_above_the_table(folder: Path, line: str) -> None:
    with_people(folder, line)
    session = came_in(folder)
    assert labels(session, "specimen") == list(PEOPLE.values())
    check_all(session)


@pytest.mark.parametrize("line", [
    "Sample thickness,{}", "Sample rate (Hz),{}", "Subject height: {} cm", "Test,{}", "Test {}", "Sample {} mm",
    "Specimen of {}", "Specimen data",
])  # fmt: skip
def test_a_measure_of_the_specimen_is_not_its_name(folder: Path, line: str) -> None:
    with_people(folder, line)
    assert "specimen" not in propose(folder).tree


@pytest.mark.parametrize("line", ["Operator,{}", "Operator {}"])
def test_the_operator_is_kept_too_and_no_template(folder: Path, line: str) -> None:
    with_people(folder, line)
    assert labels(came_in(folder), "operator") == list(PEOPLE.values())


def test_names_of_files_that_say_the_specimen_are_heard_first(folder: Path) -> None:
    for number in (1, 2):
        (folder / f"specimen{number}.csv").write_text(f"Subject,P{9 - number}\n" + HEAD + press(number))
    assert labels(came_in(folder), "specimen") == ["1", "2"]


def test_a_file_that_does_not_state_it_is_named(folder: Path) -> None:
    with_people(folder, "Subject,{}")
    tree = propose(folder).tree
    (folder / "measurement_9.csv").write_text("Room,4\n" + HEAD + press(1))
    assert tree["tables"][0]["facts"] == {"specimen": "Subject"}
    assert "specimen" not in propose(folder).tree
    with pytest.raises(DataError, match=r"measurement_9\.csv: nothing states its 'Subject', .* there is Room"):
        _imported(folder, tree)


def _imported(folder: Path, tree: TomlTable) -> Session:
    return import_folder(folder, parse(DataMapping, tree, "proposed"), folder.parent / "out", NOW)


def structs(folder: Path) -> None:
    """An array of structs with the vectors in one below, and who it is of above."""
    kinds = [("subject", object), ("speed", object), ("data", object)]
    trials = np.empty((1, 3), kinds)
    for number, who in enumerate(PEOPLE.values()):
        vectors = {"time_s": TIME_S[:, None], "force_N": stiffer_N(number)[:, None], "position_mm": WAY_MM[:, None]}
        trials[0, number] = (who, number + 1.0, vectors)
    scipy.io.savemat(folder / "a.mat", {"trials": trials})


def references(folder: Path) -> None:
    """The same as version 7.3 stores it: references to vectors, and to texts as codes of their letters."""
    with h5py.File(folder / "a.mat", "w") as file:
        kept, trials = file.create_group("#refs#"), file.create_group("trials")
        columns = {
            name: trials.create_dataset(name, (3, 1), h5py.ref_dtype) for name in ("subject", "t", "F_N", "z_mm")
        }
        for number, who in enumerate(PEOPLE.values()):
            letters = kept.create_dataset(f"s{number}", data=np.array([[ord(letter)] for letter in who], np.uint16))
            letters.attrs["MATLAB_class"] = np.bytes_("char")
            columns["subject"][number, 0] = letters.ref
            for name, values in (("t", TIME_S), ("F_N", stiffer_N(number)), ("z_mm", WAY_MM)):
                vector = kept.create_dataset(f"{name}{number}", data=values[None])
                vector.attrs["MATLAB_class"] = np.bytes_("double")
                columns[name][number, 0] = vector.ref


@pytest.mark.parametrize("write", [structs, references])
def test_fields_of_a_struct_say_whose_its_vectors_are(folder: Path, write: Callable[[Path], None]) -> None:
    write(folder)
    session = came_in(folder)
    assert labels(session, "specimen") == list(PEOPLE.values())
    check_all(session)


@pytest.mark.parametrize(("line", "step_s"), [("SAMPLING,20 Hz", 0.05), ("Acquisition: 0.5 kS/s", 0.002)])
def test_the_rate_of_the_rows_stands_above_them_without_that_word(folder: Path, line: str, step_s: float) -> None:
    rows = lines("{:d},{:.5f},{:.5f}", np.arange(COUNT), WAY_MM, FORCE_N)
    text(f"MODEL,ZTA\n{line}\n\nNo.,Position (mm),Force (N)\n", rows)(folder)
    check(came_in(folder), step_s=step_s)


@pytest.mark.parametrize("line", ["Low pass,20 Hz", "Excitation: 5 Hz"])
def test_other_frequencies_are_not_the_rate_of_the_rows(folder: Path, line: str) -> None:
    text(f"{line}\nPosition (mm),Force (N)\n", lines("{:.5f},{:.5f}", WAY_MM, FORCE_N))(folder)
    (question,) = propose(folder).questions
    assert "at what rate are the rows" in question.text


OF_FORCE = ("Unit:,lbF", "Load unit,lbf", "Force Units = LBF")
OF_OTHERS = ("Temperature unit,g", "Unit,°C", "Length Units,Meters")


@pytest.mark.parametrize(
    ("line", "unit"), [*((line, "lbf") for line in OF_FORCE), *((line, "N") for line in OF_OTHERS)]
)
def test_the_unit_of_force_above_is_the_answer_that_is_offered(folder: Path, line: str, unit: str) -> None:
    text(f"{line}\nTime (s),Position (mm),Load\n", PRESS)(folder)
    (question,) = propose(folder).questions
    assert question.usual == unit
    assert f'unit = "{unit}"' in question.line


def test_a_table_with_more_words_than_numbers_is_one(folder: Path) -> None:
    rows = [f"A,{who},f,left,biceps,1,{row}\n" for n, who in enumerate("PQ") for row in press(n).splitlines()]
    text("study,subject,sex,side,muscle,trial,time_s,position_mm,force_N\n", "".join(rows))(folder)
    session = came_in(folder)
    assert [trial.samples["force"] for trial in session.trials] == [COUNT, COUNT]
    check_all(session)


def test_a_row_for_each_value_may_have_many_labels(folder: Path) -> None:
    rows = [
        f"A,P1,biceps,left,KL,{at:.3f},{name},{value:.5f},{unit}\n"
        for at, way, force in zip(TIME_S, WAY_MM, FORCE_N, strict=True)
        for name, value, unit in (("force", force, "N"), ("displacement", way, "mm"))
    ]
    text("study,subject,site,side,operator,time_s,channel,value,unit\n", "".join(rows))(folder)
    check(came_in(folder))


def test_a_few_lines_of_words_with_numbers_are_no_table(folder: Path) -> None:
    (folder / "notes.csv").write_text("on,Monday,we,pressed,3,times,with,5,N,force\n" * 5)
    with pytest.raises(DataError, match=r"no rows of numbers in notes\.csv"):
        propose(folder)


def test_time_of_the_whole_is_surer_than_that_of_a_step(folder: Path) -> None:
    half = COUNT // 2
    since = np.concatenate([TIME_S[:half], TIME_S[half:] - TIME_S[half]])
    names, rows = "Step time (s)\tTime (s)\tPosition (mm)\tForce (N)\n", "{:.3f}\t{:.3f}\t{:.5f}\t{:.5f}"
    parts = [
        lines(rows, *(own[part] for own in (since, TIME_S, WAY_MM, FORCE_N))) for part in (np.s_[:half], np.s_[half:])
    ]
    text(f"[step]\nAxial - 1\n{names}", f"{parts[0]}\n[step]\nAxial - 2\n{names}{parts[1]}", name="a.txt")(folder)
    session = came_in(folder)
    assert [trial.samples["force"] for trial in session.trials] == [COUNT]
    check(session)
