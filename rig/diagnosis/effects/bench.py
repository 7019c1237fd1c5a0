"""Causes that lie in the bench: kinematics, environment, guide, sensor, time stamps."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rig.diagnosis.effects.scan import PEAKS, peaks
from rig.diagnosis.problem import Array, Effect, InverseProblem, Par, Values
from rig.remembered import cos, sin
from rig.simulation.chain import Operator, Series, Tip, one
from rig.simulation.scans import dahl, play
from rig.tissue.index_law import Fields

LOWEST_HZ, HIGHEST_HZ = 0.08, 3.0  # five breaths a minute, a pulse of 180
PITCHES_PER_MM = np.linspace(1 / 10, 1 / 0.5, 60)
NUDGE_MM = 0.02
FEWEST_PERIODS = 2.5  # in the tissue: of fewer, stiffness takes the place


def _match(problem: InverseProblem, values: Values, residual: Array) -> tuple[Array, float]:
    """Residual times its sensitivity to the surface, per sample, and the sensitivity's energy."""
    ahead = problem.predict({**values, "surface_mm": values["surface_mm"] + NUDGE_MM})[0]
    sensitivity = (ahead - problem.predict(values)[0]) / NUDGE_MM
    return residual * sensitivity, float(sensitivity @ sensitivity)


def _frequencies(problem: InverseProblem) -> Array:
    time_s = problem.variables()["session time"]
    span_s = float(np.ptp(time_s))
    return np.arange(LOWEST_HZ, HIGHEST_HZ, 0.5 / max(span_s, 5.0))


def _surface_starts(problem: InverseProblem, values: Values, residual: Array) -> Sequence[Values]:
    time_s = problem.variables()["session time"]
    found = peaks(time_s, *_match(problem, values, residual), _frequencies(problem))
    return [{"surface_motion_Hz": f} for f in found]


def _ripple_starts(problem: InverseProblem, values: Values, residual: Array) -> Sequence[Values]:
    position = problem.variables()["depth"]
    match, energy = _match(problem, values, residual)
    touching = np.abs(match) > 0
    if not touching.any():
        return [{"ripple_pitch_mm": pitch} for pitch in (1.0, 2.0)]
    longest = np.ptp(position[touching]) / FEWEST_PERIODS
    found = peaks(position, match, energy, PITCHES_PER_MM[1 / max(longest, 0.5) <= PITCHES_PER_MM])
    return [{"ripple_pitch_mm": 1 / f} for f in found]


def _surface_tries(problem: InverseProblem) -> float:
    return max(1.0, len(_frequencies(problem)) / 2 / PEAKS)


def ripple_tries(_: InverseProblem) -> float:
    """How many independent pitches are scanned for each that is followed."""
    return max(1.0, len(PITCHES_PER_MM) / 3 / PEAKS)


def pair(stem: str, unit: str, meaning: str, least: float) -> tuple[Par, Par]:
    """Sine and cosine of a wave."""
    sine = Par(f"{stem}_sin_{unit}", unit, 0.0, -10.0, 10.0, 0.02, least=least, meaning=meaning)
    return sine, replace(sine, name=f"{stem}_cos_{unit}")


def _backlash(encoder: Tip, offset: Series, v: Fields) -> Series:
    """Lost motion: 0 in forward motion, the width when retracting."""
    lost_mm = play(encoder.position_mm, encoder.drive.first, one(v, "backlash_mm")) - encoder.position_mm
    return offset + lost_mm


def _wave(stem: str, phase: Array, v: Fields) -> Array:
    return np.asarray(v[f"{stem}_sin_mm"] * sin(phase) + v[f"{stem}_cos_mm"] * cos(phase))


def _ripple(encoder: Tip, offset: Series, v: Fields) -> Series:
    return offset + _wave("ripple", 2 * np.pi * encoder.position_mm / v["ripple_pitch_mm"], v)


def _surface_motion(encoder: Tip, away: Series, v: Fields) -> Series:
    return away + _wave("surface_motion", 2 * np.pi * v["surface_motion_Hz"] * encoder.drive.time_s, v)


def _surface_harmonic(encoder: Tip, away: Series, v: Fields) -> Series:
    return away + _wave("surface_harmonic", 4 * np.pi * v["surface_motion_Hz"] * encoder.drive.time_s, v)


def _friction(tip: Tip, force_N: Series, v: Fields) -> Series:
    state = dahl(tip.position_mm, tip.drive.first, one(v, "friction_length_mm"), one(v, "friction_start"))
    return force_N + one(v, "friction_N") * state


def _cross_talk(tip: Tip, force_N: Series, v: Fields) -> Series:
    """A parabola over the axis' travel: a chord from one end to the other, and how far it hangs below in the middle."""
    place_mm = tip.drive.position_mm
    share = (place_mm - place_mm.min()) / max(float(np.ptp(place_mm)), 1e-9)
    return np.asarray(force_N + v["cross_talk_N"] * share - v["cross_talk_sag_N"] * 4 * share * (1 - share))


def _inertia(tip: Tip, force_N: Series, v: Fields) -> Series:
    return force_N + 1e-3 * one(v, "tip_inertia_kg") * tip.acceleration_mm_s2


def _remembered(tip: Tip, force_N: Series, v: Fields) -> Series:
    """A play on the force itself: nothing where it rises, all of it where it has fallen by the width."""
    force_N, width_N = np.asarray(force_N, float), one(v, "hysteresis_width_N")
    behind_N = play(force_N, tip.drive.first, width_N) - force_N
    return force_N + one(v, "hysteresis_N") / width_N * behind_N


def _hysteresis_starts(problem: InverseProblem, _: Values, __: Array) -> Sequence[Values]:
    span_N = float(np.ptp(problem.channels[0].observed))
    return [{"hysteresis_width_N": share * span_N} for share in (0.05, 0.2, 0.6)]


def _filtered(tip: Tip, force_N: Series, v: Fields) -> Series:
    return force_N - tip.drive.history.transient(np.asarray(force_N), one(v, "filter_lag_s"))


def _drifted(tip: Tip, force_N: Series, v: Fields) -> Series:
    time_s = tip.drive.time_s
    return np.asarray(force_N + one(v, "zero_drift_N_h") * (time_s - 0.5 * (time_s[0] + time_s[-1])) / 3600)


def _late(tip: Tip, force_N: Series, v: Fields) -> Series:
    return tip.drive.shifted(np.asarray(force_N), one(v, "time_offset_s"))


def _drifting_clock(tip: Tip, force_N: Series, v: Fields) -> Series:
    time_s = tip.drive.time_s
    return tip.drive.delayed(np.asarray(force_N), 1e-6 * one(v, "clock_drift_ppm") * (time_s - time_s[0]))


ELASTIC = "in the force-depth curve: gains and inverse model"
BACKLASH = Effect(
    "backlash",
    "the tip follows the encoder with a dead band of {backlash_mm:.3g} mm",
    (Par("backlash_mm", "mm", 0.0, 0.0, 3.0, 0.03, least=0.005, meaning="dead band"),),
    # The first micrometres of a dead band are no measure of it: at null the data may ask for less than none.
    begin={"backlash_mm": 0.15},
    one_sided=True,
    operator=Operator("carriage", _backlash),
    through="time since reversal",
    needs=frozenset({"unloading"}),
    repair="preload or replace the nut; or measure the tip itself",
)
FRAME_COMPLIANCE = Effect(
    "frame_compliance",
    "the frame gives way by {frame_compliance_mm_N:.3g} mm per newton between encoder and tip",
    (Par("frame_compliance_mm_N", "mm/N", 0.0, 0.0, 0.8, 0.005, least=0.002, meaning="tip behind encoder per force"),),
    one_sided=True,
    operator=Operator("frame", lambda _, compliance_mm_N, v: compliance_mm_N + one(v, "frame_compliance_mm_N")),
    needs=frozenset({"tracker", "depth"}),
    control=ELASTIC,
    repair="brace the frame, measure the tip itself, or keep the compliance in the model",
)
POSITION_RIPPLE = Effect(
    "position_ripple",
    "the screw has a periodic error of {amplitude:.3g} mm every {ripple_pitch_mm:.3g} mm",
    pair("ripple", "mm", "periodic error of the screw", 0.003),
    (Par("ripple_pitch_mm", "mm", 2.0, 0.2, 20.0, 0.02, meaning="period along the axis"),),
    _ripple_starts,
    ripple_tries,
    operator=Operator("carriage", _ripple),
    needs=frozenset({"depth"}),
    through="depth",
    repair="calibrate the screw error, or use an encoder on the carriage",
)
CONTACT_OFFSET = Effect(
    "contact_offset",
    "the surface lies {contact_offset_mm:+.3g} mm from where it was stated",
    (Par("contact_offset_mm", "mm", 0.0, -8.0, 8.0, 0.05, least=0.02, meaning="true surface minus stated surface"),),
    between=True,
    mean_of="touch",
    operator=Operator("surface", lambda _, away_mm, v: away_mm + one(v, "contact_offset_mm")),
    needs=frozenset({"surface", "depth"}),
    repair="find the contact again, or correct the stated surface",
)
SURFACE_MOTION = Effect(
    "surface_motion",
    "the surface moves by {amplitude:.3g} mm at {surface_motion_Hz:.3g} Hz (breathing or pulse)",
    pair("surface_motion", "mm", "motion of the surface", 0.01),
    (Par("surface_motion_Hz", "Hz", 0.25, 0.05, 5.0, 0.002, meaning="frequency"),),
    _surface_starts,
    _surface_tries,
    operator=Operator("surface", _surface_motion),
    needs=frozenset({"depth"}),
    repair="ask for held breath, or measure the limb with a marker and subtract it",
)
SURFACE_HARMONIC = Effect(
    "surface_motion_harmonic",
    "the surface does not move as a sine does: {amplitude:.3g} mm at twice its frequency",
    pair("surface_harmonic", "mm", "motion of the surface at twice its frequency", 0.01),
    beside="surface_motion",
    operator=Operator("surface", _surface_harmonic),
    needs=frozenset({"depth"}),
    repair="as for the motion of the surface; subtract what a marker on the limb shows, not a sine",
)
FRICTION = Effect(
    "friction",
    "the linear guide in front of the sensor has a friction of {friction_N:.3g} N",
    (Par("friction_N", "N", 0.0, 0.0, 20.0, 0.02, least=0.005, meaning="Coulomb level"),),
    (
        Par("friction_length_mm", "mm", 0.1, 2e-3, 5.0, 1.0, log=True, may_end=True, meaning="travel to build it up"),
        # A recording begins where the way out of the one before has left the guide.
        Par("friction_start", "1", 0.0, -1.0, 1.0, 0.2, may_end=True, meaning="share of it when a recording begins"),
    ),
    lambda *_: [{"friction_length_mm": mm, "friction_start": -0.5} for mm in (0.005, 0.03, 0.15, 0.6)],
    one_sided=True,
    operator=Operator("guide", _friction),
    through="time since reversal",
    needs=frozenset({"unloading"}),
    control="in the inverse model",
    repair="clean and align the guide, or put the sensor at the tip",
)
CROSS_TALK = Effect(
    "cross_talk",
    "the force follows the axis: {cross_talk_N:+.3g} N from one end of its travel to the other, in the air too",
    (
        Par("cross_talk_N", "N", 0.0, -20.0, 20.0, 0.02, least=0.005, meaning="from one end of the travel to another"),
        Par("cross_talk_sag_N", "N", 0.0, -20.0, 20.0, 0.02, least=0.005, meaning="below the chord in the middle"),
    ),
    operator=Operator("reading", _cross_talk),
    # Without it an elastic law does the same.
    needs=frozenset({"air"}),
    repair="free the cables and balance the axis, or subtract the force measured along the axis in the air",
)
TIP_INERTIA = Effect(
    "tip_inertia",
    "a mass of {tip_inertia_kg:.3g} kg moves in front of the sensor",
    (Par("tip_inertia_kg", "kg", 0.0, 0.0, 5.0, 0.02, least=0.005, meaning="mass in front of the sensor"),),
    one_sided=True,
    operator=Operator("sensing", _inertia),
    needs=frozenset({"fast"}),
    repair="weigh what is mounted on the sensor and enter it in the calibration",
)
SENSOR_HYSTERESIS = Effect(
    "sensor_hysteresis",
    "the sensor reads {hysteresis_N:.3g} N more on the way down from a force, once it has fallen by "
    "{hysteresis_width_N:.3g} N",
    (Par("hysteresis_N", "N", 0.0, 0.0, 20.0, 0.02, least=0.005, meaning="reading falling over reading rising"),),
    (Par("hysteresis_width_N", "N", 1.0, 0.005, 200.0, 1.0, log=True, meaning="fall of force that brings it out"),),
    _hysteresis_starts,
    one_sided=True,
    operator=Operator("sensing", _remembered),
    through="time since reversal",
    needs=frozenset({"unloading"}),
    repair="exercise the sensor over its range before use; replace one that has been overloaded",
)
FILTER_LAG = Effect(
    "filter_lag",
    "the force is low-passed with a time constant of {filter_lag_s:.3g} s",
    (Par("filter_lag_s", "s", 0.0, 0.0, 0.5, 0.002, least=0.0007, meaning="time constant of a first-order filter"),),
    one_sided=True,
    operator=Operator("sensing", _filtered),
    needs=frozenset({"fast"}),
    repair="raise the sensor's filter frequency, or filter the position alike",
)
TIME_OFFSET = Effect(
    "time_offset",
    "the force's time stamps are off by {time_offset_s:+.3g} s against the position's (plus: late)",
    (Par("time_offset_s", "s", 0.0, -0.3, 0.3, 0.002, least=0.0007, meaning="force stamps late"),),
    operator=Operator("stamping", _late),
    needs=frozenset({"fast"}),
    repair="correct the sensor's latency in rig.toml, or stamp both in hardware",
)
CLOCK_DRIFT = Effect(
    "clock_drift",
    "the force's clock gains {clock_drift_ppm:+.3g} ppm on the position's from the session's start on (plus: late)",
    # Quartz clocks differ by up to 50 ppm each; 10 are 0.7 ms, the least time offset, after 70 s.
    (Par("clock_drift_ppm", "ppm", 0.0, -5e3, 5e3, 10.0, least=10.0, meaning="force's clock fast against position's"),),
    operator=Operator("stamping", _drifting_clock),
    needs=frozenset({"fast", "strokes", "session time"}),
    repair="stamp both in hardware from one clock, or record a common pulse at start and end",
)
TRACKER_LATENCY = Effect(
    "tracker_latency",
    "the tracker shows the tip {tracker_latency_s:.3g} s late",
    (Par("tracker_latency_s", "s", 0.0, -0.3, 0.5, 0.005, least=0.001, meaning="tracker stamps late"),),
    operator=Operator("tracking", lambda _, late_s, v: late_s + one(v, "tracker_latency_s")),
    needs=frozenset({"tracker"}),
    repair="set the tracker's latency_ms in rig.toml",
)
ZERO_DRIFT = Effect(
    "zero_drift",
    "the force zero drifts by {zero_drift_N_h:.3g} N per hour",
    (Par("zero_drift_N_h", "N/h", 0.0, -500.0, 500.0, 0.3, least=0.1, meaning="drift of the zero"),),
    between=True,
    needs=frozenset({"strokes", "session time"}),
    operator=Operator("reading", _drifted),
    repair="let the sensor warm up and take the zero in the air before every cycle",
)
GAIN_ERROR = Effect(
    "gain_error",
    "the force reads {gain_error:.2%} too high",
    (Par("gain_error", "1", 0.0, -0.5, 0.5, 0.01, least=0.005, meaning="relative error of the force gain"),),
    needs=frozenset({"weight"}),
    operator=Operator("sensing", lambda _, force_N, v: force_N * (1 + one(v, "gain_error"))),
    repair="calibrate with a known weight",
)
BENCH_EFFECTS = (
    BACKLASH, FRAME_COMPLIANCE, POSITION_RIPPLE, CONTACT_OFFSET, SURFACE_MOTION, SURFACE_HARMONIC, FRICTION,
    CROSS_TALK, TIP_INERTIA, SENSOR_HYSTERESIS, FILTER_LAG, TIME_OFFSET, CLOCK_DRIFT, TRACKER_LATENCY, ZERO_DRIFT,
    GAIN_ERROR,
)  # fmt: skip
