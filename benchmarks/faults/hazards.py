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
        "stiffer tissue than expected, a bone or implant under it, a limb that pushes, a tip beside its place, a"
        " reference or depth too large",
        ("force_limit", "torque_limit", "force_rate", "oscillation", "depth_limit", "pain_stop", REFUSED),
        "A blow: what rises faster than the axis can turn round passes the limit. Only slow approach, a low current"
        " limit and the person's freedom to draw back bound it. A loop that swings more slowly than 12 Hz, as with a"
        " slow axis and a slow sensor together, or between soft tissue and something stiff beneath, is stopped by the"
        " force limit only.",
    ),
    Hazard(
        "The force that is shown is not the force on the limb",
        "a wrong word of configuration, another sensor, exchanged wires, a broken channel, a zero that drifts, a"
        " converter at its end, a frozen or silent sensor",
        ("first_touch", "force_lost", "force_invalid", "force_rate", "contact_lost", PROTOCOL, REFUSED, QUALITY),
        "A gain that halves is not noticed where the tip presses with less than 0.8 N, nor in a press of 10 to 30 mm/s"
        " with a sensor of 100 Hz before three of its samples are in the loading: the tip then presses with up to twice"
        " the limit. A channel that dies below 0.8 N is noticed 3 mm further in. A gain that changed in the air before"
        " the first trial of a session is found by the next calibration only: hang"
        " a known weight on the tip before each session. The first touch is judged in newtons, not in millimetres: a"
        " force channel that is dead and pressed exactly along its axis shows no moment either, and before"
        " `search_to_mm` (of the protocol; under force that of `limits`) nothing stops the approach but the following"
        " error, once the drive's current limit holds the axis back, and a tracker that sees the limb pushed away. Set"
        " it a few millimetres beyond the surface.",
    ),
    Hazard(
        "The tip is not where the axis says, or does not go where it is told",
        "wrong increments or direction, a slipping coupling, a jammed axis, falsified set-points, a frozen encoder, a"
        " drive in fault, a cut cable",
        ("axis_lost", "drive_fault", "following_error", "axis_frozen", "overspeed", "workspace", "axis_scale"),
        "A drive that runs away inwards under its own power and does not obey its quick stop: the current limit, the"
        " mechanical stops and the hardware emergency stop bound it, no software does.",
    ),
    Hazard(
        "The limb moves, or is not where it is believed to be",
        "the person moves, breathing, a strap that slips, a marker that is hidden or knocked off, a tracker that fails",
        ("patient_moved", "tracker_lost", "contact_lost", "depth_limit", PROTOCOL),
        "Without a tracker only force and depth are known of the limb. One that is drawn back slowly, under a guide"
        " whose friction is more than 0.05 N, is searched for down to `limits.depth_mm`.",
    ),
    Hazard(
        "A person wants to stop the motion and nothing happens",
        "nobody at the keyboard, a hung page, a busy service, a lost connection, a lease that ran out",
        ("emergency_stop", "operator_stop", "pain_stop", "stop_lost", "input_lost", "operator_silent"),
        "All these ways end in software; for a second after the stop process froze a press is not heard (the page then"
        " says NOT CONFIRMED). From another computer the network and, where there is one, a reverse proxy come before"
        " them. The hardware emergency stop does not depend on it.",
    ),
    Hazard(
        "The software itself stops, hangs or is late",
        "an overloaded computer, a process that is killed or frozen, a full disk, a recorder that fails",
        ("loop_overrun", "supervisor_lost", "operator_silent", "recorder_stalled", DRIVE),
        "Between the loop's end and the drive's own stop lie up to two heartbeats, in which the axis holds its place.",
    ),
    Hazard(
        "The tip stays in a limb that cannot get away",
        "a stop in contact, a crash, a limb that pushes against an axis at rest",
        ("pushed", "force_limit", DRIVE),
        "While the force sensor is lost or invalid nobody sees that the limb pushes against an axis at rest; its state"
        " says so. After a crash nothing moves by itself: `rig reset` brings the tip out once somebody agrees. Without"
        " a computer only an axis that can be pushed back by hand frees the limb.",
    ),
    Hazard(
        "Spoilt data pass as good",
        "samples that are lost or corrupt, cycles that are missed, a zero that moved, a marker that slipped",
        (QUALITY, "recorder_stalled"),
        "The verdict knows what can be seen in one trial and beside those before. Whether the right site was pressed it"
        " does not know, nor that the sensor's gain changed between the first touch and the first loading.",
    ),
)

LOOP = "tests/controller/loop/test_bench_loop_stops.py"
IN_ITS_TIME = f"{LOOP}::test_each_fault_is_told_in_its_time_and_stops_motion"
TESTS: dict[str, str] = {
    **dict.fromkeys(
        (
            "emergency_stop", "drive_fault", "axis_lost", "overspeed", "workspace", "following_error", "force_limit",
            "torque_limit", "pain_stop", "operator_stop", "force_lost", "force_invalid", "tracker_lost",
            "patient_moved", "loop_overrun", "recorder_stalled", "stop_lost", "supervisor_lost",
            "operator_silent",
        ),
        IN_ITS_TIME,
    ),
    "input_lost": "tests/controller/inputs/test_feed.py::test_a_needed_input_that_is_lost_retracts_by_name",
    "axis_frozen": "tests/controller/safety/test_table.py::test_a_frozen_axis_is_stopped_at_once",
    "pushed": "tests/controller/safety/test_giving_way.py::test_at_rest_each_of_the_two_force_checks_is_needed",
    "force_rate": "tests/controller/safety/test_force_limit.py::test_a_rate_above_its_limit_stops_with_either_sensor",
    "first_touch": "tests/controller/safety/test_first_touch.py"
    "::test_a_sign_that_turned_since_the_calibration_is_found_before_2_N_and_named",
    "contact_lost": "tests/controller/safety/test_failing_channel.py"
    "::test_a_channel_that_fails_while_a_force_is_tracked_is_noticed_before_anything_is_felt",
    "oscillation": "tests/controller/safety/test_oscillation.py"
    "::test_tissue_stiffer_than_the_loop_tolerates_is_left_and_named",
    "axis_scale": "tests/controller/safety/test_axis_scale.py"
    "::test_a_wrong_scale_is_found_within_three_millimetres_and_before_contact",
    "depth_limit": f"{LOOP}::test_deeper_than_the_limit_is_told_at_the_limit",
    DRIVE: "tests/system/test_control_faults.py"
    "::test_a_killed_loop_in_contact_leaves_the_tip_stopped_within_two_heartbeats",
    PROTOCOL: "tests/controller/loop/test_state_machine.py::test_a_zero_far_from_the_first_one_is_refused",
    REFUSED: "tests/controller/commissioning/test_commissioning.py"
    "::test_a_wiring_that_contradicts_the_force_calibration_is_refused",
    QUALITY: "tests/rig/trials/test_quality.py::test_what_is_planted_is_named_with_its_number",
}  # fmt: skip
"""The test that fails when the check is off, by code."""
