"""The supervisor with a played loop at the other end of a real channel, and with processes that are not there."""

import os
import subprocess
import sys
import threading
from pathlib import Path
from typing import cast

import pytest

from controller import claims
from controller import supervisor as module
from controller.loop.messages import (
    Heartbeat,
    LoopFailed,
    Note,
    Outcome,
    Ready,
    Recover,
    Reset,
    Run,
    Shutdown,
    StatusSaid,
)
from controller.loop.messages import Stopped as StoppedSaid
from controller.stop.word import StopReason
from controller.supervisor import Supervisor, process_environment, stop_error
from rig.channel import Answer, Message, Received
from rig.config.wiring import Wiring
from rig.errors import DeviceError, SafetyStop, UsageError
from tests.controller.played_loop import (
    DEVICES,
    OUTCOME,
    PROGRAM,
    FakeRecorder,
    PlayedLoop,
    Surroundings,
    obedient,
    until,
)


def ends_soon(around: Surroundings) -> None:
    """The loop's process ends after it has begun, and failed."""

    def end() -> None:
        until(lambda: bool(around.processes))
        around.loop.ended.set()

    threading.Timer(0.05, end).start()


def test_a_bench_is_a_stop_process_a_loop_with_its_words_and_a_recorder(around: Surroundings) -> None:
    wiring = Wiring()
    with Supervisor(wiring) as bench:
        process, stops = around.process, around.stops[0]
        ring = Path(process.command[4])
        assert process.command[:3] == [sys.executable, "-m", "controller.loop.process"]
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
        user = claims.holder(wiring)
        assert user and user.sentence.endswith("; end that first"), "nobody but this process reaches the bench"
    assert len(around.stops) == 1


class PlayedInputs:
    """The process of devices that only bring input: counts its ends."""

    closed = 0

    def close(self) -> None:
        self.closed += 1


def test_the_process_of_inputs_begins_with_the_bench_and_ends_with_it(
    around: Surroundings, monkeypatch: pytest.MonkeyPatch
) -> None:
    inputs, started = PlayedInputs(), list[tuple[Wiring, Path]]()

    def start(wiring: Wiring, ring: Path) -> PlayedInputs:
        started.append((wiring, ring))
        return inputs

    monkeypatch.setattr(module, "started_inputs", start)
    wiring = Wiring()
    with Supervisor(wiring) as bench:
        assert started == [(wiring, Path(around.process.command[4]))]
        assert inputs.closed == 0
    bench.close()
    assert inputs.closed == 1


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


def test_a_program_of_somebody_who_is_not_in_control_any_more_is_never_begun(around: Surroundings) -> None:
    with Supervisor(Wiring()) as bench:
        bench.attended = lambda: False
        with pytest.raises(SafetyStop, match="not in control any more: nothing more of it moves") as refused:
            bench.run(PROGRAM, 2.0)
        assert refused.value.code == "operator_silent"
        assert around.loop.of(Run) == []
        with pytest.raises(SafetyStop, match="not in control any more"):
            bench.act("home")
        assert around.loop.of(Recover) == []


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
        assert around.stops[0].asked == [StopReason.STOP]


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


@pytest.mark.parametrize(
    ("press", "kind"), [("stop", StopReason.STOP), ("pain", StopReason.PAIN), ("estop", StopReason.EMERGENCY)]
)
def test_a_stop_goes_through_the_stop_word(around: Surroundings, press: str, kind: StopReason) -> None:
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
        until(lambda: len(around.loop.of(Heartbeat)) > 2)
        assert set(waited) == {period_s}
        assert around.loop.of(Heartbeat)[0].attending is True
        bench.attended = lambda: False
        until(lambda: not around.loop.of(Heartbeat)[-1].attending)
        # The thread ends by itself once the loop is gone.
        around.loop.ended.set()
        until(lambda: not any(thread.name == "lease" for thread in threading.enumerate()))


def test_a_loop_that_hears_nothing_for_a_while_is_told_again(
    around: Surroundings, monkeypatch: pytest.MonkeyPatch
) -> None:
    told, refused = Supervisor._tell, list[Message]()

    def tell(bench: Supervisor, message: Message) -> None:
        if isinstance(message, Heartbeat) and not refused:
            refused.append(message)
            raise DeviceError("the loop takes no messages for 5 s; stop and restart the bench")
        told(bench, message)

    monkeypatch.setattr(Supervisor, "_tell", tell)
    with Supervisor(Wiring.model_validate({"loop": {"lease_s": 0.2}})):
        until(lambda: len(around.loop.of(Heartbeat)) > 1)
    assert len(refused) == 1


def test_the_end_stops_motion_asks_the_loop_to_leave_and_ends_all_processes(around: Surroundings) -> None:
    bench = Supervisor(Wiring())
    bench.start()
    recorder, ring = cast(FakeRecorder, bench.recorder), bench._ring_path
    ring.write_bytes(b"left behind")
    bench.close()
    assert around.stops[0].asked == [StopReason.STOP]
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
    around.first = LoopFailed(text="force sensor: no answer")
    bench = Supervisor(Wiring())
    ends_soon(around)
    with pytest.raises(DeviceError, match="force sensor: no answer"):
        bench.start()
    assert (bench.alive, around.stops[0].closed, bench.recorder) == (False, 1, None)


@pytest.mark.usefixtures("around")
def test_a_start_that_came_to_no_loop_leaves_nothing_to_recover_from(monkeypatch: pytest.MonkeyPatch) -> None:
    def without_keypad(wiring: Wiring, path: Path) -> None:
        raise DeviceError("stop.keypad: No such file or directory")

    monkeypatch.setattr(module, "StopProcess", without_keypad)
    with pytest.raises(DeviceError, match=r"stop\.keypad"):
        Supervisor(Wiring()).start()
    following = claims.take(Wiring())
    assert following.unfinished == ""
    following.release()


def test_a_start_that_was_stopped_is_a_safety_stop(around: Surroundings) -> None:
    around.first = LoopFailed(text="stopped by a person", stopped=True)
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


def test_who_waits_for_an_answer_hears_how_the_loop_went(around: Surroundings) -> None:
    def ends(loop: PlayedLoop, _: Received) -> None:
        loop.ended.set()

    around.exit_code = 3
    with Supervisor(Wiring()) as bench:
        around.reply = ends
        with pytest.raises(DeviceError, match=r"ended unasked \(exit code 3\)"):
            bench.reset()


def test_how_a_loop_went_that_never_came_is_not_known() -> None:
    assert Supervisor(Wiring())._exit_text() == "exit code None"


def test_limits_of_waiting_and_leases() -> None:
    limits = (module.START_TIMEOUT_S, module.LEAVE_TIMEOUT_S, module.LEASE_SHARE, module.UNASKED_LEASE_S)
    assert limits == (60.0, 15.0, 4, 3.0)


def test_a_stopped_program_is_an_error_with_its_cause() -> None:
    error = stop_error(Outcome("pain_stop", "the subject's pain stop at 3.00 N", 3.0, None, None))
    assert isinstance(error, SafetyStop)
    assert (str(error), error.code) == ("stopped: the subject's pain stop at 3.00 N", "pain_stop")


def test_children_get_one_thread_a_numerics_library_and_all_else_of_the_environment(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("RIG_TEST", "kept")
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
        monkeypatch.delenv(name, raising=False)
    environment = process_environment()
    assert (environment["OPENBLAS_NUM_THREADS"], environment["OMP_NUM_THREADS"]) == ("1", "1")
    assert environment["RIG_TEST"] == "kept"
    assert environment["PATH"] == os.environ["PATH"]


def test_what_a_start_takes_comes_in_its_order_and_from_the_wiring(
    around: Surroundings, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[object] = []

    def take(wiring: Wiring, address: str) -> claims.Claim:
        done.append((wiring, address))
        return claims.take(wiring, address)

    monkeypatch.setattr(module, "remove_abandoned", lambda: done.append("remove_abandoned"))
    monkeypatch.setattr(module, "take", take)
    wiring = Wiring()
    bench = Supervisor(wiring, address="http://127.0.0.1:8000")
    assert bench.ready == Ready()
    with bench:
        assert done == ["remove_abandoned", (wiring, "http://127.0.0.1:8000")]
        assert around.stops[0].wiring is wiring
        (lease,) = [thread for thread in threading.enumerate() if thread.name == "lease"]
        assert lease.daemon, "a thread that waits must not keep a command from ending"


def test_a_loop_that_ended_is_waited_for_no_longer_than_five_seconds(around: Surroundings) -> None:
    with Supervisor(Wiring()) as bench:
        around.loop.ended.set()
        assert bench._exit_text() == "exit code 0"
        assert around.process.waits[0] == 5


def test_a_program_waits_until_every_device_is_ready(around: Surroundings) -> None:
    with Supervisor(Wiring()) as bench:
        around.loop.say(StatusSaid(status={"ready": False, "busy": False, "latched": None}))
        until(lambda: not bench.status["ready"])
        ready = threading.Event()

        def become_ready() -> None:
            ready.set()
            around.loop.say(StatusSaid(status=around.status))

        threading.Timer(0.2, become_ready).start()
        bench.run(PROGRAM, 5.0)
        assert ready.is_set()


def test_waiting_for_devices_ends(around: Surroundings) -> None:
    with Supervisor(Wiring()) as bench:
        around.loop.say(StatusSaid(status={"ready": False, "busy": False, "latched": None}))
        until(lambda: not bench.status["ready"])
        assert bench.await_ready(0.05) is False
        around.loop.say(StatusSaid(status={"ready": False, "busy": False, "latched": {"code": "recovery"}}))
        assert bench.await_ready(5.0) is True
