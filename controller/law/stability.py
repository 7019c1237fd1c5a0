"""How stable the force loop is at each force, over all that the model leaves open, and what it can do."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from controller.law import synthesis
from controller.law.inverse_model import GainRow
from controller.law.loop_response import (
    Column,
    Complex,
    Constants,
    Margins,
    Rates,
    TrueTissue,
    grid,
    margins,
    noise_share,
    open_loop,
)
from controller.law.synthesis import Span, as_modelled, over_span, tissues, tolerated
from rig.config.axis_response import AxisResponse

MOTION_HZ = 1.0  # between breathing (0.25 Hz) and the pulse and a limb that is moved (2 Hz)


class ForceLoop(NamedTuple):
    """The law on its axis, for the tissue that it was made for."""

    axis: AxisResponse
    rates: Rates
    law: Constants
    span: Span

    def at(self, row: GainRow, damping_N_s_mm: float) -> "ForceLoop":
        """The same at one depth alone."""
        corners, shares = (row.tangent_N_mm / row.damping_N_s_mm,), (damping_N_s_mm / row.damping_N_s_mm,)
        return self._replace(span=self.span._replace(corners_rad_s=corners, damping_shares=shares))

    def response(self, stiffness: float, omega: Column) -> Complex:
        """Open loop at each of the span's depths on tissue so many times as stiff, shape (depths, frequencies)."""
        tissue = as_modelled(self.span)
        factor = np.full_like(np.asarray(tissue.stiffness), stiffness)
        return open_loop(self.axis, self.rates, self.law, TrueTissue(tissue[0], factor, tissue[2]), omega)

    def margins(self, stiffness: float = 1.0) -> Margins:
        """At each of the span's depths on tissue so many times as stiff."""
        omega = grid(self.rates, 1000)
        return margins(self.response(stiffness, omega), omega)

    def worst(self) -> tuple[float, float]:
        """The smallest phase margin [deg] and gain margin over the span."""
        found = over_span(self.axis, self.rates, self.law, self.span)
        return float(np.min(found.phase_deg)), float(np.min(found.gain))

    def tolerated(self) -> Column:
        """Stiffness over the model's at which the loop begins to oscillate, at each of the span's depths."""
        return tolerated(self.axis, self.rates, self.law, self.span)

    def left_of_motion(self, frequency_Hz: float = MOTION_HZ) -> float:
        """|1 / (1 + L)|, the largest over the span's depths as modelled."""
        omega = np.array([2 * math.pi * frequency_Hz])
        return float(np.max(np.abs(1 / (1 + self.response(1.0, omega)))))

    def noise_share(self) -> float:
        """Of one sample's noise, in the tissue's force; the largest over the span's depths as modelled."""
        omega = grid(self.rates)
        return float(np.max(noise_share(self.response(1.0, omega), omega, self.rates)))

    def largest_sensitivity(self) -> float:
        """The largest |1 / (1 + L)| over all of the span's tissues and frequencies: 1 over the distance from -1."""
        omega = grid(self.rates, 1000)
        loop = open_loop(self.axis, self.rates, self.law, tissues(self.span), omega)
        return float(np.max(np.abs(1 / (1 + loop))))


def loop_for(axis: AxisResponse, rates: Rates, span: Span) -> ForceLoop:
    """The loop with the law that is made for it; raises UsageError where there is none."""
    return ForceLoop(axis, rates, synthesis.constants(axis, rates, span), span)


def nearest(rows: Sequence[GainRow], forces_N: Sequence[float]) -> list[GainRow]:
    """For each force the row that is nearest to it."""
    return [min(rows, key=lambda row: abs(row.force_N - force_N)) for force_N in forces_N]
