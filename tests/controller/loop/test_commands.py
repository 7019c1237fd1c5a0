"""What the loop does with messages: each is answered by its id, and none stops it from cycling."""

import threading
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any, cast

import pytest

from controller.loop.bench_loop import BenchLoop
from controller.loop.commands import Inbox, _deed
from controller.loop.messages import (
    FROM_LOOP,
    TO_LOOP,
    Finished,
    Heartbeat,
    Note,
    Reset,
    Run,
    Shutdown,
    StatusSaid,
)
from controller.loop.modes import Mode
from controller.loop.steps import MoveTo, Program
from controller.safety.table import Action, Incident
from controller.stop.word import Deed, StopReason, StopRequest
from rig.channel import Answer, Channel, Message, encode, pair
from tests.calibrations import axis_calibration
from tests.controller.fake_bench import APPROACH, HOLD, LEAVE, ZERO, FakeBench


class Linked(FakeBench):
    """A bench of fakes whose loop listens to a real channel."""

    def __init__(self) -> None:
        super().__init__()
        self.keep_lease = False
        mine, theirs = pair()
        self.raw, self.mine, self.theirs = mine, Channel(mine, FROM_LOOP), Channel(theirs, TO_LOOP)
        self.loop._channel = self.theirs
        self.loop._commands = Inbox(self.theirs, self.responder)

    def replies(self) -> list[Message]:
        """What the loop has said, its status left out."""
        found: list[Message] = []
        for _ in range(20):
            found += [received.message for received in self.mine.receive_all()]
        return [message for message in found if not isinstance(message, StatusSaid)]

    def close(self) -> None:
        self.mine.close()
        self.theirs.close()


@pytest.fixture
def bench() -> Iterator[Linked]:
    linked = Linked()
    yield linked
    linked.close()


def test_a_program_is_answered_and_its_outcome_carries_its_id(bench: Linked) -> None:
    number = bench.mine.send(Run(program=Program(name="zero", steps=(ZERO,))))
    bench.wait(0.5)
    answer, finished = bench.replies()
    assert answer == Answer(to=number)
    assert isinstance(finished, Finished)
    assert (finished.program, finished.outcome.outcome) == (number, "complete")


def test_a_second_program_is_refused_by_its_id_and_the_first_goes_on(bench: Linked) -> None:
    first = bench.mine.send(Run(program=Program(name="one", steps=(ZERO, APPROACH, HOLD))))
    second = bench.mine.send(Run(program=Program(name="two", steps=(ZERO,))))
    bench.cycles(5)
    taken, refused = bench.replies()
    assert taken == Answer(to=first)
    assert refused == Answer(to=second, refused="a program is already under way: stop it or wait for its end")
    assert bench.loop.machine.busy


def test_a_loop_told_to_end_retracts_before_it_leaves(bench: Linked) -> None:
    bench.mine.send(Run(program=Program(name="one", steps=(ZERO, APPROACH, HOLD))))
    bench.until(lambda: bench.mode is Mode.COMPRESS)
    inbox = bench.loop._commands
    assert isinstance(inbox, Inbox)
    inbox.end()
    bench.cycle()
    assert (bench.going, bench.mode) == (True, Mode.RETRACT)
    bench.until(lambda: not bench.going)
    assert bench.mode is Mode.SAFE
    assert bench.force.true_N == 0


def test_notes_resets_and_leave_are_answered_and_a_lease_is_not(bench: Linked) -> None:
    numbers = [bench.mine.send(message) for message in (Note(code="a", text="b"), Reset())]
    bench.mine.send(Heartbeat(attending=True))
    bench.cycles(5)
    assert bench.replies() == [Answer(to=number) for number in numbers]
    assert bench.going
    bench.mine.send(Shutdown())
    bench.cycles(1)
    assert not bench.going


@pytest.mark.parametrize(
    "frame",
    [
        encode(9, Run.TYPE, b"not json"),
        encode(9, Run.TYPE, b'{"program": {"name": "x", "steps": []}}'),
        encode(9, 250, b"{}"),
        encode(9, Run.TYPE, b" " * 400_001),
        encode(9, Run.TYPE, b'{"program": ' + b"[" * 5000),
    ],
    ids=["no JSON", "no steps", "no such type", "too long", "too deep"],
)
def test_a_message_that_is_none_is_refused_counted_and_noted_and_the_loop_cycles_on(
    bench: Linked, frame: bytes
) -> None:
    while frame:
        try:
            frame = frame[bench.raw.send(frame) :]
        except BlockingIOError:
            bench.cycles(1)
    bench.cycles(20)
    (answer,) = bench.replies()
    assert isinstance(answer, Answer)
    assert (answer.to, bool(answer.refused)) == (9, True)
    assert bench.theirs.refused == 1
    assert [event.text for event in bench.ring.events if event.code == "refused"] == [
        "1 messages to the loop were not understood so far"
    ]
    number = bench.mine.send(Run(program=Program(name="zero", steps=(ZERO,))))
    bench.wait(0.5)
    assert Answer(to=number) in bench.replies()


def test_noise_on_the_channel_does_not_renew_the_lease(bench: Linked) -> None:
    bench.mine.send(Heartbeat(attending=True))
    bench.cycles(2)
    heard_ns = cast(Inbox, bench.loop._commands).heard_ns
    bench.raw.send(b"noise" * 50)
    bench.cycles(20)
    assert cast(Inbox, bench.loop._commands).heard_ns == heard_ns
    assert bench.theirs.refused > 0


def test_a_flood_of_noise_costs_no_cycle(bench: Linked) -> None:
    before = len(bench.ring.loop)
    bench.raw.send(b"\x00" * 60_000)
    bench.cycles(10)
    assert len(bench.ring.loop) == before + 10


def events(bench: FakeBench) -> list[tuple[str, int, str]]:
    return [(event.code, event.level, event.text) for event in bench.ring.events if event.code != "device_state"]


def test_a_note_and_a_reset_are_events() -> None:
    bench = FakeBench()
    bench.say("note", code="a", text="b")
    bench.say("reset")
    bench.cycles(3)
    assert events(bench) == [("a", 10, "b"), ("reset", 10, "stop acknowledged")]


def test_what_is_refused_is_a_warning_with_the_sentence_that_answers_it() -> None:
    bench = FakeBench()
    bench.begin(HOLD)
    bench.begin(HOLD)
    sentence = "a program is already under way: stop it or wait for its end"
    assert events(bench) == [("program_start", 10, "test"), ("refused", 20, sentence)]
    assert bench.link.of("answer")[-1]["refused"] == sentence


def test_a_program_whose_device_is_missing_is_refused_by_the_devices_own_sentence(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bench = FakeBench()
    monkeypatch.setattr("controller.loop.commands.missing_device", lambda *_: "the pedal is gone; plug it in")
    bench.begin(HOLD)
    assert (bench.link.of("answer")[-1]["refused"], bench.loop.machine.busy) == ("the pedal is gone; plug it in", False)


def test_messages_that_are_none_are_counted_from_the_first() -> None:
    bench = FakeBench()
    for refused in (1, 1, 3):
        bench.link.refused = refused
        bench.cycle()
    text = "{} messages to the loop were not understood so far"
    assert events(bench) == [("refused", 20, text.format(1)), ("refused", 20, text.format(3))]


def test_of_a_channel_that_is_lost_nothing_is_read() -> None:
    bench = FakeBench()
    bench.say("note", code="a", text="b")
    bench.link.lost, before = True, bench.link.received
    bench.cycles(2)
    assert (bench.link.received - before, [event for event in events(bench) if event[0] == "a"]) == (0, [])


def test_the_lease_counts_from_the_cycle_that_heard_a_message() -> None:
    bench = FakeBench(settled=0)
    bench.keep_lease = False
    bench.cycle()
    assert cast(Inbox, bench.loop._commands).heard_ns == 0
    bench.say("lease")
    bench.cycle()
    assert cast(Inbox, bench.loop._commands).heard_ns == bench.ring.loop[-2].capture_ns


def test_the_look_at_the_stop_word_is_of_the_loops_own_time() -> None:
    bench = FakeBench()
    bench.cycle()
    assert bench.page.words[2] == bench.ring.loop[-1].capture_ns


def test_stops_that_come_together_are_all_heard() -> None:
    bench = FakeBench()
    bench.begin(LEAVE)
    inbox = cast(Inbox, bench.loop._commands)
    inbox.end()
    for verb in ("unattended", "pain", "keypad"):
        bench.say(verb)
    assert inbox.collect(bench.loop) == {"unattended", "stop", "pain", "keypad"}


@pytest.mark.parametrize(
    ("said", "code"),
    [("stop", "operator_stop"), ("pain", "pain_stop"), ("estop", "emergency_stop"), ("keypad", "operator_stop")],
)
def test_each_stop_by_itself_latches_its_line_of_the_safety_table(said: str, code: str) -> None:
    bench = FakeBench()
    bench.say(said)
    bench.cycle()
    assert bench.latched == code


def test_a_stop_is_answered_in_its_cycle_as_an_event_too_and_none_where_none_was_asked() -> None:
    bench = FakeBench()
    bench.say("stop")
    bench.say("pain")
    bench.cycles(3)
    told = [event for event in events(bench) if event[0] == "stop_answered"]
    held = "nothing was moving: the axis stays where it is"
    assert sorted(told) == [("stop_answered", 10, f"PAIN 2: {held}"), ("stop_answered", 10, f"STOP 1: {held}")]


def loop_as(**values: Any) -> BenchLoop:
    """Of a loop what decides about its answer."""
    given: dict[str, Any] = {"axis_lost": "", "braked": False, "mode": Mode.RETRACT, "latched": None, **values}
    machine = SimpleNamespace(mode=given["mode"], latched=given["latched"])
    inputs = SimpleNamespace(axis_lost=given["axis_lost"])
    return cast(BenchLoop, SimpleNamespace(inputs=inputs, braked=given["braked"], machine=machine))


STOPPED = Incident(Action.SOFT, "operator_stop", "stopped")
SOFT, HARD = StopRequest(1, StopReason.STOP), StopRequest(2, StopReason.EMERGENCY)


@pytest.mark.parametrize(
    ("values", "asked", "deed"),
    [
        ({"axis_lost": "cable", "braked": True, "mode": Mode.SAFE}, (SOFT,), Deed.AXIS_LOST),
        ({"braked": True, "mode": Mode.SAFE}, (SOFT,), Deed.BRAKED),
        ({"mode": Mode.SAFE}, (HARD,), Deed.HELD),
        ({"mode": Mode.IDLE}, (HARD,), Deed.HELD),
        ({"mode": Mode.FREE}, (SOFT,), None),
        ({}, (SOFT,), None),
        ({"latched": STOPPED}, (SOFT,), Deed.RETRACTING),
        ({"latched": STOPPED}, (HARD,), None),
        ({"latched": STOPPED}, (SOFT, HARD), None),
        ({}, (HARD,), None),
    ],
)
def test_what_is_answered_is_what_is_done(
    values: dict[str, Any], asked: tuple[StopRequest, ...], deed: Deed | None
) -> None:
    assert _deed(loop_as(**values), asked) is deed


def test_a_program_beyond_the_limits_is_refused_before_anything_moves() -> None:
    bench = FakeBench()
    bench.begin(ZERO, MoveTo(position_mm=500.0, speed_mm_s=10.0))
    assert "500" in bench.link.of("answer")[-1]["refused"]
    assert bench.mode is Mode.IDLE


def test_a_program_with_a_device_that_is_not_the_calibrated_one_is_refused() -> None:
    bench = FakeBench()
    known = bench.wiring.calibration.model_copy(update={"of_axis": axis_calibration("A1")})
    bench.loop.wiring = bench.wiring.model_copy(update={"calibration": known})
    bench.force.serial = "2"
    bench.begin(ZERO, APPROACH)
    refused = bench.link.of("answer")[-1]["refused"]
    assert "FakeForce 1, but FakeForce 2 answered" in refused
    assert "EPOS4 A1, but FakeAxis 1 answered" in refused
    assert bench.mode is Mode.IDLE


def test_a_stop_during_homing_reaches_the_drive_and_none_after_it() -> None:
    """The guard looks at the stop word on the loop's own clock, and the drive asks the guard while it homes."""
    bench = FakeBench()
    inbox = cast(Inbox, bench.loop._commands)
    heard: list[bool] = []
    home = bench.axis.home

    def homes() -> None:
        bench.say("estop")
        deadline = 1000
        while not inbox.interruption() and deadline:
            deadline -= 1
            threading.Event().wait(0.001)
        heard.append(inbox.interruption())
        home()

    bench.axis.home, bench.axis.referenced = homes, False  # type: ignore[method-assign]
    bench.say("recover", act="home")
    bench.cycle()
    assert heard == [True]
    assert not inbox.interruption()
    answer = bench.stop_answers()[0]
    assert answer and answer.time_ns == bench.clock.now_ns - bench.execution_ns
