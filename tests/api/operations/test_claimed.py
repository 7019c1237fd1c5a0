"""A command without a loop takes the bench for itself, and moves nothing after a session that did not end."""

from pathlib import Path

import pytest

from api.operations.claimed import claimed
from controller.claims import take
from rig.config.products.bota_sensone import BotaWiring
from rig.config.products.maxon_epos4 import Epos4Wiring
from rig.config.wiring import Wiring
from rig.errors import DeviceError, UsageError

BENCH = Wiring(force=BotaWiring(port="/dev/ttyUSB0"), axis=Epos4Wiring(port="/dev/ttyACM0"), tracker=None)


@pytest.fixture(autouse=True)
def own_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))


def test_a_bench_in_use_is_not_calibrated_and_is_free_again_afterwards() -> None:
    service = take(BENCH)
    with pytest.raises(DeviceError, match=r"/dev/ttyACM0 is in use by"), claimed(BENCH, moves=False):
        pass
    service.release()
    for _ in range(2):
        with claimed(BENCH, moves=True):
            pass


def test_after_a_session_that_did_not_end_the_axis_does_not_move_and_stays_noted() -> None:
    crashed = take(BENCH)
    crashed.leave_note()
    crashed.release()
    with claimed(BENCH, moves=False):
        pass
    for _ in range(2):
        with (
            pytest.raises(UsageError, match=r"did not end in order; the tip may .*: run `rig reset` first"),
            claimed(BENCH, moves=True),
        ):
            pass
