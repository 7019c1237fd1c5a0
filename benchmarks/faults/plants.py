"""Planted bugs: one check switched off at a time, and the faults that must then be reported."""

from dataclasses import dataclass

from benchmarks.faults.catalogue import FAULTS, proofs
from benchmarks.faults.fault import REFUSED, Fault
from benchmarks.faults.planted_loop import CONTRADICTIONS
from controller.safety.table import TABLE, Check
from rig.errors import UsageError


@dataclass(frozen=True)
class Plant:
    """``off`` are the codes switched off; each of ``faults`` must then fail its trial."""

    name: str
    off: tuple[str, ...]
    faults: tuple[Fault, ...]


ADDITIONS = (
    "force.polarity", "force.gain_half", "force.gain_double", "force.dead", "force.crossed", "force.drift",
    "force.gain_half_between", "force.gain_double_between", "force.saturated", "inputs.frozen",
    "loop.frozen", "recorder.frozen", "operator.frozen", "bench.frozen", "tracker.jumps",
    "stop_process.frozen", "limb.inclusion", "limb.pushes", "limb.pushes_safe", "limb.leaves", "limb.drops",
    "limb.recedes", "tracker.tip_slips",
    "loop.stutters", "limb.stiffens",
    "touch.polarity", "touch.crossed", "touch.dead", "config.increments_double", "config.increments_half",
    "config.sign", "config.channel",
)  # fmt: skip
"""Faults that are planted one by one besides the table: everything that may notice them is switched off."""


def plants(table: tuple[Check, ...] = TABLE) -> dict[str, Plant]:
    """A plant for every line of ``table``, with the first fault that proves it, and one for each addition."""
    lines = {line.code: Plant(line.code, (line.code,), proofs(line.code)[:1]) for line in table}
    additions = {name: Plant(name, _off(FAULTS[name]), (FAULTS[name],)) for name in ADDITIONS}
    return lines | additions


def _off(fault: Fault) -> tuple[str, ...]:
    return tuple(CONTRADICTIONS if code == REFUSED else code for code in fault.expected)


def chosen(names: list[str]) -> list[Plant]:
    """The plants in ``names``, or all for ``all``; raises UsageError."""
    known = plants()
    if names == ["all"]:
        return list(known.values())
    unknown = [name for name in names if name not in known]
    if unknown:
        raise UsageError(f"--plant {unknown[0]}: there are all, {', '.join(known)}")
    return [known[name] for name in names]
