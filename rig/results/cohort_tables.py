"""A cohort as tables and sentences."""

from collections.abc import Iterator

from rig.results.cohort import CohortResult, CohortSession, PopulationParameter
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
    yield f"{len(found.sessions)} {found.by or 'session'}s: {done} done, {kept} kept from before, {failed} failed"


def _sessions(found: CohortResult) -> TextTable:
    names = list(dict.fromkeys(name for each in found.sessions for name in each.parameters))
    more = {"fit": [*names, "off by, %"], "diagnose": ["verdict", "causes"], "report": []}[found.work]
    who = [] if found.by else ["subject"]
    rows = [
        [*_which(each, found.by), each.state, f"{each.seconds:.1f}", *_said(each, names)] for each in found.sessions
    ]
    return TextTable("", [found.by or "session", *who, "state", "seconds", *more], rows, words=3)


def _which(each: CohortSession, by: str | None) -> list[str]:
    called = each.folder or each.session
    return [called] if by else [called, each.subject or UNKNOWN]


def _said(each: CohortSession, names: list[str]) -> list[str]:
    if names:
        values = [f"{each.parameters[name]:.4g}" if name in each.parameters else UNKNOWN for name in names]
        return [*values, UNKNOWN if each.worst_percent is None else f"{each.worst_percent:.0f}"]
    return [each.verdict, ", ".join(each.causes)] if each.verdict else []


def _population(found: CohortResult) -> TextTable:
    who = found.by or "subject"
    again = any(each.within is not None for each in found.parameters.values())
    rows = [
        [f"{name} ({each.unit})", *_spread(each), *([UNKNOWN if each.within is None else f"{each.within:.4g}"] * again)]
        for name, each in found.parameters.items()
    ]
    header = ["parameter", "mean", "95 %", f"sd of {who}s", "95 %", *([f"sd within a {who}"] * again)]
    about = max(found.parameters.values(), key=lambda each: each.sessions)
    counts = f"{about.subjects} {who}s" + (f", {about.sessions} sessions" if again else "")
    return TextTable(f"Over {counts}, {found.model_law} (random effects, REML)", header, rows)


def _spread(over: PopulationParameter) -> list[str]:
    return [f"{over.mean:.4g}", _between(over.mean_interval), f"{over.between:.4g}", _between(over.between_interval)]


def _between(interval: tuple[float, float]) -> str:
    return f"{interval[0]:.4g} to {interval[1]:.4g}"
