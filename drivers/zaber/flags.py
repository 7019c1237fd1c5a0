"""What a Zaber device says is wrong: two letters in each reply, and the reasons for which it refuses a command.

Letters: zaber.com, ASCII protocol manual, warning flags. F stops motion, W is a warning, N a note.
"""

NONE = "--"
WITHOUT_REFERENCE = ("WR", "WH")
POWERLESS = ("FO", "FD")  # by command, or since it started: what `driver enable` ends
FLAGS = {
    "FF": "critical system error",
    "FN": "peripheral not supported",
    "FZ": "peripheral inactive",
    "FH": "hardware emergency stop, driver disabled",
    "FV": "overvoltage or undervoltage, driver disabled",
    "FO": "driver disabled by command or since start",
    "FC": "current inrush error",
    "FM": "motor temperature error",
    "FD": "driver disabled",
    "FQ": "encoder error",
    "FI": "index error",
    "FA": "analog encoder out of sync",
    "FR": "overdrive limit exceeded",
    "FS": "stalled and stopped",
    "FB": "stream bounds error",
    "FP": "left its interpolated path",
    "FE": "limit error",
    "FT": "excessive twist",
    "WL": "unexpected limit trigger",
    "WV": "voltage out of range",
    "WT": "controller temperature high",
    "WS": "stalled, and recovered",
    "WM": "displaced while it stood",
    "WP": "invalid calibration type",
    "WR": "no reference position",
    "WH": "not homed",
    "NC": "moved by hand",
    "NI": "movement interrupted",
    "ND": "stream discontinuity",
    "NR": "value rounded",
    "NT": "value truncated",
    "NU": "setting not yet in force",
    "NJ": "joystick calibrating",
    "NB": "firmware being updated",
}
REASONS = {
    "BADCOMMAND": "it does not know this command",
    "BADDATA": "a value is out of its range",
    "BADAXIS": "it has no such axis",
    "BADMESSAGEID": "the command's number is wrong",
    "BADSPACE": "a space is wrong",
    "AGAIN": "it is busy and asks to be asked again",
    "DEVICEONLY": "not for one axis",
    "DRIVERDISABLED": "its driver has no power",
    "FULL": "its memory is full",
    "INACTIVE": "the axis is inactive",
    "LOCKSTEP": "the axis moves together with another",
    "NOTSUPPORTED": "it cannot do this",
    "PARKED": "the axis is parked",
    "REMOTE": "another master has it",
    "STATUSBUSY": "it moves",
}


def is_fault(flag: str) -> bool:
    """Whether ``flag`` stops motion."""
    return flag.startswith("F")


def described(flag: str) -> str:
    """The flag in words, empty for none."""
    return "" if flag == NONE else f"{flag}: {FLAGS.get(flag, 'a flag that is not in the manual')}"


def reason(word: str) -> str:
    """Why a command was refused."""
    return f"{word}: {REASONS[word]}" if word in REASONS else word or "no reason given"
