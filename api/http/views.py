"""What the service knows, as what goes over the wire."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

from api.http.lease import ControlLease
from api.http.models import (
    ControlView,
    JobView,
    LeaseView,
    ProtocolView,
    RecordingView,
    RigView,
    SessionView,
)
from api.http.service import Job, Service
from controller.devices.health import ALIVE, ON_RATE, VALID
from controller.experiments.capture import check
from controller.loop.messages import DeviceView, Status
from controller.supervisor import Supervisor
from rig.config.protocol import Indentation
from rig.config.table import load
from rig.errors import RigError
from rig.recording.sessions import TrialInfo, read_listing
from rig.results.bench import RetractResult
from rig.results.recorded import CaptureResult
from rig.results.tracking import TrackResult

State = Literal["disconnected", "not ready", "idle", "running", "stopped"]
STREAMS = ("force", "axis", "marker")
SHOWN = (".mcap", ".json", ".html")


def job(job: Job) -> JobView:
    """One job."""
    now = job.progress
    result = now.result if isinstance(now.result, CaptureResult | TrackResult | RetractResult) else None
    return JobView.model_validate({**vars(now), "id": job.id, "kind": job.kind, "result": result})


def rig(service: Service) -> RigView:
    """The bench; a bench that is not there is a state, not an error."""
    bench = service.bench
    alive = bench is not None and bench.alive
    status = bench.status if bench and alive else {}
    running = service.running
    limits = service.wiring.limits
    state, reason = _state(service, status, alive)
    return RigView.model_validate({
        **status,
        "state": state,
        "reason": reason,
        "health": _health(status.get("health", 0)),
        "devices": _devices(bench, status) if bench else {},
        "limits": {
            "force_N": service.wiring.force_limit_N, "depth_mm": limits.depth_mm, "speed_mm_s": limits.speed_mm_s
        },
        "control": control(service),
        "job": job(running).model_copy(update={"log": []}) if running else None,
    })  # fmt: skip


def control(service: Service) -> ControlView:
    """Who is in control."""
    held = service.control.lease
    if held is None:
        return ControlView(holder="", since="", left_s=0.0)
    return ControlView(holder=held.holder, since=held.since, left_s=service.control.left_s(held))


def lease(service: Service, held: ControlLease) -> LeaseView:
    """The lease for its holder."""
    left_s = service.control.left_s(held)
    return LeaseView(lease_id=held.id, holder=held.holder, since=held.since, ttl_s=held.ttl_s, left_s=left_s)


def _state(service: Service, status: Status, alive: bool) -> tuple[State, str]:
    if not alive:
        return "disconnected", service.reason or "the loop's process is gone"
    latched = status.get("latched")
    if latched:
        return "stopped", str(latched["text"])
    if status.get("busy") or service.running:
        return "running", ""
    return ("idle", "") if status.get("ready") else ("not ready", _missing(status))


def _missing(status: Status) -> str:
    """Which devices are not as they should be."""
    devices = status.get("devices", {})
    return "; ".join(
        f"{role} is {device['state']}: {device['detail']}"
        for role, device in devices.items()
        if device["state"] != "ok"
    )


def _devices(bench: Supervisor, status: Status) -> dict[str, DeviceView]:
    """Who each device is, and how it is."""
    states = status.get("devices", {})
    return {role: {**identity, **states.get(role, {})} for role, identity in bench.ready.devices.items()}


def _health(bits: int) -> dict[str, dict[str, bool]]:
    return {
        name: {
            "alive": bool(bits >> 3 * place & ALIVE),
            "valid": bool(bits >> 3 * place & VALID),
            "on_rate": bool(bits >> 3 * place & ON_RATE),
        }
        for place, name in enumerate(STREAMS)
    }


def protocols(service: Service) -> list[ProtocolView]:
    """Every indentation protocol in the folder, also those this bench refuses."""
    return [_protocol(service, path) for path in sorted(service.protocols.glob("*.toml")) if _is_protocol(path)]


def _is_protocol(path: Path) -> bool:
    return 'kind = "indentation"' in path.read_text(errors="replace")


def _protocol(service: Service, path: Path) -> ProtocolView:
    try:
        plan = load(Indentation, path)
        check(plan, service.wiring)
    except RigError as error:
        return ProtocolView(name=path.stem, file=path.name, settings={}, refusal=str(error))
    return ProtocolView(name=path.stem, file=path.name, settings=plan.model_dump(mode="json"), refusal="")


def sessions(service: Service) -> list[SessionView]:
    """Sessions with at least one recording, newest first."""
    if not service.sessions.is_dir():
        return []
    folders = [path for path in service.sessions.iterdir() if any(path.glob("*.mcap"))]
    return [_session(path) for path in sorted(folders, key=lambda path: path.stat().st_mtime, reverse=True)]


def _session(folder: Path) -> SessionView:
    info, remarks = read_listing(folder)
    trials = info.trials if info else ()
    created = info.created if info else ""
    listed = {trial.file: trial for trial in trials}
    return SessionView(
        name=folder.name,
        kind=info.kind if info else "unknown",
        created=created or datetime.fromtimestamp(folder.stat().st_mtime, UTC).isoformat(),
        trials=len(trials),
        samples=sum(sum(trial.samples.values()) for trial in trials),
        dropped=sum(sum(trial.dropped.values()) for trial in trials),
        remarks=list(remarks),
        recordings=[
            _file(folder.name, path, listed.get(path.name)) for path in sorted(folder.iterdir()) if path.suffix in SHOWN
        ],
    )


def _file(session: str, path: Path, trial: TrialInfo | None) -> RecordingView:
    return RecordingView(
        session=session,
        file=path.name,
        bytes=path.lstat().st_size,
        href=f"/api/v1/recordings/{session}/{path.name}",
        quality=trial.quality if trial else "",
        reasons=list(trial.reasons) if trial else [],
    )
