"""Recovery as a conversation with a running loop: look, do what was agreed to, look again, until the bench is ready."""

from collections.abc import Sequence
from typing import Protocol

from controller.loop.messages import Status
from controller.recovery.situation import Consent, Situation, needed, questions
from rig.errors import DeviceError, SafetyStop
from rig.results.bench import Act, ResetResult

# A device that is opened again by itself answers within its longest pause and its start, 4 s each.
AXIS_BACK_S = 15.0
SENSORS_BACK_S = 10.0
SAID: dict[Act, str] = {
    "clear": "the drive's fault was cleared",
    "retract": "the tip moved out",
    "home": "the axis was homed",
}


class RecoverableBench(Protocol):
    """What recovery asks of a running bench."""

    @property
    def status(self) -> Status:
        """The newest status."""

    def survey(self) -> Situation:
        """How things stand."""

    def act(self, act: Act) -> None:
        """One act, to its end."""

    def reset(self) -> None:
        """Acknowledges the stop in force."""

    def wait_at_rest(self, timeout_s: float = 30.0) -> None:
        """Waits until nothing moves."""

    def await_ready(self, timeout_s: float) -> bool:
        """Whether every device is ok within that time."""

    def await_device(self, role: str, timeout_s: float) -> bool:
        """Whether the device is there within that time."""


def recover(bench: RecoverableBench, consent: Consent) -> ResetResult:
    """As far as ``consent`` goes; raises DeviceError or SafetyStop where something hinders what was agreed to."""
    bench.wait_at_rest()
    bench.await_device("axis", AXIS_BACK_S)
    first = now = bench.survey()
    done: list[Act] = []
    while acts := needed(_answering(now)):
        asked = questions(now, consent)
        if asked:
            return ResetResult(happened=first.sentences, done=_said(done), open=asked)
        act = acts[-1]
        if act in done:
            raise SafetyStop(f"{SAID[act]}, and it is needed again; {'; '.join(now.sentences)}")
        bench.act(act)
        done.append(act)
        now = bench.survey()
    if now.stopped or done:
        bench.reset()
    return ResetResult(happened=first.sentences, done=_said(done), missing=_missing(bench))


def _said(done: Sequence[Act]) -> tuple[str, ...]:
    return tuple(SAID[act] for act in done)


def _answering(now: Situation) -> Situation:
    if now.lost:
        raise DeviceError(f"{now.lost}; it is opened again by itself once it answers, then recover again")
    return now


def _missing(bench: RecoverableBench) -> str:
    """Which devices are still not ok, after those that come back by themselves had time to."""
    bench.await_ready(SENSORS_BACK_S)
    devices = bench.status.get("devices", {})
    bad = [role for role in devices if devices[role]["state"] != "ok"]
    return "; ".join(f"{role} is {devices[role]['state']}: {devices[role]['detail']}" for role in bad)
