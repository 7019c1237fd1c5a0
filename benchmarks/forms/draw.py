"""What a seed hides, and in which session. What comes of it is computed only where it is asked for."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from benchmarks.forms import bench as adds
from benchmarks.forms import tissue
from benchmarks.forms.noise import NOISES
from benchmarks.forms.session import STEP_S, Bench, Part, Session, record

Random = np.random.Generator
LAW, SOFTENS = frozenset({"elastic_law"}), frozenset({"preconditioning"})
# Times spread over decades are many times: each is said truly by the other.
RELAXES = frozenset({"relaxation", "second_relaxation", "third_relaxation", "power_law_relaxation"})
MOVES, RUBS = frozenset({"surface_motion"}), frozenset({"friction"})
ROTATION = (
    "clean", "tissue", "memory", "outside", "softening", "bench", "clean", "surroundings", "outside", "two",
)  # fmt: skip


@dataclass(frozen=True)
class Draw:
    """A session of ``kind`` before it is computed; ``law`` is the tissue's, ``parts`` all that is hidden."""

    seed: int
    kind: str
    law: Part
    noise: str
    bench: Bench
    parts: tuple[Part, ...]

    @property
    def hidden(self) -> tuple[Part, ...]:
        """The parts, and the tissue's law where the simulation's own does not hold it."""
        return self.parts if self.law.name == "flat punch" else (self.law, *self.parts)

    def record(self) -> Session:
        """Computes it."""
        return record(self.bench, self.parts, np.random.default_rng([self.seed, 3]))


def draw(seed: int) -> Draw:
    """The session of a seed; ten seeds in a row hold every kind."""
    rng = np.random.default_rng([seed, 2])
    kind = ROTATION[seed % len(ROTATION)]
    own = kind in ("tissue", "memory", "two") or (kind != "clean" and rng.random() < 0.5)
    name = str(rng.choice(list(LAWS)[1:])) if own else "flat punch"
    law, force = LAWS[name](rng)
    parts = tuple(PARTS[of][int(rng.integers(len(PARTS[of])))](rng) for of in PARTS_OF[kind])
    noise = str(rng.choice([*NOISES, "quantised"]))
    return Draw(seed, kind, law, noise, draw_bench(rng, force, noise), parts)


def draw_bench(rng: Random, law: tissue.Law, noise: str) -> Bench:
    """One or two sites, four or three speeds, two of each; at 1 kHz, or 100 Hz as strain-gauge flanges give it."""
    sites = 1 if rng.random() < 2 / 3 else 2
    speeds = np.exp(np.linspace(np.log(rng.uniform(4, 6)), np.log(rng.uniform(20, 30)), 4 if sites == 1 else 3))
    speed, site = np.repeat(np.tile(speeds, sites), 2), np.repeat(np.arange(float(sites)), 2 * len(speeds))
    order = rng.permutation(len(speed))
    shallow = rng.choice([0.6, 1.0], size=len(speed), p=[0.3, 0.7])
    return Bench(
        law=law, surface_mm=rng.uniform(15, 25), clearance_mm=rng.uniform(2, 3.5), retract_mm_s=rng.uniform(8, 14),
        dwell_s=rng.uniform(0.3, 0.6), speeds_mm_s=speed[order], depths_mm=rng.uniform(5, 7) * shallow,
        holds_s=rng.uniform(0.5, 1.0, len(speed)), site=site[order], site_gain=np.exp(rng.normal(0, 0.05, sites)),
        site_mm=rng.normal(0, 0.3, sites), gain_sd=rng.uniform(0.002, 0.01), touch_sd_mm=rng.uniform(0.005, 0.03),
        rate_Hz=float(rng.choice([1000.0, 100.0])), tracker_Hz=60.0 if rng.random() < 1 / 3 else 0.0,
        noise=NOISES.get(noise, NOISES["white"]), noise_N=rng.uniform(0.003, 0.008),
        step_N=rng.uniform(0.01, 0.02) if noise == "quantised" else 0.001, zero_N=rng.uniform(-0.5, 0.5),
    )  # fmt: skip


def _tissue(name: str, names: frozenset[str], law: tissue.Law) -> tuple[Part, tissue.Law]:
    return Part(name, names), law


# By the name of each; the first is within what is simulated, of all others another law is true.
LAWS: Mapping[str, Callable[[Random], tuple[Part, tissue.Law]]] = {
    "flat punch": lambda r: _tissue("flat punch", frozenset(), tissue.flat_punch(r.uniform(0.3, 0.6))),
    "Fung": lambda r: _tissue("Fung", LAW, tissue.fung(r.uniform(0.15, 0.3), r.uniform(0.3, 0.45))),
    "Ogden": lambda r: _tissue(
        "Ogden", LAW, tissue.ogden_block(r.uniform(0.15, 0.3), r.uniform(16, 22), r.uniform(4, 9))
    ),
    "two layers": lambda r: _tissue(
        "two layers", LAW | {"substrate"}, tissue.thin_layer(r.uniform(0.02, 0.04), r.uniform(6, 10), r.uniform(12, 20))
    ),
    "neo-Hookean sphere": lambda r: _tissue(
        "neo-Hookean sphere", LAW, tissue.neo_hookean_sphere(r.uniform(0.08, 0.15), r.uniform(8, 12))
    ),
}


def _exponentials(rng: Random, count: int) -> Part:
    taus_s = 10 ** (rng.uniform(-1.3, -1.0) + np.arange(count) * rng.uniform(0.7, 1.0))
    shares = rng.uniform(0.1, 0.25, count)
    return Part(
        f"{count} relaxation times", RELAXES, "memory",
        lambda s: tissue.remember_exponentials(s.force_N, STEP_S, shares, taus_s),
    )  # fmt: skip


def _power_law(rng: Random) -> Part:
    kernel = tissue.power_law(rng.uniform(0.3, 0.7), rng.uniform(0.01, 0.05), rng.uniform(0.2, 0.4))
    return Part("power-law memory", RELAXES, "memory", lambda s: tissue.remember(s.force_N, STEP_S, kernel))


def _poroelastic(rng: Random) -> Part:
    kernel = tissue.poroelastic(rng.uniform(0.2, 0.5), rng.uniform(0.3, 2.0))
    return Part("poroelastic", RELAXES, "memory", lambda s: tissue.remember(s.force_N, STEP_S, kernel))


def _mullins(rng: Random) -> Part:
    r, m = rng.uniform(2, 4), rng.uniform(0.3, 0.8)
    return Part(
        "Mullins", SOFTENS | {"mullins"}, "softening",
        lambda s: tissue.soften_by_energy(s.force_N, s.depth_mm, s.site, s.law, r, m),
    )  # fmt: skip


def _power_softening(rng: Random) -> Part:
    exponent = rng.uniform(0.08, 0.2)
    return Part(
        "power-law softening", SOFTENS, "softening",
        lambda s: s.force_N * (1 + tissue.counts_on_site(s.site)) ** -exponent,
    )  # fmt: skip


def _cycle_softening(rng: Random) -> Part:
    share, cycles = rng.uniform(0.15, 0.35), rng.uniform(1, 3)
    return Part(
        "softening cycle by cycle", SOFTENS, "softening",
        lambda s: s.force_N * (1 + share * np.exp(-tissue.counts_on_site(s.site) / cycles)),
    )  # fmt: skip


def _lugre(rng: Random) -> Part:
    coulomb_N, length_mm = rng.uniform(0.06, 0.3), rng.uniform(0.04, 0.15)
    stiction_N, stribeck_mm_s = coulomb_N * rng.uniform(1.2, 1.6), rng.uniform(2, 8)
    return Part(
        "LuGre with Stribeck", RUBS, "guide",
        lambda s: s.force_N + adds.lugre(s.tip_mm_s, STEP_S, coulomb_N, stiction_N, stribeck_mm_s, length_mm),
    )  # fmt: skip


def _dahl(rng: Random) -> Part:
    newton, length_mm, exponent = rng.uniform(0.06, 0.3), rng.uniform(0.05, 0.2), rng.choice([0.5, 1.5])
    return Part(
        f"Dahl of exponent {exponent:g}", RUBS, "guide",
        lambda s: s.force_N + adds.dahl(s.tip_mm, newton, length_mm, exponent), {"friction_N": newton},
    )  # fmt: skip


def _backlash(rng: Random) -> Part:
    width = rng.uniform(0.1, 0.5)
    return Part(
        "backlash with hysteresis", frozenset({"backlash"}), "tip", lambda s: adds.lost_motion(s.tip_mm, width),
        {"backlash_mm": width},
    )  # fmt: skip


def _latency(rng: Random) -> Part:
    late = rng.uniform(0.004, 0.015)
    return Part("latency", frozenset({"time_offset"}), sizes={"time_offset_s": late}, late_s=late)


def _drift(rng: Random) -> Part:
    newton, warm_s = rng.choice([-1, 1]) * rng.uniform(0.08, 0.3), rng.uniform(30, 90)
    return Part(
        "zero that warms up", frozenset({"zero_drift"}), "sensor",
        lambda s: s.force_N + newton * -np.expm1(-s.time_s / warm_s),
    )  # fmt: skip


def _breathing(rng: Random) -> Part:
    height, period_s, own = rng.uniform(0.15, 0.6), rng.uniform(2.5, 5), rng.integers(2**31)
    return Part(
        "irregular breathing", MOVES, "surface",
        lambda s: s.surface_mm - adds.breath(s.time_s, np.random.default_rng(own), height, period_s),
    )  # fmt: skip


def _tremor(rng: Random) -> Part:
    rms_mm, own = rng.uniform(0.05, 0.15), rng.integers(2**31)
    return Part(
        "tremor", MOVES, "surface",
        lambda s: s.surface_mm + adds.tremor(s.time_s, np.random.default_rng(own), rms_mm),
    )  # fmt: skip


def _cogging(rng: Random) -> Part:
    newton, pitch_mm, phase = rng.uniform(0.06, 0.2), rng.uniform(1.0, 2.5), rng.uniform(0, 6)
    return Part(
        "cogging", frozenset({"cogging"}), "guide",
        lambda s: s.force_N + adds.cogging(s.axis_mm, newton, pitch_mm, phase),
        {"cogging_N": newton, "cogging_pitch_mm": pitch_mm},
    )  # fmt: skip


def _hysteresis(rng: Random) -> Part:
    share, width_N = rng.uniform(0.15, 0.4), rng.uniform(0.3, 0.8)
    return Part(
        "sensor hysteresis", frozenset({"sensor_hysteresis"}), "sensor",
        lambda s: adds.sensor_hysteresis(s.force_N, share, width_N), {"hysteresis_N": share * width_N},
    )  # fmt: skip


def _crosstalk(rng: Random) -> Part:
    newton = rng.choice([-1, 1]) * rng.uniform(0.1, 0.3)

    return Part(
        "cross-talk", frozenset({"cross_talk"}), "sensor",
        lambda s: s.force_N + newton * ((s.axis_mm - s.axis_mm.min()) / np.ptp(s.axis_mm)) ** 2,
        {"cross_talk_N": newton},
    )  # fmt: skip


def _slip(rng: Random) -> Part:
    share, own = rng.uniform(0.1, 0.3), rng.integers(2**31)
    return Part(
        "slips", stage="softening",
        act=lambda s: adds.slipped(s.force_N, s.depth_mm, np.random.default_rng(own), share),
    )  # fmt: skip


def _muscle(rng: Random) -> Part:
    share, period_s, own = rng.uniform(0.1, 0.3), rng.uniform(1.5, 4), rng.integers(2**31)
    return Part(
        "muscle that tenses", stage="softening",
        act=lambda s: s.force_N * (1 + adds.breath(s.time_s, np.random.default_rng(own), share, period_s)),
    )  # fmt: skip


PARTS: Mapping[str, tuple[Callable[[Random], Part], ...]] = {
    "memory": (lambda r: _exponentials(r, 2), lambda r: _exponentials(r, 3), _power_law, _poroelastic),
    "softening": (_mullins, _power_softening, _cycle_softening),
    "bench": (_lugre, _dahl, _backlash, _latency, _drift, _hysteresis, _cogging, _crosstalk),
    "surroundings": (_breathing, _tremor),
    "outside": (_slip, _muscle),
}
PARTS_OF: Mapping[str, tuple[str, ...]] = {"clean": (), "tissue": (), "two": ("memory", "bench")} | {
    kind: (kind,) for kind in PARTS
}
