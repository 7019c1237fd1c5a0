"""The state of one device, from what is observed of it: pure, and one rule for every role.

connecting -> ok <-> degraded;   any -> lost -> reconnecting -> connecting;   any -> fault

``fault`` needs a person, ``lost`` and ``reconnecting`` need a cable or power, and ``degraded`` answers but not as it
should. Whatever is not ``ok`` is not fit for motion.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum

# A start-up ends with samples on their way: the slowest device on the bench, a tracker, then answers within 0.1 s.
CONNECTING_NS = 5_000_000_000
# Ten times what stops motion: a pause of the computer is no lost device, and nothing moves on the strength of this.
SILENT_NS = 1_000_000_000
# The mean rate settles within fifty samples, 0.8 s of a tracker; a single bad sample is not a bad device.
DEGRADED_NS = 1_000_000_000


class DeviceState(StrEnum):
    """States of a device."""

    CONNECTING = "connecting"
    OK = "ok"
    DEGRADED = "degraded"
    LOST = "lost"
    RECONNECTING = "reconnecting"
    FAULT = "fault"


NEXT_STEPS: Mapping[DeviceState, str] = {
    DeviceState.CONNECTING: "wait a moment, then start again",
    DeviceState.DEGRADED: "`rig doctor` shows what it brings",
    DeviceState.LOST: "check its power and cable, it comes back by itself once nothing moves",
    DeviceState.RECONNECTING: "check its power and cable, it is opened again as soon as it answers",
    DeviceState.FAULT: "`rig reset` says what happened and recovers",
}


@dataclass(frozen=True)
class Observation:
    """What is seen of a device now; texts are empty where there is nothing to say.

    ``fault``: only a person can mend it; ``lost``: the link failed; ``reopening``: a new driver is being started;
    ``withheld``: it answers, but takes no orders; ``imperfect``: its samples are not as they should be.
    ``age_ns``: of the newest sample; None before the first.
    """

    age_ns: int | None
    fault: str = ""
    lost: str = ""
    reopening: bool = False
    withheld: str = ""
    imperfect: str = ""


@dataclass(frozen=True)
class DeviceStatus:
    """State, why, and since when; ``imperfect_ns``: when its samples ceased to be as they should, None if they are."""

    state: DeviceState
    detail: str
    since_ns: int
    imperfect_ns: int | None = None


def connecting(now_ns: int) -> DeviceStatus:
    """A device that was just opened."""
    return DeviceStatus(DeviceState.CONNECTING, "no sample yet", now_ns)


def following(before: DeviceStatus, seen: Observation, now_ns: int) -> DeviceStatus:
    """The status that follows ``before`` once ``seen`` was observed."""
    imperfect_ns = (now_ns if before.imperfect_ns is None else before.imperfect_ns) if seen.imperfect else None
    state, detail = _state(before, seen, now_ns, imperfect_ns)
    return DeviceStatus(state, detail, before.since_ns if state is before.state else now_ns, imperfect_ns)


def _state(before: DeviceStatus, seen: Observation, now_ns: int, imperfect_ns: int | None) -> tuple[DeviceState, str]:
    if seen.fault:
        return DeviceState.FAULT, seen.fault
    if seen.reopening:
        return DeviceState.RECONNECTING, seen.lost
    if seen.lost:
        return DeviceState.LOST, seen.lost
    if seen.age_ns is None:
        return _unheard(before, now_ns)
    if seen.age_ns > SILENT_NS:
        return DeviceState.LOST, f"no sample for more than {SILENT_NS * 1e-9:g} s"
    if seen.withheld:
        return DeviceState.DEGRADED, seen.withheld
    if imperfect_ns is not None and now_ns - imperfect_ns >= DEGRADED_NS:
        return DeviceState.DEGRADED, seen.imperfect
    return DeviceState.OK, ""


def _unheard(before: DeviceStatus, now_ns: int) -> tuple[DeviceState, str]:
    """Connecting for a while, then lost; lost until a sample comes."""
    waits = before.state is not DeviceState.CONNECTING or now_ns - before.since_ns < CONNECTING_NS
    if waits and before.state is not DeviceState.LOST:
        return DeviceState.CONNECTING, "no sample yet"
    return DeviceState.LOST, f"no sample within {CONNECTING_NS * 1e-9:g} s of its start"


def refusal(devices: Mapping[str, DeviceStatus], needed: Iterable[str]) -> str:
    """Why motion that needs those roles cannot start: the first that is not ok, and the next step; empty if all are."""
    for role in needed:
        status = devices[role]
        if status.state is not DeviceState.OK:
            return f"{role} is {status.state}: {status.detail}; {NEXT_STEPS[status.state]}"
    return ""
