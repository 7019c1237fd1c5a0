"""Whether the loop lives, as the stop process sees it, on a page written by the test and processes of its own."""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from controller.stop import liveness
from controller.stop.liveness import ATTACH_S, SILENT_NS, LoopLife
from controller.stop.word import Responder, StopWord
from tests.controller.descriptors import open_files

NOW_NS = 5_000_000_000


class Now:
    """Seconds that go on where the test says so."""

    def __init__(self) -> None:
        self.s = 100.0

    def __call__(self) -> float:
        return self.s


@pytest.fixture
def page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[StopWord]:
    monkeypatch.setattr(time, "monotonic_ns", lambda: NOW_NS)
    made = StopWord.create(tmp_path / "a.stop")
    yield made
    made.close(unlink=True)


@pytest.fixture
def process() -> Iterator["subprocess.Popen[bytes]"]:
    """A process that lives until it is killed."""
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as running:
        yield running
        running.kill()


def test_before_the_loop_comes_it_is_starting_and_after_ten_seconds_over(page: StopWord) -> None:
    now = Now()
    life = LoopLife(page, now)
    assert (life.state(), life.gone, life.over()) == ("starting", False, False)
    now.s += ATTACH_S
    assert not life.over()
    now.s += 0.001
    assert (life.over(), life.gone) == (True, False)


@pytest.mark.parametrize(("age_ns", "state"), [(0, "running"), (SILENT_NS, "running"), (SILENT_NS + 1, "silent")])
def test_a_loop_that_looks_is_running_and_one_that_does_not_for_a_fifth_of_a_second_silent(
    page: StopWord, age_ns: int, state: str
) -> None:
    loop = Responder(page)
    loop.attach(os.getpid())
    loop.take(NOW_NS - age_ns)
    assert LoopLife(page, Now()).state() == state


def test_a_beat_of_one_nanosecond_is_a_beat(page: StopWord) -> None:
    Responder(page).take(1)
    assert LoopLife(page, Now()).state() == "silent"


def test_a_loop_that_lives_is_not_over_however_long_it_takes(
    page: StopWord, process: "subprocess.Popen[bytes]"
) -> None:
    now = Now()
    life = LoopLife(page, now)
    Responder(page).attach(process.pid)
    now.s += 2 * ATTACH_S
    began_s = time.monotonic()
    assert (life.gone, life.over()) == (False, False)
    assert time.monotonic() - began_s < 0.9, "it is looked at, not waited for"


def test_a_loop_that_ends_is_gone_for_good_and_leaves_no_descriptor(
    page: StopWord, process: "subprocess.Popen[bytes]"
) -> None:
    before = open_files()
    life = LoopLife(page, Now())
    Responder(page).attach(process.pid)
    assert not life.gone
    assert len(open_files() - before) == 1
    process.kill()
    process.wait()
    for _ in range(2):
        assert (life.gone, life.over(), life.state()) == (True, True, "gone")
    assert open_files() <= before


def test_a_process_that_is_not_there_is_gone(page: StopWord, process: "subprocess.Popen[bytes]") -> None:
    process.kill()
    process.wait()
    Responder(page).attach(process.pid)
    assert LoopLife(page, Now()).gone


def test_a_loop_that_takes_over_is_followed_in_place_of_the_other(
    page: StopWord, process: "subprocess.Popen[bytes]"
) -> None:
    before = open_files()
    life = LoopLife(page, Now())
    Responder(page).attach(os.getpid())
    assert not life.gone
    Responder(page).attach(process.pid)
    assert not life.gone
    assert len(open_files() - before) == 1
    process.kill()
    process.wait()
    assert life.gone


def test_descriptor_0_is_one_too(page: StopWord, monkeypatch: pytest.MonkeyPatch) -> None:
    closed: list[int] = []
    monkeypatch.setattr(os, "pidfd_open", lambda pid: 0)  # noqa: ARG005
    monkeypatch.setattr(os, "close", closed.append)
    ended = [False]
    monkeypatch.setattr(liveness, "_ended", lambda fd: fd == 0 and ended[0])
    life = LoopLife(page, Now())
    Responder(page).attach(11)
    assert not life.gone
    Responder(page).attach(12)
    assert (life.gone, closed) == (False, [0])
    ended[0] = True
    assert (life.gone, closed) == (True, [0, 0])


def test_a_loop_that_missed_ten_of_its_slowest_cycles_is_silent_and_one_that_starts_has_ten_seconds() -> None:
    assert (liveness.SILENT_NS * 1e-9 * 50.0, liveness.ATTACH_S) == (10.0, 10.0)
