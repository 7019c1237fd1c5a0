"""The force loop as transfer functions, for python-control: the same plant and gains that `gains` designs with."""

from typing import NamedTuple

import control
import numpy as np
from numpy.typing import NDArray

from controller.law.force_position import GainRow
from controller.law.gains import Design

Column = NDArray[np.float64]
PADE_ORDER = 2
LOWEST_HZ, HIGHEST_HZ = 0.1, 100.0  # a twentieth of the lowest crossover (2 Hz), five times the highest (18 Hz)


class Bode(NamedTuple):
    """Frequency response of an open loop, each of shape (n,); phase is not wrapped."""

    frequency_Hz: Column
    gain: Column
    phase_deg: Column


def plant(tangent_N_mm: float, damping_N_s_mm: float, design: Design) -> control.TransferFunction:
    """Commanded position [mm] to measured force [N]; the delay as a Pade approximation."""
    axis = 2 * np.pi * design.bandwidth_Hz
    delay = control.tf(*control.pade(design.delay_s, PADE_ORDER))
    return control.tf([damping_N_s_mm, tangent_N_mm], [1.0]) * control.tf([axis], [1.0, axis]) * delay


def open_loop(row: GainRow, tangent_N_mm: float, damping_N_s_mm: float, design: Design) -> control.TransferFunction:
    """C P with the gains of ``row`` on tissue of ``tangent_N_mm``."""
    law = control.tf([row.proportional_mm_N, row.integral_mm_N_s], [1.0, 0.0])
    drift = control.tf([1.0, 2 * np.pi * design.drift_Hz], [1.0, 0.0])
    return law * (drift if design.drift_Hz else 1) * plant(tangent_N_mm, damping_N_s_mm, design)


def bode(loop: control.TransferFunction) -> Bode:
    """Gain and phase from LOWEST_HZ to HIGHEST_HZ."""
    frequency_Hz = np.geomspace(LOWEST_HZ, HIGHEST_HZ, 300)
    response = np.asarray(loop(2j * np.pi * frequency_Hz))
    return Bode(frequency_Hz, np.abs(response), np.degrees(np.unwrap(np.angle(response))))


def step_response(loop: control.TransferFunction, time_s: Column) -> Column:
    """Measured force after a unit step of the reference, feedback alone, shape of ``time_s``."""
    return np.asarray(control.step_response(control.feedback(loop, 1), time_s).outputs)
