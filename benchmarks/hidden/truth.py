"""The other program: a rig and a limb integrated in time, with a hidden cause in them. Knows nothing of the fitter.

All cycles of a session are stepped together, each with its own motor loop (mass, position and velocity gains, feed
forward), at 4 kHz, semi-implicit; effects act where they do in a machine. Noise is white plus two relaxation processes
plus mains hum, quantised. Every session draws its own protocol.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

Array = NDArray[np.float64]
STEP_S = 1 / 4000
RELAXING = ("relaxation", "second_relaxation", "third_relaxation")
PLAYS = np.array([[0.8], [0.9], [1.0], [1.1], [1.2]])  # widths of a hysteresis, in shares of their mean


@dataclass(frozen=True)
class Bench:
    """One session's drawn circumstances."""

    a: float
    b: float
    viscosity: float
    surface: float
    speeds: Array  # one a cycle
    depths: Array
    hold_s: Array
    dwell_s: float
    retract: float
    clearance: float
    sample_every: int
    tracker_hz: float
    camera_delay_s: float
    noise_n: float
    gain_sd: float
    touch_sd: float
    zero_n: float


@dataclass(frozen=True)
class IndentationCycle:
    """What the devices of one cycle wrote down, on the session's clock."""

    time_s: Array
    force_n: Array
    axis_time_s: Array
    axis_mm: Array
    frame_time_s: Array
    marker_mm: Array
    kelvin: Array


@dataclass(frozen=True)
class Hidden:
    """The secret: which causes with which numbers."""

    causes: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    def get(self, cause: str, number: str) -> float:
        """A number of a cause; 0 where the cause is not there."""
        return self.causes.get(cause, {}).get(number, 0.0)


def draw_bench(rng: np.random.Generator, cycles: int | None = None) -> Bench:
    """A protocol and a limb nobody chose."""
    count = cycles or int(rng.integers(10, 15))
    choices = np.sort(rng.uniform(4, 30, size=5))
    choices[0], choices[-1] = rng.uniform(4, 6), rng.uniform(24, 30)
    speeds = np.resize(choices, count)
    rng.shuffle(speeds)
    deepest = rng.uniform(5.5, 8.0)
    return Bench(
        a=rng.uniform(0.1, 0.25), b=rng.uniform(0.12, 0.25), viscosity=rng.uniform(0.006, 0.015),
        surface=rng.uniform(15, 25), speeds=speeds, depths=deepest * rng.choice([0.6, 1.0], size=count, p=[0.3, 0.7]),
        hold_s=rng.uniform(0.6, 1.2, size=count), dwell_s=rng.uniform(0.3, 0.6), retract=rng.uniform(7, 13),
        clearance=rng.uniform(2.0, 3.5), sample_every=int(rng.choice([4, 8])), tracker_hz=rng.uniform(50, 65),
        camera_delay_s=0.0, noise_n=rng.uniform(0.004, 0.008), gain_sd=rng.uniform(0.003, 0.015),
        touch_sd=rng.uniform(0.005, 0.03), zero_n=rng.uniform(-0.5, 0.5),
    )  # fmt: skip


def trajectory(bench: Bench) -> Array:
    """Set-points, shape (steps, cycles): dwell, in, hold, out, dwell; acceleration limited by a moving mean."""
    top, rows = bench.surface - bench.clearance, []
    for speed, depth, hold in zip(bench.speeds, bench.depths, bench.hold_s, strict=True):
        way = bench.clearance + depth
        corners = np.cumsum([0, bench.dwell_s, way / speed, hold, way / bench.retract, bench.dwell_s])
        rows.append((corners, [top, top, top + way, top + way, top, top]))
    steps = int(max(corners[-1] for corners, _ in rows) / STEP_S)
    time = np.arange(steps) * STEP_S
    path = np.stack([np.interp(time, corners, places) for corners, places in rows], axis=1)
    smooth = int(0.012 / STEP_S)
    padded = np.concatenate([np.repeat(path[:1], smooth, axis=0), path])
    total = np.cumsum(padded, axis=0)
    return np.asarray((total[smooth:] - total[:-smooth]) / smooth)


def elastic(bench: Bench, hidden: Hidden, depth: Array) -> Array:
    """Force of the limb at rest."""
    x = np.maximum(depth, 0.0)
    law = hidden.causes.get("elastic_law", {})
    if "quadratic" in law:
        force = bench.a * x + law["quadratic"] * x * x
    elif "power" in law:
        force = bench.a * x ** law["power"]
    else:
        force = bench.a * x * np.exp(bench.b * x)
    force = force * (1 + hidden.get("substrate", "per_mm3") * x**3)
    bump = hidden.causes.get("unknown_depth_bump", {})
    if bump:
        force = force + bump["newton"] * np.exp(-0.5 * ((depth - bump["at_mm"]) / 0.5) ** 2) * (depth > 0)
    return force


def energy(bench: Bench, depth: Array) -> Array:
    """Work of the index law up to a depth, over a: the integral of x exp(b x) in closed form."""
    x, b = np.maximum(depth, 0.0), bench.b
    return np.asarray((np.exp(b * x) * (b * x - 1) + 1) / b**2)


def run(bench: Bench, hidden: Hidden, rng: np.random.Generator) -> list[IndentationCycle]:
    """Integrates the whole session and writes down what the devices saw."""
    path = trajectory(bench)
    steps, count = path.shape
    begin = np.concatenate(
        [[0.0], np.cumsum(np.full(count - 1, steps * STEP_S + 0.4) + rng.uniform(0, 0.5, count - 1))]
    )
    gain = np.exp(rng.normal(0, bench.gain_sd, count))
    number = np.arange(count)
    gain = gain * (
        1
        + hidden.get("preconditioning", "share")
        * np.exp(-number / hidden.causes.get("preconditioning", {"strokes": 1.0})["strokes"])
    )
    gain = gain * np.where(number >= count // 2, 1 + hidden.get("unknown_session_step", "share"), 1.0)
    surface0 = bench.surface + hidden.get("contact_offset", "mm") + rng.normal(0, bench.touch_sd, count)
    motion = hidden.causes.get("surface_motion", {"mm": 0.0, "hz": 1.0, "phase": 0.0})
    twice = hidden.causes.get("surface_motion_harmonic", {"mm": 0.0, "phase": 0.0})
    reached = np.concatenate([[0.0], np.maximum.accumulate(bench.depths)[:-1]])
    state = _State(path[0].copy(), count, memories(hidden), reached, float(path.max()))
    axis, tip_log, force_log = np.empty_like(path), np.empty_like(path), np.empty_like(path)
    warm = 4.0 * (1 - np.exp(-(begin[None] + np.arange(steps)[:, None] * STEP_S) / 60.0))
    kelvin_gain = 1 + hidden.get("temperature", "per_kelvin") * (warm - warm.mean())
    for k in range(steps):
        time = begin + k * STEP_S
        speed_wanted = (path[min(k + 1, steps - 1)] - path[max(k - 1, 0)]) / (2 * STEP_S)
        phase = 2 * np.pi * motion["hz"] * time + motion["phase"]
        surface = surface0 + motion["mm"] * np.sin(phase)
        surface = surface + twice["mm"] * np.sin(2 * phase + twice["phase"])
        rise = motion["mm"] * 2 * np.pi * motion["hz"] * np.cos(phase)
        rise = rise + twice["mm"] * 4 * np.pi * motion["hz"] * np.cos(2 * phase + twice["phase"])
        state.motor(path[k], speed_wanted)
        tip, tip_speed = state.kinematics(hidden)
        force = state.contact(bench, hidden, tip, tip_speed, surface, rise, gain * kelvin_gain[k])
        force_log[k] = state.sensor(hidden, force, tip, tip_speed)
        axis[k], tip_log[k] = state.place, tip
    return _written(bench, hidden, rng, begin, axis, tip_log, force_log, warm)


def memories(hidden: Hidden) -> tuple[Array, Array]:
    """Shares and times [s] of all that relaxes, each shape (terms, 1); none: (0, 1)."""
    terms = [hidden.causes[name] for name in RELAXING if name in hidden.causes]
    shares, taus = np.array([term["share"] for term in terms]), np.array([term["tau_s"] for term in terms])
    spread = hidden.get("power_law_relaxation", "spread")
    if spread:
        # (1 + x)^-n as exponentials: trapezoids in u = ln s of the integral of s^n exp(-s (1 + x)) / Gamma(n).
        n, u = 1 / spread, np.arange(-12.0, 2.5, 0.25)
        shares = shares[0] * 0.25 * np.exp(n * u - np.exp(u)) / math.gamma(n)
        taus = taus[0] / spread * np.exp(-u)
    return shares[:, None], taus[:, None]


class _State:
    """Motor, lost motion, memory and sensor of all cycles."""

    def __init__(
        self, place: Array, count: int, memories: tuple[Array, Array], deepest: Array, place_most: float
    ) -> None:
        self.top, self.place_most = float(place.min()), place_most
        self.place, self.speed = place, np.zeros(count)
        self.follower = place.copy()
        self.tip_before = place.copy()
        self.lag_mm = np.zeros(count)
        self.bristle = np.zeros(count)
        self.shares, self.taus_s = memories
        self.memory, self.elastic_before = np.zeros((len(self.shares), count)), np.zeros(count)
        self.deepest = deepest
        self.plays = np.zeros((len(PLAYS), count))
        self.filtered = np.zeros(count)
        self.force_before: Array | None = None
        self.speed_before = np.zeros(count)
        self.touched = np.zeros(count, bool)

    def motor(self, wanted: Array, speed_wanted: Array) -> None:
        push = 90.0**2 * (wanted - self.place) + 2 * 90.0 * (speed_wanted - self.speed)
        self.speed = self.speed + STEP_S * push
        self.place = self.place + STEP_S * self.speed

    def kinematics(self, hidden: Hidden) -> tuple[Array, Array]:
        width = hidden.get("backlash", "mm")
        self.follower = np.minimum(np.maximum(self.follower, self.place), self.place + width)
        pitch = hidden.causes.get("position_ripple", {"mm": 0.0, "pitch_mm": 1.0, "phase": 0.0})
        wave = pitch["mm"] * np.sin(2 * np.pi * self.place / pitch["pitch_mm"] + pitch["phase"])
        tip = self.follower + wave - self.lag_mm
        speed = (tip - self.tip_before) / STEP_S
        self.tip_before = tip
        return tip, speed

    def contact(
        self, bench: Bench, hidden: Hidden, tip: Array, speed: Array, surface: Array, rise: Array, gain: Array
    ) -> Array:
        depth = tip - surface
        spring = gain * elastic(bench, hidden, depth) * self.softened(bench, hidden, depth)
        self.memory += self.shares * (spring - self.elastic_before) - STEP_S * self.memory / self.taus_s
        self.elastic_before = spring
        v = speed - rise
        drag = bench.viscosity * v
        if "rate_law" in hidden.causes:
            drag = bench.viscosity * 10 * np.sign(v) * (np.abs(v) / 10) ** hidden.get("rate_law", "exponent")
        wave = 1 + hidden.get("unknown_speed_gain", "share") * np.tanh((v - 5) / 8)
        drag = drag + hidden.get("hunt_crossley", "s_per_mm") * v * spring
        force = np.maximum(spring * wave + self.memory.sum(axis=0) + np.where(depth > 0, drag, 0.0), 0.0)
        self.touched |= depth > 0
        pull = hidden.causes.get("adhesion")
        if pull:
            away = self.touched & (v < 0)
            force = force - np.where(away, pull["newton"] * np.exp(-((depth / pull["mm"]) ** 2)), 0.0)
        give = hidden.get("frame_compliance", "mm_per_n")
        if give:  # the frame as a spring with a little damping: the lag settles within a few milliseconds
            self.lag_mm += STEP_S / 0.002 * (give * force - self.lag_mm)
        return np.asarray(force)

    def softened(self, bench: Bench, hidden: Hidden, depth: Array) -> Array | float:
        """What is left of the spring below the deepest place so far (Ogden and Roxburgh 1999)."""
        known = hidden.causes.get("mullins")
        if not known:
            return 1.0
        self.deepest = np.maximum(self.deepest, depth)
        below = energy(bench, self.deepest) - energy(bench, depth)
        return np.asarray(1 - known["share"] * erf(below / (known["energy"] * energy(bench, bench.depths).max())))

    def sensor(self, hidden: Hidden, force: Array, tip: Array, speed: Array) -> Array:
        rub = hidden.causes.get("friction")
        if rub:
            travel = STEP_S * speed
            self.bristle += travel / rub["mm"] * (1 - np.sign(travel) * self.bristle)
            force = force + rub["newton"] * self.bristle
        force = force + self.along_the_axis(hidden)
        force = force + 1e-3 * hidden.get("tip_inertia", "kg") * (speed - self.speed_before) / STEP_S
        self.speed_before = speed
        hysteresis = hidden.causes.get("sensor_hysteresis")
        if hysteresis:
            self.plays = np.minimum(np.maximum(self.plays, force), force + hysteresis["width_n"] * PLAYS)
            force = force + hysteresis["newton"] / hysteresis["width_n"] * (self.plays.mean(axis=0) - force)
        lag = hidden.get("filter_lag", "s")
        if not lag:
            return force
        # Trapezoidal: a plain Euler step would be a lag one step shorter than the number hidden.
        middle = 0.5 * (force + (self.force_before if self.force_before is not None else force))
        self.filtered += (middle - self.filtered) * STEP_S / (lag + 0.5 * STEP_S)
        self.force_before = force
        return self.filtered.copy()

    def along_the_axis(self, hidden: Hidden) -> Array:
        """What the axis adds to the force by where it is: magnets, and a cable that is drawn out."""
        magnets = hidden.causes.get("cogging", {"newton": 0.0, "half": 0.0, "pitch_mm": 1.0, "phase": 0.0})
        turn = 2 * np.pi * self.place / magnets["pitch_mm"] + magnets["phase"]
        way = np.maximum(self.place - self.top, 0.0) / (self.place_most - self.top)
        pulled = magnets["newton"] * np.sin(turn) + magnets["half"] * np.cos(2 * turn)
        return np.asarray(pulled + hidden.get("cross_talk", "newton") * way**2)


def _written(
    bench: Bench, hidden: Hidden, rng: np.random.Generator, begin: Array, axis: Array, tip: Array, force: Array,
    warm: Array,
) -> list[IndentationCycle]:  # fmt: skip
    pick = slice(int(rng.integers(0, bench.sample_every)), None, bench.sample_every)
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    cycles = []
    for i, start in enumerate(begin):
        time = start + np.arange(len(axis)) * STEP_S
        stamps = time[pick]
        drift = hidden.get("zero_drift", "n_per_h") * (stamps - 0.5 * begin[-1]) / 3600
        reading = force[pick, i] * (1 + hidden.get("gain_error", "share")) + bench.zero_n + rng.normal(0, 0.003) + drift
        reading = np.round((reading + force_noise(rng, stamps, bench.noise_n)) / 0.001) * 0.001
        late = hidden.get("time_offset", "s") + 1e-6 * hidden.get("clock_drift", "ppm") * (stamps - begin[0])
        frames = np.arange(time[0] + rng.uniform(0, 0.02), time[-1], 1 / bench.tracker_hz)
        delay = bench.camera_delay_s + hidden.get("tracker_latency", "s")
        along = np.interp(frames - delay, time, tip[:, i])
        marker = np.array([30.0, -50.0, -1400.0]) + along[:, None] * direction + rng.normal(0, 0.05, (len(frames), 3))
        encoder = np.round(axis[pick, i] * 2000) / 2000
        cycles.append(IndentationCycle(stamps + late, reading, stamps, encoder, frames, marker, 25 + warm[pick, i]))
    return cycles


def force_noise(rng: np.random.Generator, time: Array, level: float) -> Array:
    """White, two relaxation processes (20 ms and 0.7 s), mains hum."""
    step = time[1] - time[0]
    noise = rng.normal(0, level, len(time))
    for tau, share in ((0.02, 0.3), (0.7, 0.2)):
        keep = np.exp(-step / tau)
        kicks = rng.normal(0, share * level * np.sqrt(1 - keep**2), len(time))
        walk = np.empty_like(kicks)
        value = rng.normal(0, share * level)
        for k, kick in enumerate(kicks):
            value = keep * value + kick
            walk[k] = value
        noise += walk
    return noise + 0.2 * level * np.sin(2 * np.pi * 50 * time + rng.uniform(0, 6.28))
