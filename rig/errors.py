"""One root error; subclasses say what the caller can do.

A message is one sentence group for a person: what failed, where, what came, the limit with its unit, the next step.
"""

import errno

# Of the disk, and of what this account may use of it.
NO_ROOM = (errno.ENOSPC, errno.EDQUOT)


class RigError(Exception):
    """Root of every failure this project raises on purpose; ``exit_code`` is what the command line ends with."""

    exit_code = 1


class UsageError(RigError):
    """The request itself is wrong (configuration, protocol, file, option): correct it and call again."""

    exit_code = 2


class DataError(UsageError):
    """Given data cannot be used (NaN, gap, wrong unit, wrong order): the message names file, place and bound."""


class WriteFailed(RigError):
    """The disk did not take a result; nothing half-written was left behind."""


class DiskFull(WriteFailed):
    """The disk had no room for it: remove what is not needed, then try again."""


def write_failed(text: str, error: OSError) -> WriteFailed:
    """What to raise for ``error``, with that ``text``."""
    return (DiskFull if error.errno in NO_ROOM else WriteFailed)(text)


class DeviceError(RigError):
    """A device is absent, silent, wrong or in fault: check wiring and power, then `rig doctor`."""


class PluginError(RigError):
    """What another distribution declares failed in its own code: see its maker, or uninstall it."""


class CheckFailed(RigError):
    """A check ran and its answer is no (`rig verify`, `rig doctor`)."""


class SafetyStop(RigError):
    """Motion was stopped by a limit, a person or a lost input; acknowledge the cause before moving again.

    ``code`` is the line of the safety table that stopped it, empty where none did.
    """

    exit_code = 3

    def __init__(self, message: str, code: str = "") -> None:
        super().__init__(message)
        self.code = code


class BadTrial(RigError):
    """A trial's quality stayed bad however often it was made again; what was recorded is kept and marked."""

    exit_code = 4
