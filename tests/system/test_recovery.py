"""After a kill of each process while a force is tracked in contact, one command brings the tip out."""

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from mock_devices.testing.commands import Running, ServedBench, children, freed, pressed, rig, served_bench
from mock_devices.testing.models import index_model
from rig.recording.ring import new_path

pytestmark = [pytest.mark.extra, pytest.mark.xdist_group("recovery")]

MODULES = {
    "loop": "controller.loop.process",
    "recorder": "rig.recording.recorder",
    "stop": "controller.stop.server",
    "inputs": "controller.inputs.process",
}
ALL = ("command", *MODULES)
# What a command says that goes on to its end after one of its processes was killed.
SAID = {
    "loop": (1, "killed by signal 9"),
    "recorder": (1, "the recorder process ended"),
    "stop": (3, "the stop process is silent"),
    "inputs": (3, "input pedal is lost: the process of the inputs says nothing"),
}


@pytest.fixture
def bench() -> Iterator[ServedBench]:
    """With a foot switch."""
    with served_bench("--seed", "1", "--input", "evdev-switch") as served:
        yield served


def tracking(bench: ServedBench, tmp_path: Path) -> Running:
    """A force held in contact, and a foot switch that it needs."""
    model = tmp_path / "model.json"
    index_model(0.12, 0.22, 0.01, force_N=11.0).save(model)
    out = tmp_path / f"session-{time.monotonic_ns()}"
    port = bench.endpoints.devices["switch"]["events"]
    pedal = ("input.pedal.product=evdev-switch", f"input.pedal.port={port}", "input.pedal.stops=pain")
    running = Running(
        ["track", "--model", model, "--force", "2", "--seconds", "60", "--out", out, *bench.settings(*pedal)], tmp_path
    )
    pressed(bench, 1.5)
    return running


def killed(running: Running, *whom: str) -> None:
    """Kills those processes of the command at once, and the command itself where ``whom`` names it."""
    command = running.process.pid
    pids = {name: children(command, module) for name, module in MODULES.items()}
    assert {name: len(found) for name, found in pids.items()} == dict.fromkeys(MODULES, 1)
    assert sorted(children(command, "")) == sorted(pid for found in pids.values() for pid in found), "one is not tried"
    for name in whom:
        for pid in (pids | {"command": [command]})[name]:
            os.kill(pid, signal.SIGKILL)
    if "command" in whom:
        running.end()


@pytest.mark.parametrize(
    "whom",
    [
        ("loop",),
        *(pytest.param((name,), marks=pytest.mark.by_hand) for name in ("recorder", "command", "stop", "inputs")),
        ALL,
    ],
)
def test_one_command_brings_the_tip_out_after_a_kill(bench: ServedBench, tmp_path: Path, whom: tuple[str, ...]) -> None:
    running = tracking(bench, tmp_path)
    killed(running, *whom)
    if "command" not in whom:
        code, words = SAID[whom[0]]
        if code == 3:
            freed(bench)
        said = running.end()
        assert said.code == code and words in said.sentence, said.err
    said = rig("reset", "--yes", *bench.settings(), folder=tmp_path)
    assert said.code == 0, said.err
    assert bench.control.number("tip.force_N") == 0.0
    assert bench.control.number("axis.position_mm") == pytest.approx(0.0, abs=0.6)
    if "loop" in whom:
        assert "did not end in order" in said.out
        assert "0x8130 the host's heartbeat was missing" in said.out
        assert "the drive's fault was cleared" in said.out
    assert "the axis was homed" not in said.out
    mine = f"tissue-rig-{os.getuid()}-{running.process.pid}-"
    assert not list(new_path().parent.glob(f"{mine}*"))


def test_after_a_crash_nothing_moves_before_somebody_agrees(bench: ServedBench, tmp_path: Path) -> None:
    killed(tracking(bench, tmp_path), "command", "loop")
    before_mm = bench.control.number("axis.position_mm")
    said = rig("track", "--model", tmp_path / "model.json", "--force", "1", "--out", tmp_path / "next",
               *bench.settings(), folder=tmp_path)  # fmt: skip
    assert said.code == 1
    assert "did not end in order" in said.sentence
    assert "run `rig reset`" in said.sentence
    asked = rig("reset", *bench.settings(), folder=tmp_path)
    assert asked.code == 2
    assert (
        "may the drive's fault (0x8130 the host's heartbeat was missing) be cleared? Agree with --clear"
        in asked.sentence
    )
    asked = rig("reset", "--clear", *bench.settings(), folder=tmp_path)
    assert asked.code == 2
    assert "may the tip move out" in asked.sentence
    assert bench.control.number("axis.position_mm") == pytest.approx(before_mm, abs=0.05)
    assert rig("reset", "--retract", *bench.settings(), folder=tmp_path).code == 0
    assert bench.control.number("tip.force_N") == 0.0
