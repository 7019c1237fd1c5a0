"""The table of all benchmarks: what they say is judged against the goal, and what they do not say has missed it."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks import all as table
from benchmarks.all import Measure, Part, last_json, line_of, number_at, row_of, rows_of
from benchmarks.control.goals import GOALS
from benchmarks.control.scores import Headline
from benchmarks.growth import Curve
from benchmarks.loop import Load, served, summary

SAID = '{"force_ms": {"constant": {"ours": 1.0, "numpy slices": 8.0}}, "rig fit --help": {"clock_s": 0.3}}'


def test_a_number_is_found_by_its_keys_also_where_they_have_spaces_and_dots() -> None:
    found = last_json(f"a table\n{SAID}\n")
    assert number_at(found, "force_ms.constant.numpy slices") == 8.0
    assert number_at(found, "rig fit --help.clock_s") == 0.3
    assert number_at({"a.b": {"c": 2}}, "a.b.c") == 2.0
    with pytest.raises(KeyError):
        number_at(found, "force_ms.constant.taichi")
    with pytest.raises(ValueError, match="without a line of JSON"):
        last_json("nothing")


@pytest.mark.parametrize(
    ("measure", "ratio", "met"),
    [
        (Measure("a", "force_ms.constant.ours", 0.13, "ms", "force_ms.constant.numpy slices"), 0.125, True),
        (Measure("a", "force_ms.constant.ours", 0.12, "ms", "force_ms.constant.numpy slices"), 0.125, False),
        (Measure("a", "rig fit --help.clock_s", 0.35), None, True),
        (Measure("a", "rig fit --help.clock_s", 0.35, is_least=True), None, False),
    ],
)
def test_the_goal_bounds_the_ratio_or_the_number_itself(measure: Measure, ratio: float | None, met: bool) -> None:
    row = row_of(measure, json.loads(SAID))
    assert (row.ratio, row.met) == (ratio, met)
    assert ("met" if met else "missed") in line_of(row)


def test_what_a_benchmark_does_not_say_has_missed() -> None:
    row = row_of(Measure("a", "other", 1.0), json.loads(SAID))
    assert not row.met and "does not say 'other'" in row.why
    nothing = row_of(Measure("a", "idle.wake us", 1.3, "us", "idle.cyclictest us"), {"idle": {"wake us": None}})
    assert not nothing.met and "does not say 'idle.wake us'" in nothing.why


def test_what_only_the_whole_form_says_is_not_asked_of_the_quick_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    part = replace(
        planted(tmp_path, monkeypatch, "print('{\"here\": 1.5}')"),
        measures=(Measure("a", "here", 2.0), Measure("b", "hour_s", 5.0, whole=True)),
    )
    assert [row.work for row in rows_of(part, quick=True)] == ["a"]
    assert [row.met for row in rows_of(part, quick=False)] == [True, False]


def planted(folder: Path, monkeypatch: pytest.MonkeyPatch, text: str) -> Part:
    (folder / "planted_benchmark.py").write_text(text)
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.setenv("PYTHONPATH", str(folder))
    return Part("planted_benchmark", (), ("--quick",), (Measure("a", "here", 2.0),))


def test_a_benchmark_that_is_absent_or_fails_is_a_row_that_missed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (absent,) = rows_of(Part("benchmarks.none", (), (), (Measure("a", "here", 1.0),)), quick=True)
    assert not absent.met and "no such benchmark" in absent.why
    (failed,) = rows_of(planted(tmp_path, monkeypatch, "raise SystemExit('no bench here')"), quick=True)
    assert not failed.met and failed.why.endswith("ended with 1: no bench here")


def test_the_last_line_counts_what_was_met(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    part = planted(tmp_path, monkeypatch, "import sys\nprint('{\"here\": %d}' % len(sys.argv))")
    monkeypatch.setattr(sys, "argv", ["all", "--quick"])
    table.main([part, Part("benchmarks.none", (), (), (Measure("b", "here", 1.0),))])
    last = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert (last["met"], last["missed"], [row["here"] for row in last["rows"]]) == (1, 1, [2.0, None])


def test_rows_of_a_benchmark_that_judges_itself_are_taken_as_they_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = {"rows": [{"work": "w", "here": 1.5, "rival": "r", "ratio": 0.5, "goal": "at most 1 x", "met": True}]}
    planted(tmp_path, monkeypatch, f"print('''{json.dumps(said)}''')")
    (row,) = rows_of(Part("planted_benchmark", (), (), ()), quick=False)
    assert (row.work, row.here, row.ratio, row.met) == ("w", 1.5, 0.5, True)


def test_growth_tells_linear_from_quadratic() -> None:
    sizes = (10.0, 30.0, 100.0, 250.0, 500.0)
    linear, quadratic = (Curve("c", sizes, tuple(n**power for n in sizes), sizes) for power in (1.0, 2.0))
    assert linear.slope(linear.seconds)[0] == pytest.approx(1.0)
    assert quadratic.slope(quadratic.seconds)[0] == pytest.approx(2.0)
    assert (linear.is_worse_than_linear, quadratic.is_worse_than_linear) == (False, True)


def test_what_the_table_asks_of_loop_law_and_commands_is_what_they_say() -> None:
    asked = {part.name: part.measures for part in table.PARTS}
    said = json.dumps({kind: dict.fromkeys(summary(Load(), 1000.0), 1.0) for kind in ("idle", "http")})
    law = json.dumps({**dict.fromkeys(Headline.model_fields, 1.0), "limb_2Hz_gain": dict.fromkeys(GOALS, 1.0)})
    for name, found in (("benchmarks.loop", said), ("benchmarks.control", law)):
        for measure in asked[name]:
            assert [number_at(last_json(found), place) for place in (measure.here, measure.rival) if place]


def test_a_benchmark_that_ends_with_1_for_what_it_found_is_judged_by_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    part = planted(tmp_path, monkeypatch, "print('{\"here\": 1.5}')\nraise SystemExit(1)")
    assert [row.here for row in rows_of(part, quick=True)] == [1.5]


def test_of_the_load_over_http_only_what_was_served_counts() -> None:
    # The end of a run of wrk 4.1.0.
    said = "  1200 requests in 6.10s, 1.9MB read\n  Non-2xx or 3xx responses: 200\nRequests/sec:    196.7\n"
    assert (served(said), served(said.replace("  Non-2xx or 3xx responses: 200\n", ""))) == (1000, 1200)
