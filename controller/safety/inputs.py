"""What the safety table looks at besides the state: the state of links, clocks, recorder and people."""

from dataclasses import dataclass

from controller.loop.modes import Mode


@dataclass(slots=True)
class SafetyInputs:
    """What the table looks at besides the state; filled by the loop every cycle."""

    mode: Mode = Mode.IDLE
    force_lost: str = ""
    axis_lost: str = ""
    marker_lost: str = ""
    input_lost: str = ""
    drive_fault: str = ""
    force_valid: bool = True
    force_frozen: bool = False
    touch_wrong: str = ""
    contact_lost: str = ""
    oscillation: str = ""
    force_age_ms: float = 0.0
    axis_age_ms: float = 0.0
    marker_age_ms: float = 0.0
    limb_age_ms: float = 0.0
    late_ms: float = 0.0
    recorder_fill: float = 0.0
    recorder_silent_s: float = 0.0
    supervisor_lost: bool = False
    stop_silent_s: float = 0.0
    operator_silent_s: float = 0.0
    requests: frozenset[str] = frozenset()
