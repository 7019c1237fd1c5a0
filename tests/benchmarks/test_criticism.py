"""The judge of the diagnosis is judged: it passes who is right, and reports each way of being wrong.

Answers are given by functions that know the truth; no session is computed for them and no real recording read.
"""

import json
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks import criticism
from benchmarks.campaigns.case import Answer, AnswerFunction, Case, Named, Record, Truth, append, read, write
from benchmarks.campaigns.counts import Goal, Share, exact_interval, reliability_of
from benchmarks.campaigns.forms import case_of
from benchmarks.campaigns.measured import PARTS, SETS, WayIn
from benchmarks.campaigns.operators import OPERATORS
from benchmarks.campaigns.questions import leaves_noise_only
from rig.errors import UsageError
from rig.trials.trial import Trial

# All sizes are stated as 1, so that a plant's own size says how far above or below it is.
SMALLEST = dict.fromkeys(OPERATORS, 1.0)
SEEDS = {"forms": 400, "planted": 120, "nothing": 66, "calibration": 360, "hidden": 160}


def chance(case: Case) -> float:
    """The same number for the same case, evenly between 0 and 1."""
    return float(np.random.default_rng([case.seed, len(case.generator), 99]).random())


def first(names: frozenset[str]) -> str:
    """One of them; what acts through depth alone comes last, for it is right of a soft frame only for want of more."""
    return sorted(names - {"elastic_law", "substrate"} or names)[0]


def interval(size: float, low: float, high: float) -> tuple[float, float, float]:
    """The size and its interval, in shares of it; of one below zero the larger share is the lower end."""
    return size, min(size * low, size * high), max(size * low, size * high)


def right(case: Case) -> Answer:
    """Names what is true, sizes it with intervals that hold in 95 of 100, and finds four of five at the size stated."""
    truth = case.truth
    if truth.told == "what was measured" or "at most" in truth.told:
        return Answer("unexplained", smallest=SMALLEST)
    sets = truth.names
    ratio = next(iter(truth.sizes.values()), 1.0)
    if "the size stated" in truth.told and ratio <= 1 and chance(case) > 0.8 * ratio:
        sets = ()
    off = 0.5 if case.seed // 10 % 16 == 3 else 0.0
    sizes = {name: interval(size, 0.9 + off, 1.1 + off) for name, size in truth.sizes.items()}
    named = tuple(Named((first(names),), not truth.outside, 1.0, sizes) for names in sets)
    verdict = "unexplained" if truth.outside else "explained" if named else "adequate"
    return Answer(verdict, named, SMALLEST, tuple(truth.depends))


def names_what_is_not_there(case: Case) -> Answer:
    """Adds a false cause in one session of ten, as sure as of the true ones."""
    found = right(case)
    if case.seed % 10:
        return found
    return replace(found, named=(*found.named, Named(("tip_inertia",), True, 1.0)))


def never_detects(_: Case) -> Answer:
    """Calls everything adequate."""
    return Answer("adequate", smallest=SMALLEST)


def always_abstains(_: Case) -> Answer:
    """Calls everything unexplained, and names nothing."""
    return Answer("unexplained", smallest=SMALLEST)


def too_sure_of_sizes(case: Case) -> Answer:
    """Intervals that hold the truth in one of two."""
    found = right(case)
    off = 1.0 if chance(case) < 0.5 else 1.2
    narrow = {name: interval(size, off * 0.9, off * 1.1) for name, size in case.truth.sizes.items()}
    return replace(found, named=tuple(replace(one, sizes=narrow) for one in found.named))


def too_unsure_of_sizes(case: Case) -> Answer:
    """Intervals that always hold it."""
    found = right(case)
    wide = {name: interval(size, 0.0, 2.0) for name, size in case.truth.sizes.items()}
    return replace(found, named=tuple(replace(one, sizes=wide) for one in found.named))


def too_sure_of_names(case: Case) -> Answer:
    """One name in five is wrong, and confidence always 1."""
    found = right(case)
    return replace(found, named=(Named(("tip_inertia",), False, 1.0),)) if chance(case) < 0.2 else found


def too_modest_of_names(case: Case) -> Answer:
    """All names right, and confidence a half."""
    found = right(case)
    return replace(found, named=tuple(replace(one, confidence=0.5) for one in found.named))


def states_too_much(case: Case) -> Answer:
    """Finds every plant at the size stated: the sizes stated are too large."""
    found = right(case)
    sets = case.truth.names[:1] if "the size stated" in case.truth.told else ()
    return replace(found, named=tuple(Named((first(names),), True, 1.0) for names in sets)) if sets else found


def names_the_neighbour(case: Case) -> Answer:
    """Detects, and takes one thing for another in one session of ten."""
    found = right(case)
    if case.seed % 10 != 9:
        return found
    return replace(found, named=tuple(replace(one, effects=("adhesion",)) for one in found.named))


def outcome(name: str, answer: AnswerFunction) -> tuple[bool, list[str]]:
    """Whether every goal was met, and the lines of those that were not."""
    said: list[str] = []
    campaign = criticism.CAMPAIGNS[name]
    records = [campaign.record(seed, answer) for seed in range(SEEDS[name])]
    met = criticism.report(name, records, said.append)
    assert json.loads(said[-1])["met"] is met
    return met, [line for line in said if line.endswith("MISSED")]


@pytest.mark.parametrize("name", SEEDS)
def test_who_is_right_meets_every_goal(name: str) -> None:
    assert outcome(name, right) == (True, [])


@pytest.mark.parametrize(
    ("name", "answer", "figure"),
    [
        ("forms", names_what_is_not_there, "sessions with a certain wrong name"),
        ("forms", names_what_is_not_there, "clean sessions with a certain name"),
        ("forms", never_detects, "what the library does not hold flagged"),
        ("forms", never_detects, "something true in the answer"),
        ("forms", always_abstains, "known sizes inside"),
        ("forms", too_sure_of_sizes, "known sizes inside"),
        ("forms", too_unsure_of_sizes, "known sizes inside"),
        ("forms", names_the_neighbour, "something true in the answer"),
        ("planted", names_what_is_not_there, "sessions with a certain wrong name"),
        ("planted", never_detects, "found, planted above"),
        ("planted", names_the_neighbour, "what was planted in the answer"),
        ("nothing", names_what_is_not_there, "sessions with a certain name"),
        ("hidden", names_what_is_not_there, "clean sessions with a certain name"),
        ("hidden", never_detects, "flagged with the right variable"),
        ("hidden", always_abstains, "flagged with the right variable"),
        ("calibration", too_sure_of_sizes, "known sizes inside"),
        ("calibration", too_sure_of_names, "confidence against frequency"),
        ("calibration", too_modest_of_names, "confidence against frequency"),
        ("calibration", states_too_much, "found, planted at the size stated"),
        ("calibration", never_detects, "found, planted at the size stated"),
    ],
)
def test_each_way_of_being_wrong_is_reported(name: str, answer: Callable[[Case], Answer], figure: str) -> None:
    met, missed = outcome(name, answer)
    assert not met
    assert any(line.startswith(figure) for line in missed), missed


def test_a_wrong_name_is_printed_with_seed_generator_truth_and_answer_and_can_be_run_again(
    capsys: pytest.CaptureFixture[str],
) -> None:
    def wrong(case: Case) -> Answer:
        return Answer("explained", (Named(("friction", "backlash"), True, 0.9), Named(("adhesion",), False, 0.1)))

    assert criticism.main(["--campaign", "forms", "--only", "110"], wrong) == 1
    line, summary = capsys.readouterr().out.splitlines()
    assert line.startswith("seed 110 clean: true is nothing (")
    assert "answer explained {friction, backlash} {adhesion}?" in line and line.endswith("WRONG friction or backlash")
    assert json.loads(summary)["wrong_seeds"] == [110]
    assert criticism.main(["--campaign", "forms", "--only", "110"], never_detects) == 0


@pytest.mark.parametrize("name", SEEDS)
def test_a_record_keeps_the_seed_that_makes_it_again(name: str) -> None:
    campaign = criticism.CAMPAIGNS[name]
    for seed in range(30, 40):
        one = campaign.record(seed, right)
        assert one.seed == seed
        assert replace(campaign.record(one.seed, right), cpu_s=one.cpu_s) == one


def test_seeds_are_new_in_each_run_and_printed(capsys: pytest.CaptureFixture[str]) -> None:
    for _ in range(2):
        assert criticism.main(["--campaign", "forms", "--count", "1"], never_detects) == 1
    first, second = (line for line in capsys.readouterr().out.splitlines() if line.startswith("forms: seeds"))
    assert first != second and int(first.split()[2]) >= criticism.DEVELOPMENT


def test_what_the_file_holds_is_not_done_again_and_is_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, asked = tmp_path / "records.json", list[int]()

    def noted(case: Case) -> Answer:
        asked.append(case.seed)
        return Answer("unexplained", (Named(("friction",), True, 0.5, {"friction_N": (1.0, -np.inf, np.inf)}),))

    run = ["--campaign", "forms", "--json", str(file)]
    for more in (["--seed", "20", "--count", "2"], ["--count", "3", "--resume"]):
        criticism.main([*run, *more], noted)
    assert asked == [20, 21, 22]
    assert json.loads(capsys.readouterr().out.splitlines()[-1])["sessions"] == 3
    kept = read(file)
    assert kept[0].truth == case_of(20).truth
    assert kept[0].answer.named[0].sizes["friction_N"] == (1.0, -np.inf, np.inf)
    file.write_text('{"seed": 1}\n')
    with pytest.raises(UsageError, match="holds no records of a campaign"):
        read(file)


def test_a_run_is_neither_overwritten_nor_gone_on_with_unasked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "records.jsonl"
    run = ["--campaign", "forms", "--count", "1", "--json", str(file)]
    assert criticism.main([*run, "--resume"], never_detects) == 2
    assert "holds no sessions to go on with" in capsys.readouterr().err
    criticism.main(run, never_detects)
    kept = file.read_text()
    assert criticism.main(run, never_detects) == 2
    assert "holds 1 sessions already; go on with --resume" in capsys.readouterr().err
    assert file.read_text() == kept


def test_a_record_cut_short_is_done_again(tmp_path: Path) -> None:
    file = tmp_path / "records.jsonl"
    first, second = criticism.collect("forms", [30, 31], never_detects, file=file)
    file.write_text(file.read_text()[:-40])
    assert read(file) == [first]
    again = criticism.collect("forms", [30, 31], never_detects, file=file)
    assert [one.seed for one in again] == [30, 31] == [one.seed for one in read(file)]
    append(file, second)
    assert len(read(file)) == 3


def test_two_workers_do_what_one_does(tmp_path: Path) -> None:
    records = [criticism.collect("forms", range(30, 36), never_detects, jobs) for jobs in (1, 2)]
    plain = [[replace(one, cpu_s=0.0) for one in each] for each in records]
    assert plain[0] == plain[1]
    write(tmp_path / "records.json", plain[0])
    assert read(tmp_path / "records.json") == plain[0]


def test_intervals_are_those_of_clopper_and_pearson() -> None:
    # 0 of 200: 1 - 0.025^(1/200); 3 of 10 from the tables of Pearson and Hartley (1966).
    assert exact_interval(0, 200) == pytest.approx((0.0, 1 - 0.025 ** (1 / 200)))
    assert exact_interval(3, 10) == pytest.approx((0.0667, 0.6525), abs=1e-4)
    assert exact_interval(0, 0) == (0.0, 1.0)


@pytest.mark.parametrize(
    ("hits", "count", "contradicts"),
    [(0, 3, False), (1, 3, False), (2, 3, True), (0, 0, False)],
)
def test_few_counts_contradict_a_goal_only_where_chance_does_not_explain_them(
    hits: int, count: int, contradicts: bool
) -> None:
    assert Share("", Goal(high=0.01), hits, count).contradicts(0.999) is contradicts


def test_a_goal_with_no_trial_is_a_miss_and_says_so() -> None:
    untried = Share("found above", Goal(low=0.9), 0, 0)
    assert not untried.met
    assert untried.line.endswith("0/0    not counted              goal at least 0.9  no trial at all: MISSED")
    assert untried.json["missed"] == "no trial at all: MISSED"
    assert Share("found above", Goal(low=0.9), 8, 10).line.endswith("goal at least 0.9  MISSED")
    assert Share("found above", Goal(low=0.9), 9, 10).line.endswith("goal at least 0.9")


def test_an_answer_that_states_no_size_meets_no_goal_of_planting() -> None:
    _, missed = outcome("planted", lambda case: replace(right(case), smallest={}))
    assert [line for line in missed if line.startswith("found, planted above") and "no trial at all" in line]


def test_half_of_the_plants_are_in_parts_of_recordings_in_each_of_which_as_many() -> None:
    names = [criticism.CAMPAIGNS["planted"].record(seed, right).generator for seed in range(2 * len(SETS))]
    assert names[::2] == [each.name for each in SETS]
    counts = Counter(names[1::2])
    assert set(counts) == {each.name for each in PARTS} and max(counts.values()) - min(counts.values()) <= 1


def test_a_way_in_ends_at_a_depth_a_force_or_its_turn_and_its_motion_goes_on() -> None:
    """2 mm/s at 10 Hz to 4 mm and back, on 0.5 N/mm: sample 7 is at 1.2 mm, sample 11 0.8 N above the first five."""
    time_s = np.arange(41) / 10
    place_mm = np.interp(time_s, [0, 2, 4], [7, 11, 7])
    trial = Trial("ramp", time_s, 0.5 * (place_mm - 7), time_s, place_mm)
    for part, samples in ((WayIn(far_mm=1.1), 7), (WayIn(rise_N=0.76), 11), (WayIn(), 21)):
        taken = part.of(trial)
        assert len(taken.force_s) == samples == len(taken.axis_s) - 2
    assert f"{WayIn(far_mm=15.0)} {WayIn(rise_N=0.2)}" == "in to 15 mm in to 0.2 N"


def test_calibration_error_and_brier_score_of_a_hand_worked_case() -> None:
    def one(confidence: float, name: str) -> Record:
        answer = Answer("explained", (Named((name,), True, confidence),))
        return Record(1, "", Truth((frozenset({"friction"}),)), answer)

    records = [one(0.9, "friction"), one(0.9, "backlash"), one(0.3, "friction")]
    found = reliability_of(records)
    assert found.error == pytest.approx((abs(1.8 - 1) + abs(0.3 - 1)) / 3)
    assert found.brier == pytest.approx((0.01 + 0.81 + 0.49) / 3)


@pytest.mark.parametrize(("left_N", "said"), [(0.006, [True]), (0.0063, [False]), (None, [])])
def test_explained_counts_as_false_where_the_error_left_is_above_the_known_noise(
    left_N: float | None, said: Sequence[bool]
) -> None:
    answer = Answer("explained", left_N=left_N, noise_N=0.005)
    assert list(leaves_noise_only(Record(1, "", Truth(), answer))) == said
