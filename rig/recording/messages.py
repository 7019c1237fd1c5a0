"""What controller and recorder say to each other over their channel."""

from typing import ClassVar

from rig.channel import Message, Reply


class Open(Message):
    """Record everything published from now on into the new file ``path``."""

    TYPE: ClassVar[int] = 30
    path: str
    metadata: dict[str, dict[str, str]]


class Close(Message):
    """Finish the recording."""

    TYPE: ClassVar[int] = 31
    summary: dict[str, str]


class Quit(Message):
    """Finish what is open, and end."""

    TYPE: ClassVar[int] = 32


class Opened(Reply):
    """The recording has begun; ``unrecorded`` samples came since the one before."""

    TYPE: ClassVar[int] = 33
    path: str
    unrecorded: int


class Closed(Reply):
    """The recording is finished: samples, samples lost before it and gaps in their numbers, per stream."""

    TYPE: ClassVar[int] = 34
    path: str
    samples: dict[str, int]
    dropped: dict[str, int]
    missing: dict[str, int]
    unreadable: int


class Started(Message):
    """The recorder is attached to its ring."""

    TYPE: ClassVar[int] = 35


class RecorderFailed(Message):
    """The recorder did not start, or the disk failed meanwhile."""

    TYPE: ClassVar[int] = 36
    text: str


TO_RECORDER = (Open, Close, Quit)
FROM_RECORDER = (Opened, Closed, Started, RecorderFailed)
