"""What goes over the wire of the service; requests are strict: no unknown keys, no NaN, no silent conversion."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, JsonValue

from controller.loop.messages import DeviceView
from rig.results.bench import RetractResult
from rig.results.recorded import CaptureResult
from rig.results.tracking import TrackResult

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$")]


class RequestBody(BaseModel):
    """Root of request bodies."""

    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False)


class CaptureRequest(RequestBody):
    """Starts a protocol."""

    kind: Literal["capture"]
    protocol: Name = Field(description="name of a protocol as /protocols lists it")
    session: Name = Field(description="name of the new session folder")


class TrackRequest(RequestBody):
    """Tracks forces with gains from the model of a session."""

    kind: Literal["track"]
    session: Name = Field(description="session whose fitted model gives the gains; the run is recorded there")
    forces_N: list[Annotated[float, Field(gt=0)]] = Field(min_length=1, max_length=20)
    seconds: Annotated[float, Field(gt=1, le=600)] = 10.0


class RetractRequest(RequestBody):
    """Moves out of the tissue, after a stop that was acknowledged."""

    kind: Literal["retract"]


class RecoverRequest(RequestBody):
    """What is agreed to; without a consent that is needed, the answer asks for it and nothing is done."""

    clear: bool = Field(default=False, description="clear the drive's fault")
    retract: bool = Field(default=False, description="move the tip out")
    home: bool = Field(default=False, description="home the axis where it has no reference")


class LeaseRequest(RequestBody):
    """Takes control of the bench."""

    holder: Annotated[str, Field(min_length=1, max_length=80, description="who this is, as others are told")]
    ttl_s: float = Field(default=5.0, ge=0.5, le=30.0, description="how long it lasts after each renewal")


class LeaseView(BaseModel):
    """The lease, as its holder gets it."""

    lease_id: str = Field(description="to be sent as X-Control-Lease with whatever moves")
    holder: str
    since: str
    ttl_s: float
    left_s: float


class ControlView(BaseModel):
    """Who is in control, as everybody may see it; empty where nobody is."""

    holder: str
    since: str
    left_s: float


class JobView(BaseModel):
    """A piece of work."""

    id: str
    kind: str
    name: str
    state: Literal["running", "succeeded", "failed", "stopped"]
    done: float
    total: float
    unit: str
    message: str
    time_left_s: float | None = Field(description="at the pace so far; null before the first part is done")
    log: list[str] = Field(description="what it said so far; empty where the bench is shown, see /jobs/{id}")
    result: CaptureResult | TrackResult | RetractResult | None = Field(description="once it has succeeded")


class Info(BaseModel):
    """Who this service is."""

    software: str
    service_id: str = Field(description="changes with every start of the service")
    monotonic_ns: int = Field(description="the clock of all samples, now")
    sessions_folder: str
    stop_port: int = Field(description="of the stop process on 127.0.0.1, which takes POST /estop, /pain and /stop")


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
    job: JobView | None


class ProtocolView(BaseModel):
    """A protocol file."""

    name: str
    file: str
    settings: dict[str, JsonValue]
    refusal: str = Field(description="why it cannot be started on this bench; empty if it can")


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


class Done(BaseModel):
    """A stop or a reset took effect."""

    done: bool
    mode: str
    detail: str
    id: int = Field(default=0, description="of a stop, as in the recording")
