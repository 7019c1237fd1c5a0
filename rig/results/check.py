"""From a protocol check to its result."""

from rig.diagnosis.design import ASSUMED_NATS, NOT_SEPARABLE_NATS, Detectability
from rig.results.diagnosis import MOCK_LIMB, AmbiguousPair, Confusion, ProtocolCheckResult


def check_result(found: Detectability, tissue: str = MOCK_LIMB) -> ProtocolCheckResult:
    """The check as it is saved."""
    pairs = [AmbiguousPair(pair=(one, other), nats=left) for one, other, left in found.pairs]
    return ProtocolCheckResult(
        tissue=tissue,
        duration_s=found.duration_s,
        cycles=found.cycles,
        detectable=found.detectable,
        not_testable=found.not_testable,
        not_separable=tuple(pair for pair in pairs if pair.nats < NOT_SEPARABLE_NATS),
        ambiguous=tuple(pair for pair in pairs if pair.nats >= NOT_SEPARABLE_NATS),
        confusion_nats=Confusion(of=ASSUMED_NATS, names=found.names, matrix=found.confusion.tolist()),
    )
