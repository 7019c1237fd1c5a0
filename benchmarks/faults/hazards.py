"""What can hurt somebody or spoil what is measured: causes, the checks against it, and the tests of those checks."""

from dataclasses import dataclass

from benchmarks.faults.fault import DRIVE, PROTOCOL, QUALITY, REFUSED


@dataclass(frozen=True)
class Hazard:
    """``checks`` are codes: of the safety table, or of what notices besides it. ``left`` is what no check sees."""

    name: str
    causes: str
    checks: tuple[str, ...]
    left: str


HAZARDS = (
    Hazard(
        "The tip presses harder than the person bears",
        "stiffer tissue than expected, a bone or implant under it, a limb that pushes against the tip, a tip beside its"
        " place, a reference or depth too large",
        ("force_limit", "torque_limit", "force_rate", "depth_limit", "pain_stop", REFUSED),
        "A blow: what rises faster than the axis can turn round (some 20 ms) passes the limit. Only slow approach, low"
        " current limits and the person's own freedom to draw back bound it.",
    ),
    Hazard(
        "The force that is shown is not the force on the limb",
        "a wrong word of configuration, another sensor, exchanged wires, a broken channel, a zero that drifts, a"
        " converter at its end, a frozen or silent sensor",
        ("force_lost", "force_invalid", "force_rate", PROTOCOL, REFUSED, QUALITY),
        "A gain that changed in the air between two trials is found by the next calibration only: hang a known weight"
        " on the tip before each session.",
    ),
    Hazard(
        "The tip is not where the axis says, or does not go where it is told",
        "wrong increments or direction, a slipping coupling, a blocked or jammed axis, falsified set-points, a frozen"
        " encoder, a drive in fault, a cut cable",
        ("axis_lost", "drive_fault", "following_error", "axis_frozen", "overspeed", "workspace"),
        "A drive that runs away inwards under its own power and does not obey its quick stop: the current limit, the"
        " mechanical stops and the hardware emergency stop bound it, no software does.",
    ),
    Hazard(
        "The limb moves, or is not where it is believed to be",
        "the person moves, breathing, a strap that slips, a marker that is hidden or knocked off, a tracker that fails",
        ("patient_moved", "tracker_lost", "depth_limit", PROTOCOL),
        "Without a tracker only force and depth are known of the limb.",
    ),
    Hazard(
        "A person wants to stop the motion and nothing happens",
        "nobody at the keyboard, a hung page, a busy service, a lost connection, a lease that ran out",
        ("emergency_stop", "operator_stop", "pain_stop", "operator_silent"),
        "All these ways end in software. The hardware emergency stop does not, and must be within reach.",
    ),
    Hazard(
        "The software itself stops, hangs or is late",
        "an overloaded computer, a process that is killed or frozen, a full disk, a recorder that fails",
        ("loop_overrun", "supervisor_lost", "operator_silent", "recorder_stalled", "operator_stop", DRIVE),
        "Between the loop's end and the drive's own stop lie up to two heartbeats, in which the axis holds its place.",
    ),
    Hazard(
        "Spoilt data pass as good",
        "samples that are lost or corrupt, cycles that are missed, a zero that moved, a scale that is wrong",
        (QUALITY, "recorder_stalled"),
        "The verdict knows what can be seen in one trial. Whether the right site was pressed it does not know.",
    ),
)

TESTS: dict[str, str] = {
    "emergency_stop": "tests/controller/test_safety.py::test_each_immediate_cause_stops_where_it_is_and_latches",
    "drive_fault": "tests/controller/test_safety.py::test_each_immediate_cause_stops_where_it_is_and_latches",
    "axis_lost": "tests/controller/test_safety.py::test_each_immediate_cause_stops_where_it_is_and_latches",
    "following_error": "tests/controller/test_safety.py::test_each_immediate_cause_stops_where_it_is_and_latches",
    "axis_frozen": "tests/controller/test_safety.py::test_a_frozen_axis_is_stopped_at_once",
    "overspeed": "tests/controller/test_safety.py::test_an_axis_faster_than_its_limit_is_stopped_at_once",
    "workspace": "tests/controller/test_safety.py::test_each_immediate_cause_stops_where_it_is_and_latches",
    "force_limit": "tests/controller/test_safety.py::test_each_soft_cause_retracts_from_contact_and_latches",
    "torque_limit": "tests/controller/test_safety.py::test_each_soft_cause_retracts_from_contact_and_latches",
    "pain_stop": "tests/controller/test_safety.py::test_each_soft_cause_retracts_from_contact_and_latches",
    "operator_stop": "tests/controller/test_safety.py::test_each_soft_cause_retracts_from_contact_and_latches",
    "force_lost": "tests/controller/test_safety.py::test_a_force_sample_older_than_two_missed_periods_retracts",
    "force_invalid": "tests/controller/test_safety.py::test_each_soft_cause_retracts_from_contact_and_latches",
    "force_rate": "tests/controller/test_safety.py::test_each_soft_cause_retracts_from_contact_and_latches",
    "depth_limit": "tests/controller/test_safety.py::test_each_soft_cause_retracts_from_contact_and_latches",
    "tracker_lost": "tests/controller/test_safety.py::test_each_soft_cause_retracts_from_contact_and_latches",
    "patient_moved": "tests/controller/test_safety.py::test_a_limb_that_moved_against_the_robot_retracts",
    "loop_overrun": "tests/controller/test_safety.py::test_each_soft_cause_retracts_from_contact_and_latches",
    "recorder_stalled": "tests/controller/test_safety.py::test_each_soft_cause_retracts_from_contact_and_latches",
    "supervisor_lost": "tests/controller/test_safety.py::test_each_soft_cause_retracts_from_contact_and_latches",
    "operator_silent": "tests/controller/test_safety.py::test_each_soft_cause_retracts_from_contact_and_latches",
    DRIVE: "tests/system/test_control_faults.py"
    "::test_a_killed_loop_in_contact_leaves_the_tip_stopped_within_two_heartbeats",
    PROTOCOL: "tests/controller/test_machine.py::test_a_zero_far_from_the_first_is_refused",
    REFUSED: "tests/system/test_faults.py::test_a_protocol_beyond_the_limits_is_refused_before_anything_is_opened",
    QUALITY: "tests/benchmarks/test_campaign.py::test_quality_notices_only_where_it_names_the_disturbance",
}
"""The test that fails when the check is off, by code."""
