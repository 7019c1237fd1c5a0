"""The supervisor with a played loop at the other end of a real channel, and with processes that are not there."""

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from socket import socket
from typing import Any, cast

import pytest

from controller import supervisor as module
from controller.claims import take
from controller.messages import (
    TO_LOOP,
    Failed,
    Finished,
    Lease,
    Note,
    Outcome,
    Ready,
    Recover,
    Reset,
    Run,
    Shutdown,
    StatusSaid,
    Survey,
    Surveyed,
)
from controller.messages import Stopped as StoppedSaid
from controller.recovery import Consent, Situation
from controller.steps import Program, Zero
from controller.stop.word import Kind
from controller.supervisor import Supervisor, process_environment, stopped
from rig.channel import Answer, Channel, Message, Received
from rig.config.wiring import Wiring
from rig.errors import DeviceError, SafetyStop, UsageError

PROGRAM = Program(name="zero", steps=(Zero(duration_s=0.1),))
OUTCOME = Outcome("complete", "", 1.0, None, None)
DEVICES = {"force": {"product": "p"}}


class PlayedLoop(threading.Thread):
    """The loop's end of the channel: answers what it is asked, and keeps it."""

    def __init__(self, end: socket, around: "Surroundings") -> None:
        super().__init__(daemon=True)
        self.channel, self.around = Channel(end, TO_LOOP), around
        self.heard: list[Message] = []
        self.ended = threading.Event()

    def run(self) -> None:
        self.say(self.around.first)
        self.say(StatusSaid(status=self.around.status))
        while not self.ended.wait(0.001) and not self.channel.lost:
            received = self.channel.receive()
            if received:
                self.heard.append(received.message)
                self.around.reply(self, received)
        self.channel.close()

    def say(self, message: Message) -> None:
        self.channel.send(message)

    def of(self, kind: type[Message]) -> list[Any]:
        return [message for message in self.heard if isinstance(message, kind)]


@dataclass
class FakeProcess:
    """What stands for the loop's process: ends with its played loop, or hangs until it is killed."""

    command: list[str]
    options: dict[str, Any]
    loop: PlayedLoop
    around: "Surroundings"
    pid: int = 4711
    code: int | None = None
    waits: list[float | None] = field(default_factory=list)
    killed: bool = False

    def poll(self) -> int | None:
        return self.code

    def wait(self, timeout: float | None = None) -> int:
        self.waits.append(timeout)
        if self.around.hangs and not self.killed:
            raise subprocess.TimeoutExpired("loop", timeout or 0.0)
        self.loop.join(5)
        self.code = self.around.exit_code if self.code is None else self.code
        return self.code

    def kill(self) -> None:
        self.killed = True
        self.code = -signal.SIGKILL
        self.loop.ended.set()


@dataclass
class FakeStops:
    """The stop process: keeps what was asked of the word."""

    wiring: Wiring
    path: Path
    port: int = 5151
    asked: list[Kind] = field(default_factory=list)
    closed: int = 0

    @property
    def requester(self) -> "FakeStops":
        return self

    def request(self, kind: Kind) -> None:
        self.asked.append(kind)

    def close(self) -> None:
        self.closed += 1


class FakeRecorder:
    """The recorder's client: only its end matters here."""

    def __init__(self, ring: Path) -> None:
        self.ring, self.quits = ring, 0

    def quit(self) -> None:
        self.quits += 1


def obedient(loop: PlayedLoop, received: Received) -> None:
    match received.message:
        case Run():
            loop.say(Answer(to=received.id))
            loop.say(Finished(program=received.id, outcome=OUTCOME))
        case Shutdown():
            loop.ended.set()
        case Reset():
            loop.say(Answer(to=received.id))
            loop.say(StatusSaid(status={**loop.around.status, "latched": None}))


@dataclass
class Surroundings:
    """What the supervisor finds around it."""

    first: Message = field(default_factory=lambda: Ready(devices=DEVICES, realtime={"core": "1"}))
    status: dict[str, Any] = field(default_factory=lambda: {"ready": True, "busy": False, "latched": None})
    reply: Callable[[PlayedLoop, Received], None] = field(default=obedient)
    exit_code: int = 0
    hangs: bool = False
    processes: list[FakeProcess] = field(default_factory=list)
    stops: list[FakeStops] = field(default_factory=list)

    @property
    def process(self) -> FakeProcess:
        return self.processes[-1]

    @property
    def loop(self) -> PlayedLoop:
        return self.process.loop

    def popen(self, command: list[str], **options: Any) -> FakeProcess:
        loop = PlayedLoop(socket(fileno=os.dup(int(command[5]))), self)
        self.processes.append(FakeProcess(command, options, loop, self))
        loop.start()
        return self.process

    def stop_process(self, wiring: Wiring, path: Path) -> FakeStops:
        self.stops.append(FakeStops(wiring, path))
        return self.stops[-1]


@pytest.fixture
def around(monkeypatch: pytest.MonkeyPatch) -> Iterator[Surroundings]:
    made = Surroundings()
    monkeypatch.setattr(subprocess, "Popen", made.popen)
    monkeypatch.setattr(module, "StopProcess", made.stop_process)
    monkeypatch.setattr(module, "RecorderClient", FakeRecorder)
    yield made
    for process in made.processes:
        process.loop.ended.set()


def until(condition: Callable[[], bool], within_s: float = 3.0) -> None:
    waits = threading.Event()
    for _ in range(round(within_s / 0.005)):
        if condition():
            return
        waits.wait(0.005)
    raise AssertionError("it did not come")


def ends_soon(around: Surroundings) -> None:
    """The loop's process ends after it has failed."""

    def end() -> None:
        around.loop.ended.set()

    threading.Timer(0.05, end).start()


def test_a_bench_is_a_stop_process_a_loop_with_its_words_and_a_recorder(around: Surroundings) -> None:
    wiring = Wiring()
    with Supervisor(wiring) as bench:
        process, stops = around.process, around.stops[0]
        ring = Path(process.command[4])
        assert process.command[:3] == [sys.executable, "-m", "controller.loop_process"]
        assert Wiring.model_validate_json(process.command[3]) == wiring
        # Behind it the locks on the bench's ports, so that they last as long as the loop.
        assert process.options["pass_fds"][0] == int(process.command[5])
        assert [os.fstat(fd).st_size > 0 for fd in process.options["pass_fds"][1:]] == [True]
        assert process.command[7] == ""
        assert Path(process.command[6]) == stops.path == ring.with_suffix(".stop")
        assert (process.options["start_new_session"], process.options["stdin"]) == (True, subprocess.DEVNULL)
        assert process.options["env"] == process_environment()
        assert (bench.ready.devices, bench.ready.realtime) == (DEVICES, {"core": "1"})
        assert cast(FakeRecorder, bench.recorder).ring == ring
        assert (bench.alive, bench.loop_pid, bench.stop_port) == (True, 4711, 5151)
        assert bench.status["ready"] is True
    assert len(around.stops) == 1


def test_the_loop_may_be_another_module(around: Surroundings) -> None:
    with Supervisor(Wiring(), loop_module="planted.loop"):
        assert around.process.command[2] == "planted.loop"


def test_the_stop_process_may_come_first_and_then_comes_once(around: Surroundings) -> None:
    bench = Supervisor(Wiring())
    assert bench.stop_port == 0
    bench.prepare()
    assert (bench.stop_port, around.processes) == (5151, [])
    with bench:
        assert len(around.stops) == 1


def test_before_its_start_and_after_its_end_there_is_no_bench(around: Surroundings) -> None:
    bench = Supervisor(Wiring())
    for _ in range(2):
        assert (bench.alive, bench.status, bench.incidents, bench.stop_port) == (False, {}, [], 0)
        for act in (bench.stop, bench.pain, bench.estop, bench.reset, lambda: bench.run(PROGRAM, 1.0)):
            with pytest.raises(DeviceError, match="the bench is not running"):
                act()
        if not around.processes:
            with pytest.raises(DeviceError, match="the bench is not running"):
                _ = bench.loop_pid
            with bench:
                assert bench.alive


def test_a_program_is_run_and_its_outcome_returned(around: Surroundings) -> None:
    with Supervisor(Wiring()) as bench:
        assert bench.run(PROGRAM, 2.0) == OUTCOME
        assert [run.program for run in around.loop.of(Run)] == [PROGRAM]


def test_a_program_that_is_refused_is_not_stopped(around: Surroundings) -> None:
    def refuse(loop: PlayedLoop, received: Received) -> None:
        if isinstance(received.message, Run):
            loop.say(Answer(to=received.id, refused="too deep"))
        else:
            obedient(loop, received)

    around.reply = refuse
    with Supervisor(Wiring()) as bench:
        with pytest.raises(UsageError, match="too deep"):
            bench.run(PROGRAM, 2.0)
        assert around.stops[0].asked == []


def test_a_program_that_does_not_end_in_its_time_is_stopped(around: Surroundings) -> None:
    def endless(loop: PlayedLoop, received: Received) -> None:
        if isinstance(received.message, Run):
            loop.say(Answer(to=received.id))
        else:
            obedient(loop, received)

    around.reply = endless
    with Supervisor(Wiring()) as bench:
        with pytest.raises(DeviceError, match=r"did not end its program within 0\.1 s"):
            bench.run(PROGRAM, 0.1)
        assert around.stops[0].asked == [Kind.STOP]


def test_a_program_waits_until_the_devices_are_ok(around: Surroundings) -> None:
    around.status = {"ready": False}
    bench = Supervisor(Wiring())
    threading.Timer(0.15, lambda: around.loop.say(StatusSaid(status={"ready": True}))).start()
    bench.start()
    assert bench.status["ready"] is True
    bench.close()


def test_a_stop_in_force_is_not_waited_for(around: Surroundings, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "READY_TIMEOUT_S", 60.0)
    around.status = {"ready": False, "latched": {"code": "pain_stop", "text": "pain"}}
    with Supervisor(Wiring()) as bench:
        assert bench.run(PROGRAM, 2.0) == OUTCOME


def test_devices_that_do_not_become_ok_are_waited_for_three_seconds() -> None:
    assert module.READY_TIMEOUT_S == 3.0


@pytest.mark.parametrize(("press", "kind"), [("stop", Kind.STOP), ("pain", Kind.PAIN), ("estop", Kind.EMERGENCY)])
def test_a_stop_goes_through_the_stop_word(around: Surroundings, press: str, kind: Kind) -> None:
    with Supervisor(Wiring()) as bench:
        getattr(bench, press)()
        assert around.stops[0].asked == [kind]
        assert bench.stops is around.stops[0]  # type: ignore[comparison-overlap]


def test_a_note_goes_to_the_loop(around: Surroundings) -> None:
    with Supervisor(Wiring()) as bench:
        bench.note("capture", "trial 1")
        until(lambda: bool(around.loop.of(Note)))
        assert around.loop.of(Note) == [Note(code="capture", text="trial 1")]


def test_incidents_are_kept_in_order(around: Surroundings) -> None:
    with Supervisor(Wiring()) as bench:
        said = [StoppedSaid(code=code, text=code, action="SOFT") for code in ("pain_stop", "operator_stop")]
        for incident in said:
            around.loop.say(incident)
        until(lambda: len(bench.incidents) == 2)
        assert bench.incidents == said


def test_a_reset_is_over_when_the_status_shows_it(around: Surroundings) -> None:
    around.status = {"ready": True, "latched": {"code": "pain_stop"}}
    with Supervisor(Wiring()) as bench:
        bench.reset()
        assert bench.status["latched"] is None


def test_a_reset_that_changes_nothing_is_said(around: Surroundings, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "ANSWER_TIMEOUT_S", 0.1)

    def answers_only(loop: PlayedLoop, received: Received) -> None:
        if isinstance(received.message, Reset):
            loop.say(Answer(to=received.id))
        else:
            obedient(loop, received)

    around.status, around.reply = {"ready": True, "latched": {"code": "pain_stop"}}, answers_only
    with Supervisor(Wiring()) as bench, pytest.raises(DeviceError, match=r"did not leave its safe state within 0\.1 s"):
        bench.reset()


def test_rest_is_waited_for_as_long_as_the_loop_is_busy_and_no_longer_than_asked(around: Surroundings) -> None:
    around.status = {"ready": True, "busy": True}
    with Supervisor(Wiring()) as bench:
        bench.wait_at_rest(0.1)
        assert bench.status["busy"] is True
        threading.Timer(0.1, lambda: around.loop.say(StatusSaid(status={"ready": True, "busy": False}))).start()
        bench.wait_at_rest(10.0)
        assert bench.status["busy"] is False


@pytest.mark.parametrize(("lease_s", "period_s"), [(2.0, 0.5), (0.0, 0.75)])
def test_the_lease_is_renewed_four_times_in_it_and_says_whether_somebody_attends(
    around: Surroundings, monkeypatch: pytest.MonkeyPatch, lease_s: float, period_s: float
) -> None:
    waited: list[float] = []

    class Closing(threading.Event):
        def wait(self, timeout: float | None = None) -> bool:
            waited.append(timeout or 0.0)
            return super().wait(0.002)

    bench = Supervisor(Wiring.model_validate({"loop": {"lease_s": lease_s}}))
    bench._closing = Closing()
    with bench:
        until(lambda: len(around.loop.of(Lease)) > 2)
        assert set(waited) == {period_s}
        assert around.loop.of(Lease)[0].attending is True
        bench.attended = lambda: False
        until(lambda: not around.loop.of(Lease)[-1].attending)
        # The thread ends by itself once the loop is gone.
        around.loop.ended.set()
        until(lambda: not any(thread.name == "lease" for thread in threading.enumerate()))


def test_the_end_stops_motion_asks_the_loop_to_leave_and_ends_all_processes(around: Surroundings) -> None:
    bench = Supervisor(Wiring())
    bench.start()
    recorder, ring = cast(FakeRecorder, bench.recorder), bench._ring_path
    ring.write_bytes(b"left behind")
    bench.close()
    assert around.stops[0].asked == [Kind.STOP]
    assert around.loop.of(Shutdown) == [Shutdown()]
    assert around.process.waits == [15.0]
    assert recorder.quits == 1
    assert (bench.recorder, around.stops[0].closed, ring.exists(), bench.alive) == (None, 1, False, False)
    assert bench._closing.is_set()
    bench.close()
    assert (recorder.quits, around.stops[0].closed) == (1, 1), "a second time nothing happens"


def test_a_loop_that_does_not_leave_is_killed(around: Surroundings) -> None:
    around.hangs = True
    bench = Supervisor(Wiring())
    bench.start()
    bench.close()
    assert around.process.killed
    assert around.process.waits == [15.0, None]


def test_an_end_after_the_loop_has_gone_asks_nothing_of_it(around: Surroundings) -> None:
    bench = Supervisor(Wiring())
    bench.start()
    around.process.code = 1
    assert not bench.alive
    around.loop.ended.set()
    bench.close()
    assert around.stops[0].asked == []


def test_a_bench_whose_loop_fails_is_ended_with_its_sentence(around: Surroundings) -> None:
    around.first = Failed(text="force sensor: no answer")
    bench = Supervisor(Wiring())
    ends_soon(around)
    with pytest.raises(DeviceError, match="force sensor: no answer"):
        bench.start()
    assert (bench.alive, around.stops[0].closed, bench.recorder) == (False, 1, None)


def test_a_start_that_was_stopped_is_a_safety_stop(around: Surroundings) -> None:
    around.first = Failed(text="stopped by a person", stopped=True)
    bench = Supervisor(Wiring())
    ends_soon(around)
    with pytest.raises(SafetyStop, match="stopped by a person"):
        bench.start()


@pytest.mark.parametrize(
    ("code", "text"), [(0, "exit code 0"), (3, "exit code 3"), (-9, "killed by signal 9"), (-15, "killed by signal 15")]
)
def test_a_loop_that_goes_says_how_it_went(around: Surroundings, code: int, text: str) -> None:
    around.exit_code = code
    with Supervisor(Wiring()) as bench:
        around.loop.ended.set()
        around.loop.join(2)
        with pytest.raises(DeviceError, match=rf"ended unasked \({text}\)|the bench is not running"):
            bench.reset()
        assert bench._exit_text() == text
        assert not bench.alive


def test_how_a_loop_went_that_never_came_is_not_known() -> None:
    assert Supervisor(Wiring())._exit_text() == "exit code None"


def test_limits_of_waiting_and_leases() -> None:
    limits = (module.START_TIMEOUT_S, module.LEAVE_TIMEOUT_S, module.LEASE_SHARE, module.UNASKED_LEASE_S)
    assert limits == (60.0, 15.0, 4, 3.0)


def test_a_stopped_program_is_an_error_with_its_cause() -> None:
    error = stopped(Outcome("pain_stop", "the subject's pain stop at 3.00 N", 3.0, None, None))
    assert isinstance(error, SafetyStop)
    assert str(error) == "stopped: the subject's pain stop at 3.00 N"


def test_children_get_one_thread_a_numerics_library_and_all_else_of_the_environment(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("RIG_TEST", "kept")
    environment = process_environment()
    assert (environment["OPENBLAS_NUM_THREADS"], environment["OMP_NUM_THREADS"]) == ("1", "1")
    assert environment["RIG_TEST"] == "kept"
    assert environment["PATH"] == os.environ["PATH"]


HELD = {"ready": False, "latched": {"code": "recovery", "text": "the drive was in fault", "action": "IMMEDIATE"}}


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
    forget()


def forget() -> None:
    """As after a recovery: the next test's bench starts as usual."""
    claim = take(Wiring())
    claim.finished = True
    claim.release()


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
    around: Surroundings, status: dict[str, Any], exit_code: int, told: bool
) -> None:
    around.status, around.exit_code = status, exit_code
    Supervisor(Wiring(), waiting=True).__enter__().close()
    around.status, around.exit_code = {"ready": True, "latched": None}, 0
    bench = Supervisor(Wiring())
    bench.start()
    assert ("did not end in order" in held_of(around)) is told
    bench.close()
    forget()


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
    around.status, around.reply = HELD | {"devices": {"axis": {"state": "degraded", "detail": ""}}}, recovering
    bench = Supervisor(Wiring(), waiting=True)
    bench.start()
    assert bench.recover(Consent()).open[0][0] == "retract"
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
