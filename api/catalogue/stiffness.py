"""How stiff each session found a subject: at one depth for all sessions of a site, since tissue stiffens with depth."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence

from rig.errors import UsageError
from rig.results.catalogue import ModelEntry, SessionEntry, StiffnessEntry
from rig.tissue.registry import law_named

# A session's own fit; the model that a diagnosis extended has the bench's causes in it.
FITTED = "fit/model.json"


def compared(sessions: Iterable[SessionEntry], models: Iterable[ModelEntry]) -> tuple[StiffnessEntry, ...]:
    """Newest first; sessions whose model does not say how deep it holds are left out."""
    recorded = {session.session: session.at for session in sessions}
    sites: dict[str, list[ModelEntry]] = defaultdict(list)
    for model in models:
        if model.file == FITTED and model.depth_mm:
            sites[model.site].append(model)
    found = [entry for site in sites.values() for entry in _of_site(site, recorded)]
    return tuple(sorted(found, key=lambda entry: (entry.at, entry.key), reverse=True))


def _of_site(models: Sequence[ModelEntry], recorded: Mapping[str, str]) -> Iterator[StiffnessEntry]:
    depth_mm = min(model.depth_mm for model in models if model.depth_mm)
    for model in models:
        try:
            law = law_named(model.law)(**model.parameters)
        except UsageError:  # a law that was added where the session was fitted, and is not known here
            continue
        shared = model.model_dump(include={"key", "session", "subject", "site", "law"})
        at = recorded.get(model.session, model.at)
        yield StiffnessEntry(**shared, at=at, depth_mm=depth_mm, stiffness_N_mm=float(law.force(depth_mm)) / depth_mm)
