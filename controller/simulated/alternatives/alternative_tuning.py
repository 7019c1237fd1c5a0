"""Gains of the alternatives: the best that keep the law's own margins on the same tissues with the same spare delay.

Ratio of both gains and corner of the second integral are searched, and of each pair the fastest is taken that keeps
MARGIN_DEG and MARGIN_GAIN over half to twice the stiffness; the best is that with the smallest error where a limb moves
at 2 Hz, at all forces.
"""

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.law.inverse_model import GainRow
from controller.law.loop_response import Column, Complex, Rates, grid, margins
from controller.law.synthesis import LARGEST_STIFFNESS, LEAST_STIFFNESS, MARGIN_DEG, MARGIN_GAIN, SPARE_S
from rig.config.axis_response import AxisResponse

Schedule = Literal["constant", "secant", "tangent"]
DEPTHS, POINTS, COARSE, FINE = 8, 100, 24, 5
LEADS_S = (0.0, 0.003, 0.006, 0.009, 0.012)
DRIFTS_RAD_S = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 30.0)
# Below the least force of any test an alternative need not keep the margins; the law keeps them from contact on.
LEAST_N = 0.25
JUDGED_N = (0.5, 1.0, 2.0, 5.0, 10.0)
MOTION_HZ = 2.0


class TissueAt(NamedTuple):
    """Arrays over depths: stiffness, damping and the schedule's factor there, and whether the depth is judged."""

    tangent_N_mm: Column
    damping_N_s_mm: Column
    factor: Column
    judged: NDArray[np.bool_]


class Tuning(NamedTuple):
    """If = ``integral`` x factor, Pf = ``lead_s`` x If."""

    integral: float
    lead_s: float
    drift_rad_s: float
    mass_s: float = 0.0


def factors(schedule: Schedule, rows: Sequence[GainRow]) -> Column:
    """What the gains are in proportion to at each row: 1, or one over secant or tangent stiffness."""
    if schedule == "constant":
        return np.ones(len(rows))
    tangents = np.array([row.tangent_N_mm for row in rows])
    if schedule == "tangent":
        return 1 / tangents
    depths, forces = np.array([row.depth_mm for row in rows]), np.array([row.force_N for row in rows])
    return np.asarray(np.where(depths > 0, np.maximum(depths, 1e-9) / np.maximum(forces, 1e-9), 1 / tangents))


def tissue_at(schedule: Schedule, rows: Sequence[GainRow], damping_N_s_mm: float) -> TissueAt:
    """Depths evenly spread, and those of the forces that are judged."""
    forces = np.array([row.force_N for row in rows])
    # A model may end below LEAST_N: its last depth is then the only one.
    least = min(int(np.searchsorted(forces, LEAST_N)), len(rows) - 1)
    even = np.linspace(least, len(rows) - 1, DEPTHS).round().astype(int)
    judged = [int(np.abs(forces - force_N).argmin()) for force_N in JUDGED_N]
    at = np.concatenate([even, judged])
    tangents = np.array([row.tangent_N_mm for row in rows])[at]
    return TissueAt(
        tangents, np.full(len(at), damping_N_s_mm), factors(schedule, rows)[at], np.arange(len(at)) >= len(even)
    )


def alternative_loop(
    axis: AxisResponse, rates: Rates, tuning: Tuning, tissue: TissueAt, stiffness: float, omega: Column
) -> Complex:
    """Open loop at each depth, shape (depths, frequencies); a slow sensor's sample stands for cycles."""
    s, t = 1j * omega, rates.cycle_s
    held_s = 0.5 * (rates.sample_s - rates.cycle_s)
    integrator = t / (1 - np.exp(-s * t))
    shape = (tuning.lead_s + integrator) / (1 + tuning.mass_s * s) * (1 + tuning.drift_rad_s * integrator)
    there = np.exp(-s * (axis.delay_s + held_s)) / ((1 + s * axis.lag1_s) * (1 + s * axis.lag2_s))
    plant = stiffness * tissue.tangent_N_mm[:, None] + tissue.damping_N_s_mm[:, None] * s
    return np.asarray(tuning.integral * tissue.factor[:, None] * shape * there * plant)


def tuned(
    axis: AxisResponse, rates: Rates, tissues: Sequence[TissueAt], drifts_rad_s: Sequence[float] = DRIFTS_RAD_S
) -> Tuning:
    """The best for all of ``tissues`` together."""
    tissue = _together(tissues)
    tried = [
        fastest(axis, rates, tissue, Tuning(1.0, float(lead_s), drift_rad_s))
        for lead_s in LEADS_S
        for drift_rad_s in drifts_rad_s
    ]
    return min(tried, key=lambda tuning: motion_error(axis, rates, tuning, tissue))


def _together(tissues: Sequence[TissueAt]) -> TissueAt:
    return TissueAt(*(np.concatenate(columns) for columns in zip(*tissues, strict=True)))


def fastest(axis: AxisResponse, rates: Rates, tissue: TissueAt, tuning: Tuning) -> Tuning:
    """The largest ``integral`` that keeps the margins on every tissue; 0 where none does.

    Of two integrals too little gain is as bad as too much: tried from the top down, then made finer.
    """
    for integral in np.geomspace(1e3, 1e-1, COARSE) / tissue.factor.max():
        if keeps(axis, rates, tuning._replace(integral=float(integral)), tissue):
            break
    else:
        return tuning._replace(integral=0.0)
    low, high = float(integral), float(integral) * 1e4 ** (1 / (COARSE - 1))
    for _ in range(FINE):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if keeps(axis, rates, tuning._replace(integral=middle), tissue) else (low, middle)
    return tuning._replace(integral=low)


def keeps(axis: AxisResponse, rates: Rates, tuning: Tuning, tissue: TissueAt) -> bool:
    """Whether the product's margins are kept, with its spare delay."""
    phase_deg, gain = worst(axis._replace(delay_s=axis.delay_s + SPARE_S), rates, tuning, tissue)
    return phase_deg >= MARGIN_DEG and gain >= MARGIN_GAIN


def worst(
    axis: AxisResponse, rates: Rates, tuning: Tuning, tissue: TissueAt, points: int = POINTS
) -> tuple[float, float]:
    """The smallest phase margin [deg] and gain margin over half to twice the stiffness."""
    omega = grid(rates, points)
    all_stiffness = LEAST_STIFFNESS, 1.0, LARGEST_STIFFNESS
    loop = np.concatenate([alternative_loop(axis, rates, tuning, tissue, one, omega) for one in all_stiffness])
    if np.abs(loop[:, -1]).max() >= 1:
        return 0.0, 1.0  # it crosses nowhere, so that nothing would be found amiss
    found = margins(loop, omega)
    return float(np.min(found.phase_deg)), float(np.min(found.gain))


def motion_error(axis: AxisResponse, rates: Rates, tuning: Tuning, tissue: TissueAt) -> float:
    """Mean logarithm of the error [N] that a millimetre of limb at 2 Hz leaves at the forces judged."""
    omega = np.array([2 * math.pi * MOTION_HZ])
    left = 1 / np.abs(1 + alternative_loop(axis, rates, tuning, tissue, 1.0, omega)[:, 0])
    moved = np.abs(tissue.tangent_N_mm + 1j * omega * tissue.damping_N_s_mm)
    return float(np.mean(np.log(left * moved)[tissue.judged]))
