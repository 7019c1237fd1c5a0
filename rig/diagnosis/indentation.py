"""The indentation rig as a problem: index or constant simulation, the bench's and the tissue's possible causes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rig.diagnosis.descent import PRIOR_SCALES
from rig.diagnosis.effects.registry import CAUSES
from rig.diagnosis.effects.tissue import STIFFENING, STIFFENING_EFFECT
from rig.diagnosis.observations import SHOWS_FAST_HZ, Observations
from rig.diagnosis.problem import Array, Effect, Par, Scatter, Signal, Values, operators
from rig.remembered import exp
from rig.simulation.chain import respond
from rig.simulation.drive import SETTLE_MM_S, MeasuredMotion
from rig.tissue.index_law import Fields, index_force

STIFFNESS = Par("a_N_mm", "N/mm", 0.5, 1e-5, 1e3, 0.1, log=True, meaning="stiffness at contact")
DAMPING = Par("damping_N_s_mm", "N s/mm", 0.0, -1.0, 10.0, 0.005, meaning="damping")
# Nothing tells it from a zero there. Leaving a recording out moves it by what a limb has, 0.01 N s/mm, at most.
AT_ONE_SPEED = replace(DAMPING, low=0.0, scale=0.01 / PRIOR_SCALES)
SURFACE = Par("surface_mm", "mm", 0.0, -1e4, 1e4, 0.05, meaning="axis position of the surface")
ZERO = Par("zero_N", "N", 0.0, -1e3, 1e3, 0.02, meaning="force zero")
TIP_ZERO = Par("tip_zero_mm", "mm", 0.0, -1e4, 1e4, 0.05, meaning="tracker zero along the axis")
START_SAMPLES = 4000  # 0.05 s; four times as many change the start by 2 um and 0.1 %
# Of the travel, to either side of where contact was found: lags and lost motion move it by less.
ROOM_SHARE = 0.25
BLIND_MM = 0.12  # six deviations of the place of contact between recordings (0.02 mm)
MEMORY_S = 1.0
FEWEST_WAY_OUT = 0.2  # 2.6 of 13 mm: five times the way in which a guide's friction turns round
BLIND_SAMPLES = 2.5  # an acceleration reaches over two samples to either side, their average over half a one
SAME_SPEED = 0.02  # of the fastest: strokes of 4.0 mm/s by a testing machine scatter by 0.5 %, of two speeds by 30 %
# Beyond it, noise of the motion passes for a filter and a delay of the force.
MOST_JITTER_MM = 0.0008
Simulation = Literal["index", "constant"]


def library(simulation: Simulation) -> tuple[Effect, ...]:
    """All causes; ``stiffening`` only where the simulation has none."""
    return (*CAUSES.values(), *([STIFFENING_EFFECT] if simulation == "constant" else []))


def nulls() -> dict[str, float]:
    """Every parameter of the simulation and of the causes at its null."""
    own = (STIFFNESS, STIFFENING, DAMPING, SURFACE, ZERO, TIP_ZERO)
    return {par.name: par.null for par in (*own, *(par for cause in CAUSES.values() for par in cause.pars))}


@dataclass(frozen=True)
class IndentationProblem:
    """Observations judged against the index or the constant-stiffness simulation."""

    data: Observations
    simulation: Simulation = "index"

    @property
    def title(self) -> str:
        """Which simulation is judged."""
        return self.simulation

    @cached_property
    def channels(self) -> tuple[Signal, ...]:
        """Force [N], and the tip [mm] where a tracker was there."""
        memory = MEMORY_S / self.data.drive.period_s
        force = Signal("force", "N", self.data.force_N, self.data.drive.recording, memory)
        if not self.data.has_tracker:
            return (force,)
        return force, Signal("tip", "mm", self.data.tip_mm, self.data.drive.tip_recording)

    @property
    def recordings(self) -> int:
        """Recordings of the session."""
        return self.data.drive.recordings

    @cached_property
    def base(self) -> tuple[Par, ...]:
        """What the simulation itself has free; a stated surface is taken at its word."""
        pars = [STIFFNESS, *([STIFFENING] if self.simulation == "index" else [])]
        pars.append(DAMPING if self._shows_damping else AT_ONE_SPEED)
        pars += [] if self.data.surface_mm is not None else [surface(self.data)]
        return (*pars, ZERO, *([TIP_ZERO] if self.data.has_tracker else []))

    @cached_property
    def effects(self) -> tuple[Effect, ...]:
        """The library for this simulation."""
        return library(self.simulation)

    @cached_property
    def scatter(self) -> tuple[Scatter, ...]:
        """Stiffness, place of contact and zero differ by chance from recording to recording."""
        return (
            Scatter("stiffness", "1", 0.02, _scaled),
            Scatter("touch", "mm", 0.03, lambda v, s: {**v, "surface_mm": v["surface_mm"] + s}),
            Scatter("zero", "N", 0.005, lambda v, s: {**v, "zero_N": v["zero_N"] + s}),
        )

    @cached_property
    def offers(self) -> Mapping[str, str]:
        """Why a need of an effect is not met, by need."""
        return missing(self.data)

    @cached_property
    def labels(self) -> Mapping[str, Sequence[str]]:
        """As the session has them."""
        return self.data.labels

    def start(self) -> Values:
        """Best of a coarse grid of surface and stiffening, the rest by linear least squares."""
        values = coarse_start(self.data, stiffening=self.simulation == "index")
        if not self.data.has_tracker:
            return values
        encoder_mm = self.data.drive.at_tracker(self.data.drive.position_mm)
        return {**values, "tip_zero_mm": float(np.median(self.data.tip_mm - encoder_mm))}

    @cached_property
    def _shows_damping(self) -> bool:
        """Whether the tip goes at several speeds: at one a tissue that drove it would give a ripple another size."""
        drive = self.data.drive
        speed_mm_s = drive.velocity_mm_s[drive.position_mm >= np.median(drive.position_mm)]
        return bool(np.std(speed_mm_s) > SAME_SPEED * np.abs(speed_mm_s).max())

    @cached_property
    def _nulls(self) -> Values:
        return nulls()

    def predict(self, values: Fields) -> tuple[Array, ...]:
        """Force, and tip where it was measured."""
        values = {**self._nulls, **values}
        response = respond(self.data.drive, values, operators(self.effects, values))
        return response if self.data.has_tracker else (response.force_N,)

    def blind(self, values: Fields) -> NDArray[np.bool_]:
        """Samples about the instant of contact, where the damper's force jumps between two, and gaps of the axis."""
        drive = self.data.drive
        surface = values["surface_mm"] + values["contact_offset_mm"]
        reach = np.maximum(BLIND_MM, BLIND_SAMPLES * np.abs(drive.velocity_mm_s) * drive.period_s)
        moving = np.abs(drive.velocity_mm_s) > SETTLE_MM_S
        touching = np.asarray((np.abs(drive.position_mm - surface) < reach) & moving)
        return touching if self.data.unseen is None else touching | self.data.unseen

    @property
    def units(self) -> Mapping[str, str]:
        """Of the variables, and of the force."""
        return UNITS

    def variables(self) -> Mapping[str, Array]:
        """What a residual may depend on; ``depth`` counts from an arbitrary zero."""
        drive = self.data.drive
        given = {
            "depth": drive.position_mm,
            "velocity": drive.velocity_mm_s,
            "acceleration": drive.acceleration_mm_s2,
            "time in recording": drive.in_recording_s,
            "time since reversal": drive.since_reversal_s,
            "session time": drive.time_s,
            "cycle number": drive.cycle,
            "speed": drive.speed_mm_s,
        }
        return given if drive.temperature_C is None else {**given, "temperature": drive.temperature_C}


UNITS = {
    "depth": "mm", "velocity": "mm/s", "acceleration": "mm/s2", "time in recording": "s", "time since reversal": "s",
    "session time": "s", "cycle number": "1", "speed": "mm/s", "temperature": "degC", "force": "N",
}  # fmt: skip


def _scaled(values: Fields, share: Array) -> Fields:
    return {**values, "a_N_mm": values["a_N_mm"] * exp(np.clip(share, -2.0, 2.0))}


def missing(data: Observations) -> dict[str, str]:
    """Needs that the data cannot meet, each with its reason in words."""
    drive, reasons = data.drive, {"weight": "a gain error looks exactly like another stiffness; hang a known weight"}
    if not data.has_tracker:
        reasons["tracker"] = "no tip tracker: without an independent tip position this looks like softer tissue"
    if data.surface_mm is None:
        reasons["surface"] = "nobody stated where the surface is, so it is fitted"
    if drive.temperature_C is None or np.ptp(drive.temperature_C) < 0.5:
        reasons["temperature"] = "no temperature was recorded, or it changed by less than 0.5 K"
    if data.rate_Hz < SHOWS_FAST_HZ:
        reasons["fast"] = f"force at {data.rate_Hz:.0f} Hz is too slow; 200 Hz or more shows it"
    elif data.jitter_mm > MOST_JITTER_MM:
        reasons["fast"] = (
            f"the axis' time stamps jitter, by {1e3 * data.jitter_mm:.1f} um of motion (limit {1e3 * MOST_JITTER_MM:g} "
            "um): record on a computer with less to do, and with real-time priority"
        )
    if drive.recordings < 4:
        reasons["strokes"] = f"{drive.recordings} recordings are too few cycles; at least 4"
    if not data.one_clock:
        reasons["session time"] = "each recording counts its own time, so nobody knows how far apart they were made"
    if data.contact_mm is not None and drive.position_mm.min() > data.contact_mm[1]:
        reasons["air"] = "the tip never leaves the tissue; begin and end each cycle above the surface"
    if way_out(drive) < FEWEST_WAY_OUT:
        reasons["unloading"] = "the recordings do not show the way out; record the retraction too"
    loading = drive.speed_mm_s[drive.starts[:-1]]
    if loading.max() < 1.5 * max(float(loading.min()), 1e-9):
        reasons["speeds"] = "all cycles have about one speed; use at least three, from slow to fast"
    return reasons


def surface(data: Observations) -> Par:
    """The surface's parameter, near to where the estimator of contact found it."""
    if data.contact_mm is None:
        return SURFACE
    room_mm = ROOM_SHARE * float(np.ptp(data.drive.position_mm))
    return replace(SURFACE, low=data.contact_mm[0] - room_mm, high=data.contact_mm[1] + room_mm)


def way_out(drive: MeasuredMotion) -> float:
    """How far the tip comes back from its deepest place, as a share of the cycle: the median recording's."""
    shares = []
    for i, j in pairwise(drive.starts):
        place = drive.position_mm[i:j]
        deepest = int(place.argmax())
        shares.append((place[deepest] - place[deepest:].min()) / max(float(np.ptp(place)), 1e-9))
    return float(np.median(shares))


def coarse_start(data: Observations, stiffening: bool) -> dict[str, float]:
    """Values near the optimum, from a grid on at most 4000 samples."""
    stride = max(1, data.drive.size // START_SAMPLES)
    x, v, force = (a[::stride] for a in (data.drive.position_mm, data.drive.velocity_mm_s, data.force_N))
    low, high = np.percentile(x, [0.5, 99.5])
    bounds = surface(data)
    # Of a recording that begins in contact the surface lies above its start.
    grid = np.linspace(min(low, data.contact_mm[0]) if data.contact_mm else low, high, 42)[:-3]
    surfaces = [data.surface_mm] if data.surface_mm is not None else grid[(grid >= bounds.low) & (grid <= bounds.high)]
    best: tuple[float, dict[str, float]] = (np.inf, nulls())
    for surface_mm in surfaces:
        depth = np.maximum(x - surface_mm, 0.0)
        for growth in _growths(depth, stiffening):
            columns = np.stack([index_force(depth, 1.0, growth), v * (depth > 0), np.ones_like(x)], axis=1)
            solution, *_ = np.linalg.lstsq(columns, force, rcond=None)
            error = float(np.sum((force - columns @ solution) ** 2))
            if error < best[0] and solution[0] > 0:
                found = dict(zip(("a_N_mm", "damping_N_s_mm", "zero_N"), map(float, solution), strict=True))
                best = error, {**nulls(), **found, "b_per_mm": growth, "surface_mm": float(surface_mm)}
    return best[1]


def _growths(depth_mm: Array, stiffening: bool) -> Sequence[float]:
    deepest = max(float(depth_mm.max()), 1e-3)
    return tuple(np.array([0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0]) / deepest) if stiffening else (0.0,)
