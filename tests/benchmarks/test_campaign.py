"""The campaign's own rules: who counts as having noticed, how soon, and that nothing of the table is left out."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from api.cli.mock_inputs import input_options
from benchmarks.faults import planted_loop
from benchmarks.faults.catalogue import FAULTS, proofs, unproven
from benchmarks.faults.commission import SCENARIO as COMMISSIONING
from benchmarks.faults.evaluation import Notice, Outcome, evaluate
from benchmarks.faults.fault import DRIVE, NOBODY, QUALITY, REFUSED, Fault, bound_s, bounds
from benchmarks.faults.plants import chosen, plants
from benchmarks.faults.results import interval, repeated
from benchmarks.faults.scenarios import INDENTATION, SCENARIOS, Ended, beyond_good
from benchmarks.faults.trial import Trial, last_sample_ns, wiring_for
from controller.safety.table import TABLE
from rig.errors import UsageError
from rig.recording.reader import Recording

MS = 1_000_000
BOUND_MS = 100
"""Of a stop by the operator: one cycle of a busy computer."""
STOP = Fault("test", "press", ("operator_stop",), lambda _: None)
SEEN = Outcome(Ended("stopped"), 0, 0, (Notice("operator_stop", 5 * MS),), None, "", "free, powered", "", True)


def test_what_is_declared_notices_within_its_bound() -> None:
    found = evaluate(STOP, SEEN)
    assert (found.by, found.detected_s, found.unnoticed) == ("operator_stop", 0.005, "")


@pytest.mark.parametrize(("after_ms", "is_late"), [(BOUND_MS, False), (BOUND_MS + 1, True)])
def test_a_notice_after_its_bound_is_a_failure(after_ms: int, is_late: bool) -> None:
    found = evaluate(STOP, replace(SEEN, stops=(Notice("operator_stop", after_ms * MS),)))
    assert ("late" in found.unnoticed) is is_late


def test_the_bound_counts_from_the_onset_of_what_the_fault_leads_to() -> None:
    stops = (Notice("operator_stop", 2000 * MS),)
    assert "late" in evaluate(STOP, replace(SEEN, stops=stops)).unnoticed
    assert evaluate(STOP, replace(SEEN, stops=stops, onset_ns=1950 * MS)).detected_s == 0.05


def test_a_stop_before_what_the_fault_leads_to_took_no_time() -> None:
    assert evaluate(STOP, replace(SEEN, onset_ns=None)).detected_s == 0.0


def test_another_check_does_not_count() -> None:
    found = evaluate(STOP, replace(SEEN, stops=(Notice("force_limit", MS), Notice("operator_stop", 2 * MS))))
    assert found.unnoticed == "noticed by force_limit only, not by operator_stop"


def test_a_fault_that_nobody_noticed_is_a_failure() -> None:
    assert evaluate(STOP, replace(SEEN, stops=())).unnoticed == "nobody noticed"


@pytest.mark.parametrize(("verdict", "measures", "is_noticed"), [
    ("good", (), False), ("usable", ("zero_drift_N",), False), ("usable", ("force.gap_ms",), True),
    ("bad", ("zero_drift_N", "force.gap_ms"), True),
])  # fmt: skip
def test_quality_notices_only_where_it_names_the_disturbance(
    verdict: str, measures: tuple[str, ...], is_noticed: bool
) -> None:
    gap = replace(STOP, expected=(QUALITY,), named=("force.gap_ms",))
    found = evaluate(gap, replace(SEEN, ended=Ended("complete", verdict, measures), stops=()))
    assert (found.unnoticed == "") is is_noticed


def test_where_nothing_is_wrong_nobody_may_notice_anything() -> None:
    nothing = replace(STOP, expected=(NOBODY,))
    assert evaluate(nothing, replace(SEEN, stops=(), ended=Ended("complete", "good"))).unnoticed == ""
    assert evaluate(nothing, SEEN).unnoticed == "noticed by operator_stop only, not by nobody"
    assert evaluate(nothing, replace(SEEN, stops=(), ended=Ended("complete", "usable", ("gap_ms",)))).unnoticed


def test_a_blind_quality_names_nothing() -> None:
    measured = {"force.gap_ms": 200.0, "zero_drift_N": 0.01}
    assert beyond_good(measured, INDENTATION.quality) == ("force.gap_ms",)
    assert beyond_good(measured, planted_loop.BLIND.quality) == ()


def test_a_drive_that_stopped_by_itself_comes_before_a_loop_that_woke_up_later() -> None:
    frozen = replace(STOP, expected=(DRIVE,))
    late = (Notice("axis_lost", 4500 * MS),)
    assert evaluate(frozen, replace(SEEN, stops=late, unpowered_ns=60 * MS)).by == DRIVE
    told = (Notice("drive_fault", 61 * MS),)
    assert evaluate(frozen, replace(SEEN, stops=told, unpowered_ns=60 * MS)).by == "drive_fault"


def test_torque_lost_before_the_fault_is_not_its_doing() -> None:
    assert evaluate(STOP, replace(SEEN, stops=(), happened_ns=MS, unpowered_ns=0)).by == ""


@pytest.mark.parametrize(("code", "text", "is_stall"), [
    ("loop_overrun", "the loop came 120 ms late (limit 100 ms)", True),
    ("axis_lost", "axis: newest sample is 51 ms old (limit 50 ms)", True), ("axis_lost", "axis lost: cable", False),
    ("force_limit", "force 16.00 N is above limits.force_N, 15 N", False),
])  # fmt: skip
def test_a_stall_of_the_computer_is_known_by_its_sentence(code: str, text: str, is_stall: bool) -> None:
    assert Notice(code, 0, text).is_stall is is_stall


def test_what_is_turned_down_is_noticed_by_its_sentence() -> None:
    refused = replace(STOP, expected=(REFUSED,))
    assert evaluate(refused, replace(SEEN, stops=(), refusal="too large")).unnoticed == ""
    ended = Ended("force.axis contradicts the calibration", refused=True)
    assert evaluate(refused, replace(SEEN, stops=(), ended=ended)).unnoticed == ""
    assert evaluate(refused, replace(SEEN, stops=())).unnoticed == "nobody noticed"


def test_every_line_of_the_table_has_a_fault_that_it_alone_may_notice() -> None:
    assert unproven() == []
    assert unproven((*TABLE, TABLE[0]._replace(code="unheard_of"))) == ["unheard_of"]


def test_every_fault_can_be_configured_and_is_expected_by_what_there_is() -> None:
    for name, fault in FAULTS.items():
        wiring_for(fault)
        assert fault.name == name
        assert fault.scenario in (*SCENARIOS, COMMISSIONING)
        assert set(fault.expected) <= set(bounds())
        assert fault.named or QUALITY not in fault.expected


def test_the_inputs_that_a_fault_is_about_are_needed_and_played_by_the_bench() -> None:
    played = {name: input_options(wiring_for(fault)) for name, fault in FAULTS.items() if wiring_for(fault).input}
    pedal, glove = ["--input", "evdev-switch"], ["--input", "firmata-glove"]
    assert played == {"switch.unplugged": pedal, "glove.silent": glove, "inputs.frozen": pedal}
    assert all(each.is_needed for name in played for each in wiring_for(FAULTS[name]).input.values())


def test_every_line_of_the_table_is_planted_with_its_proof() -> None:
    for line in TABLE:
        plant = plants()[line.code]
        assert plant.off == (line.code,)
        assert plant.faults == proofs(line.code)[:1]
        assert len(plant.faults) == 1


# Additions that the campaign must have beside the table, by the words of those who asked for them.
ASKED = {
    "sign": "force.polarity", "gain x0.5": "force.gain_half", "gain x2": "force.gain_double",
    "gain x0.5 at the limits of every bench": "force.gain_half_between",
    "gain x2 at the limits of every bench": "force.gain_double_between", "dead channel": "force.dead",
    "wrong channel": "force.crossed", "zero drift": "force.drift", "saturation": "force.saturated",
    "frozen loop": "loop.frozen", "frozen recorder": "recorder.frozen", "frozen operator": "operator.frozen",
    "frozen bench": "bench.frozen", "frozen stop process": "stop_process.frozen", "frozen inputs": "inputs.frozen",
    "tracker jump": "tracker.jumps", "wrong increments": "config.increments_double",
    "stiff inclusion": "limb.inclusion", "limb that pushes": "limb.pushes", "limb that leaves": "limb.leaves",
}  # fmt: skip


@pytest.mark.parametrize("asked", ASKED)
def test_every_addition_is_a_fault_and_is_planted_by_itself(asked: str) -> None:
    planted = plants()[ASKED[asked]]
    assert planted.faults == (FAULTS[ASKED[asked]],)
    assert planted.off


def test_whatever_stops_motion_has_a_bound_that_ends() -> None:
    unbounded = {code for fault in FAULTS.values() for code in fault.expected if math.isinf(bound_s(fault, code))}
    assert unbounded == {QUALITY, REFUSED, NOBODY}


def test_where_a_share_of_messages_is_lost_the_bound_counts_from_the_last_that_came() -> None:
    """Of three that were taken in time the last came too late for anybody to know of it."""
    taken = [(1, 2), (5, 6), (9, 10)], [(11, 12), (17, 40)]
    rows = [np.array(of, [("capture_ns", "i8"), ("arrival_ns", "i8")]) for of in taken]
    recordings = cast(list[Recording], [SimpleNamespace(tables={"axis": each}) for each in rows])
    assert [last_sample_ns(recordings, "axis", before) for before in (41, 40, 12, 11)] == [17, 11, 9, 9]


def test_faults_that_took_several_runs_are_said() -> None:
    once = Trial("axis.cut", 0, "", "c", 0.0, "axis_lost", 0.05, "", "", 1.0, 0.0, "free", "", True)
    assert repeated([once]).endswith(": none")
    assert repeated([once, replace(once, fault="loop.late", attempts=3)]).endswith(": loop.late (3)")


def test_a_planted_loop_lacks_the_check_and_nothing_else() -> None:
    codes = [line.code for line in TABLE]
    left = [line.code for line in planted_loop.without({"force_limit"})]
    assert left == [code for code in codes if code != "force_limit"]


def test_a_plant_that_is_not_there_is_named() -> None:
    with pytest.raises(UsageError, match="--plant unheard_of: there are all, emergency_stop"):
        chosen(["unheard_of"])


def test_intervals_of_rates_are_exact() -> None:
    """Clopper and Pearson 1934: none of n has the upper bound 1 - 0.025 ** (1 / n)."""
    assert interval(0, 45) == pytest.approx((0.0, 1 - 0.025 ** (1 / 45)))
    assert interval(45, 45)[0] == pytest.approx(0.025 ** (1 / 45))
    assert interval(0, 0) == (0.0, 1.0)
