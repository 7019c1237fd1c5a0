"""Writes `docs/safety.md` from hazards, safety table and results: `python -m benchmarks.faults.document`.

The results are those of `python -m benchmarks.faults --trials 1 --json docs/validation/faults.json`.
"""

import json
import sys
from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np

from benchmarks.faults.catalogue import FAULTS
from benchmarks.faults.fault import DRIVE, PROTOCOL, QUALITY, REFUSED, bounds
from benchmarks.faults.hazards import HAZARDS, TESTS, Hazard
from benchmarks.faults.plants import plants
from benchmarks.faults.results import rate, read, repeated
from benchmarks.faults.trial import Trial
from controller.safety.table import TABLE, Action
from rig.errors import RigError
from rig.recording.files import write_text

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "docs" / "validation" / "faults.json"
PAGE = ROOT / "docs" / "safety.md"
REACTIONS = {
    Action.IMMEDIATE: "the drive stops by its own ramp, the tip stays",
    Action.SOFT: "the tip retracts, then stays",
}
# What notices besides the table: how, and what follows.
BESIDES = {
    DRIVE: ("the drive misses the loop's heartbeats", "the drive stops and brakes by itself"),
    PROTOCOL: ("a step meets what it cannot go on with", "the tip retracts, then stays"),
    REFUSED: ("configuration, calibration or message is turned down", "nothing moves, one sentence says why"),
    QUALITY: ("the trial's quality names it", "motion goes on, the trial is not good, a bad one is repeated"),
}
HEADER = """# Hazards, checks, and how fast they are

This page is written by `python -m benchmarks.faults.document` from the safety table (`controller/safety/table.py`), the
declared hazards (`benchmarks/faults/hazards.py`) and the measured results in `docs/validation/faults.json`; a test
holds it complete and current.

## What this software is not

Nothing here is a certified safety function. No part of the software, the drive's firmware or the computer has been
developed or assessed to a safety standard (such as IEC 61508, ISO 13849 or IEC 60601), and no check below may be the
only thing between the tip and an injury. A bench on which people are measured needs, whatever this page says:

- a hardware emergency stop within reach of the operator and one for the person, wired to the drive's safe torque off
  (STO), which works with the computer switched off;
- a current limit in the drive and mechanical stops that bound force and travel by themselves;
- an axis that can be pushed back by hand, or a limb that can be drawn out, with the power off;
- an operator who watches, and a risk assessment of the bench as it stands.

What the software does is to stop early and say why, so that those are seldom needed.
"""


def page(done: Sequence[Trial], date: str) -> str:
    """The whole document."""
    faults = [one for one in done if not one.plant]
    planted = {one.plant for one in done if one.plant}
    reported = {one.plant for one in done if one.plant and (one.unnoticed or one.unsafe)}
    return "\n".join(
        [
            HEADER,
            _campaign(faults, date, len(planted), len(reported)),
            *_not_measured(faults, reported),
            *(_section(one, faults) for one in HAZARDS),
        ]
    )


def _campaign(faults: Sequence[Trial], date: str, planted: int, reported: int) -> str:
    commits = ", ".join(sorted({one.commit for one in faults}))
    unnoticed, unsafe = sum(bool(one.unnoticed) for one in faults), sum(bool(one.unsafe) for one in faults)
    return f"""## How it was measured

`python -m benchmarks.faults` brings about each of {len(FAULTS)} faults at random moments, through real processes and
wires of the mock bench, and holds each to what is declared to notice it and to the bound of that. Results of {date},
commit {commits}: {rate("trials unnoticed", unnoticed, len(faults))}; {rate("unsafe", unsafe, len(faults))}. With
`--plant all` each check is switched off in turn: {reported} of {planted} such bugs were reported.

Time to detect is from the fault, or from the moment at which what it leads to was true (force above the limit, say), to
the stop; 0 where it was foreseen. Where a share of messages is damaged, it is from the last sample that came. The bound
is in brackets, by name where a fault has its own, as the program outside the loop notices it. Peak is the tissue's own
force in all trials that this check noticed; the limit was 15 N. Faults {repeated(faults)}.
This is a simulated bench on one computer: what a real one does has to be measured there.
"""


def _not_measured(done: Sequence[Trial], reported: Collection[str]) -> list[str]:
    """What the results do not hold, said by name: a check without a figure is no measured check."""
    measured = {one.noticed_by for one in done if not one.unnoticed}
    missing = [code for code in TESTS if code not in measured]
    unplanted = [name for name in plants() if name not in reported]
    said = [("Not measured in these results", missing), ("Not planted in these results", unplanted)]
    return [f"{what}: {', '.join(f'`{name}`' for name in names)}.\n" for what, names in said if names]


def _section(hazard: Hazard, done: Sequence[Trial]) -> str:
    rows = "\n".join(_row(code, done) for code in hazard.checks)
    return f"""## {hazard.name}

Causes: {hazard.causes}.

| check | detection | reaction | provoked by | s to detect: median, longest (bound) | peak N | test |
|---|---|---|---|---|---|---|
{rows}

What is left: {hazard.left}
"""


def _row(code: str, done: Sequence[Trial]) -> str:
    mine = [one for one in done if one.noticed_by == code and not one.unnoticed]
    detection, reaction = _said(code)
    by = ", ".join(sorted({one.fault for one in mine})) or "--"
    peak = f"{max(one.peak_N for one in mine):.1f}" if mine else "--"
    path, _, name = TESTS[code].partition("::")
    return f"| `{code}` | {detection} | {reaction} | {by} | {_times(code, mine)} | {peak} | `{path}`: `{name}` |"


def _said(code: str) -> tuple[str, str]:
    for check in TABLE:
        if check.code == code:
            summary = (check.evaluate.__doc__ or "").partition("\n")[0].rstrip(".")
            return summary, REACTIONS[check.action]
    return BESIDES[code]


def _times(code: str, mine: Sequence[Trial]) -> str:
    times = [one.detected_s for one in mine if one.detected_s is not None]
    allowed = [f"{bounds()[code]:g}"] if np.isfinite(bounds()[code]) else []
    own = {one.fault: FAULTS[one.fault].within_s for one in mine}
    allowed += [f"{name}: {within_s:g}" for name, within_s in sorted(own.items()) if within_s is not None]
    bound = f" ({'; '.join(allowed)})" if allowed else ""
    return f"{np.median(times):.3f}, {max(times):.3f}{bound}" if times else f"--{bound}"


def main() -> int:
    """Writes the page; 0, or the error's code with one sentence."""
    try:
        write_text(PAGE, page(read(RESULTS), json.loads(RESULTS.read_text())["date"]))
    except RigError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main())
