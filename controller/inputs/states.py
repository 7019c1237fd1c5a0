"""What the process of the inputs says of each of them, over the ring that it shares with the loop."""

from typing import NamedTuple

from rig.channels import STAMP, Stream

# Often enough that a lost switch stops motion within a second, and nothing to the loop.
SAY_EVERY_S = 0.2
DETAIL_BYTES = 150  # of the 244 that a slot takes


class InputState(NamedTuple):
    """One input as it is now, by its number in the configuration."""

    seq: int
    capture_ns: int
    arrival_ns: int
    input: int
    state: str
    detail: str


INPUT_STATE = Stream(63, "input_state", InputState, STAMP | {
    "input": ("1", "number of the input in the configuration"),
    "state": ("1", "as of devices"),
    "detail": ("1", "one sentence for a person"),
})  # fmt: skip


def packed(seq: int, now_ns: int, number: int, state: str, detail: str) -> bytes:
    """A row of it, its text cut to what a slot takes."""
    short = detail.encode()[:DETAIL_BYTES].decode(errors="ignore")
    return INPUT_STATE.pack(InputState(seq, now_ns, now_ns, number, state, short))
