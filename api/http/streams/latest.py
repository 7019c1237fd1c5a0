"""The newest samples of a stream, for who asks once: never an old one as if it were fresh."""

import math
from collections.abc import Iterator, Mapping
from typing import Literal

from pydantic import BaseModel, Field

from api.http.streams.batch import LATE_NS
from api.http.streams.history import LiveHistory, Rows
from api.http.streams.live_run import LiveRun
from api.http.streams.signals import LiveSignal
from rig.channels import AXIS, FORCE

# A second of the fastest sensor; whoever wants more subscribes.
MOST_LATEST = 1000
# What each cycle of the loop says again of a device, whether or not that has said anything new.
SAID_AGAIN = {
    "force_N": FORCE.name, "error_N": FORCE.name, "position_mm": AXIS.name, "depth_mm": AXIS.name,
}  # fmt: skip


class SampleView(BaseModel):
    """One sample."""

    seq: int = Field(description="its number, as in the recording of the same run")
    time_ns: int = Field(description="host monotonic time at which it was taken")
    age_s: float
    values: dict[str, float | None] = Field(description="by field, in the stream's unit; null where nobody knows")


class LatestView(BaseModel):
    """The newest of a stream; there are ``samples`` of one that is live, and of no other."""

    stream: str
    unit: str
    topic: str
    step: int = Field(description="by which seq rises from sample to sample")
    run: str = Field(description="changes with every start of the loop; samples are counted within it")
    monotonic_ns: int = Field(description="the clock of all samples, now")
    state: Literal["live", "invalid", "stale", "lost"] = Field(
        description="invalid: it comes, and its device does not vouch for it; stale: nothing came in time;"
        " lost: the loop has lost the device, or no loop runs"
    )
    reason: str = Field(description="why it is not live; empty where it is")
    age_s: float | None = Field(description="of the newest; null where none has come in this run")
    samples: list[SampleView] = Field(description="newest last")
    last_seen: SampleView | None = Field(default=None, description="of one that is not live: what came last, now old")


def latest(signal: LiveSignal, run: LiveRun, count: int, now_ns: int, lost: Mapping[str, str]) -> LatestView:
    """The ``count`` newest; ``lost`` says by topic why the loop has lost a device."""
    history = run.histories[signal.source]
    rows = history.between(history.end - count, history.end)
    shown = [_sample(signal, row, now_ns) for row in rows]
    state, reason = next(_doubts(signal, run, now_ns, lost), ("live", ""))
    return LatestView.model_validate({
        **{name: getattr(signal, name) for name in ("unit", "topic", "step")},
        "stream": signal.name, "run": run.id, "monotonic_ns": now_ns, "state": state, "reason": reason,
        "age_s": shown[-1].age_s if shown else None,
        "samples": [] if reason else shown,
        "last_seen": shown[-1] if shown and reason else None,
    })  # fmt: skip


def _doubts(signal: LiveSignal, run: LiveRun, now_ns: int, lost: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """State and reason of each doubt, the gravest first."""
    again = SAID_AGAIN.get(signal.fields[0]) if signal.source == "loop" else None
    sources = (signal.source, again) if again else (signal.source,)
    topics = (signal.topic, again)
    if run.ended:
        yield "lost", "no loop runs; connect the bench"
    yield from (("lost", f"{topic} is lost: {why}") for topic, why in lost.items() if topic in topics)
    for source in sources:
        yield from _doubt(source, run.histories[source], now_ns)


def _doubt(source: str, history: LiveHistory, now_ns: int) -> Iterator[tuple[str, str]]:
    if not history.end:
        yield "lost", f"nothing has come of {source} in this run"
        return
    (newest,) = history.between(history.end - 1, history.end)
    age_ns = now_ns - int(newest["time_ns"])
    if age_ns > LATE_NS + history.period_ns:
        yield "stale", f"the newest of {source} is {age_ns * 1e-9:.2f} s old; look at its device and the bench's state"
    if "valid" in (history.dtype.names or ()) and not newest["valid"]:
        yield "invalid", f"the device does not vouch for the newest of {source}: a fault, or a marker that is not seen"


def _sample(signal: LiveSignal, row: Rows, now_ns: int) -> SampleView:
    time_ns = int(row["time_ns"])
    values = {field: _known(float(row[field])) for field in signal.fields}
    return SampleView(seq=int(row["seq"]), time_ns=time_ns, age_s=(now_ns - time_ns) * 1e-9, values=values)


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
