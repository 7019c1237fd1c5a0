"""The study's question put to a session: constant stiffness or index model, judged on the same curves and rows."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rig.errors import DataError, UsageError
from rig.progress import Progress, silent
from rig.recording.sessions import Session
from rig.tissue.control_table import control_rows
from rig.tissue.fitting import LawFit, fit_law
from rig.tissue.intervals import LEVEL
from rig.tissue.judging import Errors, Judged, given_forces, judge
from rig.tissue.laws import FloatArray, Law
from rig.tissue.model import Model, Provenance, Quality, ValidRange
from rig.tissue.rates import rate_of
from rig.tissue.registry import COMPARED
from rig.tissue.summary import RateTest, Row, Skipped, SpeedSummary
from rig.trials.curves import Curve, loading_curve
from rig.trials.cycles import cut, cycle_of
from rig.trials.findings import SAMPLES_LEFT_OUT, STATED, TRIAL_LEFT_OUT, Finding
from rig.trials.reading import SEVERAL, trials_of
from rig.trials.trial import TrialSet, inspected
from rig.version import SOFTWARE

Laws = Sequence[type[Law]]
Known = Mapping[str, float]
# Share of the time until every law is fitted once: evaluating fits it again without each trial and each speed.
FITTING = 0.2


@dataclass(frozen=True)
class Study:
    """Curves of a session and the laws fitted to them, by name; ``force_N`` are the rows at which errors are taken.

    Displacement is measured from the contact that the law with the smallest residual, ``closest``, puts into each
    trial, for all laws alike. ``rate`` says whether speeds differ; None where trials or speeds are too few to tell.
    """

    session: str
    curves: tuple[Curve, ...]
    skipped: tuple[Skipped, ...]
    force_N: FloatArray
    judged: Mapping[str, Judged]
    closest: str
    rate: RateTest | None

    @property
    def speeds(self) -> tuple[SpeedSummary, ...]:
        """One summary a speed, slowest first."""
        found = []
        for speed_mm_s in sorted({curve.speed_mm_s for curve in self.curves}):
            group = [curve for curve in self.curves if curve.speed_mm_s == speed_mm_s]
            depth_mm, force_N = (max(c.max_depth_mm for c in group), max(c.max_force_N for c in group))
            found.append(SpeedSummary(speed_mm_s, len(group), depth_mm, force_N))
        return tuple(found)

    @property
    def origins_mm(self) -> FloatArray:
        """Where displacement is measured from, relative to the contact found, shape (n,)."""
        return self.judged[self.closest].fit.offsets_mm


def study_session(
    session: Session, laws: Laws = COMPARED, known: Known | None = None, progress: Progress = silent
) -> Study:
    """Reads every trial of ``session``, fits and judges; trials without a usable curve are skipped with their reason.

    Raises DataError where no trial gives a curve, UsageError of a drive axis.
    """
    return study_sessions([session], laws, known, progress)


def study_sessions(
    sessions: Sequence[Session], laws: Laws = COMPARED, known: Known | None = None, progress: Progress = silent
) -> Study:
    """As ``study_session``, for sessions of several subjects at once: each subject is also left out in turn.

    A trial of several sessions is called by its session's folder and its own name.
    """
    places = [session.place.resolve() for session in sessions]
    twice = [place for place in places if places.count(place) > 1]
    if twice:
        raise UsageError(f"{twice[0]} is given twice; give each session once")
    curves: list[Curve] = []
    skipped: list[Skipped] = []
    for session in sessions:
        session.refuse_axis()
        place = f"{session.place}/" if len(sessions) > 1 else ""
        found, missing = _curves_or_refusal(session)
        curves += [
            replace(curve, name=f"{place}{curve.name}", recording=curve.recording and f"{place}{curve.recording}")
            for curve in found
        ]
        skipped += [Skipped(f"{place}{one.trial}", one.reason) for one in missing]
    return study_curves(", ".join(session.info.id for session in sessions), curves, skipped, laws, known, progress)


def _curves_or_refusal(session: Session) -> tuple[list[Curve], list[Skipped]]:
    curves, skipped = curves_of(session)
    if not curves:
        reasons = f"{skipped[0].trial}: {skipped[0].reason}" if skipped else "there is no trial"
        raise DataError(f"{session.place}: no trial gives a curve ({len(skipped)} skipped); first: {reasons}")
    return curves, skipped


def curves_of(session: Session) -> tuple[list[Curve], list[Skipped]]:
    """The loading curves of a session's trials, and those that have none or are bad; runs of force are neither."""
    return curves_in(inspected(trials_of(session)), str(session.info.subject.get("id", "")))


def curves_in(found: TrialSet, subject: str = "") -> tuple[list[Curve], list[Skipped]]:
    """The same of trials that were inspected."""
    skipped = [Skipped(said.recording, said.text) for said in found.findings if said.kind in TRIAL_LEFT_OUT]
    curves: list[Curve] = []
    for trial in found.trials:
        kept = tuple(f for f in found.findings if f.recording == trial.name and f.kind in SAMPLES_LEFT_OUT | STATED)
        cycles = cut(trial)
        recording = trial.name if len(cycles) > 1 else ""
        if recording:
            text = f"cut into its {len(cycles)} cycles where force is lowest between them"
            kept = (*kept, Finding(trial.name, "recording", "cut", text))
        for part in cycles:
            try:
                curve = loading_curve(cycle_of(part))
            except DataError as error:
                skipped.append(Skipped(part.name, str(error).removeprefix(f"{part.name}: ")))
            else:
                curves.append(replace(curve, subject=subject, recording=recording, findings=(*curve.findings, *kept)))
    several = tuple(finding for finding in found.findings if finding.kind in SEVERAL)
    curves[:1] = [replace(curve, findings=(*curve.findings, *several)) for curve in curves[:1]]
    return curves, skipped


def study_curves(
    session: str,
    curves: Sequence[Curve],
    skipped: Sequence[Skipped] = (),
    laws: Laws = COMPARED,
    known: Known | None = None,
    progress: Progress = silent,
) -> Study:
    """Fits and judges ``laws`` on the same curves and rows, with parameters ``known`` where a law has them."""
    fits: dict[str, LawFit] = {}
    for number, law in enumerate(laws):
        progress(f"fitting {law.name}", FITTING * number / len(laws))
        fits[law.name] = fit_law(law, curves, known=_known(law, known or {}))
    closest = min(fits, key=lambda name: fits[name].rmse_N)
    force_N = given_forces(curves)
    judged: dict[str, Judged] = {}
    for number, (name, fit) in enumerate(fits.items()):
        progress(f"evaluating {name}", FITTING + (1 - FITTING) * number / len(fits))
        judged[name] = judge(fit, curves, force_N, fits[closest].offsets_mm)
    return Study(session, tuple(curves), tuple(skipped), force_N, judged, closest, rate_of(curves))


def refuse_at_bounds(study: Study, law: str) -> None:
    """Raises DataError where a parameter of the law stands at a bound: other than 0, no tissue has it.

    At 0 an effect is absent, and a number without unit (an exponent of 1) may well be what its bound is.
    """
    fit = study.judged[law].fit
    pushed = (p for p in fit.law.parameters if p.name in fit.at_bounds and p.value and p.unit != "1")
    for p in pushed:
        raise DataError(
            f"{study.session}: these curves tell no stiffness: fitting {fit.law.formula} pushed {p.name} to its bound, "
            f"{p.value:.3g} {p.unit}; look at the recordings in `rig report`, choose some with --only, or fit another "
            "law with --model"
        )


def _known(law: type[Law], known: Known) -> Known:
    return {name: value for name, value in known.items() if name in law.bounds}


def model_of(study: Study, law: str, subject: Mapping[str, object]) -> Model:
    """The fitted law as a model to save and to control with; of several subjects the model names none."""
    judged = study.judged[law]
    return Model(
        law=judged.law, covariance=judged.covariance, intervals=judged.intervals, interval_level=LEVEL,
        interval_method=judged.interval_method,
        valid=ValidRange(
            depth_mm=max(curve.max_depth_mm for curve in study.curves),
            force_N=max(curve.max_force_N for curve in study.curves),
            speeds_mm_s=tuple(speed.speed_mm_s for speed in study.speeds),
        ),
        data=Provenance(
            session=study.session, trials=tuple(curve.name for curve in study.curves), software=SOFTWARE,
            sha256=fingerprint(study.curves), subject=str(subject.get("id", "")), site=str(subject.get("site", "")),
        ),
        quality=_quality(judged), control=control_rows(judged, study.force_N),
    )  # fmt: skip


def _quality(judged: Judged) -> Quality:
    out = judged.trials_left_out
    return Quality(
        rmse_N=judged.fitted.rmse_N,
        max_error_mm=judged.fitted.max_error_mm,
        max_error_percent=judged.fitted.max_error_percent,
        held_out_max_error_mm=out.max_error_mm if out else None,
        held_out_max_error_percent=out.max_error_percent if out else None,
    )


def fingerprint(curves: Sequence[Curve]) -> str:
    """SHA-256 over the curves' names, depths and forces: the id of the data a model was fitted to."""
    digest = hashlib.sha256()
    for curve in curves:
        digest.update(curve.name.encode())
        digest.update(np.ascontiguousarray(curve.depth_mm, "<f8").tobytes())
        digest.update(np.ascontiguousarray(curve.force_N, "<f8").tobytes())
    return digest.hexdigest()


def rows(errors: Errors) -> list[Row]:
    """One row a given force; spread is the standard deviation over trials."""
    found = []
    for index, force_N in enumerate(errors.force_N):
        measured, predicted = errors.measured_mm[:, index], errors.predicted_mm[:, index]
        reached = np.isfinite(measured)
        if not reached.any():
            continue
        percent = errors.error_percent[reached, index]
        found.append(
            Row(
                float(force_N),
                float(measured[reached].mean()),
                float(measured[reached].std()),
                float(predicted[reached].mean()),
                float(errors.error_mm[reached, index].max()),
                float(np.nanmax(percent)) if np.isfinite(percent).any() else None,
            )
        )
    return found
