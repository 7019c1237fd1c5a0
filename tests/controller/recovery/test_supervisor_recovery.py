"""The supervisor before and after a crash: what it refuses, what it notes for the next, and recovery with its loop."""

from dataclasses import replace

import pytest

from controller.claims import take
from controller.loop.messages import (
    Recover,
    Reset,
    Run,
    Status,
    Survey,
    Surveyed,
)
from controller.recovery.situation import Consent, Situation
from controller.supervisor import Supervisor
from rig.channel import Answer, Received
from rig.config.wiring import Wiring
from rig.errors import DeviceError
from tests.controller.played_loop import PROGRAM, PlayedLoop, Surroundings, obedient

HELD: Status = {
    "ready": False, "latched": {"code": "recovery", "text": "the drive was in fault", "action": "IMMEDIATE"}
}  # fmt: skip


def test_a_bench_that_waits_for_recovery_is_refused_to_whoever_did_not_come_for_it(around: Surroundings) -> None:
    around.status = HELD
    with pytest.raises(DeviceError, match="the drive was in fault; run `rig reset`"), Supervisor(Wiring()):
        raise AssertionError("it was entered")
    assert around.process.code == 0
    with Supervisor(Wiring(), waiting=True) as bench:
        assert bench.held == "the drive was in fault"
    bench = Supervisor(Wiring())
    bench.start()
    with pytest.raises(DeviceError, match="run `rig reset`"):
        bench.run(PROGRAM, 1.0)
    assert around.loop.of(Run) == []
    bench.close()


def held_of(around: Surroundings) -> str:
    """What the loop was told to wait for."""
    return around.process.command[7]


def test_whoever_comes_for_recovery_moves_nothing_at_the_start(around: Surroundings) -> None:
    with Supervisor(Wiring(), waiting=True):
        assert held_of(around) == "the bench was started for recovery"


@pytest.mark.parametrize(
    ("status", "exit_code", "told"),
    [
        ({"ready": True, "latched": None}, 0, False),
        ({"ready": True, "latched": None}, 1, False),
        ({"ready": True, "latched": None}, -9, True),
        ({"ready": True, "latched": {"code": "pain_stop", "action": "SOFT"}}, 0, False),
        ({"ready": True, "latched": {"code": "emergency_stop", "action": "IMMEDIATE"}}, 0, True),
    ],
)
def test_a_session_that_may_have_left_the_tip_inside_is_told_to_the_next(
    around: Surroundings, status: Status, exit_code: int, told: bool
) -> None:
    around.status, around.exit_code = status, exit_code
    Supervisor(Wiring(), waiting=True).__enter__().close()
    around.status, around.exit_code = {"ready": True, "latched": None}, 0
    bench = Supervisor(Wiring())
    bench.start()
    assert ("did not end in order" in held_of(around)) is told
    bench.close()


def test_a_bench_in_use_by_another_process_is_refused_before_anything_is_started(around: Surroundings) -> None:
    claim = take(Wiring())
    with pytest.raises(DeviceError, match="is in use by"):
        Supervisor(Wiring()).start()
    assert (around.processes, around.stops) == ([], [])
    claim.release()


SITUATION = Situation("killed", "", "", (), True, False, True, 25.0, 5.0)


def recovering(loop: PlayedLoop, received: Received) -> None:
    match received.message:
        case Survey():
            out = bool(loop.of(Recover))
            loop.say(Surveyed(to=received.id, situation=replace(SITUATION, retracted=out)))
            loop.say(Answer(to=received.id))
        case Recover():
            loop.say(Answer(to=received.id))
        case _:
            obedient(loop, received)


def test_a_recovery_is_a_conversation_with_the_loop_after_which_nothing_is_noted_any_more(around: Surroundings) -> None:
    around.status, around.reply = {**HELD, "devices": {"axis": {"state": "degraded", "detail": ""}}}, recovering
    bench = Supervisor(Wiring(), waiting=True)
    bench.start()
    assert bench.recover(Consent()).open[0].act == "retract"
    around.status = {"ready": True, "devices": {"axis": {"state": "ok", "detail": ""}}}
    assert bench.recover(Consent(retract=True)).ready
    assert [act.act for act in around.loop.of(Recover)] == ["retract"]
    assert len(around.loop.of(Reset)) == 1
    bench.close()
    with Supervisor(Wiring()):
        assert held_of(around) == ""


def test_an_act_that_the_loop_refuses_is_an_error_of_the_device(around: Surroundings) -> None:
    def refuse(loop: PlayedLoop, received: Received) -> None:
        if isinstance(received.message, Recover):
            loop.say(Answer(to=received.id, refused="the fault is still there"))
        else:
            obedient(loop, received)

    around.reply = refuse
    with Supervisor(Wiring()) as bench, pytest.raises(DeviceError, match="the fault is still there"):
        bench.act("clear")
