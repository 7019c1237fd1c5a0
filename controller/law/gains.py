"""From a tissue model and the axis' bandwidth to the gains of the force loop.

The plant from commanded position to measured force, at one depth, is

    P(s) = (k + B s) w / (s + w) exp(-s T)

with k the tangent stiffness, B the damping, w the -3 dB frequency of the drive's position loop and T the delay of
command, bus and sensor. At the crossover wc the PI law C(s) = Pf + If / s must have gain 1 / |P| and
phase PM - pi - arg P, which solve for Pf and If exactly. Damping makes |P| rise with frequency: where the loop would
come too near to 1 again at the frequency at which its phase is -180 degrees, both gains are lowered until it does not.
The law's second integral, (1 + wd / s), is counted with the plant.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

from controller.law.force_position import GainRow
from rig.errors import UsageError
from rig.tissue.model import Model

Choice = Literal["tangent", "secant", "constant", "admittance"]

# Stiffness may be this much higher than the model says, and the loop must still be this far from instability.
STIFFNESS_ERROR = 0.5
LEAST_MARGIN_DEG = 30.0  # the lower end of what textbooks ask for (30 to 60 deg)
HIGHEST_HZ = 500.0  # half of the rate of a loop of 1 kHz
GRID = 200


@dataclass(frozen=True)
class Design:
    """What the gains are designed for: the axis as it is, and the loop as it is wanted."""

    bandwidth_Hz: float
    delay_s: float
    crossover_Hz: float
    phase_margin_deg: float
    gain_margin: float = 3.0
    drift_Hz: float = 0.0

    @property
    def lag_s(self) -> float:
        """How much later than its command the axis' force shows, for slow changes."""
        return self.delay_s + 1 / (2 * math.pi * self.bandwidth_Hz)


class Margins(NamedTuple):
    """How far a loop is from instability."""

    crossover_Hz: float
    phase_deg: float
    gain: float


def plant(tangent_N_mm: float, damping_N_s_mm: float, design: Design, frequency_Hz: float) -> tuple[float, float]:
    """Gain [N/mm] and phase [rad, not wrapped] from the PI law's output to measured force."""
    w, axis = 2 * math.pi * frequency_Hz, 2 * math.pi * design.bandwidth_Hz
    drift = design.drift_Hz / frequency_Hz
    gain = math.hypot(tangent_N_mm, w * damping_N_s_mm) * axis / math.hypot(axis, w) * math.hypot(1.0, drift)
    lag = math.atan2(w, axis) + w * design.delay_s + math.atan(drift)
    return gain, math.atan2(w * damping_N_s_mm, tangent_N_mm) - lag


def open_loop(
    gains: tuple[float, float], tangent_N_mm: float, damping_N_s_mm: float, design: Design, frequency_Hz: float
) -> tuple[float, float]:
    """Gain and phase [rad, not wrapped] of C P, for ``gains`` Pf and If."""
    gain, phase = plant(tangent_N_mm, damping_N_s_mm, design, frequency_Hz)
    lag = gains[1] / (2 * math.pi * frequency_Hz)
    return math.hypot(gains[0], lag) * gain, math.atan2(-lag, gains[0]) + phase


def margins(
    gains: tuple[float, float], tangent_N_mm: float, damping_N_s_mm: float, design: Design, low_Hz: float = 0.01
) -> Margins:
    """Crossover, phase margin there, and gain margin; the smallest phase margin where unity is crossed more often."""
    grid = [low_Hz * (HIGHEST_HZ / low_Hz) ** (i / GRID) for i in range(GRID + 1)]
    loop = [open_loop(gains, tangent_N_mm, damping_N_s_mm, design, f) for f in grid]

    def crossing(part: int, level: float, at: int) -> float:
        low, high = grid[at], grid[at + 1]
        rising = loop[at][part] < level
        for _ in range(50):
            middle = math.sqrt(low * high)
            value = open_loop(gains, tangent_N_mm, damping_N_s_mm, design, middle)[part]
            low, high = (middle, high) if (value < level) == rising else (low, middle)
        return math.sqrt(low * high)

    unity = [crossing(0, 1.0, i) for i in range(GRID) if (loop[i][0] - 1) * (loop[i + 1][0] - 1) <= 0]
    turned = [crossing(1, -math.pi, i) for i in range(GRID) if loop[i][1] > -math.pi >= loop[i + 1][1]]
    phases = [math.degrees(open_loop(gains, tangent_N_mm, damping_N_s_mm, design, f)[1]) + 180.0 for f in unity]
    largest = max((open_loop(gains, tangent_N_mm, damping_N_s_mm, design, f)[0] for f in turned), default=0.0)
    return Margins(unity[0] if unity else math.nan, min(phases, default=180.0), 1 / largest if largest else math.inf)


def pi_gains(tangent_N_mm: float, damping_N_s_mm: float, design: Design) -> tuple[float, float]:
    """Pf [mm/N] and If [mm/(N s)] for the wanted crossover and margins; raises UsageError where none exist."""
    wc = 2 * math.pi * design.crossover_Hz
    plant_gain, plant_phase = plant(tangent_N_mm, damping_N_s_mm, design, design.crossover_Hz)
    law_phase = math.radians(design.phase_margin_deg) - math.pi - plant_phase
    if law_phase >= 0:
        raise UsageError(
            f"no PI law reaches {design.crossover_Hz:g} Hz with {design.phase_margin_deg:g} deg"
            f" at {tangent_N_mm:g} N/mm: lower loop.crossover_Hz or loop.phase_margin_deg"
        )
    # Below -90 degrees the proportional part would be negative; the integrator alone then has the margin there is.
    lead, lag = (math.cos(law_phase), -math.sin(law_phase)) if law_phase > -math.pi / 2 else (0.0, 1.0)
    gains = lead / plant_gain, lag * wc / plant_gain
    found = margins(gains, tangent_N_mm, damping_N_s_mm, design)
    lower = min(1.0, found.gain / design.gain_margin)
    gains = gains[0] * lower, gains[1] * lower
    _refuse_fragile(gains, tangent_N_mm, damping_N_s_mm, design)
    return gains


def _refuse_fragile(gains: tuple[float, float], tangent_N_mm: float, damping_N_s_mm: float, design: Design) -> None:
    """Raises UsageError where tissue stiffer than the model by STIFFNESS_ERROR would leave too little margin."""
    stiff_N_mm = (1 + STIFFNESS_ERROR) * tangent_N_mm
    left = margins(gains, stiff_N_mm, damping_N_s_mm, design).phase_deg
    if left < LEAST_MARGIN_DEG:
        raise UsageError(
            f"at {tangent_N_mm:.3g} N/mm and {design.crossover_Hz:g} Hz, tissue {100 * STIFFNESS_ERROR:.0f} % stiffer"
            f" than the model would leave {left:.0f} deg of phase margin (bound {LEAST_MARGIN_DEG:g} deg):"
            " lower loop.crossover_Hz"
        )


def _refuse_unstable(
    choice: Choice, gains: tuple[float, float], tangent_N_mm: float, damping_N_s_mm: float, design: Design
) -> None:
    """Raises UsageError where gains made for another stiffness make the loop unstable on the model's own tissue."""
    left = margins(gains, tangent_N_mm, damping_N_s_mm, design)
    if left.phase_deg <= 0 or left.gain <= 1:
        raise UsageError(
            f"{choice} gains for {design.crossover_Hz:g} Hz are unstable where the model has {tangent_N_mm:.3g} N/mm:"
            f" phase margin {left.phase_deg:.0f} deg, gain margin {left.gain:.2f} (bounds 0 and 1);"
            " use tangent gains or lower loop.crossover_Hz"
        )


def schedule(
    model: Model, design: Design, depths_mm: Sequence[float], choice: Choice = "tangent"
) -> tuple[GainRow, ...]:
    """Gains at each depth; force must grow with depth, tangent stiffness must be positive.

    ``tangent`` is the design. The others are what it is compared with: ``secant`` takes F / x for the stiffness,
    ``constant`` one stiffness for all depths (least squares through contact) in gains and inverse model, and
    ``admittance`` is a damper, v = e / D, with D for the stiffest depth.
    """
    forces = [model.force_N(depth_mm) for depth_mm in depths_mm]
    tangents = [model.tangent_N_mm(depth_mm) for depth_mm in depths_mm]
    _refuse_flat(depths_mm, forces, tangents)
    damping = model.damping_N_s_mm
    if choice == "admittance":
        stiffest = pi_gains(max(tangents), damping, design)
        mobility = math.hypot(stiffest[0] * 2 * math.pi * design.crossover_Hz, stiffest[1])
        stiffness, gains = tangents, [(0.0, mobility)] * len(tangents)
    elif choice == "constant":
        one = sum(d * f for d, f in zip(depths_mm, forces, strict=True)) / sum(d * d for d in depths_mm)
        depths_mm = [force / one for force in forces]
        stiffness, gains = [one] * len(forces), [pi_gains(one, damping, design)] * len(forces)
    else:
        secants = [f / d if d > 0 else k for d, f, k in zip(depths_mm, forces, tangents, strict=True)]
        stiffness = secants if choice == "secant" else tangents
        gains = [pi_gains(k, damping, design) for k in stiffness]
    for found, tangent in zip(gains, tangents, strict=True):
        _refuse_unstable(choice, found, tangent, damping, design)
    return tuple(
        GainRow(force_N=f, depth_mm=d, tangent_N_mm=k, proportional_mm_N=g[0], integral_mm_N_s=g[1])
        for f, d, k, g in zip(forces, depths_mm, stiffness, gains, strict=True)
    )


def _refuse_flat(depths_mm: Sequence[float], forces: Sequence[float], tangents: Sequence[float]) -> None:
    for at, (depth_mm, tangent) in enumerate(zip(depths_mm, tangents, strict=True)):
        if not tangent > 0 or (at and forces[at] <= forces[at - 1]):
            raise UsageError(
                f"the model's tangent stiffness at {depth_mm:.3g} mm is {tangent:.3g} N/mm; gains need it above 0:"
                " use a model fitted up to that depth, of a law that is stiff from contact on (rig fit --model index)"
            )
