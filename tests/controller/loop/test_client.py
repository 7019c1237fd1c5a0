"""The supervisor's end of the channel against a loop played by the test: whose answer is whose, and what goes wrong."""

import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest

from controller.loop import client as loop_client
from controller.loop.client import LoopClient
from controller.loop.messages import (
    TO_LOOP,
    Finished,
    Heartbeat,
    LoopFailed,
    Note,
    Outcome,
    Ready,
    Reset,
    Run,
    StatusSaid,
    Stopped,
    Survey,
    Surveyed,
)
from controller.loop.steps import Hold, Program, TrackForce
from controller.recovery.situation import Situation
from rig.channel import Answer, Channel, Message, Received, pair
from rig.errors import DeviceError, SafetyStop, UsageError

HOLD = Run(program=Program(name="hold", steps=(Hold(duration_s=1.0),)))
PATIENCE_S = 5.0


class PlayedLoop:
    """The loop's end."""

    def __init__(self) -> None:
        mine, theirs = pair()
        self.channel = Channel(mine, TO_LOOP)
        self.client = LoopClient(theirs, lambda: "killed by signal 9")

    def say(self, message: Message) -> None:
        self.channel.send(message)

    def heard(self) -> Received:
        """The next message, waited for."""
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            received = self.channel.receive()
            if received:
                return received
            time.sleep(0.001)
        raise AssertionError("nothing was said to the loop")


@pytest.fixture
def loop() -> Iterator[PlayedLoop]:
    played = PlayedLoop()
    yield played
    played.channel.close()
    played.client.close()


def finished(program: int, name: str) -> Finished:
    return Finished(program=program, outcome=Outcome(name, "", 1.0, None, None))


def asked(call: Callable[[], object]) -> "threading.Thread":
    thread = threading.Thread(target=call)
    thread.start()
    return thread


def test_a_program_ends_with_its_own_outcome(loop: PlayedLoop) -> None:
    with ThreadPoolExecutor() as pool:
        running = pool.submit(loop.client.run, HOLD, PATIENCE_S)
        received = loop.heard()
        assert received.message == HOLD
        loop.say(Answer(to=received.id))
        loop.say(finished(received.id + 7, "of another program"))
        loop.say(finished(received.id, "its own"))
        assert running.result().outcome == "its own"


def test_the_outcome_of_a_program_given_up_is_not_taken_for_the_next(loop: PlayedLoop) -> None:
    with ThreadPoolExecutor() as pool:
        first = pool.submit(loop.client.run, HOLD, 0.05)
        given_up = loop.heard()
        loop.say(Answer(to=given_up.id))
        with pytest.raises(DeviceError, match=r"the loop did not end its program within 0\.05 s"):
            first.result()
        second = pool.submit(loop.client.run, HOLD, PATIENCE_S)
        received = loop.heard()
        loop.say(finished(given_up.id, "late"))
        loop.say(Answer(to=received.id))
        loop.say(finished(received.id, "its own"))
        assert second.result().outcome == "its own"


def test_a_refusal_belongs_to_what_was_asked(loop: PlayedLoop) -> None:
    with ThreadPoolExecutor() as pool:
        reset, note = Reset(), Note(code="a", text="b")
        first, second = pool.submit(loop.client.ask, reset, "a reset"), pool.submit(loop.client.ask, note, "a note")
        for received in (loop.heard(), loop.heard()):
            refused = "the tip still retracts" if received.message == reset else ""
            loop.say(Answer(to=received.id, refused=refused))
        with pytest.raises(UsageError, match="the tip still retracts"):
            first.result()
        assert second.result() > 0


def test_a_loop_that_does_not_answer_is_said(loop: PlayedLoop, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loop_client, "ANSWER_TIMEOUT_S", 0.05)
    with pytest.raises(DeviceError, match=r"the loop did not answer a reset within 0\.05 s; stop and"):
        loop.client.ask(Reset(), "a reset")


def test_the_loops_own_sentence_is_the_error_and_a_stop_is_a_stop() -> None:
    for stopped, kind in ((False, DeviceError), (True, SafetyStop)):
        played = PlayedLoop()
        played.say(LoopFailed(text="why", stopped=stopped))
        played.channel.close()
        with pytest.raises(kind, match=r"^why$"):
            played.client.ready(PATIENCE_S)
        played.client.close()


def test_a_loop_that_is_gone_is_said_with_how_it_went(loop: PlayedLoop) -> None:
    with ThreadPoolExecutor() as pool:
        running = pool.submit(loop.client.run, HOLD, PATIENCE_S)
        loop.say(Answer(to=loop.heard().id))
        loop.channel.close()
        with pytest.raises(DeviceError, match=r"the loop's process ended unasked \(killed by signal 9\)"):
            running.result()
    with pytest.raises(DeviceError, match="the bench is not running"):
        loop.client.tell(Heartbeat(attending=True))


def test_status_incidents_and_what_was_found_are_kept(loop: PlayedLoop) -> None:
    found = Ready(devices={"axis": {"serial": "1"}}, realtime={"memory": "locked"})
    assert loop.client.status == {}
    loop.say(found)
    assert loop.client.ready(PATIENCE_S) == found
    loop.say(Stopped(code="pain_stop", text="ow", action="SOFT"))
    loop.say(StatusSaid(status={"busy": True}))
    assert loop.client.wait_until(lambda status: status.get("busy", False), PATIENCE_S)
    assert [incident.text for incident in loop.client.incidents] == ["ow"]
    assert not loop.client.wait_until(lambda status: not status["busy"], 0.05)


def track(points: int) -> Run:
    """A program that follows so many points, each as long as a number can be."""
    gains = [{"force_N": force, "depth_mm": force, "tangent_N_mm": 1.0, "damping_N_s_mm": 0.01} for force in (1.0, 2.0)]
    times = tuple(1e-4 * n / 3 for n in range(points))
    forces = (1 / 3,) * points
    values = {"step": "track", "times_s": times, "forces_N": forces, "gains": gains, "crossover_rad_s": 10.0}
    return Run(program=Program(name="long", steps=(TrackForce.model_validate(values),)))


def test_a_reference_of_4500_points_goes_through_whole(loop: PlayedLoop) -> None:
    program = track(4500)
    assert len(program.model_dump_json()) > 150_000
    with ThreadPoolExecutor() as pool:
        running = pool.submit(loop.client.run, program, PATIENCE_S)
        received = loop.heard()
        assert received.message == program
        loop.say(Answer(to=received.id))
        loop.say(finished(received.id, "complete"))
        assert running.result().outcome == "complete"


def test_a_program_too_large_is_refused_before_it_is_sent(loop: PlayedLoop) -> None:
    with pytest.raises(UsageError, match=r"^program long takes \d{6} bytes as a message, and one may have 400000;"):
        loop.client.run(track(12_000), PATIENCE_S)
    loop.client.tell(Reset())
    assert loop.heard().message == Reset()
    assert loop.channel.refused == 0


def test_a_loop_that_reads_nothing_is_said_and_nobody_waits_for_ever(
    loop: PlayedLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(loop_client, "ANSWER_TIMEOUT_S", 0.1)
    with pytest.raises(DeviceError, match="the loop takes no messages"):
        for _ in range(1000):
            loop.client.tell(track(2000))


SITUATION = Situation("killed", "", "", (), True, False, True, 25.0, 5.0)


def test_a_survey_is_the_one_that_was_asked_for(loop: PlayedLoop) -> None:
    with ThreadPoolExecutor(1) as asking:
        survey = asking.submit(loop.client.survey)
        asked = loop.heard()
        assert isinstance(asked.message, Survey)
        loop.say(Surveyed(to=asked.id + 1, situation=replace(SITUATION, stopped="of another")))
        loop.say(Surveyed(to=asked.id, situation=SITUATION))
        loop.say(Answer(to=asked.id))
        assert survey.result(PATIENCE_S) == SITUATION


def test_a_survey_that_does_not_come_is_an_error(loop: PlayedLoop, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loop_client, "ANSWER_TIMEOUT_S", 0.2)
    with ThreadPoolExecutor(1) as asking:
        survey = asking.submit(loop.client.survey)
        loop.say(Answer(to=loop.heard().id))
        with pytest.raises(DeviceError, match=r"did not say how things stand within 0\.2 s"):
            survey.result(PATIENCE_S)


def test_a_refusal_because_of_a_stop_is_a_safety_stop(loop: PlayedLoop) -> None:
    with ThreadPoolExecutor(1) as asking:
        for stopped, error in ((True, SafetyStop), (False, UsageError)):
            answer = asking.submit(loop.client.ask, Reset(), "a reset")
            loop.say(Answer(to=loop.heard().id, refused="not now", stopped=stopped))
            with pytest.raises(error, match="not now"):
                answer.result(PATIENCE_S)


def test_the_reader_is_a_daemon_that_ends_with_the_client(loop: PlayedLoop) -> None:
    reader = loop.client._reader
    assert (reader.name, reader.daemon, reader.is_alive()) == ("loop-reader", True, True)
    loop.client.close()
    assert not reader.is_alive()
    assert loop.client.gone


def test_of_what_nobody_came_for_the_newest_64_are_kept() -> None:
    kept: dict[int, int] = {}
    for number in range(100):
        loop_client._keep(kept, number, number)
    assert kept == {number: number for number in range(36, 100)}


def test_limits_of_waiting() -> None:
    assert (loop_client.ANSWER_TIMEOUT_S, loop_client.LISTEN_S, loop_client.KEPT) == (5.0, 0.5, 64)


def test_the_end_waits_for_two_looks_of_the_reader(loop: PlayedLoop, monkeypatch: pytest.MonkeyPatch) -> None:
    waited_s: list[float | None] = []
    join = loop.client._reader.join

    def joined(timeout: float | None = None) -> None:
        waited_s.append(timeout)
        join(timeout)

    monkeypatch.setattr(loop.client._reader, "join", joined)
    loop.client.close()
    assert waited_s == [1.0]


def test_what_was_told_has_gone_whenever_the_loop_reads_it(loop: PlayedLoop) -> None:
    """Two programs are more than the socket holds: the rest of the second goes without another message."""
    with ThreadPoolExecutor(1) as telling:
        told = [telling.submit(loop.client.tell, track(4500)) for _ in range(2)]
        time.sleep(0.1)
        assert [loop.heard().id for _ in told] == [each.result(PATIENCE_S) for each in told]


def test_an_answer_and_the_end_wake_whoever_waits_at_once(loop: PlayedLoop) -> None:
    with ThreadPoolExecutor(1) as asking:
        answer = asking.submit(loop.client.ask, Reset(), "a reset", 8.0)
        loop.say(Answer(to=loop.heard().id))
        assert answer.result(4.0) > 0
        end = asking.submit(loop.client.wait_until, lambda _: False, 8.0)
        time.sleep(0.1)
        loop.channel.close()
        assert end.result(4.0)
