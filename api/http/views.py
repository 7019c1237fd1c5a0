"""What the service knows, as what goes over the wire."""

import contextlib
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal
from urllib.parse import quote

from api.http.jobs.places import is_text
from api.http.jobs.views import summary
from api.http.lease import ControlLease
from api.http.models import ControlView, LeaseView, RecordingList, RecordingView, RigView, SessionView
from api.http.service import Service
from controller.devices.health import ALIVE, ON_RATE, VALID
from controller.loop.messages import Status
from rig.recording.sessions import TrialInfo, read_listing
from rig.results.catalogue import SessionList

State = Literal["disconnected", "not ready", "idle", "running", "stopped"]
STREAMS = ("force", "axis", "marker")
SHOWN = (".mcap", ".json", ".html")


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
        "devices": service.devices(bench) if bench else {},
        "limits": {
            "force_N": service.wiring.force_limit_N, "depth_mm": limits.depth_mm, "speed_mm_s": limits.speed_mm_s
        },
        "control": control(service),
        "job": summary(running) if running else None,
    })  # fmt: skip


def control(service: Service) -> ControlView:
    """Who is in control."""
    held = service.control.lease
    if held is None:
        return ControlView(holder="", since="", left_s=0.0)
    left_s = service.control.left_s(held)
    return ControlView(holder=held.holder, since=held.since, left_s=left_s, epoch=held.epoch, purpose=held.purpose)


def lease(service: Service, held: ControlLease) -> LeaseView:
    """The lease for its holder."""
    left_s = service.control.left_s(held)
    return LeaseView(
        lease_id=held.id, holder=held.holder, since=held.since, ttl_s=held.ttl_s, left_s=left_s, epoch=held.epoch,
        purpose=held.purpose,
    )  # fmt: skip


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


def _health(bits: int) -> dict[str, dict[str, bool]]:
    return {
        name: {
            "alive": bool(bits >> 3 * place & ALIVE),
            "valid": bool(bits >> 3 * place & VALID),
            "on_rate": bool(bits >> 3 * place & ON_RATE),
        }
        for place, name in enumerate(STREAMS)
    }


def recordings(root: Path, found: SessionList) -> RecordingList:
    """Sessions in ``root`` with their recordings, without those that were removed meanwhile."""
    items: list[SessionView] = []
    for entry in found.items:
        with contextlib.suppress(FileNotFoundError):
            items.append(session(root / entry.session))
    return RecordingList(items=items, next=found.next, remarks=list(found.remarks))


def session(folder: Path) -> SessionView:
    """One of them."""
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
            _file(folder.name, path, listed.get(path.name))
            for path in sorted(folder.iterdir())
            if path.suffix in SHOWN and is_text(path.name)
        ],
    )


def _file(session: str, path: Path, trial: TrialInfo | None) -> RecordingView:
    return RecordingView(
        session=session,
        file=path.name,
        bytes=path.lstat().st_size,
        href=f"/api/v1/recordings/{quote(session)}/{quote(path.name)}",
        quality=trial.quality if trial else "",
        reasons=list(trial.reasons) if trial else [],
    )
