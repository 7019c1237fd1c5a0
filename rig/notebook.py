"""A session as a notebook takes it: trials as tables with units, the fit, the diagnosis, and pictures of them.

Nothing here writes into the session's folder. Tables are Arrow tables; each field carries its ``unit`` and ``meaning``
as metadata. ``pandas`` is needed only where a table is asked for as a data frame.
"""

import shutil
import weakref
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from pathlib import Path
from tempfile import mkdtemp
from typing import TYPE_CHECKING, Literal

import pyarrow as pa

from rig.errors import UsageError
from rig.progress import Progress, silent
from rig.recording.reader import Recording
from rig.recording.sessions import Session, TrialInfo
from rig.recording.tables import arrow_table, filled
from rig.results.diagnosis import DiagnosisResult
from rig.results.fit import FitResult
from rig.results.study import fit_result
from rig.tissue.model import Model
from rig.tissue.registry import COMPARED, check_known, law_named
from rig.tissue.study import Study, model_of, study_session
from rig.trials.curves import loading_curve
from rig.trials.cycles import cycle_of, pushed
from rig.trials.opening import Opening, open_place
from rig.trials.reading import trials_of
from rig.trials.recorded import trial_of
from rig.trials.segments import segments_of
from rig.trials.surface import find_surface

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

Simulation = Literal["index", "constant"]
_CURVE_UNITS = {
    "time_s": ("s", "since the first force sample of the trial"),
    "depth_mm": ("mm", "from contact, positive into the tissue"),
    "force_N": ("N", "positive in compression, from the zero in the air"),
    "rate_mm_s": ("mm/s", "speed into the tissue"),
}
_SEGMENT_UNITS = {
    "kind": ("", "air, loading, hold or unloading"),
    "start_s": ("s", "its first sample, since the first force sample of the trial"),
    "end_s": ("s", "its last sample"),
}
_TRIAL_UNITS = {
    "name": ("", "name of the trial"),
    "speed_mm_s": ("mm/s", "speed asked for"),
    "depth_mm": ("mm", "depth asked for"),
    "peak_force_N": ("N", "largest force from the zero"),
    "surface_mm": ("mm", "where the axis found the surface"),
    "outcome": ("", "how the trial ended"),
    "quality": ("", "good, usable or bad; empty where nobody judged"),
}


def open_data(place: Path, opening: Opening) -> "SessionData":
    """What ``place`` holds; what is made of foreign files is kept as long as the answer is in use."""
    scratch = Path(mkdtemp(prefix="rig-"))
    try:
        session = open_place(place, opening, scratch, datetime.now().astimezone())
    except BaseException:
        shutil.rmtree(scratch)
        raise
    weakref.finalize(session, shutil.rmtree, scratch)
    return SessionData(session)


def to_pandas(table: pa.Table) -> "pd.DataFrame":
    """The table as a data frame; ``attrs["units"]`` names the unit of each column.

    Raises UsageError where pandas is not installed.
    """
    try:
        import pandas  # noqa: F401, PLC0415 - not needed but here
    except ImportError as error:
        raise UsageError(
            "pandas is not installed: pip install 'tissue-rig[pandas]', or take the Arrow table (.arrow)"
        ) from error
    frame: pd.DataFrame = table.to_pandas()
    frame.attrs["units"] = units(table)
    return frame


def units(table: pa.Table) -> dict[str, str]:
    """Unit of each field; empty for texts and numbers without one."""
    return {field.name: (field.metadata or {}).get(b"unit", b"").decode() for field in table.schema}


def _table(columns: Mapping[str, object], described: Mapping[str, tuple[str, str]], **facts: str) -> pa.Table:
    """Columns with unit and meaning, and ``facts`` on the whole."""
    arrays = [pa.array(columns[name]) for name in described]
    fields = [
        pa.field(name, array.type, metadata={"unit": unit, "meaning": meaning})
        for array, (name, (unit, meaning)) in zip(arrays, described.items(), strict=True)
    ]
    return pa.table(arrays, schema=pa.schema(fields, facts))


@dataclass(frozen=True)
class TrialData:
    """One trial of an opened session; its recording is read when a table is first asked for."""

    session: Session
    info: TrialInfo

    @property
    def name(self) -> str:
        """The trial's name in the session."""
        return self.info.name

    @cached_property
    def recording(self) -> Recording:
        """All that was recorded; raises DataError where the file is damaged."""
        return self.session.recording(self.name)

    @property
    def streams(self) -> tuple[str, ...]:
        """Streams that have rows: of force, axis, marker, loop, event."""
        return tuple(stream.name for stream, _ in filled(self.recording))

    def arrow(self, stream: str = "force") -> pa.Table:
        """A stream as it was recorded, one row a sample, as devices reported it.

        Raises UsageError for a stream that there is not.
        """
        found = {known.name: known for known in self.recording.streams}
        if stream not in found:
            raise UsageError(f"there is no stream {stream!r}; choose one of {', '.join(found)}")
        return arrow_table(self.recording, found[stream])

    def pandas(self, stream: str = "force") -> "pd.DataFrame":
        """The same as a data frame, see `to_pandas`."""
        return to_pandas(self.arrow(stream))

    def loading(self) -> pa.Table:
        """Force over depth while the tip goes steadily into the tissue: what a fit sees.

        Depth counts from contact, force from the zero in the air; both are in the table's metadata, as text. Raises
        DataError where the trial has no usable loading.
        """
        curve = loading_curve(cycle_of(trial_of(self.name, self.recording)))
        facts = {"trial": self.name, "zero_N": repr(curve.zero_N), "contact_mm": repr(curve.contact.position_mm)}
        return _table({name: getattr(curve, name) for name in _CURVE_UNITS}, _CURVE_UNITS, **facts)

    def segments(self) -> pa.Table:
        """Air, loading, holds and unloading of the trial, one row each, in order: what the tip did.

        Raises DataError where nothing tells the surface, above which is air.
        """
        cycle = pushed(cycle_of(trial_of(self.name, self.recording)))[0]
        surface_mm = find_surface(cycle).contact.position_mm
        found = segments_of(cycle.time_s, cycle.position_mm, surface_mm)
        columns = {
            "kind": [one.kind for one in found],
            "start_s": [float(cycle.time_s[one.rows.start]) for one in found],
            "end_s": [float(cycle.time_s[one.rows.stop - 1]) for one in found],
        }
        return _table(columns, _SEGMENT_UNITS)


class SessionData:
    """An opened session: its trials, and what fit and diagnosis say of it."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._studies: dict[tuple[tuple[str, ...], tuple[tuple[str, float], ...]], Study] = {}

    def __repr__(self) -> str:
        return f"<{self._session.info.kind} session {self.name!r} with {len(self.trials)} trials in {self.folder}>"

    def __iter__(self) -> Iterator[TrialData]:
        return iter(self.trials)

    @property
    def name(self) -> str:
        """The session's id."""
        return self._session.info.id

    @property
    def folder(self) -> Path:
        """Where it lies."""
        return self._session.place

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences on what was not as it should be when it was opened; empty if all was."""
        return self._session.remarks

    @cached_property
    def trials(self) -> tuple[TrialData, ...]:
        """Trials whose recording is there, in order."""
        return tuple(TrialData(self._session, info) for info in self._session.trials)

    def trial(self, name: str) -> TrialData:
        """The trial called ``name``; raises UsageError with the names there are."""
        wanted = self._session.trial(name).name
        return next(trial for trial in self.trials if trial.name == wanted)

    def arrow(self) -> pa.Table:
        """One row a trial: speed, depth, peak force, surface, outcome and quality."""
        infos = [trial.info for trial in self.trials]
        return _table({name: [getattr(info, name) for info in infos] for name in _TRIAL_UNITS}, _TRIAL_UNITS)

    def pandas(self) -> "pd.DataFrame":
        """The same as a data frame, see `to_pandas`."""
        return to_pandas(self.arrow())

    def fit(
        self, laws: Sequence[str] = (), known: Mapping[str, float] | None = None, model_law: str = "index"
    ) -> FitResult:
        """The fit of constant stiffness, the index law and further ``laws`` to the session, as `rig fit` makes it.

        ``known`` are parameters that are given, in the units of their names; ``model_law`` is the law whose `model` is
        meant. Raises UsageError for laws and parameters there are not, DataError where no trial gives a curve.
        """
        recordings = {trial.name: trial.info.sha256 for trial in self.trials}
        study = self._study((*laws, model_law), known or {})
        return fit_result(study, "", law_named(model_law).name, known or {}, recordings)

    def model(self, law: str = "index", known: Mapping[str, float] | None = None) -> Model:
        """The fitted law with covariance, intervals and range of validity: what `rig track` controls with.

        ``model(...).save(path)`` writes the file. Raises as `fit` does.
        """
        study = self._study((law,), known or {})
        return model_of(study, law_named(law).name, self._session.info.subject)

    def plot(self, laws: Sequence[str] = (), known: Mapping[str, float] | None = None) -> "Figure":
        """Force over displacement with the laws through it, and how wrong each law is, as a matplotlib figure."""
        from rig.report.figures import fit_figure  # noqa: PLC0415 - matplotlib takes a second to load

        return fit_figure(self._study(tuple(laws), known or {}))

    def diagnose(self, simulation: Simulation = "index", progress: Progress = silent) -> DiagnosisResult:
        """What the simulation gets wrong on this session, with causes by name, as `rig diagnose` finds it.

        ``progress`` is called with what is being done and the share that is done. Takes seconds to minutes.
        """
        from rig.diagnosis.run import diagnose_session  # noqa: PLC0415 - loads an optimiser

        return DiagnosisResult.model_validate(diagnose_session(trials_of(self._session), simulation, progress))

    def _study(self, laws: tuple[str, ...], known: Mapping[str, float]) -> Study:
        """Laws compared, and those asked for; kept, because pictures and results are asked for one after another."""
        compared = {law.name: law for law in (*COMPARED, *map(law_named, laws))}
        check_known(known, list(compared.values()))
        key = tuple(compared), tuple(sorted(known.items()))
        if key not in self._studies:
            self._studies[key] = study_session(self._session, list(compared.values()), known)
        return self._studies[key]
