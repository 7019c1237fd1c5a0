"""A failure counts as the computer's only where a witness saw it stand still meanwhile."""

import itertools
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mock_devices.testing.commands import until
from tests import witness as witnessing
from tests.witness import AGAIN, ROOT, STALL_MS, Witness, watch

pytest_plugins = ["pytester"]


@pytest.mark.parametrize(("late_ms", "seen"), [(STALL_MS - 0.5, 0), (STALL_MS + 0.5, 1)])
def test_a_wake_that_came_too_late_is_written_down_and_no_other(tmp_path: Path, late_ms: float, seen: int) -> None:
    file, turns = tmp_path / "stalls", iter([True, False])
    times_ns = itertools.chain([0], itertools.repeat(round((2.0 + late_ms) * 1e6)))
    before = os.sched_getaffinity(0)
    try:
        watch(min(before), file, lambda: next(times_ns), lambda: next(turns))
    finally:
        os.sched_setaffinity(0, before)
    assert Witness(file).stalls_ms() == [pytest.approx(late_ms)] * seen


def test_a_process_that_stood_still_says_so_and_ends_with_who_started_it(tmp_path: Path) -> None:
    asks = "from rig.realtime import ask_fifo; exit(bool(ask_fifo(1)))"
    if subprocess.run([sys.executable, "-c", asks], cwd=ROOT, check=False).returncode:
        pytest.skip("no right to real-time priority here: no witness speaks")
    file = tmp_path / "stalls"
    with subprocess.Popen([sys.executable, "-m", "tests.witness", str(file), "0"], cwd=ROOT) as witness:
        until(file.exists, 10.0, "the witness at work")
        witness.send_signal(signal.SIGSTOP)
        time.sleep(0.1)
        witness.send_signal(signal.SIGCONT)
        until(lambda: Witness(file).stalls_ms() != [], 10.0, "the stall written down")
        witness.terminate()
    assert max(Witness(file).stalls_ms()) > 50


def test_a_quiet_computer_is_awaited_but_not_for_ever(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file, began_s = tmp_path / "stalls", time.monotonic()
    monkeypatch.setattr(witnessing, "QUIET_S", 0.4)
    file.write_text(f"{time.monotonic_ns()} 50.0\n")
    Witness(file).await_quiet()
    assert 0.4 <= time.monotonic() - began_s < 2.0
    monkeypatch.setattr(witnessing, "PATIENCE_S", 0.5)
    file.write_text(f"{time.monotonic_ns() + 10**12} 50.0\n")
    began_s = time.monotonic()
    Witness(file).await_quiet()
    assert 0.5 <= time.monotonic() - began_s < 2.0


STANDS_STILL = "STALLS.write_text(f'{time.monotonic_ns()} 50.0\\n')"


@pytest.mark.parametrize(
    ("marker", "before", "within", "outcome"),
    [
        ("bench", "", STANDS_STILL, {"passed": 1, "rerun": 1}),
        ("bench", "", "", {"failed": 1}),
        ("bench", STANDS_STILL, "", {"failed": 1}),
        ("other", "", STANDS_STILL, {"failed": 1}),
        ("bench", "", f"{STANDS_STILL}; TRIES.clear()", {"failed": 1, "rerun": AGAIN}),
    ],
    ids=["a stall", "no stall", "a stall before it", "a test without a bench", "a stall each time"],
)
def test_a_test_of_the_bench_is_run_again_after_a_stall_alone(
    pytester: pytest.Pytester, marker: str, before: str, within: str, outcome: dict[str, int]
) -> None:
    pytester.makepyfile(
        f"""
        import time
        from pathlib import Path
        import pytest
        STALLS, TRIES = Path("stalls"), []
        {before}
        @pytest.mark.{marker}
        def test_once():
            TRIES.append(1)
            {within or "pass"}
            assert len(TRIES) > 1
        """
    )
    pytester.makeini("[pytest]\nmarkers =\n    bench\n    other\n")
    pytester.makeconftest(
        f"""
        import sys
        from pathlib import Path
        sys.path.insert(0, {str(ROOT)!r})
        from tests import witness
        from tests.witness import Witness
        witness.QUIET_S = 0.1
        def pytest_configure(config):
            config.pluginmanager.register(Witness(Path("stalls")))
        """
    )
    answer = pytester.runpytest_subprocess("-p", "no:xdist", "-p", "no:schemathesis")
    assert answer.parseoutcomes() == outcome
    if "passed" in outcome:
        answer.stdout.fnmatch_lines(["*stood still 1 times, for up to 50 ms; run again: *test_once*"])
