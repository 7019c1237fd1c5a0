"""What goes over the wire of the service; requests are strict: no unknown keys, no NaN, no silent conversion."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, JsonValue

from api.http.jobs.states import JobState, Verb
from api.http.listing import Listing
from controller.loop.messages import DeviceView
from rig.results.catalogue import Text

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$")]


class RequestBody(BaseModel):
    """Root of request bodies."""

    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False)


class RecoverRequest(RequestBody):
    """What is agreed to; without a consent that is needed, the answer asks for it and nothing is done."""

    clear: bool = Field(default=False, description="clear the drive's fault")
    retract: bool = Field(default=False, description="move the tip out")
    home: bool = Field(default=False, description="home the axis where it has no reference")


class LeaseRequest(RequestBody):
    """Takes control of the bench."""

    purpose: Annotated[str, Field(max_length=200, description="what for, as others are told")] = ""
    holder: Annotated[str, Field(min_length=1, max_length=80, description="what this page or program calls itself")]
    ttl_s: float = Field(default=5.0, ge=0.5, le=30.0, description="how long it lasts after each renewal")


class TakeoverRequest(LeaseRequest):
    """Takes control from whoever has it."""

    reason: Annotated[str, Field(min_length=3, max_length=200, description="why, as whoever had control is told")]


class LeaseView(BaseModel):
    """The lease, as its holder gets it."""

    lease_id: str = Field(description="to be sent as X-Control-Lease with whatever moves")
    holder: str = Field(description="the name of token or account, and behind it what its program calls itself")
    since: str
    ttl_s: float
    left_s: float
    epoch: int = Field(default=0, description="grows with every lease given")
    purpose: str = ""


class ControlView(BaseModel):
    """Who is in control, as everybody may see it; empty where nobody is."""

    epoch: int = 0
    purpose: str = ""
    holder: str
    since: str
    left_s: float


class JobProblem(BaseModel):
    """Why a job did not succeed."""

    code: str = Field(description="a line of the safety table, or data, device, refused, crashed, cancelled, ...")
    detail: str


class JobSummary(BaseModel):
    """A piece of work, as lists show it."""

    id: str
    kind: str
    name: str
    state: JobState
    seq: int = Field(default=0, description="grows with every job, whatever the clock was set to")
    moves: bool = Field(description="it uses the bench")
    by: str = Field(description="who started it")
    session: str | None = Field(default=None, description="the session it works on or records")
    created: str
    started: str | None = None
    ended: str | None = None
    done: float
    total: float
    unit: str
    message: str = Field(description="what it does now; of a paused calibration what a person is to do")
    time_left_s: float | None = Field(description="by its plan, else at the pace so far; null where neither is known")
    can: list[Verb] = Field(description="what it may be asked for now")
    problem: JobProblem | None = Field(default=None, description="why it did not succeed")


class ServiceLimits(BaseModel):
    """How much the service takes at a time."""

    body_bytes: int = Field(description="of a request, but for uploads")
    upload_bytes: int
    page_entries: int = Field(description="of one page of a list")
    waiting_jobs: int = Field(description="computations that may wait for their turn")
    requests_per_s: float = Field(description="of one caller, in the long run")
    channels: int = Field(description="of one WebSocket")
    open_connections: int = Field(description="that look on at a time: WebSockets, and readers of events")
    open_connections_each: int = Field(description="of one token or login")
    message_bytes: int = Field(description="of what a client says over a WebSocket")
    messages_per_s: float = Field(description="of one WebSocket, in the long run")
    lowest_rate_hz: float = Field(description="of a channel with max_rate_hz")
    highest_rate_hz: float
    latest_samples: int = Field(description="of one answer of /streams/{stream}/latest")
    kept_s: float = Field(description="how long samples are kept for who comes back")


class Capabilities(BaseModel):
    """What this service can do; what is a laboratory's own, as its protocols, has lists that ask for a right."""

    products: dict[str, list[str]] = Field(description="by role: devices that can stand here, those of plug-ins too")
    extras: list[str] = Field(description="optional parts of the program that are installed")
    jobs: list[str] = Field(description="kinds of jobs")
    export_formats: list[str] = Field(description="of /sessions/{session}/export/{form}")
    streams: dict[str, str] = Field(description="live streams with their unit")
    protocols: list[str] = Field(description="spoken here: the interface's version, the WebSocket's subprotocol")
    transports: dict[str, str] = Field(description="the address of each")
    limits: ServiceLimits


class Info(BaseModel):
    """Who this service is, and what it can do."""

    software: str
    service_id: str = Field(description="changes with every start of the service")
    monotonic_ns: int = Field(description="the clock of all samples, now")
    sessions_folder: str = Field(description="empty for whoever sends no credential")
    stop_port: int = Field(description="of the stop process on 127.0.0.1, which takes POST /estop, /pain and /stop")
    away_stops: str = Field(description="where a page of other computers finds the same beside the service; else empty")
    capabilities: Capabilities


class RigView(BaseModel):
    """The bench as of now."""

    state: Literal["disconnected", "not ready", "idle", "running", "stopped"]
    reason: str = Field(description="why it is disconnected, not ready or stopped; empty otherwise")
    ready: bool = Field(default=False, description="every device is ok; without that nothing starts")
    mode: str = ""
    time_ns: int = 0
    force_N: float | None = None
    reference_N: float | None = None
    position_mm: float | None = None
    depth_mm: float | None = None
    missed: int = 0
    cycles: int = 0
    rates_Hz: dict[str, float] = {}
    health: dict[str, dict[str, bool]] = Field(description="per stream: alive, valid, on_rate")
    lost: dict[str, str] = {}
    devices: dict[str, DeviceView] = Field(
        description="per role: product, serial, firmware, settings; state (connecting, ok, degraded, lost,"
        " reconnecting, fault), detail, since_ns"
    )
    limits: dict[str, float]
    control: ControlView
    job: JobSummary | None


class ProtocolView(BaseModel):
    """A protocol file."""

    name: Text
    file: Text
    settings: dict[str, JsonValue]
    refusal: Text = Field(description="why it cannot be started on this bench; empty if it can")


class RecordingView(BaseModel):
    """A file of a session."""

    session: str
    file: str
    bytes: int
    href: str
    quality: str = Field(default="", description="of a trial: good, usable, bad, or empty where nobody judged")
    reasons: list[str] = Field(default_factory=list, description="why the quality is not good, one sentence each")


class SessionView(BaseModel):
    """A session and its recordings."""

    name: str
    kind: str
    created: str
    trials: int
    samples: int
    dropped: int
    remarks: list[str] = Field(description="what is not as it should be in the folder, as its list tells")
    recordings: list[RecordingView]


class RecordingList(Listing[SessionView]):
    """Sessions with their recordings, newest first; ``next`` is the cursor of what follows, null at the end."""

    remarks: list[str] = Field(default=[], description="folders that are not listed, and why")


class Done(BaseModel):
    """A stop or a reset took effect."""

    done: bool
    mode: str
    detail: str
    id: int = Field(default=0, description="of a stop, as in the recording")
