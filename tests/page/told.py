"""What a pretended service says of one session from subject to tracking, in the forms that the real one gives."""

import math
from typing import Any

from api.http.jobs.views import FileView
from api.http.listing import Listing
from api.http.models import ProtocolView
from api.http.routes.curves import CurvesView, CurveView
from api.http.routes.foresight import ExpectedForce, Foresight
from api.http.routes.sessions import SessionFiles
from rig.diagnosis.estimates import ErrorGain, Estimate, NamedCause, NextExperiment
from rig.results.catalogue import (
    ModelEntry,
    ModelList,
    SessionEntry,
    SessionList,
    SubjectEntry,
    SubjectList,
    TrialEntry,
    TrialList,
)
from rig.results.diagnosis import DiagnosisResult
from rig.results.fit import DisplacementErrors, FitResult, HeldOut, LawResult, ParameterResult
from rig.results.tracking import Followed, LoopCount, Plateau, TrackResult
from rig.tissue.summary import Row

NAME, SUBJECT, SITE = "20261123-101500", "S07", "left forearm"
AT = "2026-11-23T10:15:00+00:00"
WHOM: dict[str, Any] = {"session": NAME, "subject": SUBJECT, "site": SITE, "at": AT}
SPEEDS = (5.0, 15.0, 30.0)


def force_N(depth_mm: float, speed_mm_s: float) -> float:
    """A forearm's."""
    return 0.12 * depth_mm * math.exp(0.22 * depth_mm) + 0.01 * speed_mm_s if depth_mm > 0 else 0.0


def _curve(name: str, speed_mm_s: float, quality: str) -> CurveView:
    depths = [*(0.1 * i - 1.0 for i in range(91)), *(8.0 - 0.1 * i for i in range(91))]
    times = [i * 0.1 / speed_mm_s for i in range(len(depths))]
    forces = [force_N(depth, speed_mm_s if i < 91 else -speed_mm_s) for i, depth in enumerate(depths)]
    return CurveView(
        name=name, quality=quality, speed_mm_s=speed_mm_s, from_surface=True,
        # Before the surface is found there is no depth.
        time_s=tuple(times), force_N=tuple(forces), depth_mm=(None, None, *depths[2:]),
    )  # fmt: skip


CURVES = CurvesView(
    session=NAME,
    curves=tuple(
        _curve(f"trial_{i:03d}", speed, quality)
        for i, (speed, quality) in enumerate(zip(SPEEDS, ("good", "usable", "good"), strict=True), 1)
    ),
)
SETTINGS: dict[str, Any] = {
    "speeds_mm_s": [5, 15, 30], "trials": 1, "depth_mm": 8.0, "force_limit_N": 12.0, "hold_s": 0.5
}  # fmt: skip
PROTOCOLS = [
    ProtocolView(name="quick", file="quick.toml", settings=SETTINGS, refusal=""),
    ProtocolView(name="deep", file="deep.toml", settings={}, refusal="depth_mm 900 is above limits.depth_mm 25 mm"),
]
FORESIGHT = Foresight(
    protocol="quick", verdict="as planned", trials=3, duration_s=34.0, depth_mm=8.0, force_limit_N=12.0,
    sentence="5.9 N at most are expected, at 30 mm/s and 8 mm; the force limit of 12 N is not reached",
    expected=tuple(ExpectedForce(speed_mm_s=v, depth_mm=8.0, force_N=force_N(8.0, v), ends="depth") for v in SPEEDS),
)  # fmt: skip
MODELS = ModelList(
    items=(
        ModelEntry(
            key="1", file="fit/model.json", law="index", rmse_N=0.012, depth_mm=8.1, force_N=6.0,
            parameters={"a_N_mm": 0.12, "b_per_mm": 0.22, "damping_N_s_mm": 0.01}, **WHOM,
        ),
    )
)  # fmt: skip
SUBJECTS = SubjectList(items=(SubjectEntry(subject=SUBJECT, sites=(SITE,), sessions=1, first=AT, last=AT),))
SESSIONS = SessionList(
    items=(SessionEntry(key="1", kind="capture", created=AT, trials=3, samples=9000, quality="usable", **WHOM),)
)
REASON = "force went over the edge of the air: 0.4 s of rest instead of 0.5 s"
TRIALS = TrialList(
    items=tuple(
        TrialEntry(
            key=str(i), name=f"trial_{i:03d}", file=f"trial_{i:03d}.mcap", speed_mm_s=speed, depth_mm=8.0,
            peak_force_N=force_N(8.0, speed), outcome="complete", quality="usable" if i == 2 else "good",
            reasons=(REASON,) if i == 2 else (), **WHOM,
        )
        for i, speed in enumerate(SPEEDS, 1)
    )
)  # fmt: skip
SESSION = SessionFiles(
    name=NAME, kind="capture", created=AT, trials=3, samples=9000, dropped=0, remarks=[], recordings=[],
    files=[
        FileView(name=name, href=f"/api/v1/recordings/{NAME}/{name}", bytes=812_000, media_type="text/plain")
        for name in ("trial_001.mcap", "trial_002.mcap", "trial_003.mcap", "session.json", "report.html")
    ],
)  # fmt: skip
_ROWS = tuple(
    Row(force_N=f, measured_mm=x, measured_spread_mm=0.02, predicted_mm=x, error_mm=0.01, error_percent=0.2)
    for x in (2.0, 4.0, 6.0, 8.0)
    for f in (force_N(x, 0.0),)
)
_ERRORS = DisplacementErrors(max_error_mm=0.05, max_error_percent=1.4, rmse_N=0.012, rows=_ROWS)


def _parameter(value: float, unit: str) -> ParameterResult:
    low, high = 0.98 * value, 1.02 * value
    return ParameterResult(
        value=value, unit=unit, standard_error=0.01 * value, interval=(low, high), at_bound=False, known=False
    )


def _law(formula: str, rmse_N: float, **parameters: ParameterResult) -> LawResult:
    held_out = HeldOut(trials=_ERRORS, speeds=None, subjects=None)
    own = _ERRORS.model_dump() | {"rmse_N": rmse_N}
    return LawResult(
        formula=formula, parameters=parameters, interval_level=0.95, interval_method="profile", held_out=held_out,
        control=(), **own,
    )  # fmt: skip


FIT = FitResult.model_validate(
    {
        "session": NAME, "trials": ("trial_001", "trial_002", "trial_003"), "skipped": (), "speeds": (),
        "force_N": (1.0, 2.0), "closest": "index", "rate": None, "model": "fit/model.json", "model_law": "index",
        "known": {}, "recordings": {}, "remarks": ("three trials tell little of what repeats differ by",),
        "index": _law(
            "F = a x exp(b x) + B v", 0.012, a_N_mm=_parameter(0.12, "N/mm"), b_per_mm=_parameter(0.22, "1/mm"),
            damping_N_s_mm=_parameter(0.01, "N s/mm"),
        ),
        "constant": _law("F = k x + B v", 0.31, k_N_mm=_parameter(0.7, "N/mm")),
    }
)  # fmt: skip
_SHARE = Estimate(0.82, 0.71, 0.9)
DIAGNOSIS = DiagnosisResult(
    verdict="explained", simulation="index", session=NAME, recordings=3, unexplained=None,
    statement="The guide's friction explains 82 % of what the simulation gets wrong.",
    findings=(
        NamedCause(
            ("guide_friction",), "the guide holds back 0.21 N against the motion", 0.97,
            {"level_N": Estimate(0.21, 0.19, 0.23, unit="N")}, ErrorGain(0.2, 0.09, 0.55, 0.5, 0.6), 41.0, 1e-6,
            "oil the guide, or take its friction into the model", False,
        ),
        NamedCause(
            ("sensor_lag", "axis_lag"), "force comes 1.2 ms later than position says", 0.61,
            {"lag_ms": Estimate(1.2, 0.9, 1.5, unit="ms")}, ErrorGain(0.09, 0.08, 0.11, 0.05, 0.2), 22.0, 1e-3,
            "record a dither, which tells the two apart", True,
        ),
    ),
    detectable={}, not_testable={}, next_experiment=NextExperiment("a dither of 0.5 mm at 5 Hz for 2 s at 6 mm"),
    data_quality=(), parameters={}, simulation_error=(), explained_share=_SHARE, base_N=0.2, extended_N=0.08,
    flexible_N=0.07, floor_N=0.06,
)  # fmt: skip
TRACKED = TrackResult(
    recording="track_001.mcap", model="fit/model.json", max_error_percent=1.3, rms_error_N=0.011,
    levels=tuple(
        Plateau(
            given_N=f, actual_N=f + 0.004, error_N=0.004, error_percent=0.4, max_error_N=0.02, max_error_percent=1.3,
            rms_error_N=0.011, overshoot_percent=3.0, settling_s=0.42,
        )
        for f in (1.0, 2.0)
    ),
    followed=Followed(rms_error_N=0.014, largest_error_N=0.3, amplitude_ratio=None, lag_s=None), samples=10_000,
    dropped=0, loop=LoopCount(cycles=10_000, missed=3), quality="good",
)  # fmt: skip
CAPTURED: dict[str, Any] = {
    "session": NAME, "recordings": 3, "samples": 9000, "dropped": 0, "bad": [],
    "trials": [
        {
            "name": f"trial_{i:03d}", "speed_mm_s": speed, "outcome": "complete", "peak_force_N": force_N(8.0, speed),
            "quality": "usable" if i == 2 else "good", "reasons": [REASON] if i == 2 else [], "measured": {},
            "repeats": "", "surface_mm": [20.0, 19.9, 20.1],
        }
        for i, speed in enumerate(SPEEDS, 1)
    ],
}  # fmt: skip


def job(kind: str, state: str = "succeeded", **more: Any) -> dict[str, Any]:
    """A job of that kind."""
    known = {
        "id": f"job-{kind}", "kind": kind, "name": kind, "state": state, "moves": True, "by": "ann", "params": {},
        "session": NAME, "created": AT, "started": AT, "ended": None, "done": 1.0, "total": 3.0, "unit": "trials",
        "message": "trial_002, 15 mm/s", "time_left_s": 21.0, "can": [], "log": ["trial_001: good"], "result": None,
        "problem": None, "files": [],
    }  # fmt: skip
    return known | more


PICTURE = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 800 300" width="800" height="300">'
    '<path d="M40 260 Q500 250 760 30" fill="none" stroke="#0072b2" stroke-width="3"/></svg>'
)
PICTURES = (
    "fit/fit",
    "fit/residuals",
    "diagnosis/share",
    "diagnosis/simulation",
    "diagnosis/residuals",
    "diagnosis/evidence",
)
NO_JOBS: dict[str, Any] = {
    f"jobs/{kind}": {"items": [], "next": None}
    for kind in ("capture", "track", "threshold", "fit", "diagnose", "report", "verify")
}


def everything() -> dict[str, Any]:
    """All answers of a bench at rest with one session."""
    base = f"recordings/{NAME}"
    return {
        "subject": {"id": SUBJECT, "site": SITE, "pain_threshold_N": 12.0, "site_thresholds_N": {}},
        "subjects": SUBJECTS, "models": MODELS,
        "protocols": Listing[ProtocolView](items=PROTOCOLS), "protocols/quick/foresight": FORESIGHT,
        "sessions": SESSIONS, f"sessions/{NAME}": SESSION, f"sessions/{NAME}/curves": CURVES, "trials": TRIALS,
        f"{base}/fit/fit.json": FIT, f"{base}/diagnosis/diagnosis.json": DIAGNOSIS, f"{base}/track.json": TRACKED,
        **{f"{base}/{name}.svg": PICTURE for name in PICTURES}, **NO_JOBS,
    }  # fmt: skip


def nothing() -> dict[str, Any]:
    """All answers of a bench that was never used."""
    empty: dict[str, Any] = {"items": [], "next": None}
    return {
        "subject": {"id": "", "site": "", "pain_threshold_N": 15.0, "site_thresholds_N": {}}, "subjects": empty,
        "models": empty, "protocols": empty, "sessions": empty, "trials": empty, **NO_JOBS,
    }  # fmt: skip
