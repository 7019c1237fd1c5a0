"""A cohort fitted: ``python -m benchmarks.cohort [--quick]``: 50 made sessions on the cores, and from what is kept.

Of a diagnosis and a page one session each is worked on, so that a plan of 1,000 sessions stands on measured costs.
"""

import argparse
import json
import os
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from api.operations.cohort.cohort import cohort, cohort_operation
from api.operations.cohort.runners import cores, on_cores, one_by_one
from api.operations.cohort.wanted import Wanted
from mock_devices.testing.made.synthetic import Bench, index_force, write_made_session

SESSIONS, GOAL_S, PLANNED = 50, 60.0, 1000
VISITS = 2  # of each subject


def made(folder: Path, count: int, trials: int = 1, speeds_mm_s: Sequence[float] = (10.0, 20.0)) -> list[Path]:
    """Sessions of subjects who came twice, 0.15 N/mm stiff give or take a fifth."""
    random = np.random.default_rng(0)
    subjects = 0.15 * np.exp(0.2 * random.standard_normal(-(-count // VISITS)))
    places = []
    for number in range(count):
        force = index_force(a_N_mm=float(subjects[number // VISITS] * np.exp(0.05 * random.standard_normal())))
        cycles = Bench(rate_Hz=250.0, force=force).cycles(trials, speeds_mm_s)
        about = {"id": f"subject-{number // VISITS:03d}"}
        places.append(write_made_session(folder / f"session-{number:03d}", cycles, subject=dict(about)))
    return places


def timed(places: Sequence[Path], out: Path, wanted: Wanted, serial: bool = False) -> tuple[float, float]:
    """Seconds on the clock, and of one core in the sessions themselves."""
    began = time.perf_counter()
    found = cohort(cohort_operation(wanted, places), places, out, wanted, one_by_one if serial else on_cores)
    assert not found.failed, found.failed[0].reason
    return time.perf_counter() - began, sum(each.seconds for each in found.sessions)


def main() -> None:
    """Prints each figure; the last line is one JSON object."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="10 sessions, and the goal in proportion")
    count = 10 if parser.parse_args().quick else SESSIONS
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.environ["XDG_CACHE_HOME"] = str(folder / "kept")
        places = made(folder / "sessions", count)
        fit_s, each_s = timed(places, folder / "fits", Wanted("fit"))
        kept_s, _ = timed(places, folder / "again", Wanted("fit"))
        one = {work: timed(places[:1], folder / work, Wanted(work), True)[1] for work in ("diagnose", "report")}
    costs_s = {"fit": each_s / count, **one}
    print(f"{count} sessions fitted on {cores()} cores in {fit_s:.1f} s; from what is kept in {kept_s:.2f} s")
    for work, cost in costs_s.items():
        plan = PLANNED * cost / 60.0
        print(f"{PLANNED} sessions, {work}: {cost:.2f} s of a core each, {plan:.0f} core minutes")
    print(json.dumps({
        "sessions": count, "fit_s": fit_s, "fifty_s": fit_s * SESSIONS / count, "kept_s": kept_s, "cost_s": costs_s,
    }))  # fmt: skip


if __name__ == "__main__":
    main()
