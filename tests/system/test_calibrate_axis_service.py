"""Axis and glove calibrated through a service: questions, stops by every way, a holder or a service that is gone."""

import os
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from api.http.jobs.states import ENDS
from mock_devices.testing.commands import PATIENCE_S, Running, ServedBench, children, served_bench, until
from mock_devices.testing.service import ServedRig
from rig.config.calibration_files import read_axis, read_dynamics, read_glove
from tests.system.test_calibrate_service import finish
from tests.system.test_stop import asked

pytestmark = [
    pytest.mark.bench, pytest.mark.extra, pytest.mark.xdist_group("calibrate-axis-service"), pytest.mark.timeout(900)
]  # fmt: skip
BRAKED = "braked while the drive moved by itself: nothing starts"
# The search for table and block is some forty moves of 0.05 mm, each with a look at the force.
SEARCHED_S = 240.0


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServedRig]:
    folder = tmp_path_factory.mktemp("service")
    with served_bench("--seed", "1") as bench:
        served = ServedRig(bench, folder, bench.settings("stop.port=0"))
        Running.started.remove(served.running)  # it outlives a test, and is ended here
        try:
            yield served
        finally:
            finish(served)


@pytest.fixture
def lease(served: ServedRig) -> Iterator[str]:
    found = served.lease()
    yield found
    if served.ask("GET", "/control/lease")["holder"]:
        served.ask("DELETE", "/control/lease", lease=found)


def begun(served: ServedRig, lease: str, kind: str = "calibrate-axis", **params: object) -> str:
    return str(served.ask("POST", "/jobs", {"kind": kind, "params": params}, lease)["id"])


def becomes(served: ServedRig, lease: str, job: str, *states: str, within_s: float = PATIENCE_S) -> dict[str, Any]:
    """The job once it is so; its holder stays in control, where there is one."""
    deadline_s = time.monotonic() + within_s
    while (now := served.ask("GET", f"/jobs/{job}"))["state"] not in states:
        assert time.monotonic() < deadline_s and (now["state"] not in ENDS), now
        if lease:
            served.ask("PUT", "/control/lease", lease=lease)
        time.sleep(0.1)
    return dict(now)


def under_way(bench: ServedBench) -> bool:
    return abs(bench.control.number("axis.velocity_mm_s")) > 1.0


def stands(bench: ServedBench) -> bool:
    return not under_way(bench) and bench.control.get("axis.powered")["axis.powered"] is False


def moving(served: ServedRig, lease: str) -> str:
    """A job that moves the axis now, and for three seconds to come, with its way known to be free."""
    job = begun(served, lease, clear=True, to_mm=58.0)
    until(lambda: served.ask("GET", f"/jobs/{job}")["message"] == "16 mm", PATIENCE_S, "its first long step")
    until(lambda: under_way(served.bench), PATIENCE_S, "the axis under way")
    return job


def by_service(served: ServedRig, _job: str) -> None:
    assert served.ask("POST", "/estop")["detail"] == BRAKED


def beside_service(served: ServedRig, _job: str) -> None:
    assert asked(int(served.ask("GET", "/info")["stop_port"]), "/pain")[1]["done"] == BRAKED


def by_cancel(served: ServedRig, job: str) -> None:
    served.ask("POST", f"/jobs/{job}/cancel")


def test_a_stop_at_the_question_ends_it_before_anything_has_moved(served: ServedRig, lease: str) -> None:
    job = begun(served, lease)
    asks = becomes(served, lease, job, "paused")
    assert asks["message"].startswith("see that the tip's way is free from home to 14 mm, and the limb out: then the")
    assert served.rig["state"] == "disconnected" and "which every stop brakes" in served.rig["reason"]
    assert served.ask("POST", "/estop")["detail"] == "nothing was moving: the bench does not start"
    assert becomes(served, lease, job, "cancelled")["result"] is None
    assert stands(served.bench)


@pytest.mark.parametrize("stop", [by_service, beside_service, by_cancel])
def test_each_way_to_a_stop_brakes_the_axis(
    served: ServedRig, lease: str, stop: Callable[[ServedRig, str], None]
) -> None:
    job = moving(served, lease)
    stop(served, job)
    done = becomes(served, lease, job, "cancelled")
    assert "stopped on request" in done["problem"]["detail"], done
    assert stands(served.bench)
    until(lambda: "then connect" in served.rig["reason"], PATIENCE_S, "the devices free again")


def test_an_axis_whose_holder_is_gone_is_braked(served: ServedRig, lease: str) -> None:
    job = moving(served, lease)
    served.ask("DELETE", "/control/lease", lease=lease)
    done = becomes(served, "", job, "failed")
    assert done["problem"]["code"] == "operator_silent" and "not in control any more" in done["problem"]["detail"]
    assert stands(served.bench)


def test_the_axis_is_calibrated_against_the_tracker(served: ServedRig, lease: str) -> None:
    job = begun(served, lease)
    becomes(served, lease, job, "paused")
    served.ask("POST", f"/jobs/{job}/resume", lease=lease)
    done = becomes(served, lease, job, "succeeded", within_s=SEARCHED_S)
    found = read_axis(served.folder / done["result"]["file"])
    assert found.scale == pytest.approx(1.0, abs=0.005) and found.direction_known_by == "limb marker"
    listed = {one["file"]: one["what"] for one in served.ask("GET", "/calibrations")["items"]}
    assert listed[done["result"]["file"]] == "axis"


@pytest.mark.by_hand
def test_a_person_lays_the_block_that_the_job_asks_for(served: ServedRig, lease: str) -> None:
    control, table_mm = served.bench.control, served.bench.control.number("surface.position_mm")
    job = begun(served, lease, clear=True, gauge_block_mm=5.0, near_mm=round(table_mm, 1) - 0.3)
    asks = becomes(served, lease, job, "paused", within_s=SEARCHED_S)
    assert asks["message"] == "put the gauge block of 5 mm under the tip"
    control.set({"surface.position_mm": table_mm - 5.0})
    served.ask("POST", f"/jobs/{job}/resume", lease=lease)
    done = becomes(served, lease, job, "succeeded", within_s=SEARCHED_S)
    control.set({"surface.position_mm": table_mm})
    found = read_axis(served.folder / done["result"]["file"])
    assert found.reference == "gauge block" and found.scale == pytest.approx(1.0, abs=0.01)


def test_a_service_that_is_killed_leaves_an_axis_that_stands_and_ports_that_are_free(tmp_path: Path) -> None:
    with served_bench("--seed", "1") as bench:
        served = ServedRig(bench, tmp_path, bench.settings("stop.port=0"))
        moving(served, served.lease())
        (worker,) = children(served.running.process.pid, "api.http.jobs.worker")
        os.kill(served.running.process.pid, signal.SIGKILL)
        until(lambda: stands(bench), 2.0, "the axis at rest")
        until(lambda: not Path(f"/proc/{worker}").exists(), PATIENCE_S, "the end of what moved it")
        served.running.end()


@pytest.mark.by_hand
def test_the_simulated_bench_calibrates_axis_and_glove_by_itself(tmp_path: Path) -> None:
    with served_bench("--seed", "1") as bench:  # only for its control; the service has a bench of its own
        served = ServedRig(bench, tmp_path, ["--set", "input.glove.product=firmata-glove"])
        lease = served.lease()

        def found(kind: str, **params: object) -> Path:
            done = becomes(served, lease, begun(served, lease, kind, **params), "succeeded", within_s=SEARCHED_S)
            return Path(tmp_path / done["result"]["file"])

        assert read_axis(found("calibrate-axis")).scale == pytest.approx(1.0, abs=0.005)
        assert read_dynamics(found("calibrate-dynamics")).doubts == []
        glove = read_glove(found("calibrate-glove", weights="1 N,2 N,4 N"), "")
        assert {finger: known.loads_N for finger, known in glove.fingers.items()} == dict.fromkeys(
            ("thumb", "index", "middle"), (0.0, 1.0, 2.0, 4.0)
        )
        finish(served)
