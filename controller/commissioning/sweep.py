"""Small motions in the air that show how an axis follows: sweeps on a steady way, and slow turns, within its limits."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.config.wiring import Wiring
from rig.errors import UsageError

Column = NDArray[np.float64]

# Half a millimetre is a thousand counts of an encoder.
LARGEST_SWING_MM = 0.5
# The tip goes on at a steady speed while it swings, faster than it swings: no dry friction turns, and the response is
# that of a linear drive. Slow all the same: a set-point that comes 0.1 ms late is 0.4 um of a way of 4 mm/s. A tenth
# of the acceleration is left to the drive for friction.
STEADY_SHARE, SWING_SHARE, ACCELERATION_SHARE = 0.07, 0.05, 0.9
# Before a sweep the drive's integral has taken up the friction of the turn (80 ms); after it lags of 10 ms are over.
RUN_IN_S, REST_S = 0.15, 0.1
# Three times what is declared: there two lags differ from one and a delay from both, and a tenth of the swing is left.
BAND = 3.0
# Of the sampling theorem's half, what leaves a set-point five values a turn.
RATE_SHARE = 0.2
# Below it a second holds too few turns; no lag of an axis for a force loop is as long.
LOWEST_HZ = 2.0
# Fewer counts than this are rounded to a sine of another shape.
FEWEST_COUNTS = 4.0
EDGE = 0.05  # of a sweep, over which it fades in and out
# Longer than the way on which guides stick (some ten micrometres), and slow beside lags: they explain a tenth of it.
TURN_MM, TURN_MM_S = 0.05, 1.0


class AirSweep(NamedTuple):
    """``repeats`` ways, there and back in turn, with a sweep on each; then ``turns`` slow ones over TURN_MM."""

    lowest_Hz: float
    highest_Hz: float
    swing_mm: float
    swing_mm_s: float
    steady_mm_s: float
    acceleration_mm_s2: float
    sweep_s: float
    repeats: int
    turns: int

    @property
    def each_s(self) -> float:
        """Of one way: run in, sweep, rest."""
        return RUN_IN_S + self.sweep_s + REST_S

    @property
    def way_mm(self) -> float:
        """How far it leads, swing included."""
        return self.steady_mm_s * self.each_s + self.swing_mm

    @property
    def turn_s(self) -> float:
        """Of one slow way there and back."""
        return 4 * TURN_MM / TURN_MM_S

    @property
    def turns_begin_s(self) -> float:
        """When the slow ways begin."""
        return self.each_s * self.repeats + REST_S

    @property
    def duration_s(self) -> float:
        """Of all of it; a quarter of a turn leads to the first, and one back."""
        return self.turns_begin_s + self.turn_s * (self.turns + 0.5)

    @property
    def resolution_Hz(self) -> float:
        """Within it of either end a sweep this fast has little power."""
        return math.sqrt((self.highest_Hz - self.lowest_Hz) / self.sweep_s)


def sweep_for(wiring: Wiring, sweep_s: float, repeats: int, turns: int) -> AirSweep:
    """What limits and product allow; raises UsageError with number and bound where it would show nothing."""
    limits, axis = wiring.limits, wiring.axis
    per_mm = axis.increments_per_mm or math.inf  # known once the drive has answered, and looked at then
    counted_Hz = math.sqrt(ACCELERATION_SHARE * axis.acceleration_mm_s2 * per_mm / FEWEST_COUNTS) / (2 * math.pi)
    sweep = AirSweep(
        LOWEST_HZ,
        min(BAND * axis.bandwidth_Hz, RATE_SHARE * wiring.loop.rate_Hz, counted_Hz),
        LARGEST_SWING_MM,
        SWING_SHARE * limits.speed_mm_s,
        STEADY_SHARE * limits.speed_mm_s,
        ACCELERATION_SHARE * axis.acceleration_mm_s2,
        sweep_s,
        repeats,
        turns,
    )
    _refuse_blind(sweep, wiring)
    return sweep


def _refuse_blind(sweep: AirSweep, wiring: Wiring) -> None:
    """What cannot be seen up to the axis' own bandwidth says nothing of its lags."""
    axis = wiring.axis
    if sweep.highest_Hz < axis.bandwidth_Hz:
        raise UsageError(
            f"loop.rate_Hz {wiring.loop.rate_Hz:g}, axis.acceleration_mm_s2 {axis.acceleration_mm_s2:g} and"
            f" axis.increments_per_mm {axis.increments_per_mm:g} show the axis up to {sweep.highest_Hz:.3g} Hz (a fifth"
            f" of the rate, swings of {FEWEST_COUNTS:g} counts), below axis.bandwidth_Hz {axis.bandwidth_Hz:g}: raise"
            " them, or check axis.bandwidth_Hz"
        )


def amplitude_mm(sweep: AirSweep, frequency_Hz: Column) -> Column:
    """Of a sine of each frequency, shape of ``frequency_Hz``: the smallest that swing, speed, acceleration allow."""
    omega = 2 * np.pi * frequency_Hz
    bounds = np.full_like(omega, sweep.swing_mm), sweep.swing_mm_s / omega, sweep.acceleration_mm_s2 / omega**2
    return np.asarray(np.minimum.reduce(bounds))


def sweep_mm(sweep: AirSweep, time_s: Column) -> Column:
    """One sweep from 0 to ``sweep_s``, 0 elsewhere; its frequency rises evenly, its edges fade."""
    share = np.clip(time_s / sweep.sweep_s, 0.0, 1.0)
    rise_Hz = sweep.highest_Hz - sweep.lowest_Hz
    turns = sweep.sweep_s * (sweep.lowest_Hz * share + 0.5 * rise_Hz * share**2)
    fade = np.clip(np.minimum(share, 1.0 - share) / EDGE, 0.0, 1.0)
    swing = amplitude_mm(sweep, sweep.lowest_Hz + rise_Hz * share) * np.sin(2 * np.pi * turns)
    return np.asarray(np.sin(0.5 * np.pi * fade) ** 2 * swing)


def steady_mm(sweep: AirSweep, elapsed_s: float) -> float:
    """The way without its sweeps: there on even ones, back on odd ones; at its ends braked as the sines may be."""
    way, within_s = divmod(elapsed_s, sweep.each_s)
    along = sweep.steady_mm_s * within_s
    return along if way % 2 == 0 else sweep.steady_mm_s * sweep.each_s - along


def offset_mm(sweep: AirSweep, elapsed_s: float) -> float:
    """Where the set-point stands, from the place at which all began."""
    if elapsed_s < sweep.each_s * sweep.repeats:
        swing_mm = sweep_mm(sweep, np.array([elapsed_s % sweep.each_s - RUN_IN_S]))
        return steady_mm(sweep, elapsed_s) + float(swing_mm[0])
    ended_mm = steady_mm(sweep, sweep.each_s * (sweep.repeats % 2))
    return ended_mm + turning_mm(sweep, elapsed_s - sweep.turns_begin_s)


def turning_mm(sweep: AirSweep, elapsed_s: float) -> float:
    """The slow way: a triangle that begins and ends in its middle."""
    if not 0.0 <= elapsed_s < sweep.turn_s * (sweep.turns + 0.5):
        return 0.0
    turn = elapsed_s / sweep.turn_s + 0.25
    return TURN_MM * (1.0 - 4.0 * abs(turn - math.floor(turn) - 0.5))
