"""What controller and recorder say to each other over their channel."""

from rig.channel import Message, Reply


class Open(Message, kind=30):
    """Record everything published from now on into the new file ``path``."""

    path: str
    metadata: dict[str, dict[str, str]]


class Close(Message, kind=31):
    """Finish the recording."""

    summary: dict[str, str]


class Quit(Message, kind=32):
    """Finish what is open, and end."""


class Opened(Reply, kind=33):
    """The recording has begun; ``unrecorded`` samples came since the one before."""

    path: str
    unrecorded: int


class Closed(Reply, kind=34):
    """The recording is finished: samples, samples lost before it and gaps in their numbers, per stream."""

    path: str
    samples: dict[str, int]
    dropped: dict[str, int]
    missing: dict[str, int]
    unreadable: int


class Started(Message, kind=35):
    """The recorder is attached to its ring."""


class RecorderFailed(Message, kind=36):
    """The recorder did not start, or the disk failed meanwhile."""

    text: str


TO_RECORDER = (Open, Close, Quit)
FROM_RECORDER = (Opened, Closed, Started, RecorderFailed)
