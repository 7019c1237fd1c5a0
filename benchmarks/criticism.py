"""How often is the diagnosis right, and are its numbers what they say? Campaigns with known truth, counted exactly.

    python -m benchmarks.criticism --campaign forms --count 200
    python -m benchmarks.criticism --campaign planted --count 200 --jobs 2 --json planted.jsonl
    python -m benchmarks.criticism --campaign planted --count 200 --jobs 2 --json planted.jsonl --resume
    python -m benchmarks.criticism --campaign forms --only 4711

`forms` hides things by formulas that are not the engine's, `hidden` by those of the engine in another program;
`planted` puts causes into real recordings, `nothing` gives these as they are or shuffled, and `calibration` compares
confidence, intervals and smallest sizes with what comes of them. The first seed is new in each run unless given, and is
printed; ``--only`` repeats seeds. ``--json FILE`` keeps each record in a line as soon as it is there; ``--resume`` goes
on with that run where it was stopped. Each figure stands beside its goal. The last line is one JSON object; exit 1
where a goal was missed, or a certain name was wrong in a seed of ``--only``.
"""

import argparse
import json
import secrets
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from statistics import median

from benchmarks.campaigns.calibration import CALIBRATION
from benchmarks.campaigns.campaign import Campaign
from benchmarks.campaigns.case import AnswerFunction, Record, append, read, write
from benchmarks.campaigns.counts import Share, reliability_of, share_of, table
from benchmarks.campaigns.engine import answer as engine_answer
from benchmarks.campaigns.forms import FORMS
from benchmarks.campaigns.hidden import HIDDEN
from benchmarks.campaigns.nothing import NOTHING
from benchmarks.campaigns.planted import PLANTED
from rig.errors import RigError, UsageError

CAMPAIGNS: Mapping[str, Campaign] = {
    "forms": FORMS, "hidden": HIDDEN, "planted": PLANTED, "nothing": NOTHING, "calibration": CALIBRATION,
}  # fmt: skip
DEVELOPMENT, SEEDS = 10_000, 10**8  # seeds below the first are for development


def collect(
    name: str, seeds: Sequence[int], answer: AnswerFunction, jobs: int = 1, file: Path | None = None
) -> list[Record]:
    """Records of the seeds and of what ``file`` holds, each kept and printed as soon as it is there."""
    records = read(file)
    if file is not None:
        write(file, records)
    done = {one.seed for one in records}
    for one in _judged(name, [seed for seed in seeds if seed not in done], answer, jobs):
        records.append(one)
        if file is not None:
            append(file, one)
        print(one.line, flush=True)
    return sorted(records, key=lambda one: one.seed)


def _judged(name: str, seeds: Sequence[int], answer: AnswerFunction, jobs: int) -> Iterator[Record]:
    if jobs == 1:
        yield from (CAMPAIGNS[name].record(seed, answer) for seed in seeds)
        return
    with ProcessPoolExecutor(jobs) as pool:
        running = [pool.submit(CAMPAIGNS[name].record, seed, answer) for seed in seeds]
        try:
            yield from (future.result() for future in as_completed(running))
        finally:
            pool.shutdown(cancel_futures=True)


def report(name: str, records: Sequence[Record], say: Callable[[str], None] = print) -> bool:
    """Every figure beside its goal, hits by generator, and the summary as JSON; whether every goal is met."""
    campaign = CAMPAIGNS[name]
    shares = [share_of(question, records) for question in campaign.questions]
    for line in (share.line for share in shares):
        say(line)
    for line in table(shares, sorted({one.generator for one in records})):
        say(line)
    reliability = reliability_of(records) if campaign.asks_confidence else None
    for line in reliability.lines if reliability else ():
        say(line)
    met = all(share.met for share in shares) and (reliability is None or reliability.met)
    wrong = [one for one in records if one.false_names]
    for one in wrong:
        say(one.line)
    took_s = [one.cpu_s for one in records] or [0.0]
    say(f"processor time of a session: {median(took_s):.1f} s in the median, {max(took_s):.1f} s at most")
    summary = _summary(name, records, shares) | {"wrong_seeds": [one.seed for one in wrong], "met": met}
    say(json.dumps(summary | ({"reliability": reliability.json} if reliability else {})))
    return met


def _summary(name: str, records: Sequence[Record], shares: Sequence[Share]) -> dict[str, object]:
    return {
        "campaign": name, "sessions": len(records), "median_cpu_s": median([one.cpu_s for one in records] or [0.0]),
        "figures": {share.text: share.json for share in shares},
    }  # fmt: skip


def first_seed(asked: int | None, file: Path | None, resumes: bool) -> int:
    """The seed asked for, that of the run in ``file``, or a new one; raises UsageError where a run would be lost."""
    kept = [one.seed for one in read(file)]
    if kept and not resumes:
        raise UsageError(f"{file}: holds {len(kept)} sessions already; go on with --resume, or give another file")
    if resumes and not kept:
        raise UsageError(f"{file or '--resume'}: holds no sessions to go on with; give the --json FILE of a run")
    if asked is not None:
        return asked
    return min(kept) if kept else DEVELOPMENT + secrets.randbelow(SEEDS)


def repeat(name: str, seeds: Sequence[int], answer: AnswerFunction) -> bool:
    """The seeds again, with all that was said; whether no certain name was wrong."""
    records = collect(name, seeds, answer)
    wrong = [one.seed for one in records if one.false_names]
    print(json.dumps({"campaign": name, "sessions": len(records), "wrong_seeds": wrong, "met": not wrong}))
    return not wrong


def main(arguments: Sequence[str] | None = None, answer: AnswerFunction = engine_answer) -> int:
    """Runs and prints; 1 where a goal was missed, 2 for wrong use."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--campaign", choices=CAMPAIGNS, required=True)
    parser.add_argument("--count", type=int, default=10, help="sessions in all; 0 with --resume counts what FILE holds")
    parser.add_argument("--seed", type=int, help="first seed; a new one unless given")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--json", type=Path, metavar="FILE", help="records, one a line")
    parser.add_argument("--resume", action="store_true", help="go on with the run that FILE holds")
    parser.add_argument("--only", type=int, nargs="+", metavar="SEED", help="these seeds and no others")
    asked = parser.parse_args(arguments)
    try:
        if asked.only:
            return 0 if repeat(asked.campaign, asked.only, answer) else 1
        first = first_seed(asked.seed, asked.json, asked.resume)
        print(f"{asked.campaign}: seeds {first} to {first + asked.count - 1}", flush=True)
        records = collect(asked.campaign, range(first, first + asked.count), answer, asked.jobs, asked.json)
        return 0 if report(asked.campaign, records) else 1
    except RigError as error:
        print(error, file=sys.stderr)
        return error.exit_code


if __name__ == "__main__":
    sys.exit(main())
