"""The limb: where its surface is, and the force it answers a tip with."""

import math

from mock_devices.parameters import Surface, Tissue
from mock_devices.physics import STEP_S
from mock_devices.physics.chain import Chain


class Limb:
    """The surface, which can be moved while the bench runs, and never jumps."""

    def __init__(self, surface: Surface) -> None:
        self.wanted_mm = surface.position_mm
        self._rest_mm = surface.position_mm
        self.speed_limit_mm_s = surface.speed_mm_s
        self.position_mm = surface.position_mm
        self.speed_mm_s = 0.0

    def step(self, chain: Chain, time_s: float, touching: bool) -> float:
        """Where the surface is one step later."""
        if self._rest_mm != self.wanted_mm:
            way_mm = self.wanted_mm - self._rest_mm
            stride_mm = self.speed_limit_mm_s * STEP_S
            self._rest_mm += max(-stride_mm, min(way_mm, stride_mm))
        position_mm = self._rest_mm
        for shift in chain.surface:
            position_mm += shift(time_s, touching)
        self.speed_mm_s = (position_mm - self.position_mm) / STEP_S
        self.position_mm = position_mm
        return position_mm


class TissueLaw:
    """F = scale a x exp(b x) + B v in contact, never negative; hidden effects stand where physics puts them."""

    def __init__(self, tissue: Tissue) -> None:
        self.stiffness_scale = tissue.stiffness_scale
        self.present = tissue.present
        self.inclusion_mm, self.inclusion_N_mm = tissue.inclusion_mm, tissue.inclusion_N_mm
        self._a, self._b, self._viscosity = tissue.a_N_mm, tissue.b_per_mm, tissue.damping_N_s_mm

    def elastic_N(self, depth_mm: float) -> float:
        """The index law at rest, without any hidden effect."""
        return self.stiffness_scale * self._a * depth_mm * math.exp(self._b * depth_mm)

    def included_N(self, depth_mm: float) -> float:
        """What something stiff inside adds once the tip has reached it: a straight line from its depth on."""
        return self.inclusion_N_mm * max(depth_mm - self.inclusion_mm, 0.0)

    def force_N(self, chain: Chain, depth_mm: float, speed_mm_s: float, time_s: float) -> float:
        """Compressive force on the tip; below zero only where an adhesion is hidden."""
        inside = self.present and depth_mm > 0
        if not inside and not chain.acts_in_air:
            return 0.0
        elastic_N = viscous_N = 0.0
        if inside:
            elastic_N = self.elastic_N(depth_mm) if chain.elastic is None else chain.elastic(self.elastic_N, depth_mm)
            for factor in chain.factors:
                elastic_N *= factor(depth_mm, time_s)
            elastic_N += self.included_N(depth_mm)
            viscous_N = self._viscosity * speed_mm_s if chain.viscous is None else chain.viscous(speed_mm_s, elastic_N)
        force_N = elastic_N + viscous_N
        for memory in chain.memories:
            force_N += memory(elastic_N)
        force_N = force_N if inside and force_N > 0 else 0.0
        for pull in chain.pulls:
            force_N += pull(depth_mm, speed_mm_s, self.present)
        return force_N
