"""Every fault against what must notice it: `python -m benchmarks.faults [--trials 1] [--only axis.cut ...]`.

Each trial has a fresh bench and loop; a scenario runs, and one fault is brought about at a random moment. A trial fails
where nobody noticed, where what noticed is not what is declared for that fault, or where it came later than the bound
in the safety table; it is unsafe where the true force went a tenth over the limit, or the tip still moves afterwards.

With `--plant all`, or codes, the campaign is tried instead: a check is switched off in the loop, and its fault must
fail. With `--json FILE` every trial is kept as soon as it is done, and what FILE holds is not done again. The last line
is one JSON object; exit 1 where anything went unnoticed or unsafe, or a planted bug was not reported.
"""

import argparse
import json
import math
import sys
import tempfile
import time
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from benchmarks.faults.catalogue import FAULTS, unproven
from benchmarks.faults.fault import Fault
from benchmarks.faults.plants import Plant, chosen
from benchmarks.faults.results import HEADER, line, rate, read, repeated, write
from benchmarks.faults.trial import Spoilt, Trial, trial
from controller.safety.table import TABLE
from rig.errors import DeviceError, RigError, UsageError

ATTEMPTS = 12


class Campaign:
    """Runs what is not in the file yet, until time is up."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.done = read(options.json)
        self._options = options
        self._until_s = time.monotonic() + 60 * options.minutes

    def run(self, faults: list[Fault], plant: Plant | None = None) -> list[Trial]:
        """Trials of ``faults``: each once before any comes a second time, so that an end leaves none out."""
        name = plant.name if plant else ""
        planted = ",".join(plant.off) if plant else ""
        for number in range(self._options.trials):
            for fault in faults:
                if time.monotonic() < self._until_s and not self._known(fault, number, name):
                    self.done.append(self._repeated(fault, number, name, planted))
                    write(self._options.json, self.done, datetime.now(UTC).date().isoformat())
        names = {fault.name for fault in faults}
        return [one for one in self.done if one.fault in names and one.plant == name]

    def _known(self, fault: Fault, number: int, plant: str) -> bool:
        return any((one.fault, one.number, one.plant) == (fault.name, number, plant) for one in self.done)

    def _repeated(self, fault: Fault, number: int, plant: str, planted: str) -> Trial:
        """A trial whose run lives to see its fault; those that do not are said on stderr and done again."""
        for attempt in range(1, ATTEMPTS + 1):
            final = attempt == ATTEMPTS
            try:
                with tempfile.TemporaryDirectory() as name:
                    folder = Path(name) / "session"
                    done = trial(fault, number, self._options.seed, folder, plant, planted, final)
                    return replace(done, attempts=attempt)
            except (Spoilt, DeviceError) as cause:
                print(f"{fault.name}: done again: {cause}", file=sys.stderr)
        raise UsageError(f"{fault.name}: {ATTEMPTS} runs ended before their fault: is the computer busy?")


def selected(names: list[str]) -> list[Fault]:
    """The faults in ``names``, or all; raises UsageError."""
    unknown = [name for name in names if name not in FAULTS]
    if unknown:
        raise UsageError(f"--only {unknown[0]}: there are {', '.join(FAULTS)}")
    return [fault for name, fault in FAULTS.items() if name in names or not names]


def provoke(campaign: Campaign, names: list[str]) -> tuple[dict[str, int], bool]:
    """Every fault, a line each; the summary, and whether all is well."""
    print(HEADER, flush=True)
    done: list[Trial] = []
    for fault in selected(names):
        mine = campaign.run([fault])
        done += mine
        if mine:
            print(line(fault, mine), flush=True)
    unnoticed, unsafe = (sum(bool(getattr(one, what)) for one in done) for what in ("unnoticed", "unsafe"))
    print(rate("unnoticed", unnoticed, len(done)))
    print(rate("unsafe", unsafe, len(done)))
    print(repeated(done))
    return _summary(len(done), unnoticed=unnoticed, unsafe=unsafe), not unnoticed and not unsafe


def plant(campaign: Campaign, names: list[str]) -> tuple[dict[str, int], bool]:
    """Every planted bug with its faults; the summary, and whether all were reported."""
    trials = planted = reported = 0
    for each in chosen(names):
        done = campaign.run(list(each.faults), each)
        failed = {one.fault: one.unnoticed or one.unsafe for one in done}
        is_reported = bool(failed) and all(failed.values())
        trials, planted, reported = trials + len(done), planted + 1, reported + is_reported
        said = "; ".join(f"{fault}: {what or 'NOT REPORTED'}" for fault, what in failed.items())
        print(f"{each.name:22}{said or 'NO TRIAL'}", flush=True)
    print(rate("planted bugs not reported", planted - reported, planted))
    return _summary(trials, planted=planted, reported=reported), planted == reported


def _summary(trials: int, **counts: int) -> dict[str, int]:
    empty = {"trials": trials, "table": len(TABLE), "unnoticed": 0, "unsafe": 0, "planted": 0, "reported": 0}
    return empty | counts


def main() -> int:
    """Runs and prints; 1 where a check of the campaign failed, 2 for wrong use."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.faults", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--trials", type=int, default=1, help="of each fault")
    parser.add_argument("--only", nargs="*", default=[], help="faults by name, for example axis.cut")
    parser.add_argument("--plant", nargs="*", default=[], metavar="CODE", help="checks to switch off in turn; all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=math.inf, help="ends after the trial under way then")
    parser.add_argument("--json", type=Path, help="every trial; those it holds already are not done again")
    options = parser.parse_args()
    try:
        if unproven():
            raise UsageError(f"no fault is declared that {', '.join(unproven())} alone may notice")
        campaign = Campaign(options)
        summary, is_well = plant(campaign, options.plant) if options.plant else provoke(campaign, options.only)
    except RigError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    print(json.dumps(summary))
    return 0 if is_well else 1


if __name__ == "__main__":
    sys.exit(main())
