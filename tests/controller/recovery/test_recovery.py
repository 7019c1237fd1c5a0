"""The way back: what is needed, what is asked, and what the loop does, whole and on a clock of its own."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import pytest

from controller.loop.messages import Status
from controller.loop.modes import Mode
from controller.recovery.conversation import recover
from controller.recovery.situation import ALL, Consent, Situation, is_retracted, needed, questions
from rig.config.products.maxon_epos4 import Epos4Wiring
from rig.config.wiring import Limits
from rig.errors import DeviceError, SafetyStop
from rig.results.bench import Act, Question
from tests.controller.fake_bench import HOLD, ZERO, FakeBench

WELL = Situation("", "", "", (), True, True, True, 0.0, 0.1)
CRASHED = replace(
    WELL, stopped="killed", fault="0x8130 no heartbeat", history=("0x8130 no heartbeat",), retracted=False,
    position_mm=25.3, force_N=5.7,
)  # fmt: skip


# --- what is needed --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("now", "acts"),
    [
        (WELL, ()),
        (CRASHED, ("clear",)),
        (replace(CRASHED, fault=""), ("retract",)),
        (replace(CRASHED, fault="", referenced=False, position_mm=None), ("retract", "home")),
        (replace(CRASHED, fault="", referenced=False, outward=False), ("home",)),
    ],
)
def test_one_thing_after_the_other_and_no_homing_without_need(now: Situation, acts: tuple[Act, ...]) -> None:
    assert needed(now) == acts
    assert [question.act for question in questions(now, Consent())] == list(acts)
    assert questions(now, ALL) == ()


def test_a_question_names_what_it_is_about() -> None:
    assert questions(CRASHED, Consent()) == (
        Question(act="clear", question="may the drive's fault (0x8130 no heartbeat) be cleared?"),
    )
    inside = replace(CRASHED, fault="")
    assert questions(inside, Consent()) == (
        Question(act="retract", question="may the tip move out, from 25.3 mm to its end position?"),
    )
    inward = replace(inside, referenced=False, outward=False)
    assert questions(inward, Consent())[0].question.startswith("is the tip out of the tissue")


def test_what_happened_is_said_in_sentences() -> None:
    assert CRASHED.sentences == (
        "killed",
        "the drive is in fault: 0x8130 no heartbeat",
        "the drive remembers: 0x8130 no heartbeat",
        "the axis stands at 25.30 mm, force 5.70 N",
    )
    assert replace(WELL, position_mm=None, force_N=None).sentences == (
        "the axis stands without a reference, force unknown",
    )


@pytest.mark.parametrize(
    ("method", "direction", "outward"),
    # CiA 402-2, object 6098: 17 and -4 search towards negative positions, 18 and -3 towards positive ones; 33 and 34
    # take the next index and 37 the present place, which may be in the tissue.
    [(17, 1, True), (17, -1, False), (18, 1, False), (18, -1, True), (-4, 1, True), (-3, 1, False), (-3, -1, True),
     (33, 1, False), (34, -1, False), (37, 1, False), (37, -1, False)],
)  # fmt: skip
def test_only_a_search_for_a_switch_or_stop_on_the_outer_side_leads_out(
    method: Any, direction: Any, outward: bool
) -> None:
    assert Epos4Wiring(homing_method=method, direction=direction).homes_outward is outward


def test_the_tip_is_out_within_a_millimetre_of_the_end_of_its_way() -> None:
    limits = Limits(position_min_mm=5.0)
    assert is_retracted(6.0, limits)
    assert not is_retracted(6.1, limits)


# --- the conversation ------------------------------------------------------------------------------------------------


@dataclass
class ScriptedBench:
    """Shows one situation after the other, a new one after each act."""

    situations: list[Situation]
    status: Status = field(default_factory=lambda: Status(devices={"force": {"state": "ok", "detail": ""}}))
    away: Iterable[str] = ()
    acts: list[str] = field(default_factory=list)

    def survey(self) -> Situation:
        return self.situations[0]

    def act(self, act: Act) -> None:
        self.acts.append(act)
        if len(self.situations) > 1:
            self.situations.pop(0)

    def reset(self) -> None:
        self.acts.append("reset")

    def wait_at_rest(self, timeout_s: float = 30.0) -> None:
        assert timeout_s > 0

    def await_ready(self, timeout_s: float) -> bool:
        assert timeout_s > 0
        return not self.away

    def await_device(self, role: str, timeout_s: float) -> bool:
        assert timeout_s > 0
        return role not in self.away


AFTER_A_CRASH = [CRASHED, replace(CRASHED, fault=""), replace(CRASHED, fault="", retracted=True, position_mm=0.0)]


def test_with_every_consent_it_clears_retracts_and_acknowledges() -> None:
    bench = ScriptedBench(list(AFTER_A_CRASH))
    found = recover(bench, ALL)
    assert bench.acts == ["clear", "retract", "reset"]
    assert found.happened == CRASHED.sentences
    assert found.done == ("the drive's fault was cleared", "the tip moved out")
    assert found.ready


@pytest.mark.parametrize(
    ("consent", "acts", "open_"),
    [(Consent(), [], "clear"), (Consent(clear=True), ["clear"], "retract"), (Consent(retract=True), [], "clear")],
)
def test_without_a_consent_it_goes_no_further_and_asks(consent: Consent, acts: list[str], open_: str) -> None:
    bench = ScriptedBench(list(AFTER_A_CRASH))
    found = recover(bench, consent)
    assert bench.acts == acts
    assert [question.act for question in found.open] == [open_]
    assert not found.ready


def test_nothing_is_done_where_nothing_happened() -> None:
    bench = ScriptedBench([WELL])
    assert recover(bench, Consent()).ready
    assert bench.acts == []


def test_an_act_that_does_not_help_is_not_repeated() -> None:
    bench = ScriptedBench([replace(CRASHED, fault="")])
    with pytest.raises(SafetyStop, match="the tip moved out, and it is needed again"):
        recover(bench, ALL)
    assert bench.acts == ["retract"]


def test_an_axis_that_does_not_answer_is_named_with_the_next_step() -> None:
    with pytest.raises(DeviceError, match="the line is gone; it is opened again by itself"):
        recover(ScriptedBench([replace(CRASHED, lost="the line is gone")]), ALL)


def test_a_sensor_that_stays_away_is_named_and_the_bench_is_not_ready() -> None:
    status: Status = {"devices": {"force": {"state": "reconnecting", "detail": "unplugged"}}}
    found = recover(ScriptedBench([WELL], status, away=["force"]), ALL)
    assert found.missing == "force is reconnecting: unplugged"
    assert not found.ready


# --- in the loop -----------------------------------------------------------------------------------------------------


def crashed(position_mm: float = 25.0, fault: str = "0x8130 no heartbeat", referenced: bool = True) -> FakeBench:
    """A loop started on what a crash left: torque off, the tip in the tissue."""
    bench = FakeBench(position_mm=position_mm, settled=0, held="the session before did not end in order")
    bench.axis.on, bench.axis.fault_text, bench.axis.referenced = False, fault, referenced
    bench.axis.remembered = (fault,) if fault else ()
    bench.cycles(100)
    return bench


def done(bench: FakeBench, act: Act) -> str:
    """The loop's refusal of one act, empty where it did it."""
    before = len(bench.link.of("answer"))
    bench.say("recover", act=act)
    bench.until(lambda: len(bench.link.of("answer")) > before)
    return str(bench.link.of("answer")[-1]["refused"])


def surveyed(bench: FakeBench) -> dict[str, Any]:
    bench.say("survey")
    bench.cycles(2)
    found: dict[str, Any] = bench.link.of("surveyed")[-1]["situation"]
    return found


def test_a_loop_on_a_drive_in_fault_moves_nothing_and_says_what_happened() -> None:
    bench = crashed()
    bench.wait(1.0)
    assert bench.mode is Mode.SAFE
    assert not bench.axis.commands
    assert bench.axis.position_mm == 25.0
    status = bench.link.statuses[-1]
    assert status["latched"] and status["latched"]["code"] == "recovery"
    assert status["devices"]["axis"]["state"] == "fault"
    assert not status["ready"]
    now = surveyed(bench)
    assert (now["fault"], now["history"]) == ("0x8130 no heartbeat", ("0x8130 no heartbeat",))
    assert (now["referenced"], now["retracted"], now["position_mm"]) == (True, False, 25.0)
    assert now["stopped"] == "the session before did not end in order"
    assert now["force_N"] == pytest.approx(
        5.0, abs=1.7
    )  # 1 N/mm, 5 mm deep; zero and calibration are off by 0.8 N each


def test_clearing_moves_nothing_then_the_tip_leaves_to_the_end_of_its_way_then_the_bench_is_ready() -> None:
    bench = crashed()
    assert done(bench, "clear") == ""
    bench.wait(0.2)
    assert bench.axis.position_mm == 25.0
    assert done(bench, "retract") == ""
    bench.until(lambda: bench.mode is Mode.SAFE, within_s=5.0)
    bench.wait(0.1)
    assert bench.axis.position_mm == pytest.approx(0.0, abs=0.01)
    assert max(mm for _, mm in bench.axis.commands) <= 25.0
    assert "home" not in bench.axis.calls
    assert surveyed(bench)["retracted"]
    bench.say("reset")
    bench.wait(0.2)
    assert bench.mode is Mode.IDLE
    assert bench.link.statuses[-1]["ready"]


def test_the_tip_leaves_also_without_a_force_sensor() -> None:
    bench = crashed()
    bench.force.cut = "the line is gone"
    done(bench, "clear")
    assert done(bench, "retract") == ""
    bench.until(lambda: bench.mode is Mode.SAFE, within_s=5.0)
    bench.wait(0.1)
    assert bench.axis.position_mm == pytest.approx(0.0, abs=0.01)


def test_without_a_reference_nothing_retracts_and_homing_finds_it_anew() -> None:
    bench = crashed(fault="", referenced=False)
    assert "no reference" in done(bench, "retract")
    assert surveyed(bench)["position_mm"] is None
    bench.axis.home_mm = 0.0
    assert done(bench, "home") == ""
    bench.wait(0.2)
    assert bench.axis.position_mm == pytest.approx(0.0, abs=0.01)
    assert {mm for _, mm in bench.axis.commands} == {0.0}


def test_nothing_is_homed_with_the_tip_inside() -> None:
    bench = crashed(fault="")
    assert "the tip stands at 25.0 mm: retract it before the axis is homed" in done(bench, "home")
    assert "home" not in bench.axis.calls


def test_no_act_while_anything_moves() -> None:
    bench = FakeBench()
    bench.press()
    assert "something moves" in done(bench, "retract")
    assert bench.mode is Mode.COMPRESS


def test_no_act_on_an_axis_that_does_not_answer() -> None:
    bench = crashed()
    bench.axis.cut = "the line is gone"
    bench.wait(0.1)
    assert "the axis does not answer: the line is gone" in done(bench, "clear")


def test_a_fault_that_stays_is_an_answer_and_not_the_end_of_the_loop() -> None:
    bench = crashed()
    bench.axis.unclearable = "the fault is still there"
    assert done(bench, "clear") == "the fault is still there"
    assert bench.going


def test_an_emergency_stop_ends_a_retraction() -> None:
    bench = crashed(fault="")
    done(bench, "retract")
    bench.wait(0.3)
    bench.say("estop")
    bench.wait(0.2)
    assert bench.mode is Mode.SAFE
    assert 15.0 < bench.axis.position_mm < 25.0
    assert bench.latched == "emergency_stop"


def test_no_program_starts_before_the_recovery() -> None:
    bench = crashed(fault="")
    bench.begin(ZERO, HOLD)
    bench.cycle()
    assert "did not end in order" in bench.link.of("answer")[-1]["refused"]
