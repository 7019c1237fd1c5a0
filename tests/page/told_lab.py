"""What a pretended service says of the laboratory around a session: subjects over time, devices, who may come in."""

from typing import Any

from api.http.access.audit import AuditLine
from api.http.access.models import AccountView, AuditView, TokenView
from api.http.listing import Listing
from api.http.routes.calibrations import CalibrationView
from rig.results.catalogue import (
    DiagnosisEntry,
    SessionEntry,
    StiffnessEntry,
    SubjectEntry,
    SubjectHistory,
    ThresholdEntry,
)
from tests.page.told import AT, NAME, SITE, SUBJECT

PERSON = "Ann Unmistakable-Example"
EARLIER, EARLIER_AT = "20261102-090000", "2026-11-02T09:00:00+00:00"
_VISITS = ((NAME, AT, 0.094), (EARLIER, EARLIER_AT, 0.131))


def _who(session: str, at: str) -> dict[str, Any]:
    return {"key": session, "session": session, "at": at, "subject": SUBJECT, "site": SITE}


HISTORY = SubjectHistory(
    subject=SubjectEntry(subject=SUBJECT, name=PERSON, sites=(SITE,), sessions=2, first=EARLIER_AT, last=AT),
    sessions=tuple(
        SessionEntry(kind="capture", created=at, trials=9, samples=9000, quality="good", **_who(session, at))
        for session, at, _ in _VISITS
    ),
    thresholds=(ThresholdEntry(recording="track_001", force_N=9.4, up_to_N=12.0, **_who(NAME, AT)),),
    models=(),
    diagnoses=(
        DiagnosisEntry(
            file="diagnosis/diagnosis.json", verdict="explained", explained_share=0.82, causes=("guide_friction",),
            statement="The guide's friction explains 82 % of what the simulation gets wrong.", **_who(NAME, AT),
        ),
    ),
    operations=(),
    stiffness=tuple(
        StiffnessEntry(law="index", depth_mm=6.0, stiffness_N_mm=stiffness, **_who(session, at))
        for session, at, stiffness in _VISITS
    ),
)  # fmt: skip
CALIBRATIONS = [
    CalibrationView(
        what="force", used=True, file="/etc/tissue-rig/force-20261101.json", product="BFT-SENS-SER-M8", serial="000271",
        date="2026-11-01T08:00:00+00:00", uncertainty_percent=0.62, refused="",
    ),
    CalibrationView(
        what="axis", used=True, file="/etc/tissue-rig/axis-20251030.json", product="maxon-epos4", serial="11",
        date="2025-10-30T08:00:00+00:00", uncertainty_percent=0.1, refused="it is 389 days old, and the limit is 365",
    ),
]  # fmt: skip
TOKENS = [TokenView(id="a1", name="notebook", scope="read", created=AT)]
ACCOUNTS = [AccountView(name="ann", scope="operate"), AccountView(name="ben", scope="admin")]
AUDIT = AuditView(
    items=[
        AuditLine(seq=2, time=AT, who="eve", credential="login", what="POST /api/v1/tokens", outcome="403", before=""),
        AuditLine(seq=1, time=AT, who="ann", credential="login", what="POST /api/v1/jobs", outcome="202", before=""),
    ],
    next=None,
    broken=[],
)


def around() -> dict[str, Any]:
    """All answers on a laboratory with one subject, three devices and two people."""
    return {
        f"subjects/{SUBJECT}": HISTORY, "calibrations": Listing[CalibrationView](items=CALIBRATIONS),
        "accounts": Listing[AccountView](items=ACCOUNTS), "tokens": Listing[TokenView](items=TOKENS),
        "audit": AUDIT,
    }  # fmt: skip


def bare() -> dict[str, Any]:
    """All answers on one that nobody has used, with a subject of whom nothing but the code is left."""
    left = HISTORY.model_copy(
        update={
            "subject": SubjectEntry(subject=SUBJECT),
            "sessions": (),
            "thresholds": (),
            "diagnoses": (),
            "stiffness": (),
        }
    )
    nobody: dict[str, Any] = {"items": [], "next": None}
    return {
        f"subjects/{SUBJECT}": left, "calibrations": nobody, "accounts": nobody, "tokens": nobody,
        "audit": AuditView(items=[], next=None, broken=[]),
    }  # fmt: skip
