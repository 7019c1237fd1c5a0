"""What several tests of the controller begin with."""

import subprocess
from collections.abc import Iterator
from pathlib import Path
from tempfile import mkdtemp

import pytest

from controller import supervisor as module
from tests.controller.played_loop import FakeRecorder, Surroundings


@pytest.fixture
def around(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Surroundings]:
    """What a supervisor finds around it; its ports are locked in a folder of this test's process alone."""
    monkeypatch.setenv("XDG_STATE_HOME", mkdtemp(dir=tmp_path))
    made = Surroundings()
    monkeypatch.setattr(subprocess, "Popen", made.popen)
    monkeypatch.setattr(module, "StopProcess", made.stop_process)
    monkeypatch.setattr(module, "RecorderClient", FakeRecorder)
    yield made
    for process in made.processes:
        process.loop.ended.set()
