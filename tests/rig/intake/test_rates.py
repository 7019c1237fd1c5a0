"""Rows without a time come at the rate that stands above them, or in the name of their file, each file at its own."""

from pathlib import Path

import numpy as np
import pytest

from rig.intake.proposal import propose
from rig.intake.questions import OpenQuestion
from tests.rig.intake.test_foreign import COUNT, FORCE_N, WAY_MM, came_in, lines

HEAD = "Force (N),Position (mm)\n"
NUMBERS = np.arange(COUNT)


def write(folder: Path, name: str, above: str = "", factor: float = 1.0) -> None:
    (folder / name).write_text(above + HEAD + lines("{:.5f},{:.5f}", factor * FORCE_N, WAY_MM))


def steps_ns(folder: Path, *answers: str) -> list[list[int]]:
    session = came_in(folder, *answers)
    found = [session.recording(trial.name).tables["force"]["capture_ns"] for trial in session.trials]
    return [sorted(set(np.diff(own).tolist())) for own in found]


@pytest.mark.parametrize(
    ("name", "rate"),
    [("creep_1000Hz.csv", "1000"), ("gel 1kHz 2.csv", "1000"), ("a_0.5Hz_250_hz.csv", "250"), ("b-200sps.csv", "200")],
)
def test_the_rate_in_the_name_of_a_file_is_the_usual_answer(folder: Path, name: str, rate: str) -> None:
    write(folder, name)
    (question,) = propose(folder).questions
    assert (question.usual, question.line) == (rate, f"time = {{ rate_Hz = {float(rate)} }}")
    assert f"in Hz (its name says {rate})?" in question.text
    assert steps_ns(folder, question.usual) == [[round(1e9 / float(rate))]]


@pytest.mark.parametrize(("name", "example"), [("cyclic_1Hz.csv", "1"), ("gel_10Hz.csv", "10"), ("Hz_hertz_4.csv", "")])
def test_a_slow_one_may_be_that_of_the_strokes_and_no_answer_for_scripts(folder: Path, name: str, example: str) -> None:
    write(folder, name)
    (question,) = propose(folder).questions
    assert isinstance(question, OpenQuestion)
    assert (question.usual, question.example) == ("", example)


def test_a_counter_beside_it_says_which_rows_were_lost(folder: Path) -> None:
    rows = lines("{},{:.5f},{:.5f}", NUMBERS, FORCE_N, WAY_MM).splitlines(keepends=True)
    (folder / "a_1000Hz.csv").write_text("sample," + HEAD + "".join(rows[:20] + rows[21:]))
    (question,) = propose(folder).questions
    assert question.line == 'time = { column = "sample", form = "counter", rate_Hz = 1000.0 }'
    assert steps_ns(folder, "1000") == [[1_000_000, 2_000_000]]


def test_files_of_two_rates_are_asked_for_both(folder: Path) -> None:
    write(folder, "a_1000Hz.csv")
    write(folder, "b_500Hz.csv", factor=2)
    assert [question.usual for question in propose(folder).questions] == ["1000", "500"]
    assert steps_ns(folder, "1000", "500") == [[1_000_000], [2_000_000]]


def test_files_of_two_rates_stated_above_have_their_own(folder: Path) -> None:
    write(folder, "a.csv", "Sample rate: 1000 Hz\n")
    write(folder, "b.csv", "Sample rate: 500 Hz\n", factor=2)
    assert steps_ns(folder) == [[1_000_000], [2_000_000]]
