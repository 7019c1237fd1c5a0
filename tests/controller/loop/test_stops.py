"""Stops at any moment in the loop: what is done, what is answered, and that nothing begins afterwards."""

from typing import cast

import pytest

from controller.loop.commands import Inbox
from controller.loop.messages import Recover
from controller.loop.modes import Mode
from controller.stop.word import Deed
from tests.controller.fake_bench import APPROACH, HOLD, LEAVE, PRESS, ZERO, FakeBench


def deeds(bench: FakeBench) -> list[Deed | None]:
    return [answer and answer.deed for answer in bench.stop_answers()]


@pytest.mark.parametrize("verb", ["stop", "pain", "keypad"])
def test_a_soft_stop_in_contact_retracts_and_says_so_in_its_first_cycle(verb: str) -> None:
    bench = FakeBench()
    bench.press()
    bench.say(verb)
    bench.cycle()
    assert deeds(bench) == [Deed.RETRACTING]
    answer = bench.stop_answers()[0]
    assert answer is not None
    assert 0 <= bench.clock.now_ns - answer.time_ns < bench.period_ns
    bench.until(lambda: bench.mode is Mode.SAFE)
    assert bench.force.true_N == 0.0


def test_an_emergency_stop_brakes_and_says_so() -> None:
    bench = FakeBench()
    bench.press()
    bench.say("estop")
    bench.cycle()
    assert deeds(bench) == [Deed.BRAKED]
    assert "quick_stop" in bench.axis.calls


def test_every_further_press_is_answered_whatever_the_tip_does_by_then() -> None:
    bench = FakeBench()
    bench.press()
    bench.say("pain")
    bench.cycles(3)
    bench.say("pain")
    bench.cycles(1)
    bench.say("estop")
    bench.cycles(1)
    bench.say("stop")
    bench.cycles(1)
    assert deeds(bench) == [Deed.RETRACTING, Deed.RETRACTING, Deed.BRAKED, Deed.BRAKED]
    assert [answer and answer.id for answer in bench.stop_answers()] == [1, 2, 3, 4]


@pytest.mark.parametrize(("verb", "code"), [("stop", "operator_stop"), ("pain", "pain_stop")])
def test_a_stop_at_rest_moves_nothing_and_nothing_begins_until_it_is_acknowledged(verb: str, code: str) -> None:
    bench = FakeBench()
    before_mm = bench.axis.position_mm
    bench.say(verb)
    bench.wait(0.5)
    assert deeds(bench) == [Deed.HELD]
    assert (bench.latched, bench.axis.position_mm) == (code, before_mm)
    bench.begin(ZERO, APPROACH)
    refused = bench.link.of("answer")[-1]
    assert (refused["stopped"], "acknowledge it with a reset first" in refused["refused"]) == (True, True)
    bench.say("reset")
    bench.cycles(2)
    assert bench.run(ZERO)["outcome"] == "complete"


def test_a_stop_at_rest_in_contact_retracts() -> None:
    bench = FakeBench()
    bench.run(ZERO, APPROACH, PRESS)
    assert bench.mode is Mode.IDLE
    assert bench.force.true_N > 1.0
    bench.say("pain")
    bench.cycle()
    assert deeds(bench) == [Deed.RETRACTING]
    bench.until(lambda: bench.mode is Mode.SAFE)
    assert bench.force.true_N == 0.0


def test_a_stop_between_two_programs_keeps_the_second_from_beginning() -> None:
    bench = FakeBench()
    bench.run(ZERO, APPROACH, PRESS, LEAVE)
    bench.say("stop")
    bench.begin(ZERO, APPROACH, HOLD)
    bench.cycles(3)
    assert (bench.mode, deeds(bench)) == (Mode.SAFE, [Deed.HELD])
    assert bench.link.of("answer")[-1]["stopped"]


def test_an_axis_that_is_lost_confirms_nothing() -> None:
    bench = FakeBench()
    bench.press()
    bench.axis.cut = "unplugged"
    bench.say("estop")
    bench.cycle()
    answer = bench.stop_answers()[0]
    assert answer is not None
    assert (answer.deed, answer.confirmed) == (Deed.AXIS_LOST, False)


def test_presses_are_in_the_recording_with_id_and_deed() -> None:
    bench = FakeBench()
    bench.press()
    bench.say("pain")
    bench.cycle()
    assert ("stop_answered", "PAIN 1: retracting") in [(event.code, event.text) for event in bench.ring.events]


def test_a_keypad_that_is_gone_is_named() -> None:
    bench = FakeBench()
    bench.press()
    bench.say("keypad")
    bench.cycle()
    assert bench.loop.machine.latched is not None
    assert bench.loop.machine.latched.text.startswith("the keypad or foot switch for stops is gone")


def test_an_axis_that_stands_away_from_zero_when_the_loop_begins_stays_there() -> None:
    bench = FakeBench(position_mm=23.0)
    bench.wait(0.5)
    assert bench.axis.position_mm == pytest.approx(23.0, abs=1e-6)


@pytest.mark.parametrize("verb", ["stop", "pain"])
def test_a_soft_stop_after_an_emergency_stop_leaves_the_axis_braked(verb: str) -> None:
    bench = FakeBench()
    bench.press()
    bench.say("estop")
    bench.wait(0.2)
    stood_mm = bench.axis.position_mm
    bench.say(verb)
    bench.wait(0.5)
    assert deeds(bench) == [Deed.BRAKED, Deed.BRAKED]
    assert (bench.latched, bench.axis.position_mm) == ("emergency_stop", stood_mm)


def test_a_stop_of_homing_on_consent_does_not_hinder_what_is_asked_later() -> None:
    bench = FakeBench()
    inbox = cast(Inbox, bench.loop._commands)
    bench.say("pain")
    bench.link.inbox.append(Recover(act="home"))
    bench.cycle()
    refused = bench.link.of("answer")[-1]
    assert (refused["stopped"], "home" in bench.axis.calls) == (True, False)
    assert not inbox.interruption()
    assert deeds(bench) == [Deed.START_ENDED]
