"""Work on a long recording is done by a process of its own, and ends as it would have here."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from rig.apart import LONG_BYTES, NICENESS, apart
from rig.errors import DataError
from rig.recording.reader import read_recording


@pytest.fixture
def long(tmp_path: Path) -> Path:
    with (tmp_path / "trial_001.mcap").open("wb") as file:
        file.truncate(LONG_BYTES)
    return tmp_path / "trial_001.mcap"


def test_a_long_one_has_a_process_of_its_own_and_a_short_one_none(long: Path) -> None:
    assert apart(long, os.getpid) != os.getpid()
    os.truncate(long, LONG_BYTES - 1)
    assert apart(long, os.getpid) == os.getpid()


def test_it_is_refused_as_here(long: Path) -> None:
    with pytest.raises(DataError, match="not a recording"):
        apart(long, read_recording, long)


def test_a_process_that_ends_says_how(long: Path) -> None:
    with pytest.raises(DataError, match=r"trial_001.mcap: .* ended with code 9, .*\(it said nothing\)"):
        apart(long, os._exit, 9)
    with pytest.raises(DataError, match=r"ended with code 1, .*\(ValueError: invalid literal"):
        apart(long, int, "no number")


def test_it_goes_after_the_service_and_takes_no_priority_back(long: Path) -> None:
    assert apart(long, os.getpriority, os.PRIO_PROCESS, 0) == max(NICENESS, os.getpriority(os.PRIO_PROCESS, 0))
    # As an ordinary user, whom setpriority(2) refuses what is less than before.
    behind = "import os; os.nice(12); os.geteuid() or os.setuid(65534); from rig.apart import stand_back; stand_back()"
    subprocess.run([sys.executable, "-c", f"import rig.apart; {behind}"], check=True)
