"""Protocols of one press: held for long enough to do something to it, or soon over."""

from mock_devices.testing.commands import pressed
from mock_devices.testing.service import ServedRig

SLOW = (
    'kind = "indentation"\nspeeds_mm_s = [5]\ntrials = 1\ndepth_mm = 6\nair_dwell_s = 0.2\napproach_speed_mm_s = 20\n'
    "hold_s = 30\nretract_speed_mm_s = 20\nclearance_mm = 4\nforce_limit_N = 12\n"
)
SHORT = SLOW.replace("hold_s = 30", "hold_s = 0.1").replace("speeds_mm_s = [5]", "speeds_mm_s = [20]")


def press(served: ServedRig) -> None:
    """Starts a capture and waits until the tip presses."""
    served.ask("POST", "/jobs", {"kind": "capture", "params": {"protocol": "slow", "session": "one"}}, served.lease())
    pressed(served.bench)
