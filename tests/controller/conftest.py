"""What several tests of the controller begin with."""

import subprocess
from collections.abc import Iterator

import pytest

from controller import supervisor as module
from tests.controller.played_loop import FakeRecorder, Surroundings


@pytest.fixture
def around(monkeypatch: pytest.MonkeyPatch) -> Iterator[Surroundings]:
    made = Surroundings()
    monkeypatch.setattr(subprocess, "Popen", made.popen)
    monkeypatch.setattr(module, "StopProcess", made.stop_process)
    monkeypatch.setattr(module, "RecorderClient", FakeRecorder)
    yield made
    for process in made.processes:
        process.loop.ended.set()
