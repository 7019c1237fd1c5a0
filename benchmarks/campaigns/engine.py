"""The diagnosis' own answer to a case."""

from benchmarks.campaigns.case import Answer, Case, Named
from benchmarks.campaigns.naive import naive
from rig.diagnosis.planting import with_tried_sizes
from rig.diagnosis.run import diagnose_session
from rig.results.diagnosis import DiagnosisResult


def answer(case: Case) -> Answer:
    """What `rig diagnose` says of the session: the JSON it writes, and the error on recordings left out."""
    session, noise_N = case.made
    found = diagnose_session(session)
    found = with_tried_sizes(found, session) if case.asks_sizes else found
    said = DiagnosisResult.model_validate(found)
    return Answer(
        verdict=said.verdict,
        named=tuple(
            Named(
                each.effects,
                not each.provisional,
                each.confidence,
                {name: (size.value, size.low, size.high) for name, size in each.parameters.items()},
            )
            for each in said.findings
        ),
        smallest={name: size.minimum for name, size in said.detectable.items() if size.trials},
        depends=() if said.unexplained is None else said.unexplained.depends_on,
        left_N=said.extended_N,
        noise_N=noise_N,
        naive={} if found.search is None else {name: tuple(names) for name, names in naive(found.search).items()},
    )
