"""All faults of the campaign; each line of the safety table has one that nothing else may notice: its proof."""

from benchmarks.faults import acts
from benchmarks.faults.acts import device, set_quantities, several
from benchmarks.faults.fault import DRIVE, NOBODY, PROTOCOL, QUALITY, REFUSED, Fault
from benchmarks.faults.scenarios import REST_N, SEARCH_TO_MM, SURFACE_MM, Truth
from controller.safety.table import TABLE, Check
from rig.config.wiring import Limits

DEPTH_LIMIT_MM = 10.0
WORKSPACE_MM = 28.5
PATIENT_MM = 10.0
PUSH = set_quantities(surface__speed_mm_s=20.0, surface__position_mm=SURFACE_MM - 9.0)
"""The limb comes 9 mm towards the tip."""
DROP = set_quantities(surface__speed_mm_s=60.0, surface__position_mm=SURFACE_MM + 15.0)
RECEDE = set_quantities(surface__speed_mm_s=2.0, surface__position_mm=SURFACE_MM + 9.0)
STIFF = set_quantities(tissue__inclusion_mm=0.0, tissue__inclusion_N_mm=5.0)
RUNNING = device("axis", "unguarded")
"""Without it the drive's own watches stop what the loop is to notice here."""
# The rate of a program of 1 to 3 N, once a second, is 6.3 N/s; 1 N more within the window of 10 ms is 100 N/s.
GENTLE = ("limits.force_rate_N_s=40",)
# Patient enough for a cycle that comes 70 ms late to be the only thing that is wrong.
LATE = ("loop.overrun_ms=40", "loop.stale_axis_ms=300", "loop.stale_force_ms=300", "axis.heartbeat_ms=300")
LATE_S = 0.07
# A hundred equal samples of 1 kHz where missed samples count by age alone, and one cycle.
FROZEN_S = 0.2
# What vanishes in one sample, and one turn.
AT_ONCE_S = 0.1
# The program looks after its recorder ten times a second; a recorder writes what it has at least every 0.4 s.
RECORDER_GONE_S = 0.3
DISK_FULL_S = 0.7

PEDAL = ("input.pedal.product=evdev-switch", "input.pedal.port=mock", "input.pedal.stops=pain")
GLOVE = ("input.glove.product=firmata-glove", "input.glove.port=mock", "input.glove.needed=true")


def _too_deep(truth: Truth) -> bool:
    return truth["tip.position_mm"] > SURFACE_MM + DEPTH_LIMIT_MM


def _unfelt(truth: Truth) -> bool:
    return truth["tip.depth_mm"] < 0.0


def _at_inclusion(truth: Truth) -> bool:
    return truth["tip.depth_mm"] > 2.0


def _outside(truth: Truth) -> bool:
    return truth["tip.position_mm"] > WORKSPACE_MM + 1.0


def _limb_moved(truth: Truth) -> bool:
    return abs(truth["surface.position_mm"] - SURFACE_MM) > PATIENT_MM


def _pushed(truth: Truth) -> bool:
    return truth["tip.force_N"] > REST_N + Limits().pushed_N


def _searched(truth: Truth) -> bool:
    return truth["tip.position_mm"] > SEARCH_TO_MM - 0.1


def _touches(truth: Truth) -> bool:
    return truth["tip.force_N"] > 0.1


def _moves(truth: Truth) -> bool:
    return truth["tip.velocity_mm_s"] > 1.0


def _too_strong(truth: Truth) -> bool:
    return truth["tip.force_N"] > 15.0


AXIS = (
    Fault("axis.error", "press", ("drive_fault",), device("axis", "error", 0x2310)),
    Fault("axis.lasting_error", "press", ("drive_fault",), device("axis", "lasting_error", 0x2310)),
    Fault("axis.cut", "press", ("axis_lost",), device("axis", "cut")),
    Fault("axis.freeze", "press", ("axis_lost",), device("axis", "freeze")),
    Fault("axis.silent", "press", ("axis_lost",), device("axis", "silent")),
    Fault("axis.delay", "press", ("axis_lost", "drive_fault"), device("axis", "delay", 0.1)),
    Fault("axis.scale", "hold", ("axis_scale",), acts.slipping_scale, _moves, before=True,
          why="the tip goes an eighth farther than the axis says"),
    Fault("axis.frozen", "loading", ("axis_frozen",), device("axis", "frozen"), latest_s=0.3),
    Fault(
        "axis.astray", "hold", ("following_error",), several(RUNNING, device("axis", "astray", -30.0)),
        why="set-points reach the drive falsified, outwards",
    ),
    Fault(
        "axis.runs_away", "hold", ("overspeed",), several(RUNNING, device("axis", "astray", -200.0)),
        settings=("axis.following_error_mm=30",), why="the same, faster than the axis may move",
    ),
    Fault(
        "axis.leaves", "hold", ("workspace",), several(RUNNING, device("axis", "astray", 5.0)), _outside,
        settings=(f"limits.position_max_mm={WORKSPACE_MM}", "axis.following_error_mm=10"),
        why="the same, slowly inwards, past the end of the workspace",
    ),
)  # fmt: skip

FORCE = (
    Fault("force.cut", "press", ("force_lost",), device("force", "cut")),
    Fault("force.freeze", "press", ("force_lost",), device("force", "freeze")),
    Fault("force.silent", "press", ("force_lost",), device("force", "silent")),
    Fault("force.delay", "press", ("force_lost",), device("force", "delay", 0.1)),
    Fault("force.invalid", "press", ("force_invalid",), device("force", "invalid")),
    Fault("force.frozen", "press", ("force_invalid",), device("force", "frozen"), within_s=FROZEN_S),
    Fault("force.saturated", "press", ("force_invalid",), device("force", "saturate", 0.5)),
    Fault("force.lever", "hold", ("torque_limit",), device("force", "lever", 500.0)),
    Fault("touch.polarity", "hold", ("first_touch",), device("force", "polarity"), _touches, before=True),
    Fault("touch.crossed", "hold", ("first_touch",), device("force", "crossed"), _touches, before=True),
    Fault("touch.dead", "hold", ("first_touch",), device("force", "dead"), _touches, before=True),
    Fault("force.polarity", "press", ("contact_lost",), device("force", "polarity"), within_s=AT_ONCE_S),
    Fault("force.gain_half", "press", ("contact_lost",), device("force", "gain", 0.5), within_s=AT_ONCE_S),
    Fault("force.gain_double", "press", ("force_rate",), device("force", "gain", 2.0), settings=GENTLE),
    Fault("force.dead", "press", ("contact_lost",), device("force", "dead"), within_s=AT_ONCE_S),
    Fault("force.crossed", "press", ("contact_lost",), device("force", "crossed"), within_s=AT_ONCE_S),
)

TRACKER = (
    Fault("tracker.cut", "press", ("tracker_lost",), device("tracker", "cut")),
    Fault("tracker.freeze", "press", ("tracker_lost",), device("tracker", "freeze")),
    Fault("tracker.silent", "press", ("tracker_lost",), device("tracker", "silent")),
    Fault("tracker.frozen", "press", ("tracker_lost",), device("tracker", "frozen")),
    Fault("tracker.delay", "press", ("tracker_lost",), device("tracker", "delay", 0.5)),
    Fault("tracker.unplugged", "press", ("tracker_lost",), device("tracker", "unplugged", 1)),
    Fault("tracker.error_reply", "press", ("tracker_lost",), device("tracker", "error_reply")),
    Fault("tracker.arm_hidden", "press", ("tracker_lost",), set_quantities(tracker__arm_in_view=False)),
    Fault("tracker.jumps", "press", ("patient_moved",), device("tracker", "arm_slips", 15.0)),
)

LIMB = (
    Fault(
        "limb.pushes", "hold", ("force_limit",), PUSH, _too_strong
    ),
    Fault(
        "limb.inclusion", "loading", ("force_limit",),
        set_quantities(tissue__inclusion_mm=4.0, tissue__inclusion_N_mm=20.0), _too_strong,
        latest_s=0.0, why="20 N/mm from 4 mm on, met at 10 mm/s",
    ),
    Fault(
        "limb.stiffens", "press", ("oscillation",),
        set_quantities(tissue__inclusion_mm=2.0, tissue__inclusion_N_mm=40.0), _at_inclusion,
        before=True, why="40 N/mm from 2 mm on, met by the force loop",
    ),
    Fault("limb.stiff_fast", "fast", ("force_limit",), STIFF, _too_strong, before=True, why="5 N/mm met at 30 mm/s"),
    Fault("limb.stiff_slow_sensor", "fast", ("force_limit",), STIFF, _too_strong, before=True,
          settings=("force.product=robotiq-ft300",), why="the same with a sensor of 100 Hz"),
    Fault("limb.leaves", "press", ("contact_lost",), set_quantities(tissue__present=False),
          within_s=AT_ONCE_S),
    Fault("limb.drops", "press", ("contact_lost",), DROP, _unfelt, settings=("limits.patient_mm=20",),
          why="15 mm at 60 mm/s, and the tip searches for it"),
    Fault("limb.recedes", "press", ("depth_limit",), RECEDE, _too_deep,
          settings=(f"limits.depth_mm={DEPTH_LIMIT_MM}",), why="slowly, and the tip follows, down to the depth limit"),
    Fault("limb.absent", "hold", (PROTOCOL,), set_quantities(tissue__present=False), _searched, before=True),
    Fault("limb.pushes_idle", "idle", ("pushed",), PUSH, _pushed),
    Fault("limb.pushes_safe", "safe", ("pushed",), PUSH, _pushed, why="after an emergency stop in contact"),
    Fault("limb.moves", "press", ("patient_moved",), set_quantities(surface__position_mm=35.0), _limb_moved),
)  # fmt: skip

INPUTS = (
    Fault("switch.unplugged", "press", ("input_lost",), device("switch", "unplug", True), settings=PEDAL),
    Fault("glove.silent", "press", ("input_lost",), device("glove", "silent"), settings=GLOVE),
    Fault("inputs.frozen", "press", ("input_lost",), acts.frozen(acts.inputs_process), settings=PEDAL),
)

OPERATOR = (
    Fault("port.estop", "press", ("emergency_stop",), acts.at_stop_port("/estop")),
    Fault("port.stop", "press", ("operator_stop",), acts.at_stop_port("/stop")),
    Fault("port.pain", "press", ("pain_stop",), acts.at_stop_port("/pain")),
    Fault("foot_switch.pain", "press", ("pain_stop",), acts.foot_switch("b"), keypad=True),
    Fault("foot_switch.estop", "press", ("emergency_stop",), acts.foot_switch("space"), keypad=True),
    Fault("stop_process.frozen", "press", ("stop_lost",), acts.frozen(acts.stop_process)),
    Fault("stop_process.killed", "press", ("stop_lost",), acts.killed(acts.stop_process)),
    Fault(
        "stop_process.frozen_estop",
        "press",
        ("emergency_stop",),
        several(acts.frozen(acts.stop_process), lambda live: live.supervisor.estop()),
        why="the operator's own stop needs no stop process",
    ),
    Fault("operator.estop", "press", ("emergency_stop",), lambda live: live.supervisor.estop()),
    Fault("operator.stop", "press", ("operator_stop",), lambda live: live.supervisor.stop()),
    Fault("operator.pain", "press", ("pain_stop",), lambda live: live.supervisor.pain()),
    Fault("operator.unattended", "press", ("operator_silent",), acts.unattended),
    Fault("operator.frozen", "press", ("operator_silent",), acts.frozen(acts.operator), latest_s=0.5, apart=True),
    Fault("operator.killed", "press", ("supervisor_lost",), acts.killed(acts.operator), apart=True),
    Fault("operator.oversized", "press", (REFUSED,), acts.oversized_message, why="a program of 400 kB"),
)

PROCESSES = (
    Fault("loop.killed", "press", (DRIVE,), acts.killed(acts.loop)),
    Fault("loop.frozen", "press", (DRIVE,), acts.frozen(acts.loop), freezes=True),
    Fault("loop.late", "press", ("loop_overrun",), acts.frozen(acts.loop, LATE_S), settings=LATE, freezes=True),
    Fault(
        "bench.frozen",
        "press",
        ("axis_lost", "force_lost"),
        acts.frozen(acts.bench, 0.8),
        freezes=True,
        why="all devices at once",
    ),
    Fault("recorder.frozen", "press", ("recorder_stalled",), acts.frozen(acts.recorder), latest_s=0.5),
    Fault("recorder.killed", "press", ("recorder_stalled",), acts.killed(acts.recorder), within_s=RECORDER_GONE_S),
    Fault("recorder.disk_full", "press", ("recorder_stalled",), acts.full_disk, within_s=DISK_FULL_S),
)

ANY_AXIS = ("axis_lost", "drive_fault", "following_error", "overspeed", "workspace", "axis_frozen", QUALITY)
ANY_FORCE = ("force_lost", "force_invalid", "force_rate", QUALITY)
ANY_TRACKER = ("tracker_lost", QUALITY)
STREAMS = {"axis": "axis", "force": "force", "tracker": "marker"}
LOST = {
    "axis": (ANY_AXIS, ("axis.gap_ms", "axis.rate_lost", "axis.wire_damage"), 0.1),
    "force": (ANY_FORCE, ("force.samples_lost", "force.gap_ms", "force.rate_lost", "force.wire_damage"), 0.1),
    "tracker": (ANY_TRACKER, ("tracker_lost", "tracker.wire_damage"), 0.3),
}
"""By device: who may notice damage on its wire, the measures that name it, and the share of messages damaged."""
WIRES = tuple(
    Fault(f"{role}.{kind}", "hold", by, device(role, kind, share), stream=STREAMS[role], named=named)
    for role, (by, named, share) in LOST.items()
    for kind in ("drop", "corrupt", "truncate", "garbage")
)
TRIALS = (
    Fault("nothing", "hold", (NOBODY,), acts.nothing, why="a sound trial is good, and nothing stops it"),
    Fault("tracker.missing", "hold", ANY_TRACKER, device("tracker", "missing", 0), named=("tracker_lost",)),
    Fault("tracker.tip_slips", "hold", (QUALITY,), device("tracker", "tip_slips"), named=("tracker_jump_mm",)),
    Fault("force.gain_half_between", "twice", (QUALITY,), acts.once_out(device("force", "gain", 0.5)), latest_s=0.2,
          named=("peak_off",), why="while the tip is out, between two trials"),
    Fault("force.gain_double_between", "twice", (QUALITY,), acts.once_out(device("force", "gain", 2.0)), latest_s=0.2,
          named=("peak_off",), why="the same"),
    Fault("force.drift", "hold", (QUALITY,), device("force", "drift", 0.5), named=("zero_drift_N",)),
    Fault("loop.stutters", "loading", (QUALITY,), acts.stuttering(acts.loop, 30, 0.015), latest_s=0.0,
          named=("cycles_missed",), why="half of the time it does not run"),
)  # fmt: skip
CONFIGURATION = (
    Fault("config.sign", "hold", (REFUSED,), acts.nothing, settings=("force.compression=positive",), before=True),
    Fault(
        "config.increments_double",
        "hold",
        (REFUSED,),
        acts.nothing,
        settings=("axis.increments_per_mm=4000",),
        before=True,
    ),
    Fault(
        "config.increments_half",
        "hold",
        (REFUSED,),
        acts.nothing,
        settings=("axis.increments_per_mm=1000",),
        before=True,
    ),
    Fault("config.channel", "hold", (REFUSED,), acts.nothing, settings=("force.axis=fx",), before=True),
)
COMMISSIONING = tuple(
    Fault(f"commission.{name}", "commission", (REFUSED,), device("force", kind, value), before=True)
    for name, kind, value in (
        ("polarity", "polarity", True), ("gain_half", "gain", 0.5), ("gain_double", "gain", 2.0),
        ("dead", "dead", 2), ("crossed", "crossed", True), ("drift", "drift", 0.5), ("saturated", "saturate", 6.0),
    )
)  # fmt: skip

ALL = (*AXIS, *FORCE, *TRACKER, *LIMB, *INPUTS, *OPERATOR, *PROCESSES, *WIRES, *TRIALS, *CONFIGURATION, *COMMISSIONING)
FAULTS: dict[str, Fault] = {fault.name: fault for fault in ALL}


def proofs(code: str) -> tuple[Fault, ...]:
    """Faults that nothing but ``code`` may notice."""
    return tuple(fault for fault in FAULTS.values() if fault.expected == (code,))


def unproven(table: tuple[Check, ...] = TABLE) -> list[str]:
    """Lines of ``table`` for which no fault is declared that they alone may notice."""
    return [line.code for line in table if not proofs(line.code)]
