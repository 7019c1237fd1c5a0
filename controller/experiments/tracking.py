"""Force tracking: approach, follow a force with a law made from a tissue model, retract; and how well it went."""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from controller.experiments.references import Reference
from controller.law import stability
from controller.law.axis_response import rates_of, response_of
from controller.law.gain_table import gain_rows, span_of
from controller.law.inverse_model import GainRow
from controller.law.stability import ForceLoop
from controller.loop.modes import Mode
from controller.loop.steps import Approach, Hold, Program, Retract, TrackForce, Zero
from rig.config.axis_response import AxisResponse
from rig.config.wiring import Wiring
from rig.errors import DataError, UsageError
from rig.results.tracking import Followed, Plateau
from rig.tissue.model import Model

# On tissue of 0.12 N/mm at contact the lead moves at 17 mm/s, which the inverse model does alone; ten turns of the
# fastest loop let its error go before anything is judged.
LEAD_N_S, LEAD_HOLD_S = 2.0, 0.5
TRACK_MM_S = 30.0  # the fastest of the study's speeds: what the model was fitted at
# The inverse model leaves this share of the speed to it, the rest to feedback.
AHEAD_SHARE = 0.8
# A limb that moves 0.5 mm at 2 Hz has 6.3 mm/s, one that shifts by 2 mm in 0.3 s has 10 mm/s.
DRIFT_SHARE = 0.5
LINE_PARTS = 8
# Slower is a drift that needs no loop; below ten times the sensor's noise of 0.005 N its phase says little.
LEAST_HZ, LEAST_AMPLITUDE_N = 0.2, 0.05
SETTLE_S = 1.0  # eighteen turns of a crossover of 18 Hz, two of the 2 Hz that a sensor of 100 Hz allows
SMOOTH_S = 0.05  # a turn of the fastest loop; fifty samples have a seventh of one's noise
GAIN_ROWS = 40
APPROACH_MM_S = 5.0  # at which even a stop on 50 N/mm stays below 16.5 N (limit 15 N)
CONTACT_N = 0.05  # ten times the sensor's noise

Column = NDArray[np.float64]


def levels(forces_N: Sequence[float], seconds: float) -> Reference:
    """Jumps through ``forces_N``, ``seconds`` each; raises UsageError where there would be nothing to judge."""
    if not forces_N or not min(forces_N) > CONTACT_N or not SETTLE_S < seconds < math.inf:
        raise UsageError(
            f"tracking needs forces above {CONTACT_N:g} N for more than {SETTLE_S:g} s each,"
            f" not {', '.join(f'{force:g}' for force in forces_N) or 'none'} N for {seconds:g} s"
        )
    name = ", ".join(f"{force:g}" for force in forces_N) + " N"
    times_s = tuple(at * seconds for level in range(len(forces_N)) for at in (level, level + 1))
    return Reference(name, times_s, tuple(force_N for force_N in forces_N for _ in range(2)))


def following(reference: Reference, model: Model, wiring: Wiring) -> Program:
    """Approach, follow ``reference``, retract; raises UsageError beyond model or limits."""
    refuse_unreachable(reference, model, wiring)
    law = force_law(model, wiring)
    lead = (CONTACT_N, reference.forces_N[0])
    lead_s = abs(lead[1] - lead[0]) / LEAD_N_S
    tracks = []
    if lead_s > 0:
        tracks.append(
            law.model_copy(update={"times_s": (0.0, lead_s, lead_s + LEAD_HOLD_S), "forces_N": (*lead, lead[1])})
        )
    played = {"times_s": reference.times_s, "forces_N": reference.forces_N, "repeats": reference.repeats}
    tracks.append(law.model_copy(update=played))
    return Program(
        name="force tracking " + reference.name,
        steps=(
            Zero(duration_s=0.5),
            Approach(
                speed_mm_s=min(APPROACH_MM_S, wiring.limits.speed_mm_s),
                contact_force_N=CONTACT_N,
                search_to_mm=min(wiring.limits.search_to_mm, wiring.limits.position_max_mm),
            ),
            *tracks,
            Retract(clearance_mm=5.0, speed_mm_s=min(10.0, wiring.limits.retract_speed_mm_s)),
            Hold(duration_s=0.2),
        ),
    )


def loop_for(model: Model, wiring: Wiring, axis: AxisResponse | None = None) -> ForceLoop:
    """The force loop on this bench and tissue; raises UsageError where no law holds it. ``axis``: else the bench's."""
    rates = rates_of(wiring)
    return stability.loop_for(axis or response_of(wiring), rates, span_of(model, rows_of(model), rates))


def force_law(model: Model, wiring: Wiring, response: AxisResponse | None = None) -> TrackForce:
    """A track step with its law, without a reference of its own yet. ``response``: else the bench's."""
    loop = loop_for(model, wiring, response)
    axis = loop.axis
    speed_mm_s = min(TRACK_MM_S, wiring.limits.speed_mm_s)
    friction_N, friction_mm = model.law.friction
    return TrackForce(
        times_s=(0.0, 1.0), forces_N=(CONTACT_N, CONTACT_N), gains=rows_of(model), damping_N_s_mm=model.damping_N_s_mm,
        delay_s=axis.delay_s, lag1_s=axis.lag1_s, lag2_s=axis.lag2_s, preview_s=axis.tip_lag_s,
        ahead_mm_s=AHEAD_SHARE * speed_mm_s, **loop.law._asdict(), drift_limit_mm_s=DRIFT_SHARE * speed_mm_s,
        relaxation=tuple((term.ratio, term.tau_s) for term in model.law.terms[:2]), friction_N=friction_N,
        friction_mm=friction_mm, speed_limit_mm_s=speed_mm_s,
        search_speed_mm_s=min(APPROACH_MM_S, wiring.limits.speed_mm_s), contact_force_N=CONTACT_N,
    )  # fmt: skip


def rows_of(model: Model) -> tuple[GainRow, ...]:
    """What the law takes the tissue for, from contact to the deepest point of the model."""
    return gain_rows(model, [float(depth) for depth in np.linspace(0.0, model.valid.depth_mm, GAIN_ROWS)])


def refuse_unreachable(reference: Reference, model: Model, wiring: Wiring) -> None:
    """Raises UsageError where the reference leaves contact or model, or asks more of the axis than it can."""
    refuse_beyond_bench(reference, wiring)
    model.check_force(max(reference.forces_N))
    _refuse_fast(reference, model, AHEAD_SHARE * min(TRACK_MM_S, wiring.limits.speed_mm_s))


def refuse_beyond_bench(reference: Reference, wiring: Wiring) -> None:
    """Raises UsageError for what is wrong on any tissue: contact, frequency, duration."""
    least_N = min(reference.forces_N)
    if least_N < CONTACT_N:
        raise UsageError(f"reference {reference.name} falls to {least_N:g} N, below the contact force {CONTACT_N:g} N")
    highest_Hz = 0.5 * wiring.axis.bandwidth_Hz
    if reference.frequency_Hz > highest_Hz:
        raise UsageError(
            f"reference {reference.name}: {reference.frequency_Hz:g} Hz is above half the axis' bandwidth,"
            f" {highest_Hz:g} Hz"
        )
    if not reference.duration_s > 0:
        raise UsageError(f"reference {reference.name} lasts {reference.duration_s:g} s; it must last longer than 0 s")


def _refuse_fast(reference: Reference, model: Model, limit_mm_s: float) -> None:
    """Lines, not jumps: a jump is spread at the speed there is, a line is meant to be followed."""
    lines = zip(pairwise(reference.times_s), pairwise(reference.forces_N), strict=True)
    fastest = max((_speed(model, a, b, t1 - t0) for (t0, t1), (a, b) in lines if t1 > t0 and a != b), default=0.0)
    if fastest > limit_mm_s:
        raise UsageError(
            f"reference {reference.name} needs {fastest:.1f} mm/s on this tissue, above the {limit_mm_s:g} mm/s of the"
            " force loop: make it slower or smaller"
        )


def _speed(model: Model, from_N: float, to_N: float, duration_s: float) -> float:
    """Largest speed [mm/s] along a straight line of force; soft tissue near contact needs the most."""
    depths = [model.depth_mm(float(force_N)) for force_N in np.linspace(from_N, to_N, LINE_PARTS + 1)]
    return max(abs(b - a) for a, b in pairwise(depths)) * LINE_PARTS / duration_s


def plateaus(time_s: Column, reference_N: Column, force_N: Column, mode: NDArray[np.int64]) -> tuple[Plateau, ...]:
    """Given and actual force per level of the reference, from columns of the loop stream.

    The actual force is the mean over SMOOTH_S, so that what counts is the tissue's load and not the sensor's noise.
    Raises DataError where the recording has no force tracking.
    """
    on = mode == Mode.CONTACT
    if not on.any():
        raise DataError("the recording has no force tracking: no row is in contact mode")
    time_s, reference_N, force_N = time_s[on], reference_N[on], force_N[on]
    period_s = float(np.median(np.diff(time_s)))
    smooth_N = _moving_mean(force_N, max(1, round(SMOOTH_S / period_s)))
    edges = [0, *(np.flatnonzero(np.abs(np.diff(reference_N)) > 0) + 1), len(time_s)]
    spans = [(start, end) for start, end in pairwise(edges) if time_s[end - 1] - time_s[start] > SETTLE_S]
    return tuple(_plateau(time_s[a:b], float(reference_N[a]), smooth_N[a:b]) for a, b in spans)


def followed(time_s: Column, reference_N: Column, force_N: Column, mode: NDArray[np.int64]) -> Followed:
    """The whole run at once, from columns of the loop stream; raises DataError where the recording has no tracking."""
    on = (mode == Mode.CONTACT) & np.isfinite(reference_N)
    if not on.any():
        raise DataError("the recording has no force tracking: no row is in contact mode")
    time_s, reference_N, force_N = time_s[on], reference_N[on], force_N[on]
    error_N = (force_N - reference_N)[time_s > time_s[0] + LEAD_HOLD_S]
    ratio, lag_s = _ratio(time_s[len(time_s) // 3 :], reference_N[len(time_s) // 3 :], force_N[len(time_s) // 3 :])
    return Followed(
        rms_error_N=float(np.sqrt(np.mean(error_N**2))),
        largest_error_N=float(np.max(np.abs(error_N))),
        amplitude_ratio=ratio,
        lag_s=lag_s,
    )


def _ratio(time_s: Column, reference_N: Column, force_N: Column) -> tuple[float | None, float | None]:
    """Amplitude ratio and lag [s] at the strongest frequency of the reference above LEAST_HZ."""
    grid_s = np.arange(time_s[0], time_s[-1], 1e-3)
    window = np.hanning(len(grid_s))
    given, actual = (np.interp(grid_s, time_s, signal) for signal in (reference_N, force_N))
    spectra = [np.fft.rfft((signal - np.mean(signal)) * window) for signal in (given, actual)]
    frequency_Hz = np.fft.rfftfreq(len(grid_s), 1e-3)
    strength = np.where(frequency_Hz > LEAST_HZ, np.abs(spectra[0]), 0.0)
    at = int(np.argmax(strength))
    if strength[at] * 4 / len(grid_s) < LEAST_AMPLITUDE_N:
        return None, None
    transfer = complex(spectra[1][at] / spectra[0][at])
    return abs(transfer), float(-np.angle(transfer) / (2 * np.pi * frequency_Hz[at]))


def _plateau(time_s: Column, given_N: float, force_N: Column) -> Plateau:
    steady = force_N[time_s - time_s[0] >= SETTLE_S]
    error_N = steady - given_N
    largest_N = float(np.max(np.abs(error_N)))
    return Plateau(
        given_N=given_N,
        actual_N=float(np.mean(steady)),
        error_N=float(np.mean(error_N)),
        error_percent=100 * float(np.mean(error_N)) / given_N,
        max_error_N=largest_N,
        max_error_percent=100 * largest_N / given_N,
        rms_error_N=float(np.sqrt(np.mean(error_N**2))),
        overshoot_percent=100 * max(0.0, float(np.max(force_N)) / given_N - 1),
        settling_s=_settling(time_s, np.abs(force_N - given_N) <= max(0.02 * given_N, 0.02)),
    )


def _settling(time_s: Column, inside: NDArray[np.bool_]) -> float | None:
    outside = np.flatnonzero(~inside)
    if len(outside) == 0:
        return 0.0
    return None if outside[-1] == len(inside) - 1 else float(time_s[outside[-1] + 1] - time_s[0])


def _moving_mean(values: Column, width: int) -> Column:
    padded = np.concatenate([np.full(width - 1, values[0]), values])
    return np.convolve(padded, np.full(width, 1.0 / width), mode="valid")
