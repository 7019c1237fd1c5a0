"""The text messages of `rig.v1`: control in JSON beside the binary batches."""

from typing import Annotated, Literal

from pydantic import BaseModel, Field, TypeAdapter

from api.http.models import RequestBody
from api.http.streams.batch import LAYOUT, Decimation
from api.http.streams.history import KEPT_S

PROTOCOL = "rig.v1"
# A part is then at most a second long, of which each batch holds whole ones.
LOWEST_HZ, HIGHEST_HZ = 1.0, 10_000.0
# More than there are signals.
MOST_STREAMS = 64
# A subscription to all streams has 2 kB.
LARGEST_MESSAGE_BYTES = 64_000
Number = Annotated[int, Field(ge=0, le=2**53)]


class Subscribe(RequestBody):
    """Asks for streams, events, and what was missed of both."""

    type: Literal["subscribe"]
    streams: list[str] = Field(max_length=MOST_STREAMS, description="names as in hello; none: events alone")
    max_rate_hz: float | None = Field(
        default=None, ge=LOWEST_HZ, le=HIGHEST_HZ, description="rows a second at most; absent: every sample"
    )
    decimate: Decimation | None = Field(default=None, description="minmax where max_rate_hz is given, else none")
    buffer_s: float = Field(default=2.0, ge=0.1, le=30.0, description="how far behind before the oldest is left out")
    events: bool = True
    session_id: str = Field(default="", description="of the hello in which since_event was counted")
    since_event: Number | None = Field(default=None, description="number of the last event that came")
    run: str = Field(default="", description="of the hello or run in which since_seq was counted")
    since_seq: dict[str, Number] = Field(
        default_factory=dict, max_length=MOST_STREAMS, description="by stream: number of the last sample that came"
    )


class Unsubscribe(RequestBody):
    """Ends channels."""

    type: Literal["unsubscribe"]
    channels: list[int] = Field(max_length=MOST_STREAMS)


class AskAlive(RequestBody):
    """Is answered at once."""

    type: Literal["ping"]
    id: Number = 0


ClientMessage = Annotated[Subscribe | Unsubscribe | AskAlive, Field(discriminator="type")]
CLIENT_MESSAGE: TypeAdapter[Subscribe | Unsubscribe | AskAlive] = TypeAdapter(ClientMessage)


class StreamView(BaseModel):
    """One stream that can be subscribed."""

    name: str
    unit: str
    about: str
    fields: list[str]
    topic: str = Field(description="stream of the recording whose seq numbers its samples")
    step: int = Field(description="by which seq rises from sample to sample")
    rate_hz: float = Field(description="samples a second as configured")


class Hello(BaseModel):
    """What the service says first."""

    type: Literal["hello"] = "hello"
    protocol: str = PROTOCOL
    software: str
    session_id: str = Field(description="changes with every start of the service; events are counted within it")
    run: str = Field(description="changes with every start of the loop; samples are counted within it")
    monotonic_ns: int = Field(description="the clock of all samples, now")
    event_seq: int = Field(description="number of the newest event")
    kept_s: float = Field(default=KEPT_S, description="how long samples are kept for who comes back")
    layout: str = Field(default=LAYOUT, description="of a batch, little-endian, without padding")
    streams: list[StreamView]


class ChannelView(BaseModel):
    """What comes on a channel."""

    channel: int
    stream: str
    unit: str
    decimate: Decimation
    max_rate_hz: float | None
    columns: list[str]
    step: int


class Subscribed(BaseModel):
    """The answer to `subscribe`; ``resumed`` says whether the numbers that were given are of this run and session."""

    type: Literal["subscribed"] = "subscribed"
    run: str
    resumed: bool
    channels: list[ChannelView]


class Unsubscribed(BaseModel):
    """The answer to `unsubscribe`."""

    type: Literal["unsubscribed"] = "unsubscribed"
    channels: list[int]


class Gap(BaseModel):
    """Samples ``from`` to ``to`` do not come.

    Of events the channel is 0. ``cause``: slow (this client was behind by more than its buffer), expired (not kept any
    more when it came back), source (they never came to the service).
    """

    type: Literal["gap"] = "gap"
    channel: int
    stream: str
    first: int = Field(serialization_alias="from")
    last: int = Field(serialization_alias="to")
    dropped: int
    cause: Literal["slow", "expired", "source"]


class RunBegun(BaseModel):
    """Another loop runs: samples are counted anew."""

    type: Literal["run"] = "run"
    run: str


class Alive(BaseModel):
    """The answer to `ping`; also said where there was nothing to say for a while, then without ``id``."""

    type: Literal["pong", "ping"]
    id: int | None = None
    monotonic_ns: int


class Misunderstood(BaseModel):
    """A message was not followed, and why; everything else goes on."""

    type: Literal["error"] = "error"
    code: str
    detail: str
