"""The force law around the drive's position loop: it makes every tissue the same plant, and divides by it.

Each cycle moves the set-point by

    dx = dx_ahead + (w + u) dt

dx_ahead is the inverse tissue model's step for the reference (`inverse_model`). e is what the axis should show of that
by now, a pure delay and two lags later, minus the force measured: feedback sees what is unforeseen and nothing else. At
each new sample, t after the last,

    r = wc (1 + ta d/dt)^2 e        w += (r - k w) t / (B + k t)        u += wd w t

Two leads undo the axis' two lags; the samples themselves are all the filter that they have. w is the speed at which
tissue of tangent k and damping B changes its force by r. u is the speed at which the surface itself is found to move
(breathing): a second integral, so that a steady motion leaves no steady error. k and B are those at the force measured,
so that the loop is the same at every depth (`loop_response`). w is limited to what the axis is given, which is its
anti-windup, and because only speeds are formed a change of k and B moves nothing and the hand-over from position
control makes no jump.

While no surface is felt the tip only searches, and everything starts anew at the force measured: a law that went on
from what it had expected would press on with it.

Plain arithmetic on numbers and tuples of columns: the loop runs it, and the simulation compiles it.
"""

from typing import NamedTuple

from controller.law.inverse_model import Columns, Foreseen, Inverse, foresee, interpolate, resting

# Cycles of expectation that are remembered: 46 ms at 1 kHz. With more delay feedback makes limb motion of 1 Hz worse.
LINE_CYCLES = 48


class Feedback(NamedTuple):
    """What of the feedback does not change during a run; forces below ``lost_N`` mean that there is no surface."""

    delay_s: float
    lag1_s: float
    lag2_s: float
    crossover_rad_s: float
    lead_s: float
    drift_rad_s: float
    drift_limit_mm_s: float
    speed_limit_mm_s: float
    search_mm_s: float
    lost_N: float


class Settings(NamedTuple):
    """What does not change during a run."""

    inverse: Inverse
    feedback: Feedback


class ForceReading(NamedTuple):
    """The newest force and how many samples there have been: the same number means the same sample."""

    force_N: float
    samples: int


class Expected(NamedTuple):
    """The force foreseen, newest first, as far as ``cycles`` go (``start_N`` before), and after each of two lags."""

    line_N: tuple[float, ...]
    cycles: int
    start_N: float
    lagged_N: float
    force_N: float


class Correction(NamedTuple):
    """What feedback remembers: the last error and the same after one lead, w and u."""

    error_N: float
    led_N: float
    speed_mm_s: float
    drift_mm_s: float


class Memory(NamedTuple):
    """What the law remembers from cycle to cycle; ``since_s`` is the time since the last sample that was new."""

    ahead: Foreseen
    expected: Expected
    correction: Correction
    tangent_N_mm: float
    samples: int
    since_s: float


def begin(table: Columns, inverse: Inverse, force_N: float) -> Memory:
    """Memory at hand-over: what is measured now is what was foreseen, so nothing moves."""
    return start_anew((0.0,) * LINE_CYCLES, table, inverse, ForceReading(force_N, -1))


def start_anew(line_N: tuple[float, ...], table: Columns, inverse: Inverse, measured: ForceReading) -> Memory:
    """The same with a line that is there already, the sample having been seen."""
    force_N = measured.force_N
    expected = Expected(line_N, 0, force_N, force_N, force_N)
    tangent_N_mm = interpolate(table.force_N, table.tangent_N_mm, force_N)
    none = Correction(0.0, 0.0, 0.0, 0.0)
    return Memory(resting(table, inverse, force_N), expected, none, tangent_N_mm, measured.samples, 0.0)


def expect(expected: Expected, feedback: Feedback, foreseen_N: float, dt_s: float) -> Expected:
    """What the sensor should show one cycle later."""
    line_N = (foreseen_N,) + expected.line_N[:-1]  # noqa: RUF005 - numba does not unpack a tuple into a tuple
    cycles = min(expected.cycles + 1, LINE_CYCLES)
    late = min(feedback.delay_s / dt_s, LINE_CYCLES - 2.0)
    whole = int(late)
    newer_N = line_N[whole] if whole < cycles else expected.start_N
    older_N = line_N[whole + 1] if whole + 1 < cycles else expected.start_N
    delayed_N = newer_N + (late - whole) * (older_N - newer_N)
    lagged_N = expected.lagged_N + dt_s / (dt_s + feedback.lag1_s) * (delayed_N - expected.lagged_N)
    force_N = expected.force_N + dt_s / (dt_s + feedback.lag2_s) * (lagged_N - expected.force_N)
    return Expected(line_N, cycles, expected.start_N, lagged_N, force_N)


def react(
    correction: Correction, feedback: Feedback, error_N: float, tangent_N_mm: float, damping_N_s_mm: float, dt_s: float
) -> Correction:
    """r and w, ``dt_s`` after the sample before."""
    led_N = error_N + feedback.lead_s * (error_N - correction.error_N) / dt_s
    twice_led_N = led_N + feedback.lead_s * (led_N - correction.led_N) / dt_s
    lacking_N_s = feedback.crossover_rad_s * twice_led_N - tangent_N_mm * correction.speed_mm_s
    speed_mm_s = correction.speed_mm_s + lacking_N_s * dt_s / (damping_N_s_mm + tangent_N_mm * dt_s)
    return Correction(error_N, led_N, speed_mm_s, correction.drift_mm_s)


def limit(correction: Correction, feedback: Feedback, ahead_mm_s: float, dt_s: float) -> Correction:
    """w no larger than the axis is given, then u ``dt_s`` later."""
    known_mm_s, fastest_mm_s = ahead_mm_s + correction.drift_mm_s, feedback.speed_limit_mm_s
    speed_mm_s = min(max(correction.speed_mm_s, -fastest_mm_s - known_mm_s), fastest_mm_s - known_mm_s)
    drift_mm_s = correction.drift_mm_s + feedback.drift_rad_s * speed_mm_s * dt_s
    drift_mm_s = min(max(drift_mm_s, -feedback.drift_limit_mm_s), feedback.drift_limit_mm_s)
    return Correction(correction.error_N, correction.led_N, speed_mm_s, drift_mm_s)


def increment(
    memory: Memory, table: Columns, settings: Settings, reference_N: float, measured: ForceReading, dt_s: float
) -> tuple[float, Memory]:
    """The step to add to the commanded position [mm], within the speed limits, and what to remember."""
    inverse, feedback = settings
    if measured.force_N < feedback.lost_N < reference_N:
        return feedback.search_mm_s * dt_s, start_anew(memory.expected.line_N, table, inverse, measured)
    ahead, foreseen_N = memory.ahead, reference_N
    if inverse.ahead_mm_s > 0:
        ahead, foreseen_N = foresee(table, inverse, memory.ahead, reference_N, dt_s)
    expected = expect(memory.expected, feedback, foreseen_N, dt_s)
    tangent_N_mm, correction, sample_s, since_s = memory.tangent_N_mm, memory.correction, 0.0, memory.since_s + dt_s
    if measured.samples != memory.samples:
        tangent_N_mm = interpolate(table.force_N, table.tangent_N_mm, measured.force_N)
        damping = interpolate(table.force_N, table.damping_N_s_mm, measured.force_N)
        error_N, sample_s, since_s = expected.force_N - measured.force_N, since_s, 0.0
        correction = react(correction, feedback, error_N, tangent_N_mm, damping, sample_s)
    ahead_mm_s, fastest_mm_s = (ahead.depth_mm - memory.ahead.depth_mm) / dt_s, feedback.speed_limit_mm_s
    correction = limit(correction, feedback, ahead_mm_s, sample_s)
    wanted_mm_s = ahead_mm_s + correction.speed_mm_s + correction.drift_mm_s
    step_mm = min(max(wanted_mm_s, -fastest_mm_s), fastest_mm_s) * dt_s
    return step_mm, Memory(ahead, expected, correction, tangent_N_mm, measured.samples, since_s)
