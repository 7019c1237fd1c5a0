"""The study's solver: explicit Euler in time until velocities and accelerations are small.

v' = v + h a, x' = x + h v'; a = (f - gamma v)/m (its equation 4; which velocity moves the position is not stated). On
the lattice's stiffest mode w^2 = 12 k/m, c = gamma/m: with the old velocity it is stable for h < c/w^2 = gamma/(12 k),
with the new one for h^2 w^2 < 4 - 2 h c. Only the reading "raw numbers, new velocity" of the study's parameters runs at
its h = 0.01 s; in N, mm, s its mass unit is then the tonne, a million times the stated one, so times are fictitious and
only the rest state means something.
"""

from dataclasses import dataclass

import numpy as np

from rig.errors import RigError, UsageError
from rig.tissue.lattice.fire import NotConverged
from rig.tissue.lattice.numba_types import Floats, sum_loop
from rig.tissue.lattice.state import Loaded
from rig.tissue.lattice.steps import parts
from rig.tissue.lattice.threads import in_parts

_HIGHEST_MODE = 12.0  # largest eigenvalue of the 18-neighbour lattice over k, at the zone edge
_CELL_MODE = 16.0  # bound on the volume term's share over kv: 8 corners of 8 cells, three edges each
_RUNAWAY = 1e6


class Unstable(RigError):
    """The time step lets the stiffest mode grow; the message gives the largest stable step."""


@dataclass(frozen=True)
class EulerScheme:
    """Mass of a vertex in t (N s^2/mm), drag in N s/mm, step in s; thresholds on every component, mm/s and mm/s^2."""

    mass_t: float = 0.001
    drag_N_s_mm: float = 0.0005
    step_s: float = 0.01
    new_velocity: bool = True
    velocity_threshold_mm_s: float = 0.0005
    acceleration_threshold_mm_s2: float = 0.0005

    def __post_init__(self) -> None:
        for name, value in (("mass", self.mass_t), ("drag", self.drag_N_s_mm), ("time step", self.step_s)):
            if not (np.isfinite(value) and value > 0.0):
                raise UsageError(f"{name} of the Euler scheme is {value}; it must be a number above 0")

    def largest_step_s(self, k_N_mm: float, cell_N_mm: float = 0.0) -> float:
        """Largest stable h near rest for springs of k and cells of kv/d^2, both N/mm."""
        stiffness = _HIGHEST_MODE * k_N_mm + _CELL_MODE * cell_N_mm
        if not self.new_velocity:
            return self.drag_N_s_mm / stiffness
        damping, squared = self.drag_N_s_mm / self.mass_t, stiffness / self.mass_t
        return float((-damping + np.sqrt(damping**2 + 4.0 * squared)) / squared)

    def growth_per_step(self, k_N_mm: float) -> float:
        """Factor by which the stiffest mode changes per step (above 1: diverges)."""
        h, damping, squared = self.step_s, self.drag_N_s_mm / self.mass_t, _HIGHEST_MODE * k_N_mm / self.mass_t
        held = 1.0 - h * damping
        rows = (
            [[1.0 - h * h * squared, h * held], [-h * squared, held]]
            if self.new_velocity
            else [[1.0, h], [-h * squared, held]]
        )
        return float(np.max(np.abs(np.linalg.eigvals(np.array(rows)))))


READINGS: dict[str, EulerScheme] = {
    "raw numbers, new velocity": EulerScheme(),
    "raw numbers, old velocity": EulerScheme(new_velocity=False),
    "strict SI, new velocity": EulerScheme(mass_t=1e-9, drag_N_s_mm=5e-10),
    "strict SI, old velocity": EulerScheme(mass_t=1e-9, drag_N_s_mm=5e-10, new_velocity=False),
}


@sum_loop
def _step_part(
    x: Floats, v: Floats, f: Floats, inverse_mass: Floats, drag: float, h: float, new_velocity: bool
) -> tuple[float, float]:
    speed, acceleration = 0.0, 0.0
    for c in range(x.shape[0]):
        a = (f[c] - drag * v[c]) * inverse_mass[c]
        before = v[c]
        after = before + h * a
        x[c] += h * (after if new_velocity else before)
        v[c] = after
        speed = max(speed, abs(after))
        acceleration = max(acceleration, abs(a))
    return speed, acceleration


def step_all(
    x: Floats, v: Floats, f: Floats, inverse_mass: Floats, drag: float, h: float, new_velocity: bool, threads: int
) -> tuple[float, float]:
    """v += h a, x += h v (new or old v); a = (f - drag v)/m. Returns the largest speed and acceleration found."""
    ranges = parts(x.size, threads)
    peaks = in_parts(
        _step_part, [(x[i:j], v[i:j], f[i:j], inverse_mass[i:j], drag, h, new_velocity) for i, j in ranges]
    )
    return max(speed for speed, _ in peaks), max(acceleration for _, acceleration in peaks)


def run(
    lattice: Loaded,
    scheme: EulerScheme,
    most_steps: int = 20_000,
) -> int:
    """Step from rest until both thresholds are met; returns the number of steps.

    Raises `Unstable` before the numbers overflow and `NotConverged`.
    """
    block = lattice.block
    v = block.allocate()
    inverse_mass = block.allocate()
    inverse_mass[:] = lattice.free / scheme.mass_t
    x, flat_v, flat_m = lattice.x.reshape(-1), v.reshape(-1), inverse_mass.reshape(-1)
    speed = acceleration = np.inf
    runaway = _RUNAWAY * block.spacing_mm / scheme.step_s
    for step in range(most_steps):
        f = lattice.force()
        speed, acceleration = step_all(
            x, flat_v, f.reshape(-1), flat_m, scheme.drag_N_s_mm, scheme.step_s, scheme.new_velocity, lattice.slabs
        )
        if not speed < runaway:
            raise _unstable(lattice, scheme, step + 1, speed)
        if speed < scheme.velocity_threshold_mm_s and acceleration < scheme.acceleration_threshold_mm_s2:
            lattice.force()
            return step + 1
    raise NotConverged(
        f"explicit Euler stopped after {most_steps} steps with {speed:.3g} mm/s and {acceleration:.3g} mm/s^2; "
        f"asked for {scheme.velocity_threshold_mm_s:g} and {scheme.acceleration_threshold_mm_s2:g}"
    )


def _unstable(lattice: Loaded, scheme: EulerScheme, steps: int, speed: float) -> Unstable:
    law, spacing = lattice.law, lattice.block.spacing_mm
    limit = scheme.largest_step_s(law.k, law.cell / spacing**2)
    which = "new" if scheme.new_velocity else "old"
    return Unstable(
        f"explicit Euler with the {which} velocity diverged at step {steps} ({speed:.3g} mm/s): h = "
        f"{scheme.step_s:g} s, but for "
        f"k = {law.k:g} N/mm, m = {scheme.mass_t:g} t and gamma = {scheme.drag_N_s_mm:g} N s/mm it must stay "
        f"below {limit:.3g} s; "
        "raise the mass (statics do not depend on it) or use the fire solver"
    )
