"""Effects of the tissue itself: it remembers, tires, stiffens over what lies beneath, and sticks."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from mock_devices.physics import STEP_S
from mock_devices.physics.chain import Elastic, Factor, Hereditary, Pull, Viscous, knob

REFERENCE_MM_S = 10.0
# The slowest touch of a program; down to zero, a power or a step would chatter with the ripple of an axis at rest.
LINEAR_BELOW_MM_S = 0.5
FULL_PULL_MM_S = 0.5
LETS_GO_LENGTHS = 3.0  # exp(-9) of the pull is left, a ten-thousandth


@dataclass
class ElasticLaw(Elastic):
    """Another elastic law, as strong as the index law at one depth: a power law, Fung's exponential, or a mixture."""

    weight: float = knob(1.0, 0, 1, "0: index law, 1: wholly the other law")
    exponent: float = knob(2.0, 0.5, 5, "n of the power law x^n")
    fung_share: float = knob(0.0, 0, 1, "0: power law, 1: Fung's exp(b x) - 1")
    fung_per_mm: float = knob(0.3, 0.01, 2, "b of Fung's law")
    match_depth_mm: float = knob(8.0, 0.5, 20, "where both laws give the same force")

    def __call__(self, law: Callable[[float], float], depth_mm: float) -> float:
        """Newtons at ``depth_mm``."""
        power = math.pow(depth_mm / self.match_depth_mm, self.exponent)
        fung = math.expm1(self.fung_per_mm * depth_mm) / math.expm1(self.fung_per_mm * self.match_depth_mm)
        other = law(self.match_depth_mm) * ((1 - self.fung_share) * power + self.fung_share * fung)
        return (1 - self.weight) * law(depth_mm) + self.weight * other


@dataclass
class Substrate(Factor):
    """Something stiff beneath: elastic force x (1 + s (depth / h)^3)."""

    strength: float = knob(0.5, 0, 20, "s")
    thickness_mm: float = knob(10.0, 1, 60, "h")

    def __call__(self, depth_mm: float, _time_s: float) -> float:
        """The factor at this depth."""
        return 1.0 + self.strength * (depth_mm / self.thickness_mm) ** 3


@dataclass
class Preconditioning(Factor):
    """Softening by use: factor 1 + m (exp(-n / n0) - 1) after n cycles, which rest makes forgotten.

    A cycle counts once it went deeper than ``COUNTS_MM``.
    """

    softening: float = knob(0.2, 0, 0.9, "m, the share of stiffness lost in the end")
    cycles: float = knob(4.0, 0.3, 100, "n0, cycles after which 63 % of it is lost")
    recovery_s: float = knob(600.0, 1, 1e6, "rest after which 37 % of the cycles still count")
    _cycles: float = field(default=0.0, init=False)
    _deepest_mm: float = field(default=0.0, init=False)
    _last_s: float = field(default=0.0, init=False)

    COUNTS_MM = 1.0

    def __call__(self, depth_mm: float, time_s: float) -> float:
        """The factor in this cycle."""
        gap_s = time_s - self._last_s
        self._last_s = time_s
        if gap_s > 2 * STEP_S:
            self._cycles += self._deepest_mm > self.COUNTS_MM
            self._cycles *= math.exp(-gap_s / self.recovery_s)
            self._deepest_mm = 0.0
        self._deepest_mm = max(self._deepest_mm, depth_mm)
        return 1.0 + self.softening * math.expm1(-self._cycles / self.cycles)


@dataclass
class RateLaw(Viscous):
    """Viscous force level (|v| / 10 mm/s)^n sign(v) instead of B v; straight below 0.5 mm/s."""

    exponent: float = knob(0.4, 0.2, 1.5, "n")
    level_N: float = knob(0.4, 0, 2, "force at 10 mm/s")

    def __call__(self, speed_mm_s: float, _elastic_N: float) -> float:
        """Newtons at this speed."""
        speed = max(abs(speed_mm_s), LINEAR_BELOW_MM_S)
        return self.level_N * math.pow(speed / REFERENCE_MM_S, self.exponent) * speed_mm_s / speed


@dataclass
class HuntCrossleyDamping(Viscous):
    """Viscous force lambda v times the elastic one instead of B v, so that none is there at contact."""

    damping_s_mm: float = knob(0.01, 0, 0.2, "lambda")

    def __call__(self, speed_mm_s: float, elastic_N: float) -> float:
        """Newtons at this speed and load."""
        return self.damping_s_mm * speed_mm_s * elastic_N


@dataclass
class Mullins(Factor):
    """Softening by the largest load borne: factor 1 - m erf((X^2 - x^2) / r^2), X the deepest so far (Mullins 1969)."""

    softening: float = knob(0.3, 0, 0.9, "m, the largest share lost")
    reach_mm: float = knob(4.0, 0.2, 40, "r, in depth as a spring's energy has it")
    _deepest_mm: float = field(default=0.0, init=False)

    def __call__(self, depth_mm: float, _time_s: float) -> float:
        """The factor at this depth."""
        self._deepest_mm = max(self._deepest_mm, depth_mm)
        return 1.0 - self.softening * math.erf((self._deepest_mm**2 - depth_mm**2) / self.reach_mm**2)


@dataclass
class PowerLawRelaxation(Hereditary):
    """Fractional memory: what a rise of the elastic force leaves fades as g (1 + t / t0)^-n."""

    ratio: float = knob(0.5, 0, 3, "g, at once")
    begin_s: float = knob(0.02, 0.002, 10, "t0")
    exponent: float = knob(0.3, 0.1, 2, "n")
    _elastic_N: float = field(default=0.0, init=False)

    WIDTH, SLOWEST, FASTEST = 0.5, -14.0, 2.5  # of ln s below; the fastest holds exp(-12) of the rest

    def __post_init__(self) -> None:
        # Gamma(n) (1 + t/t0)^-n is the integral of s^n exp(-s) exp(-s t/t0) over ln s; what is slower stands still.
        places = [self.SLOWEST + self.WIDTH * k for k in range(round((self.FASTEST - self.SLOWEST) / self.WIDTH) + 1)]
        shares = [self.WIDTH * math.exp(self.exponent * u - math.exp(u)) / math.gamma(self.exponent) for u in places]
        shares[0] += 1.0 - math.fsum(shares)
        keep = [math.exp(-STEP_S / self.begin_s * math.exp(u)) for u in places]
        self._terms = [(kept, self.ratio * share * math.sqrt(kept)) for kept, share in zip(keep, shares, strict=True)]
        self._left_N = [0.0] * len(places)

    def __call__(self, elastic_N: float) -> float:
        """Newtons that relax."""
        rise_N, self._elastic_N = elastic_N - self._elastic_N, elastic_N
        pairs = zip(self._terms, self._left_N, strict=True)
        self._left_N = [kept * left_N + gain * rise_N for (kept, gain), left_N in pairs]
        return math.fsum(self._left_N)


@dataclass
class Relaxation(Hereditary):
    """A Prony term: q' = -q / tau + g dF/dt of the elastic force; q is added to it."""

    ratio: float = knob(0.3, 0, 1.5, "g")
    time_constant_s: float = knob(0.8, 0.02, 100, "tau")
    _q_N: float = field(default=0.0, init=False)
    _elastic_N: float = field(default=0.0, init=False)

    def __post_init__(self) -> None:
        self._keep = math.exp(-STEP_S / self.time_constant_s)
        self._gain = self.ratio * math.exp(-STEP_S / 2 / self.time_constant_s)

    def __call__(self, elastic_N: float) -> float:
        """Newtons that relax."""
        self._q_N = self._keep * self._q_N + self._gain * (elastic_N - self._elastic_N)
        self._elastic_N = elastic_N
        return self._q_N


@dataclass
class Adhesion(Pull):
    """The tip sticks: -level exp(-(depth / l)^2) while it leaves, until it is 3 l away; full above 0.5 mm/s."""

    level_N: float = knob(0.3, 0, 5, "pull at the surface")
    length_mm: float = knob(0.5, 0.02, 5, "l")
    _stuck: bool = field(default=False, init=False)

    def __call__(self, depth_mm: float, speed_mm_s: float, present: bool) -> float:
        """Newtons, never above zero."""
        self._stuck = present and (depth_mm > 0 or (self._stuck and depth_mm > -LETS_GO_LENGTHS * self.length_mm))
        if not self._stuck or speed_mm_s >= 0:
            return 0.0
        share = min(-speed_mm_s / FULL_PULL_MM_S, 1.0)
        return -self.level_N * share * math.exp(-((depth_mm / self.length_mm) ** 2))
