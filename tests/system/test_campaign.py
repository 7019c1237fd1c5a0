"""The fault campaign in small: faults that are noticed, and a planted bug that it reports, through real processes."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from mock_devices.testing.commands import ROOT

# A computer that stands still ends runs before their fault, and they are done again.
pytestmark = [pytest.mark.campaign, pytest.mark.timeout(240)]


def campaign(*options: str | Path) -> tuple[int, dict[str, int], str]:
    """Exit code, last line and all that was printed."""
    command = [sys.executable, "-m", "benchmarks.faults", *map(str, options)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=220, check=False)
    assert done.stdout, done.stderr
    return done.returncode, json.loads(done.stdout.splitlines()[-1]), done.stdout


def test_faults_are_noticed_by_what_is_declared_for_them(tmp_path: Path) -> None:
    file = tmp_path / "faults.json"
    code, summary, said = campaign("--only", "force.cut", "limb.pushes", "--json", file)
    assert code == 0, said
    assert (summary["trials"], summary["unnoticed"], summary["unsafe"]) == (2, 0, 0)
    kept = {one["fault"]: one["noticed_by"] for one in json.loads(file.read_text())["trials"]}
    assert kept == {"force.cut": "force_lost", "limb.pushes": "force_limit"}


@pytest.mark.parametrize("code", ["force_rate"])
def test_a_planted_bug_is_reported(code: str) -> None:
    ended, summary, said = campaign("--plant", code)
    assert ended == 0, said
    assert (summary["planted"], summary["reported"]) == (1, 1)
