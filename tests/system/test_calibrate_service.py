"""The force sensor calibrated through a service: a person is asked for each weight, the simulated bench for none."""

import re
import time
from pathlib import Path
from typing import Any

import pytest

from api.http.jobs.states import ENDS
from mock_devices.testing.commands import PATIENCE_S, served_bench
from mock_devices.testing.service import ServedRig
from rig.config.calibration_files import read_force

pytestmark = [pytest.mark.bench, pytest.mark.extra, pytest.mark.xdist_group("calibrate-service")]

BODY = {"kind": "calibrate-force", "params": {"weights": "1 N,2 N", "load": "pressed"}}


def ended(served: ServedRig, put_on: list[float]) -> dict[str, Any]:
    """The job at its end; each load that it asks for is put on the mock's tip."""
    lease, until_s = served.lease(), time.monotonic() + PATIENCE_S
    job = served.ask("POST", "/jobs", BODY, lease)["id"]
    while (now := served.ask("GET", f"/jobs/{job}"))["state"] not in ENDS:
        assert time.monotonic() < until_s, now
        if now["state"] == "paused":
            found = re.search(r"put ([0-9.]+) N", now["message"])
            put_on.append(float(found[1]) if found else 0.0)
            served.bench.control.set({"load.axial_N": put_on[-1]})
            served.ask("PUT", "/control/lease", lease=lease)
            served.ask("POST", f"/jobs/{job}/resume", lease=lease)
        time.sleep(0.05)
    served.ask("DELETE", "/control/lease", lease=lease)
    return dict(now)


def finish(served: ServedRig) -> None:
    served.running.interrupt()
    served.running.end()


def test_a_person_is_asked_for_each_weight_and_connects_again(tmp_path: Path) -> None:
    with served_bench("--seed", "1") as bench:
        served, loads = ServedRig(bench, tmp_path, bench.settings()), list[float]()
        done = ended(served, loads)
        assert (done["state"], loads) == ("succeeded", [0.0, 1.0, 2.0, 1.0, 0.0]), done
        found = read_force(tmp_path / done["result"]["file"])
        assert found.serial == bench.endpoints.serials["force"] and found.compression == "negative"
        assert [found.matrix[at][at] for at in range(3)] == pytest.approx([1.0, 1.0, 1.0], abs=0.03)
        shown = served.rig
        assert shown["state"] == "disconnected" and "see that nothing is in the tip's way" in shown["reason"]
        listed = [one["file"] for one in served.ask("GET", "/calibrations")["items"]]
        assert done["result"]["file"] in listed
        served.ask("POST", "/rig/connect", {}, served.lease())
        served.becomes("idle")
        finish(served)


def test_the_simulated_bench_puts_its_weights_on_by_itself(tmp_path: Path) -> None:
    with served_bench("--seed", "1") as bench:  # only for its control; the service has a bench of its own
        served = ServedRig(bench, tmp_path, [])
        done = ended(served, [])
        assert done["state"] == "succeeded", done
        assert (tmp_path / done["result"]["file"]).is_file()
        finish(served)
