"""Requests made from the service's own description, while the tip presses: each answer is one that it describes.

What ends the run by design (the stops), takes control away, or counts guesses of passwords is asked last. What never
ends is left out, and tested where it belongs.
"""

import contextlib
import json
import os
import re
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import uvicorn
from fastapi import FastAPI

from api.http.access.scopes import Scope
from mock_devices.testing.access import token
from mock_devices.testing.commands import ServedBench, free_port, pressed, until
from mock_devices.testing.service import ServedRig

pytestmark = pytest.mark.extra

# Each operation as described takes 50 s in all on two quick cores, and ends by itself; requests at random never do.
SECONDS, AT_RANDOM_S = 150, 10
# What was made to break the description may break the limit of a body first: that is refused with 413.
REFUSED = ["400", "401", "403", "404", "405", "406", "409", "413", "415", "422", "428", "429"]
ENDLESS = "/(live|events)$"
LAST = "/(estop|pain|cancel|pause|resume|control/take|control/lease)$|/auth/"
CHECKS = (
    "not_a_server_error", "status_code_conformance", "content_type_conformance", "response_schema_conformance",
    "response_headers_conformance", "negative_data_rejection",
)  # fmt: skip
HOLD = (
    'kind = "indentation"\nspeeds_mm_s = [20]\ntrials = 1\ndepth_mm = 6\nair_dwell_s = 0.2\napproach_speed_mm_s = 20\n'
    "hold_s = 600\nretract_speed_mm_s = 20\nclearance_mm = 4\nforce_limit_N = 12\n[quality]\nrepeats = 0\n"
)


def judged(
    address: str, seconds: int, folder: Path, *more: str, phase: str = "coverage", last: bool = False
) -> subprocess.CompletedProcess[str]:
    """Schemathesis over the description at ``address``; it ends with 1 where an answer is not as described."""
    program = Path(sys.executable).with_name("schemathesis")
    paths = ["--include-path-regex", LAST] if last else ["--exclude-path-regex", f"{ENDLESS}|{LAST}"]
    settings = folder / "schemathesis.toml"
    settings.write_text(f"[checks]\nnegative_data_rejection.expected-statuses = {json.dumps(REFUSED)}\n")
    return subprocess.run(
        [program, "--config-file", settings, "run", address, "--max-time", str(seconds), "--phases", phase,
         "--request-timeout", "30", "--checks", ",".join(CHECKS), *paths, "--no-color", *more],
        cwd=folder, capture_output=True, text=True, timeout=300, check=False, env=os.environ | {"NO_COLOR": "1"},
    )  # fmt: skip


def refuse_untried(said: str) -> None:
    """Fails where an operation that is not left out was not tried before the time was over."""
    counted = re.search(r"Selected: (\d+)/(\d+)\n  Tested: (\d+)\n", said)
    assert counted, said[-3000:]
    selected, described, tried = map(int, counted.groups())
    assert 0 < selected == tried <= described, f"{tried} of {selected} operations were tried"


@pytest.mark.timeout(600)
def test_every_answer_is_as_described_while_the_tip_presses(bench: ServedBench, tmp_path: Path) -> None:
    (tmp_path / "protocols").mkdir()
    (tmp_path / "protocols" / "hold.toml").write_text(HOLD)
    settings = bench.settings("stop.port=0", "loop.lease_s=0")
    rig = ServedRig(bench, tmp_path, ["--protocols", "protocols", *settings])
    lease = rig.lease()
    renewing, over = threading.Event(), threading.Event()

    def renew() -> None:
        while not over.wait(5.0):
            rig.ask("PUT", "/control/lease", lease=lease)
            renewing.set()

    keeper = threading.Thread(target=renew)
    keeper.start()  # at once: what comes now takes as long as the lease beside a second bench
    try:
        asked = {"kind": "capture", "params": {"protocol": "hold", "session": "held"}}
        job = rig.ask("POST", "/jobs", asked, lease)["id"]
        pressed(bench)
        # Made at the first request: beside a second bench that takes longer than the 10 s that Schemathesis gives it.
        assert rig.ask("GET", "/openapi.json")["paths"]
        credential = f"Authorization: Bearer {token(Scope.ADMIN)}"
        described = f"{rig.address}/api/v1/openapi.json"
        done = judged(described, SECONDS, tmp_path, "-H", credential)
        at_random = judged(described, AT_RANDOM_S, tmp_path, "-H", credential, phase="fuzzing")
        for each in (done, at_random):
            assert each.returncode == 0, each.stdout[-6000:]
        refuse_untried(done.stdout)
        shown = rig.ask("GET", f"/jobs/{job}")
        assert renewing.is_set() and shown["state"] == "running", shown["message"]
        assert bench.control.number("tip.force_N") > 1.0
    finally:
        over.set()
        keeper.join()
    ended = judged(described, SECONDS, tmp_path, "-H", credential, last=True)
    assert ended.returncode == 0, ended.stdout[-6000:]
    refuse_untried(ended.stdout)
    rig.becomes("stopped")


@contextlib.contextmanager
def served(app: FastAPI) -> Iterator[str]:
    server = uvicorn.Server(uvicorn.Config(app, port=free_port(), log_level="critical"))
    thread = threading.Thread(target=server.run)
    thread.start()
    until(lambda: server.started, 20.0, "the planted service listening")
    yield f"http://127.0.0.1:{server.config.port}/openapi.json"
    server.should_exit = True
    thread.join(20)


@pytest.mark.parametrize(("answer", "found"), [({"count": 3}, 0), ({"count": "three"}, 1), ({}, 1)])
def test_the_judge_says_no_where_an_answer_is_not_as_described(
    tmp_path: Path, answer: dict[str, object], found: int
) -> None:
    app = FastAPI()
    described = {"type": "object", "properties": {"count": {"type": "integer"}}, "required": ["count"]}

    @app.get("/counted", responses={200: {"content": {"application/json": {"schema": described}}}})
    def counted() -> dict[str, object]:  # planted: what is described is not what comes
        return answer

    with served(app) as address:
        done = judged(address, 5, tmp_path)
    assert done.returncode == found, done.stdout[-3000:]
    refuse_untried(done.stdout)


def test_an_operation_that_no_time_was_left_for_is_told(tmp_path: Path) -> None:
    app = FastAPI()
    for number in range(20):

        @app.get(f"/slow/{number}")
        def slow() -> dict[str, str]:  # planted: one answer takes as long as there is for all
            time.sleep(2.0)
            return {}

    with served(app) as address:
        done = judged(address, 2, tmp_path)
    with pytest.raises(AssertionError, match=r"\d of 20 operations were tried"):
        refuse_untried(done.stdout)
