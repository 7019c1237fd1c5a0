"""The states of a job, and what may be asked of it."""

from typing import Literal, get_args

JobState = Literal[
    "queued", "running", "pausing", "paused", "cancelling", "succeeded", "failed", "cancelled", "interrupted"
]
JobEnd = Literal["succeeded", "failed", "cancelled", "interrupted"]
ENDS: frozenset[str] = frozenset(get_args(JobEnd))
Verb = Literal["cancel", "pause", "resume"]
