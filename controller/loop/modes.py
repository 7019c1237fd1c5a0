"""What the controller is doing, as one number in every row of the loop stream."""

from enum import IntEnum


class Mode(IntEnum):
    """Modes of the controller; position is commanded in all but CONTACT, where force is."""

    IDLE = 0
    FREE = 1
    APPROACH = 2
    COMPRESS = 3
    CONTACT = 4
    RETRACT = 5
    SAFE = 6


AT_REST = (Mode.IDLE, Mode.SAFE)
"""Modes in which nothing is asked to move."""

PRESSING = (Mode.COMPRESS, Mode.CONTACT)
"""Modes in which the tip is meant to be in contact, and goes deeper by what it feels."""
