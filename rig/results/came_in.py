"""What came in: of each recording what its streams hold, what was understood of them, and which later step uses it."""

from collections.abc import Mapping
from typing import Literal

from pydantic import Field

from rig.recording.alignment import Alignment
from rig.results.base import Number, Result, SavedResult

NAME = "what-came-in"
FILE, TABLE = f"{NAME}.json", f"{NAME}.csv"
Quality = Literal["good", "usable", "bad"]


class StreamIn(Result):
    """One stream of a recording; numbers without a unit in their name are in ``unit``."""

    stream: str
    unit: str
    samples: int = Field(description="with a number that the device vouches for")
    missing: int = Field(description="rows without such a number")
    left_out: int = Field(description="rows that the import left out, since their time did not grow")
    span_s: Number
    rate_Hz: Number = Field(description="median")
    lowest_rate_Hz: Number = Field(description="over the longest step from sample to sample")
    gaps: int = Field(description="steps longer than five periods")
    longest_gap_s: Number = Field(description="null without a gap")
    lost: int = Field(description="samples whose time is not after all before them")
    lowest: Number
    highest: Number
    noise: Number = Field(description="standard deviation of a sample; of a marker, of its noisiest coordinate")
    noise_from: Literal["air", "rest", "differences", ""] = Field(
        description="air and rest: about straight lines over a fifth of a second in which the axis stands still; "
        "differences: of neighbours, where it never does"
    )
    resolution: Number = Field(description="step of the values; null where they have none in common")
    saturated: float = Field(description="share of samples at the end of a range")
    saturated_at: tuple[float, ...]
    longest_repeat: int = Field(description="samples in a row of one value, at most")


class CycleIn(Result):
    """One cycle of a recording as a fit sees it; ``refused`` says why it sees none, and is empty where it does."""

    name: str
    kind: tuple[str, ...] = Field(description="from the air, unless said otherwise")
    contact_mm: Number = Field(description="axis position of the surface, in the sense of the loading")
    contact_low_mm: Number
    contact_high_mm: Number = Field(description="the 95 % interval, or the one that holds it for certain")
    zero_N: Number
    depth_mm: Number
    peak_N: Number
    speed_mm_s: Number
    refused: str = ""


class Use(Result):
    """Whether a later step takes the recording, and why not, or not all of it."""

    used: bool
    why: str = ""


class RecordingIn(Result):
    """One recording: streams, clocks, cycles, how good it is, and what each later step does with it."""

    name: str
    streams: tuple[StreamIn, ...]
    one_clock: bool = Field(description="all streams were sampled at the same instants")
    alignments: Mapping[str, Alignment] = Field(description="of streams that came on another clock, by name")
    cycles: tuple[CycleIn, ...]
    quality: Quality
    reasons: tuple[str, ...]
    fit: Use
    diagnose: Use

    @property
    def trouble(self) -> tuple[bool, int, int]:
        """How much is to be said of it: more is worse."""
        unused = (not self.fit.used) + (not self.diagnose.used)
        return self.quality == "bad", unused, len(self.reasons)

    def stream(self, name: str) -> StreamIn | None:
        """The stream of that name, if it holds anything."""
        return next((stream for stream in self.streams if stream.stream == name), None)


class CameInResult(SavedResult):
    """Everything that is known of a session before it is fitted or judged."""

    session: str
    recordings: tuple[RecordingIn, ...]
    sha256: Mapping[str, str] = Field(description="of each recording, as it was looked at")
    remarks: tuple[str, ...] = ()

    def shown(self, most: int) -> tuple[tuple[RecordingIn, ...], str]:
        """Where there are more than ``most``, the first, the worst and some evenly between; and a sentence on that."""
        found = self.recordings
        if len(found) <= most:
            return found, ""
        first = range(most // 6)
        ranked = sorted(range(len(found)), key=lambda number: found[number].trouble, reverse=True)
        bad = [number for number in ranked if any(found[number].trouble) and number not in first][: most // 2]
        others = [number for number in range(len(first), len(found)) if number not in bad]
        left = most - len(first) - len(bad)
        between = [others[at * len(others) // left] for at in range(left)]
        rest = f"{len(bad)} of which most is to be said, and {left} from all over the others"
        said = f"{most} of {len(found)} recordings: the first {len(first)}, {rest}"
        return tuple(found[number] for number in sorted([*first, *bad, *between])), said
