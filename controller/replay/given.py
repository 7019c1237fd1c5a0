"""What a cycle was decided on and no sample holds: stops by people, lost links, faults of the drive, other processes.

These are inputs of the loop and not its decisions. A recording has them in the sentence of the stop that followed, and
so they are given to the replay at that cycle; it must draw the same conclusion from them. Everything else is decided
anew from samples.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field

from controller.safety.table import Action
from rig.channels import EventSample

REQUESTED = {"emergency_stop": "estop", "pain_stop": "pain", "operator_stop": "stop"}
SILENT = re.compile(r"silent for ([\d.]+) s")
FULL = re.compile(r"buffer (\d+) % full")
LOST = {"axis_lost": "axis lost: ", "force_lost": "force sensor lost: ", "tracker_lost": "tracker lost: "}
# A sentence says tenths: a time just beyond its limit must not be read as one just within it, and be said alike.
ROUNDED_S = 0.04
FAULT = "the drive reports: "


@dataclass
class Given:
    """Inputs of one cycle beside samples; ``lost`` by code of the stop, ``named`` what was given, for a person."""

    requests: frozenset[str] = frozenset()
    lost: dict[str, str] = field(default_factory=dict)
    drive_fault: str = ""
    recorder_silent_s: float = 0.0
    recorder_fill: float = 0.0
    stop_silent_s: float = 0.0
    operator_silent_s: float = 0.0
    supervisor_lost: bool = False
    named: list[str] = field(default_factory=list)


def given_by(events: Iterable[EventSample]) -> dict[int, Given]:
    """By time of the cycle [ns]: what stood behind its stop."""
    found: dict[int, Given] = {}
    for event in events:
        if event.level >= Action.SOFT:
            _add(found.setdefault(event.capture_ns, Given()), event.code, event.text)
    return {time_ns: given for time_ns, given in found.items() if given.named}


def _add(given: Given, code: str, text: str) -> None:
    given.named.append(f"{code}: {text}")
    if code in REQUESTED:
        keypad = {"keypad"} if "keypad" in text else set()
        given.requests |= {REQUESTED[code]} | keypad
    elif code in LOST and text.startswith(LOST[code]):
        given.lost[code] = text.removeprefix(LOST[code])
    elif code == "drive_fault":
        given.drive_fault = text.removeprefix(FAULT)
    elif not _of_processes(given, code, text):
        given.named.pop()


def _of_processes(given: Given, code: str, text: str) -> bool:
    """Whether other processes stood behind it."""
    silent, full = SILENT.search(text), FULL.search(text)
    silent_s = float(silent[1]) + ROUNDED_S if silent else 0.0
    if code == "recorder_stalled":
        given.requests |= set() if silent or full else {"recording"}
        given.recorder_silent_s, given.recorder_fill = silent_s, float(full[1]) / 100 if full else 0.0
    elif code == "stop_lost":
        given.stop_silent_s = silent_s
    elif code == "operator_silent" and silent:
        given.operator_silent_s = silent_s
    elif code == "operator_silent":
        given.requests |= {"unattended"}
    elif code == "supervisor_lost":
        given.supervisor_lost = True
    else:
        return False
    return True
