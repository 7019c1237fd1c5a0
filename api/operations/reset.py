"""The way back after a crash, a fault or a stop: what happened, and one consent for each thing that is done."""

from collections.abc import Callable
from dataclasses import replace

from controller.operation import Operation
from controller.recovery.situation import Consent
from rig.errors import CheckFailed
from rig.results.bench import Act, ResetResult

Recover = Callable[[Consent], ResetResult]
Ask = Callable[[Act, str], bool]


def reset(operation: Operation, recover: Recover, agreed: Consent, ask: Ask) -> ResetResult:
    """Recovers as far as is agreed to, and asks for what is not; raises CheckFailed after a no, Cancelled between."""
    found = recover(agreed)
    operation.say(*found.happened)
    while found.open:
        operation.say(*found.done)
        for needed in found.open:
            if not ask(needed.act, needed.question):
                raise CheckFailed(f"not agreed to: {needed.question} Nothing more was done")
            agreed = replace(agreed, **{needed.act: True})
        operation.refuse_cancelled("what was agreed to")
        found = recover(agreed)
    operation.say(*found.done, found.missing or "the bench is ready")
    return found
