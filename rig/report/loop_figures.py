"""Pictures of an open force loop: Bode, Nyquist beside what keeps it from -1, and sensitivity."""

from collections.abc import Mapping
from typing import TypeAlias

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from rig.report.drawing import dress, new_figure, speed_colors
from rig.report.ink import INK, QUIET, SMALL_PT
from rig.tissue.laws import FloatArray

Loops: TypeAlias = Mapping[str, NDArray[np.complex128]]


def bode_figure(frequency_Hz: FloatArray, loops: Loops) -> Figure:
    """Open loops by name, each of the shape of ``frequency_Hz``: gain and phase over frequency."""
    figure = new_figure(8.0, 5.4)
    gain, phase = figure.subplots(2, 1, sharex=True)
    dress(gain, "Open loop at several forces", "", "gain")
    dress(phase, "", "frequency, Hz", "phase, deg")
    for (name, loop), color in zip(loops.items(), speed_colors(len(loops)), strict=True):
        angle = np.unwrap(np.angle(loop))
        gain.loglog(frequency_Hz, np.abs(loop), color=color, linewidth=1.3, label=name)
        turns = np.ceil(angle[0] / (2 * np.pi))
        phase.semilogx(frequency_Hz, np.degrees(angle - 2 * np.pi * turns), color=color, linewidth=1.3)
    gain.axhline(1.0, color=QUIET, linewidth=0.8)
    phase.axhline(-180.0, color=QUIET, linewidth=0.8)
    phase.set_ylim(-360, 0)
    gain.legend(frameon=False, fontsize=SMALL_PT, labelcolor=INK)
    return figure


def nyquist_figure(frequency_Hz: FloatArray, loops: Loops) -> Figure:
    """Open loops around -1 with the circle of a sensitivity of 2, and sensitivity over frequency."""
    figure = new_figure(9.0, 4.4)
    plane, sensitivity = figure.subplots(1, 2)
    dress(plane, "Nyquist", "real part", "imaginary part")
    dress(sensitivity, "Sensitivity |1 / (1 + L)|", "frequency, Hz", "")
    turn = np.linspace(0, 2 * np.pi, 200)
    plane.plot(-1 + 0.5 * np.cos(turn), 0.5 * np.sin(turn), color=QUIET, linewidth=0.8)
    plane.plot([-1], [0], "+", color=INK)
    for (name, loop), color in zip(loops.items(), speed_colors(len(loops)), strict=True):
        plane.plot(loop.real, loop.imag, color=color, linewidth=1.3, label=name)
        sensitivity.loglog(frequency_Hz, np.abs(1 / (1 + loop)), color=color, linewidth=1.3)
    plane.set(xlim=(-3, 1), ylim=(-2.5, 1.5), aspect="equal")
    sensitivity.axhline(1.0, color=QUIET, linewidth=0.8)
    plane.legend(frameon=False, fontsize=SMALL_PT, labelcolor=INK)
    return figure
