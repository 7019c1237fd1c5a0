"""The servo axis as a problem: motion in, drive force out, judged by the same engine as the tissue.

Inverse dynamic model F = M a + Fv v + offset, in SI units, and the causes an axis is known for. Motion and force pass
the same zero-phase filter and are thinned together (parallel decimation; Gautier 1997).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, filtfilt

from rig.diagnosis.problem import Array, Effect, Par, Scatter, Signal, Values
from rig.tissue.index_law import Fields

# At 50 Hz, which is as fast as thinned rows tell, the filter lets 5 % pass; six lags of them, the largest order of the
# noise, reach over MEMORY_S.
CUT_HZ = 35.0
THINNED_HZ = 100.0
BLOCKS = 12
SIGN_M_S = 5e-4
BLIND_M_S = 3e-3  # six times SIGN_M_S: from here on friction has its full sign (tanh 6 = 1 - 1e-5)
EDGE_S = 0.25
MEMORY_S = 0.05

MASS = Par("mass_kg", "kg", 50.0, 1e-3, 1e5, 1.0, log=True, meaning="moved mass")
VISCOUS = Par("viscous_N_s_m", "N s/m", 0.0, -1e4, 1e5, 5.0, least=1.0, meaning="viscous friction")
OFFSET = Par("offset_N", "N", 0.0, -1e4, 1e4, 0.5, meaning="constant force (amplifier offset, weight)")
AXIS_EFFECTS = (
    Effect(
        "coulomb_friction", "the axis has Coulomb friction of {coulomb_N:.3g} N whatever its speed",
        (Par("coulomb_N", "N", 0.0, 0.0, 1e4, 1.0, least=0.2, meaning="Coulomb friction"),),
        one_sided=True, repair="add Coulomb friction to the feed-forward",
    ),
    Effect(
        "asymmetric_friction",
        "friction grows with speed by {asymmetry_N_s_m:+.3g} N s/m forward and as much the other way backward",
        (Par("asymmetry_N_s_m", "N s/m", 0.0, -1e4, 1e4, 2.0, least=1.0, meaning="half the difference of directions"),),
        repair="use friction parameters of their own for each direction",
    ),
    Effect(
        "dead_time", "the force acts {dead_time_s:.3g} s after its command",
        (Par("dead_time_s", "s", 0.0, -0.05, 0.05, 5e-4, least=5e-4, meaning="delay of the force"),),
        needs=frozenset({"fast"}), repair="add the delay to the controller's design",
    ),
    Effect(
        "position_ripple", "the force ripples by {amplitude:.3g} N every {ripple_pitch_m:.3g} m",
        (
            Par("ripple_sin_N", "N", 0.0, -1e3, 1e3, 0.5, least=0.2, meaning="ripple along the screw"),
            Par("ripple_cos_N", "N", 0.0, -1e3, 1e3, 0.5, least=0.2, meaning="ripple along the screw"),
        ),
        (Par("ripple_pitch_m", "m", 0.005, 5e-4, 0.1, 1e-5, meaning="period along the axis"),),
        lambda *_: [{"ripple_pitch_m": pitch} for pitch in (0.0025, 0.004, 0.005, 0.01, 0.02)],
        repair="compensate the ripple along the screw",
    ),
    Effect(
        "flexible_mode", "a flexible mode adds {flexible_kg_s2:.3g} kg s^2 times the fourth derivative of position",
        (Par("flexible_kg_s2", "kg s^2", 0.0, 0.0, 10.0, 1e-3, least=1e-4, meaning="mass over squared resonance"),),
        one_sided=True, needs=frozenset({"fast"}), repair="filter the command at the resonance",
    ),
)  # fmt: skip
VISCOUS_EFFECT = Effect(
    "viscous_friction", "the axis is braked by {viscous_N_s_m:.3g} N per m/s", (VISCOUS,), one_sided=True,
    repair="add viscous friction to the feed-forward",
)  # fmt: skip


@dataclass(frozen=True)
class AxisRecording:
    """One recording, SI units, shape (n,): position and reference [m], control signal [V], added pulses [V]."""

    name: str
    time_s: Array
    position_m: Array
    reference_m: Array
    control_V: Array
    pulses_V: Array
    force_N_V: float
    kp_1_s: float
    kv_V_s_m: float

    @property
    def period_s(self) -> float:
        """Sampling period."""
        return float(np.median(np.diff(self.time_s)))


@dataclass(frozen=True)
class Motion:
    """Filtered and thinned signals, shape (m,)."""

    position: Array
    velocity: Array
    acceleration: Array
    snap: Array
    force: Array
    time_s: Array


def motion_of(recording: AxisRecording) -> Motion:
    """Derivatives by central differences of the filtered position; force through the same filter."""
    rate = 1 / recording.period_s
    numerator, denominator = butter(4, min(CUT_HZ, 0.4 * rate) / (rate / 2))
    position = filtfilt(numerator, denominator, recording.position_m)
    derivatives = [position]
    for _ in range(4):
        derivatives.append(np.gradient(derivatives[-1], recording.period_s))
    force = filtfilt(numerator, denominator, recording.force_N_V * recording.control_V)
    edge, step = int(EDGE_S * rate), max(1, round(rate / THINNED_HZ))
    take = slice(edge, len(position) - edge, step)
    q, v, a, _, s = (np.ascontiguousarray(d[take]) for d in derivatives)
    return Motion(q, v, a, s, force[take], recording.time_s[take])


@dataclass(frozen=True)
class AxisProblem:
    """One recording of an axis, cut into blocks that are left out in turn."""

    motion: Motion
    frictionless: bool = False

    @property
    def title(self) -> str:
        """Which simulation is judged."""
        return "axis"

    @cached_property
    def channels(self) -> tuple[Signal, ...]:
        """Drive force [N]."""
        count = len(self.motion.force)
        memory = MEMORY_S / float(np.median(np.diff(self.motion.time_s)))
        return (Signal("force", "N", self.motion.force, np.arange(count) * BLOCKS // count, memory),)

    @property
    def recordings(self) -> int:
        """Blocks."""
        return BLOCKS

    @property
    def base(self) -> tuple[Par, ...]:
        """Mass, viscous friction where the axis is not taken as frictionless, offset."""
        return (MASS, OFFSET) if self.frictionless else (MASS, VISCOUS, OFFSET)

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The axis' library."""
        return (VISCOUS_EFFECT, *AXIS_EFFECTS) if self.frictionless else AXIS_EFFECTS

    @property
    def scatter(self) -> tuple[Scatter, ...]:
        """An axis is the same in all blocks."""
        return ()

    @cached_property
    def offers(self) -> Mapping[str, str]:
        """All needs are met at 100 Hz or more."""
        rate = 1 / float(np.median(np.diff(self.motion.time_s)))
        return {} if rate >= 99 else {"fast": f"{rate:.0f} Hz is too slow"}

    def start(self) -> Values:
        """Linear least squares."""
        m = self.motion
        columns = np.stack([m.acceleration, m.velocity, np.ones_like(m.force)], axis=1)
        mass, viscous, offset = np.linalg.lstsq(columns, m.force, rcond=None)[0]
        values = {par.name: par.null for effect in self.effects for par in effect.pars}
        viscous = 0.0 if self.frictionless else float(viscous)
        return {**values, "mass_kg": max(float(mass), 0.01), "viscous_N_s_m": viscous, "offset_N": float(offset)}

    def predict(self, fields: Fields) -> tuple[Array, ...]:
        """Force the drive must give for this motion."""
        values = {name: float(value) for name, value in fields.items()}
        m, g = self.motion, values.get
        direction = np.tanh(m.velocity / SIGN_M_S)
        force = values["mass_kg"] * m.acceleration + values["offset_N"]
        force = force + values["viscous_N_s_m"] * m.velocity + g("coulomb_N", 0.0) * direction
        force = force + g("asymmetry_N_s_m", 0.0) * np.abs(m.velocity) + g("flexible_kg_s2", 0.0) * m.snap
        if g("ripple_sin_N", 0.0) or g("ripple_cos_N", 0.0):
            phase = 2 * np.pi * m.position / values["ripple_pitch_m"]
            force = force + values["ripple_sin_N"] * np.sin(phase) + values["ripple_cos_N"] * np.cos(phase)
        if g("dead_time_s", 0.0):
            force = np.interp(m.time_s + values["dead_time_s"], m.time_s, force)
        return (np.asarray(force),)

    def blind(self, values: Fields) -> NDArray[np.bool_]:  # noqa: ARG002 - where it stands still is known beforehand
        """Standstill, where friction is whatever holds the axis."""
        return np.asarray(np.abs(self.motion.velocity) < BLIND_M_S)

    @property
    def units(self) -> Mapping[str, str]:
        """Of the variables; the drive is asked for newtons."""
        return {"depth": "m", "velocity": "m/s", "acceleration": "m/s2", "session time": "s", "force": "N"}

    def variables(self) -> Mapping[str, Array]:
        """What a residual may depend on."""
        m = self.motion
        return {"depth": m.position, "velocity": m.velocity, "acceleration": m.acceleration, "session time": m.time_s}


SUBSTEPS = 4


def simulate(recording: AxisRecording, values: Mapping[str, float], limit_V: float = 10.0) -> Array:
    """Closed loop with the recorded reference: the control signal [V] the model would have asked for, shape (n,).

    The loop is the recorded one: kv (kp (reference - position) - velocity), velocity the backward difference of the
    two-sample mean, saturated, pulses added as they were.
    """
    period, g = recording.period_s, values.get
    mass = values["mass_kg"]
    viscous, coulomb = values["viscous_N_s_m"], g("coulomb_N", 0.0)
    asymmetry, offset = g("asymmetry_N_s_m", 0.0), values["offset_N"]
    added = recording.pulses_V * pulse_share(recording)
    place, speed = float(recording.position_m[0]), 0.0
    before = [place, place]
    control = np.empty(len(recording.time_s))
    step = period / SUBSTEPS
    for k, reference in enumerate(recording.reference_m):
        measured = (place - before[0]) / (2 * period)
        before = [before[1], place]
        wish = recording.kv_V_s_m * (recording.kp_1_s * (reference - place) - measured) + added[k]
        volts = min(max(wish, -limit_V), limit_V)
        control[k] = volts
        for _ in range(SUBSTEPS):
            push = recording.force_N_V * volts - offset - viscous * speed - asymmetry * abs(speed)
            # Dry friction brings to rest within a step what it can hold, and opposes the motion otherwise.
            free = speed + step * push / mass
            brake = step * coulomb / mass
            speed = free - brake if free > brake else free + brake if free < -brake else 0.0
            place += step * speed
    return control


def pulse_share(recording: AxisRecording) -> float:
    """How the pulses enter the control signal, by regression on what the loop alone would have asked for."""
    if not np.any(recording.pulses_V):
        return 0.0
    position, period = recording.position_m, recording.period_s
    velocity = np.concatenate([[0.0, 0.0], (position[2:] - position[:-2]) / (2 * period)])
    own = recording.kv_V_s_m * (recording.kp_1_s * (recording.reference_m - position) - velocity)
    pulses = recording.pulses_V - recording.pulses_V.mean()
    return float(pulses @ (recording.control_V - own) / (pulses @ pulses))


def force_error_percent(recording: AxisRecording, values: Mapping[str, float]) -> float:
    """100 |F - F_simulated| / |F| of the closed loop."""
    simulated = simulate(recording, values)
    return 100 * float(np.linalg.norm(recording.control_V - simulated) / np.linalg.norm(recording.control_V))
