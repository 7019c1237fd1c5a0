"""A service that uses the bench: what others may do beside it, what comes back by itself, what recovers."""

import json
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from mock_devices.testing.commands import (
    PATIENCE_S,
    children,
    pressed,
    rig,
    served_bench,
    until,
)
from mock_devices.testing.models import known_session
from mock_devices.testing.service import ServedRig

pytestmark = [pytest.mark.extra, pytest.mark.xdist_group("recovery")]

AWAY, WORKER = "api.http.stops.server", "api.http.jobs.worker"
MODULES = ("controller.loop.process", "rig.recording.recorder", "controller.stop.server", AWAY)


@pytest.fixture
def served(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[ServedRig]:
    """With the options in the test's parameter, where it has one."""
    (tmp_path / "links").mkdir()
    known_session(tmp_path / "sessions" / "known")
    with served_bench("--seed", "1", "--links", str(tmp_path / "links")) as bench:
        found = ServedRig(bench, tmp_path, [*getattr(request, "param", ()), *bench.settings()])
        yield found
        if found.running.process.poll() is None:
            found.running.interrupt()
            found.running.end()


def test_beside_a_service_nobody_disturbs_it_and_what_was_lost_comes_back(served: ServedRig) -> None:
    bench, settings = served.bench, served.bench.settings()
    seen = rig("doctor", *settings, "--json", "doctor.json", folder=served.folder)
    assert seen.code == 0, seen.err
    assert f"as the service at {served.address} sees them" in seen.out
    roles = [found["role"] for found in json.loads((served.folder / "doctor.json").read_text())["devices"]]
    assert sorted(roles) == ["axis", "force", "tracker"]
    model = served.folder / "sessions" / "known" / "fit" / "model.json"
    second = rig("track", "--model", model, "--force", "1", "--out", "second", *settings, folder=served.folder)
    assert second.code == 1
    assert f"(process {served.running.process.pid})" in second.sentence
    assert f"or use it at {served.address}" in second.sentence
    assert served.rig["state"] == "idle"
    for role in ("force", "tracker"):
        bench.control.fault(role, "unplug", True)
        served.becomes("not ready")
        assert role in served.rig["reason"]
        bench.control.fault(role, "unplug", False)
        served.becomes("idle")
        assert served.rig["devices"][role]["state"] == "ok"


def test_a_loop_killed_under_a_service_is_recovered_through_it(served: ServedRig) -> None:
    bench = served.bench
    loop = served.loop
    os.kill(loop, signal.SIGKILL)
    served.becomes("disconnected")
    said = rig("reset", "--yes", *bench.settings(), folder=served.folder)
    assert said.code == 0, said.err
    assert "the drive's fault was cleared" in said.out
    served.becomes("idle")
    # The axis: its cable first, then its power. It comes back without torque, and moves only after a recovery.
    bench.control.fault("axis", "unplug", True)
    until(lambda: served.rig["devices"]["axis"]["state"] in ("lost", "reconnecting"), PATIENCE_S, "the axis lost")
    bench.control.fault("axis", "restart", True)
    bench.control.fault("axis", "unplug", False)
    until(lambda: served.rig["devices"]["axis"]["state"] == "fault", PATIENCE_S, "the axis back without a reference")
    assert bench.control.get("axis.powered")["axis.powered"] is False
    said = rig("reset", "--yes", *bench.settings(), folder=served.folder)
    assert said.code == 0, said.err
    assert "the axis was homed" in said.out
    served.becomes("idle")


def tracking(served: ServedRig) -> None:
    """A force held in contact."""
    request = {"kind": "track", "params": {"model": {"session": "known"}, "forces_N": [2.0], "seconds": 60.0}}
    served.ask("POST", "/jobs", request, served.lease())
    pressed(served.bench, 1.5)


@pytest.mark.by_hand
def test_a_killed_service_leaves_a_bench_that_one_command_recovers(served: ServedRig) -> None:
    tracking(served)
    served.running.kill()
    said = rig("reset", "--yes", *served.bench.settings(), folder=served.folder)
    assert said.code == 0, said.err
    assert served.bench.control.number("tip.force_N") == 0.0


def child(served: ServedRig, module: str, other_than: int = 0) -> int:
    """Process number of the service's child that runs ``module``, once there is one other than that."""
    found: list[int] = []

    def there() -> bool:
        found[:] = [pid for pid in children(served.running.process.pid, module) if pid != other_than]
        return len(found) == 1

    until(there, PATIENCE_S, module)
    return found[0]


def problem(served: ServedRig, job: str) -> str:
    """Code of what is wrong with a job; empty while nothing is."""
    return str((served.ask("GET", f"/jobs/{job}")["problem"] or {}).get("code", ""))


@pytest.mark.parametrize("served", [("--behind-proxy", "https://bench.example.org")], indirect=True)
def test_what_dies_beside_the_motion_leaves_it_alone_and_when_all_die_one_command_brings_the_tip_out(
    served: ServedRig,
) -> None:
    bench = served.bench
    away = child(served, AWAY)
    tracking(served)
    simulated = {"kind": "simulate", "params": {"model": {"session": "known"}, "reference": "step:2,duration_s=2"}}
    job = served.ask("POST", "/jobs", simulated)
    os.kill(child(served, WORKER), signal.SIGKILL)
    os.kill(away, signal.SIGKILL)
    until(lambda: problem(served, job["id"]) == "crashed", PATIENCE_S, "the computation being told of")
    assert child(served, AWAY, other_than=away)
    assert served.rig["state"] == "running"
    assert bench.control.number("tip.force_N") == pytest.approx(2.0, abs=0.5)
    everything = children(served.running.process.pid, "")
    assert len(everything) == len(MODULES)
    assert all(children(served.running.process.pid, module) for module in MODULES)
    for pid in (served.running.process.pid, *everything):
        os.kill(pid, signal.SIGKILL)
    served.running.end()
    said = rig("reset", "--yes", *bench.settings(), folder=served.folder)
    assert said.code == 0, said.err
    assert bench.control.number("tip.force_N") == 0.0
