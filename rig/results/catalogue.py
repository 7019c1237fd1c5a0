"""What the catalogue lists: sessions, trials, models, diagnoses, thresholds and other work, by subject and site.

``at`` is UTC in one form, so that it sorts as text; empty where nobody knows. ``key`` is unique in its list.
"""

from collections.abc import Mapping
from typing import Annotated, Generic, TypeVar

from pydantic import BeforeValidator, Field

from rig.results.base import Number, Result, SavedResult

Value = TypeVar("Value")
Entry = TypeVar("Entry", bound=Result)


def storable(value: Value) -> Value | str:
    """Text without what no database keeps, NUL and halves of characters that stand alone; all else as it is."""
    if not isinstance(value, str):
        return value
    return value.replace("\0", "\ufffd").encode("utf-8", "replace").decode()


Text = Annotated[str, BeforeValidator(storable)]
Texts = tuple[Text, ...]


class CatalogueEntry(Result):
    """A line of a list; ``session`` is the name of the folder it was read from."""

    key: Text
    session: Text
    at: str = Field(default="", description="when, UTC; of a file its date")
    subject: Text = Field(default="", description="the subject's code")
    site: Text = ""


class SessionEntry(CatalogueEntry):
    """A session, as its folder tells it."""

    id: Text = ""
    kind: str = Field(default="unknown", description="capture, import, track; unknown where nothing could be read")
    created: Text = Field(default="", description="as the session states it")
    software: Text = ""
    protocol: Text = ""
    trials: int = 0
    samples: int = 0
    dropped: int = 0
    quality: str = Field(
        default="", description="of the worst trial that was not made again; empty where nobody judged"
    )
    remarks: Texts = ()


class TrialEntry(CatalogueEntry):
    """A trial and its quality."""

    name: Text
    file: Text
    speed_mm_s: Number = None
    depth_mm: Number = None
    peak_force_N: Number = None
    outcome: Text = ""
    quality: str = ""
    reasons: Texts = ()


class ModelEntry(CatalogueEntry):
    """A fitted model, of `rig fit` or extended by `rig diagnose`."""

    file: Text
    law: Text
    parameters: Mapping[str, float]
    rmse_N: Number
    held_out_max_error_percent: Number = None
    depth_mm: Number = None
    force_N: Number = None
    causes: Texts = ()


class StiffnessEntry(CatalogueEntry):
    """Force at rest over depth, by a session's own model; at the depth that all models of the site cover."""

    law: Text
    depth_mm: float
    stiffness_N_mm: float


class DiagnosisEntry(CatalogueEntry):
    """A diagnosis; ``causes`` are those it named first."""

    file: Text
    verdict: str
    statement: Text
    explained_share: Number = None
    causes: Texts = ()


class CauseEntry(CatalogueEntry):
    """A cause that a diagnosis named, alone or among those that the data cannot tell apart."""

    name: Text
    statement: Text
    confidence: float


class ThresholdEntry(CatalogueEntry):
    """Where the subject stopped a ramp; ``force_N`` is null where it went on to ``up_to_N``."""

    recording: Text
    force_N: Number
    up_to_N: float


class WorkEntry(CatalogueEntry):
    """An operation that left its result in the session."""

    kind: str = Field(description="capture, import, track, threshold, fit, diagnose or report")
    file: Text


class SubjectEntry(Result):
    """A subject, by its code; ``name`` is null where none is kept, or whoever asks may not see it."""

    subject: Text
    name: Text | None = None
    sites: Texts = ()
    sessions: int = 0
    first: str = ""
    last: str = ""


class SiteEntry(Result):
    """Where a subject was pressed, and how often."""

    subject: Text
    site: Text
    sessions: int
    first: str
    last: str


class EntryList(Result, Generic[Entry]):
    """One page of entries; ``next`` is the cursor of what follows, null at the end."""

    items: tuple[Entry, ...]
    next: str | None = None


class SessionList(EntryList[SessionEntry], SavedResult):
    """Sessions, newest first; ``next`` is the cursor of what follows, null at the end."""

    remarks: Texts = Field(default=(), description="folders that are not listed, and why")


class TrialList(EntryList[TrialEntry], SavedResult):
    """Trials, newest first."""


class ModelList(EntryList[ModelEntry], SavedResult):
    """Models, newest first."""


class DiagnosisList(EntryList[DiagnosisEntry], SavedResult):
    """Diagnoses, newest first."""


class CauseList(EntryList[CauseEntry], SavedResult):
    """Causes named, newest first."""


class WorkList(EntryList[WorkEntry], SavedResult):
    """Operations, newest first."""


class SubjectList(EntryList[SubjectEntry], SavedResult):
    """Subjects by code."""


class SiteList(EntryList[SiteEntry], SavedResult):
    """Sites by subject."""


class SubjectHistory(SavedResult):
    """All that is known of a subject, newest first."""

    subject: SubjectEntry
    sessions: tuple[SessionEntry, ...]
    thresholds: tuple[ThresholdEntry, ...]
    models: tuple[ModelEntry, ...]
    diagnoses: tuple[DiagnosisEntry, ...]
    operations: tuple[WorkEntry, ...]
    stiffness: tuple[StiffnessEntry, ...] = ()


class CatalogueResult(SavedResult):
    """What a catalogue was made of."""

    catalogue: str
    sessions: int
    subjects: int
    names: int
    remarks: Texts = ()


class NamesResult(SavedResult):
    """Names that were backed up, or brought back."""

    file: str
    names: int


class SubjectExport(SavedResult):
    """A subject's data in one archive; ``left_out`` are files that were not taken, and why."""

    subject: Text
    archive: str
    sessions: int
    files: int
    bytes: int
    left_out: Texts = ()


class ErasureResult(SavedResult):
    """What an erasure takes, or has taken once it is ``done``; ``confirm`` is what the second step asks for."""

    subject: Text
    done: bool
    named: bool = Field(description="whether a person's name is kept for the code")
    sessions: Texts
    files: int
    bytes: int
    statement: str = Field(description="what becomes of the sessions, and what is not reached")
    confirm: str = ""
