"""A cohort as tables and sentences."""

from collections.abc import Iterator

from rig.results.cohort import CohortResult, CohortSession
from rig.results.tables import UNKNOWN, Caution, Part, TextTable


def cohort_parts(found: CohortResult) -> Iterator[Part]:
    """Every session, what failed, and what subjects share."""
    yield _sessions(found)
    yield from (Caution(f"no result: {each.reason}") for each in found.failed)
    if found.parameters:
        yield _population(found)
    if found.causes:
        ranked = sorted(found.causes.items(), key=lambda each: -each[1])
        yield "named: " + ", ".join(f"{cause} in {count}" for cause, count in ranked)
    yield from found.remarks
    done, kept, failed = (sum(each.state == state for each in found.sessions) for state in ("done", "kept", "failed"))
    yield f"{len(found.sessions)} sessions: {done} done, {kept} kept from before, {failed} failed"


def _sessions(found: CohortResult) -> TextTable:
    names = list(dict.fromkeys(name for each in found.sessions for name in each.parameters))
    rows = [
        [each.folder or each.session, each.subject or UNKNOWN, each.state, f"{each.seconds:.1f}", *_said(each, names)]
        for each in found.sessions
    ]
    more = {"fit": names, "diagnose": ["verdict", "causes"], "report": []}[found.work]
    return TextTable("", ["session", "subject", "state", "seconds", *more], rows, words=3)


def _said(each: CohortSession, names: list[str]) -> list[str]:
    if names:
        return [f"{each.parameters[name]:.4g}" if name in each.parameters else UNKNOWN for name in names]
    return [each.verdict, ", ".join(each.causes)] if each.verdict else []


def _population(found: CohortResult) -> TextTable:
    rows = [
        [
            f"{name} ({each.unit})", f"{each.mean:.4g}", _between(each.mean_interval), f"{each.between:.4g}",
            _between(each.between_interval), UNKNOWN if each.within is None else f"{each.within:.4g}",
            f"{each.subjects}", f"{each.sessions}",
        ]
        for name, each in found.parameters.items()
    ]  # fmt: skip
    header = [
        "parameter",
        "mean",
        "95 %",
        "sd of subjects",
        "95 %",
        "sd of a subject's sessions",
        "subjects",
        "sessions",
    ]
    return TextTable(f"Over subjects, {found.model_law} (random effects, REML)", header, rows)


def _between(interval: tuple[float, float]) -> str:
    return f"{interval[0]:.4g} to {interval[1]:.4g}"
